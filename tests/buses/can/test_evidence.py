"""Published figures of CAN, each met to the last digit that its source prints."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from subprocess import CompletedProcess
from typing import Any

import pytest

import busplan
from busplan.buses.can.evidence import FUNCTIONS

ROWS: Mapping[str, Callable[..., Any]] = FUNCTIONS


@cache
def evidence() -> dict[str, Any]:
    found: dict[str, Any] = busplan.evidence("can").to_dict()
    return found


def figures() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = evidence()["figures"]
    return found


SEEN = {"CAN: bits of frames of 8 bytes that hardware counted", "CAN: the load of a log"}
"""Sections of what frames on a bus had."""
FULL = "CAN and CAN FD: frames a second on a full bus"
ADAPTERS = {"CAN: from program to program over Kvaser's PCIe card", "CAN: an echo of 8 bytes at 500 kbit/s"}
"""Sections of times that adapters, drivers and programs are in."""
RULE = "CAN: a vendor's rule for servo drives"
"""A bound with room for more than frames."""


def test_each_published_figure_is_met_as_printed() -> None:
    printed = [figure for figure in figures()[:-1] if figure["section"] not in {*SEEN, FULL, *ADAPTERS, RULE}]
    assert len(printed) > 20
    for figure in printed:
        decimals = len(str(figure["published"]).partition(".")[2])
        assert round(figure["computed"], decimals) == figure["published"], figure["quantity"]


def test_a_vendors_rule_has_room_for_the_frames_of_its_axes() -> None:
    (rule,) = (figure for figure in figures() if figure["section"] == RULE)
    assert rule["computed"] == 55 + 2 * 2 * 135 < rule["published"]


def test_what_was_not_read_again_is_graded_so() -> None:
    grades: dict[str, set[str]] = {}
    for figure in figures():
        grades.setdefault(figure["section"], set()).add(figure["grade"])
    assert grades.pop("CAN: the worst instance is not the first") == {"recalled"}
    assert {grade for section in (*SEEN, FULL, *ADAPTERS) for grade in grades.pop(section)} == {"measured", "derived"}
    assert set.union(*grades.values()) == {"published"}


def test_what_a_bus_had_lies_between_no_stuff_bits_and_the_most(run: Callable[..., CompletedProcess[str]]) -> None:
    seen = [figure for figure in figures() if figure["section"] in SEEN]
    over = [figure["relative_residual"] for figure in seen if figure["method"] == "worst stuffing"]
    full = {(figure["quantity"], figure["method"]): figure for figure in figures() if figure["section"] == FULL}
    for (quantity, method), figure in full.items():
        slowest, fastest = full[quantity, "worst stuffing"]["computed"], full[quantity, "no stuffing"]["computed"]
        assert slowest < figure["published"] < fastest, quantity
        over += [figure["published"] / slowest - 1] if method == "no stuffing" else []
    for figure in seen:
        if figure["method"] == "no stuffing":
            assert figure["relative_residual"] < 0
        elif figure["method"] != "worst stuffing":
            assert abs(figure["relative_residual"]) < 0.04, figure["quantity"]
    # What verdicts say of the model.
    errs = f"this timing model gives {100 * min(over):.0f} to {100 * max(over):.0f}% more than measured frames"
    assert f"  correction      none: {errs}\n" in run("capacity", "can-servo-8", "--all").stdout


def test_what_adapters_and_programs_are_in_has_room_for_its_frames() -> None:
    own = {(figure["quantity"], figure["method"]): figure for figure in figures() if figure["section"] in ADAPTERS}
    # The 110 us of Kvaser are a rounded frame of 111 bits.
    assert own["write to read", "no stuffing"]["computed"] == 111 + 25 + 90
    assert own["write to read", "no stuffing"]["residual"] == 1
    assert own["there and back, least", "worst stuffing"]["computed"] == 2 * 270
    assert own["there and back, least", "worst stuffing"]["residual"] < 0
    loop = [own["loopback of the STM32", method] for method in ("no stuffing", "worst stuffing")]
    assert loop[0]["computed"] < loop[0]["published"] < loop[1]["computed"]


def test_the_papers_can_system_spends_its_time_in_the_host() -> None:
    system = figures()[-1]
    assert (system["published"], system["computed"], system["data"]) == (10500, 135, "paper")
    assert "the other 10.4 ms are the host's, and no figure of the bus" in evidence()["notes"][system["section"]]


def test_a_verdict_says_what_nobody_has_tested(run: Callable[..., CompletedProcess[str]]) -> None:
    words = "bounds of their stuff bits (8 frames that hardware counted), response times (two worked examples)"
    assert f"{words}; never measured: the cycle" in " ".join(run("evidence", "can").stdout.split())
    assert f", {words}\n" in run("capacity", "can-servo-8", "--all").stdout
    assert "\n  never measured  the cycle\n" in run("capacity", "can-servo-8").stdout


@pytest.mark.parametrize(
    ("name", "frame", "least", "most"),
    [
        ("frame_bits", {}, 111, 135),
        ("fd_frame_bits", {}, 29 + 97, 32 + 115),
        ("frame_us", {"bit_rate_kbit_s": 500}, 222, 270),
        ("frame_us", {"bit_rate_kbit_s": 500, "data_bit_rate_kbit_s": 2000}, 29 * 2 + 97 / 2, 32 * 2 + 115 / 2),
    ],
)
def test_a_row_has_no_stuff_bits_the_most_or_as_many_as_measured_frames_have(
    name: str, frame: dict[str, Any], least: float, most: float
) -> None:
    """8 bytes and 11 bits: Davis 2007, and ISO 11898-1; measured frames have 0.4 of the possible stuff bits."""
    row = partial(ROWS[name], None, payload_bytes=8, identifier_bits=11, **frame)
    found = [row(stuffing=stuffing) for stuffing in ("none", "worst", "expected")]
    assert found == pytest.approx([least, most, least + 0.4 * (most - least)])


def test_a_row_of_messages_has_their_load_and_responses() -> None:
    """Two messages of 8 bytes at 500 kbit/s, 270 us each; the second of 250 us leaves no response to the third."""
    sent: dict[str, Any] = {"bit_rate_kbit_s": 500, "payload_bytes": (8, 8), "period_us": (1000, 2000)}
    assert ROWS["load"](None, **sent) == pytest.approx(0.27 + 0.135)
    assert [ROWS["response_us"](None, message=place, **sent) for place in (1, 2)] == [540, 540]
    full = {**sent, "payload_bytes": (8, 8, 8), "period_us": (1000, 250, 9000)}
    assert ROWS["response_us"](None, message=3, **full) is None
    frame: dict[str, Any] = {"payload_bytes": 8, "identifier_bits": 11, "bit_rate_kbit_s": 500, "stuffing": "worst"}
    assert ROWS["frames_s"](None, **frame) == pytest.approx(1e6 / 270)
