"""Profiles with keys that the paper's equations have no term for: they load, and are judged by the standard alone."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan

Run = Callable[..., Any]

TEXT = (Path(__file__).parents[2] / "profiles" / "paper-4ms.toml").read_text(encoding="utf-8")
TEXT = "".join(line for line in TEXT.splitlines(keepends=True) if not line.startswith("cycle_master"))
BEYOND = {
    "bus.cycle_master": ("[bus]", "cycle_master = true"),
    "bus.phy_delay_us": ("[bus]", "phy_delay_us = 0.144"),
    "cycle.retries": ("[cycle]", "retries = 1"),
    "host.transaction_us": ("[payload]", "[host]\ntransaction_us = 5"),
    "node.read_response": ("[node]", 'read_response = "concatenated"'),
    "node.write_response": ("[node]", 'write_response = "unified"'),
    "node.execution.worst_extra_us": ("[node.execution]", "worst_extra_us = 3.1"),
}
"""Each key, with the header that its line stands below; a section of its own stands before one."""


def text_with(*keys: str) -> str:
    """The shipped profile with some of these keys."""
    text = TEXT
    for key in keys:
        header, line = BEYOND[key]
        assert text.count(f"\n{header}\n") == 1
        own = f"\n{line}\n{header}\n" if line.startswith("[") else f"\n{header}\n{line}\n"
        text = text.replace(f"\n{header}\n", own)
    return text


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Where a profile of one's own is."""
    return tmp_path / "own.toml"


@pytest.mark.parametrize("key", BEYOND)
def test_such_a_key_leaves_the_standard_alone_and_a_sentence_says_why(busplan: Run, own: Path, key: str) -> None:
    own.write_text(text_with(key), encoding="utf-8")
    done = busplan("capacity", "own.toml", "--all", cwd=own.parent)
    assert done.returncode == 0, done.stderr
    assert f"  paper model     not applicable: it has no {key}\n" in done.stdout
    (header,) = [line for line in done.stdout.splitlines() if line.startswith("figure ")]
    assert header.split() == ["figure", "source", "unit", "standard"]
    document = json.loads(busplan("capacity", "own.toml", "--format", "json", cwd=own.parent).stdout)
    assert [one["timing_model"] for one in document["results"]] == ["standard"]


@pytest.mark.parametrize("command", ["capacity", "latency", "timeline", "sweep", "explain"])
def test_the_paper_is_refused_where_it_is_asked_for(busplan: Run, own: Path, command: str) -> None:
    own.write_text(text_with("bus.cycle_master", "host.transaction_us"), encoding="utf-8")
    more = {"sweep": ("--vary", "bus.nodes=1,2"), "explain": ("required_us",)}.get(command, ())
    done = busplan(command, "own.toml", *more, "--timing-model", "paper", cwd=own.parent)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "--timing-model paper: not applicable, "
        "the paper model has no bus.cycle_master, host.transaction_us; use standard\n"
    )
    assert busplan(command, "own.toml", *more, "--timing-model", "standard", cwd=own.parent).returncode == 0
    assert busplan(command, "own.toml", *more, cwd=own.parent).returncode == 0


def test_every_such_key_at_once_has_one_sentence_and_one_verdict(busplan: Run, own: Path) -> None:
    own.write_text(text_with(*BEYOND), encoding="utf-8")
    done = busplan("capacity", "own.toml", "--all", cwd=own.parent)
    assert done.stdout.count("not applicable") == 1
    assert all(key in done.stdout for key in BEYOND)
    assert busplan("check", "own.toml", "--no-circle", cwd=own.parent).returncode == 0


def test_a_default_that_is_said_keeps_the_paper(own: Path) -> None:
    said = TEXT.replace(
        "\n[node]\n", '\n[host]\ntransaction_us = 0\n[node]\nread_response = "split"\nresponse_us = 1\n'
    )
    own.write_text(said.replace("\n[cycle]\n", "\ncycle_master = false\n[cycle]\nretries = 0\n"), encoding="utf-8")
    assert busplan.capacity(own).results == busplan.capacity("paper-4ms").results


# --- cycle starts that leave no time ----------------------------------------------------------------------


def without_time(period_us: float = 4000) -> str:
    """Cycle starts of 27.530 us at gap count 63 over two hops, and 120 us of isochronous traffic behind each."""
    text = text_with("bus.cycle_master").replace("= true\n", "= true\nisochronous_us = 120\n", 1)
    return text.replace("period_us = 4000", f"period_us = {period_us}")


@pytest.mark.parametrize("period_us", [4000, 1e5, 1e9])
def test_cycle_starts_that_leave_no_time_are_a_broken_limit_without_a_loop(own: Path, period_us: float) -> None:
    own.write_text(without_time(period_us), encoding="utf-8")
    (one,) = busplan.capacity(own).results
    assert "cycle starts" in one.exceeded
    assert (one.verdict, one.fits, one.safe_nodes, one.safe_axes, one.max_nodes) == ("does not fit", False, 0, 0, 0)
    assert (one.limited_by, one.safe_limited_by) == ("cycle starts", "cycle starts")
    assert 0 < one.required_us < 1e6  # finite, and nobody waited for a fixed point
    said = str(busplan.capacity(own))
    assert "a cycle start takes 147.530 us, over 124.000 us: no time is left for the nodes" in said
    assert busplan.plan(own).recommended_changes is None


def test_the_gate_names_the_limit_and_the_way_out(busplan: Run, own: Path) -> None:
    # Half of 1 s is more than all of these cycle starts: time is not what is missing.
    own.write_text(without_time(1e6), encoding="utf-8")
    done = busplan("check", "own.toml", "--no-circle", cwd=own.parent)
    assert done.returncode == 1
    assert (
        "BP101 error: cycle.period_us: a cycle start takes 147.530 us, over 124.000 us: no time is left" in done.stdout
    )
    assert "reduce bus.isochronous_us, or stop the cycle master" in done.stdout


@pytest.mark.parametrize("line", ["cycle_master = true", pytest.param("retries = 1_000_000", marks=pytest.mark.slow)])
def test_a_timeline_of_millions_of_events_is_refused_at_once(busplan: Run, own: Path, line: str) -> None:
    text = TEXT.replace("period_us = 4000", "period_us = 1e9").replace("nonperiodic_us = 0", "nonperiodic_us = 4e8")
    header = "[bus]" if line.startswith("cycle") else "[cycle]"
    own.write_text(text.replace(f"\n{header}\n", f"\n{header}\n{line}\n"), encoding="utf-8")
    done = busplan("timeline", "own.toml", cwd=own.parent)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "a timeline shows up to 50,000 events, and this cycle has more\n"
    assert busplan("capacity", "own.toml", cwd=own.parent).returncode == 0
