"""Every limit of a rule at its edge: what just holds has no finding, what just does not has one."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from busplan.buses.ieee1394.constants import safe_gap_count

SHIPPED = Path(__file__).resolve().parents[2] / "profiles" / "paper-4ms.toml"
PLAIN = re.sub(r" *#.*", "", SHIPPED.read_text(encoding="utf-8")).split("[servo]")[0]

Codes = Callable[..., set[str]]


@pytest.fixture
def codes(check: Callable[..., Any]) -> Codes:
    """Codes found in the plain profile with lines replaced."""

    def found(*replacements: tuple[str, str], more: str = "") -> set[str]:
        text = PLAIN
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        return {finding.code for finding in check(text + more).findings}

    return found


@pytest.mark.parametrize("nodes", [1, 2, 16])
def test_gap_count_is_wasteful_above_the_table_unsafe_below_and_right_at_it(nodes: int, codes: Codes) -> None:
    safe = safe_gap_count(nodes)
    gaps = sorted({0, safe - 1, safe, safe + 1, 63})
    found = {
        gap: codes(("gap_count = 63", f"gap_count = {gap}"), ("nodes = 2", f"nodes = {nodes}")) & {"BP109", "BP110"}
        for gap in gaps
    }
    assert found == {gap: {"BP109"} if gap < safe else {"BP110"} if gap > safe else set() for gap in gaps}


@pytest.mark.parametrize(("nodes", "expected"), [(62, set()), (63, {"BP106"})])
def test_nodes_of_one_bus(nodes: int, expected: set[str], codes: Codes) -> None:
    assert codes(("nodes = 2", f"nodes = {nodes}\nmax_hops = 4")) & {"BP106"} == expected


@pytest.mark.parametrize(("hops", "expected"), [(16, set()), (17, {"BP107"})])
def test_hops_of_one_bus(hops: int, expected: set[str], codes: Codes) -> None:
    assert codes(("nodes = 2", f"nodes = 2\nmax_hops = {hops}")) & {"BP107"} == expected


@pytest.mark.parametrize(("size", "expected"), [(512, set()), (513, {"BP108", "BP111"}), (516, {"BP108"})])
def test_payload_of_a_speed_and_of_quadlets(size: int, expected: set[str], codes: Codes) -> None:
    changes = (("S400", "S100"), ("write_bytes = 12", f"write_bytes = {size}"))
    assert codes(*changes) & {"BP108", "BP111"} == expected


def test_limits_are_broken_beyond_them_and_not_at_them(codes: Codes) -> None:
    # 13 nodes are shown to fit (1959.603 us), 14 are not (2139.161 us), for two there are: 11 nodes, 44 axes to spare.
    assert codes(more="[limits]\nmin_spare_nodes = 11\nmin_spare_axes = 44\n") & {"BP104", "BP105"} == set()
    assert codes(more="[limits]\nmin_spare_nodes = 12\nmin_spare_axes = 45\n") & {"BP104", "BP105"} == {
        "BP104",
        "BP105",
    }
    # Each asks for its own.
    for nodes, axes, code in ((12, 44, "BP104"), (11, 45, "BP105")):
        more = f"[limits]\nmin_spare_nodes = {nodes}\nmin_spare_axes = {axes}\nmax_utilisation = 0.5\n"
        assert codes(more=more) & {"BP103", "BP104", "BP105"} == {code}
    # 263.320248 us of 2000 us: 13.166012 %.
    assert "BP103" not in codes(more="[limits]\nmax_utilisation = 0.131661\n")
    assert "BP103" in codes(more="[limits]\nmax_utilisation = 0.131660\n")


def test_the_slice_is_overrun_below_the_smallest_period(codes: Codes) -> None:
    # 263.320 us and a bias of 8 * 0.827 us, less an uncertainty of 6.311 us: nothing lower can be right.
    own = {"BP101", "BP102", "BP114"}
    assert codes(("period_us = 4000", "period_us = 527.25")) & own == {"BP101", "BP102"}
    assert codes(("period_us = 4000", "period_us = 527.26")) & own == {"BP114", "BP102"}
    # With that uncertainty on top: 276.247 us.
    assert codes(("period_us = 4000", "period_us = 552.49")) & own == {"BP114", "BP102"}
    assert codes(("period_us = 4000", "period_us = 552.50")) & own == set()
    # 207.117 us by the paper: below, the two agree.
    assert codes(("period_us = 4000", "period_us = 414.24")) & own == {"BP101", "BP102"}
    assert codes(("period_us = 4000", "period_us = 414.23")) & own == {"BP101"}


def test_a_reserve_is_a_share_of_the_slice_that_must_be_free(codes: Codes) -> None:
    # 276.247 us of 1000 us are the rest of a reserve of 72.3753 %.
    period = ("period_us = 4000", "period_us = 2000")
    assert codes(period, more="[limits]\nreserve = 0.72375\n") & {"BP101", "BP114"} == set()
    assert codes(period, more="[limits]\nreserve = 0.72376\n") & {"BP101", "BP114"} == {"BP114"}


def test_cycle_starts_that_leave_no_time_are_an_error_however_long_the_period_is(codes: Codes) -> None:
    # T_reset 21.047, arbitration 4.524, 2 hops 0.331 and 160 bits at 98.304 Mbit/s: 27.530 us, of 124 us at most.
    def found(isochronous_us: float) -> set[str]:
        bus = ("cycle_master = false", f"cycle_master = true\nisochronous_us = {isochronous_us}")
        return codes(bus, ("period_us = 4000", "period_us = 1e9")) & {"BP101", "BP114"}

    assert found(96.47) == set()
    assert found(96.48) == {"BP101"}
