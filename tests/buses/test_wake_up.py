"""A host that starts cycles late: its cycle beside a simulated host, and a measured worst, which is no bound."""

import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named, kind_names
from busplan.buses.hosts import hosts
from busplan.profile.starter import Machine, machine_text, shared_out
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.circle_setup import jitter_us
from busplan.questions.fit.graded import given as given_as
from busplan.questions.fit.network import network_of
from busplan.sections.base import beside


class Kind(NamedTuple):
    """A shipped profile of a kind, and how often its cycle holds the latest start."""

    profile: str
    key: str
    share: float = 1.0


KINDS = (
    Kind("gantry-24", "bus.sync_jitter_us"),
    Kind("dvrk", "bus.sync_jitter_us"),
    Kind("can-servo-8", "bus.sync_jitter_us"),
    Kind("ethercat-servo-8", "bus.master_jitter_us"),
    Kind("sercos3-servo-8", "bus.master_jitter_us", 1.5),  # CoSeMa: three halves of it
    Kind("profibus-drives-6", "bus.master_jitter_us"),
    Kind("dynamixel-arm-14", "bus.master_jitter_us"),
)
EACH = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.profile)
SLOW = ("gantry-24", "can-servo-8")  # the kind of dvrk, and one that has tests of its own
SOME = pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind.profile in SLOW), id=kind.profile) for kind in KINDS]
)


def with_jitter(kind: Kind, us: float, cycles: int | None = None, **more: Any) -> busplan.Profile:
    """The profile with a latest start, perhaps the worst of so many cycles, and other values, __ for the dot."""
    measured = {} if cycles is None else {beside(kind.key, "cycles"): cycles}
    others = {key.replace("__", "."): value for key, value in more.items()}
    return busplan.load_profile(kind.profile, changes={kind.key: us, **measured, **others})


def decided(profile: busplan.Profile) -> Any:
    return busplan.capacity(profile).verdicts[0].deciding


def test_every_kind_with_a_wake_up_is_here() -> None:
    keys = {kind: kind_named(kind).key_of("wake-up") for kind in kind_names()}
    assert {kind: key for kind, key in keys.items() if key} == {
        busplan.load_profile(kind.profile).bus.kind: kind.key for kind in KINDS
    }


@EACH
@pytest.mark.parametrize("us", [pytest.param(1.0, marks=pytest.mark.slow), 400.0])
def test_a_cycle_takes_as_much_longer_as_it_may_start_late(kind: Kind, us: float) -> None:
    punctual, late = (decided(with_jitter(kind, jitter)) for jitter in (0.0, us))
    assert late.required_us == pytest.approx(punctual.required_us + kind.share * us, rel=1e-12)
    assert sum(term.us for term in late.terms) == pytest.approx(late.required_us, rel=1e-12)
    events = busplan.timeline(with_jitter(kind, us)).to_dict()["events"]
    assert sum(event["duration_us"] for event in events if event["kind"] != "idle") == pytest.approx(
        late.required_us, rel=1e-9
    )


def test_the_papers_equations_have_no_term_for_it() -> None:
    for us, missing in ((0.0, ()), (5.0, ("bus.sync_jitter_us",))):
        (verdict,) = busplan.capacity(busplan.load_profile("paper-1ms", changes={"bus.sync_jitter_us": us})).verdicts
        assert verdict.not_applicable.get("paper", ()) == missing


@given(st.integers(1, 400), st.integers(1, 400), st.lists(st.booleans(), min_size=20, max_size=20), st.integers(0, 8))
def test_a_late_host_never_meets_its_next_cycle_where_the_plan_fits(
    late_us: int, period_us: int, is_late: list[bool], nodes: int
) -> None:
    kind = next(kind for kind in KINDS if kind.profile == "profibus-drives-6")
    changes: dict[str, Any] = {
        "bus__nodes": nodes + 1,
        "cycle__nonperiodic_us": 0.0,
        "cycle__period_us": 10.0 * period_us,
    }
    lasts_us = decided(with_jitter(kind, 0.0, **changes)).required_us
    planned = decided(with_jitter(kind, float(late_us), **changes))
    # The host wakes at each multiple of the period, or later; its cycle then runs to its end.
    starts = [number * 10.0 * period_us + late_us * late for number, late in enumerate([True, False, *is_late])]
    meets = any(start + lasts_us > later + 1e-9 for start, later in pairwise(starts))
    assert meets is (not planned.fits)


@EACH
def test_commands_come_as_late_and_samples_scatter(kind: Kind) -> None:
    punctual, late = (network_of(with_jitter(kind, us)) for us in (0.0, 400.0))
    # The window of SERCOS keeps the jitter free at its end. A cycle start before a late host delays nothing.
    for node in range(1, int(punctual.nodes) + 1):
        behind_us = deciding_cycle(late).arrival_us(node) - deciding_cycle(punctual).arrival_us(node)
        assert behind_us == pytest.approx(0.0 if kind.share > 1 else 400.0)
    is_clocked = kind.profile.startswith(("ethercat", "sercos"))
    assert jitter_us(late) - jitter_us(punctual) == pytest.approx(0.0 if is_clocked else 200.0)


@SOME
def test_a_measured_worst_is_no_bound(kind: Kind) -> None:
    bound = decided(with_jitter(kind, 5.0, cycle__period_us=64_000.0))
    assert bound.verdict == "fits"
    measured: dict[str, Any] = {"cycles": 900_000, "cycle__period_us": 64_000.0}
    (verdict,) = busplan.capacity(with_jitter(kind, 5.0, **measured)).verdicts
    found = verdict.deciding
    assert (found.verdict, found.not_shown, found.exceeded) == ("not shown to fit", ("wake_up",), ())
    assert verdict.broken_limits == (f"{kind.key} = 5 is the worst of 900,000 measured cycles, no bound",)
    assert decided(with_jitter(kind, 0.0, **measured)).verdict == "fits"
    (verdict,) = busplan.capacity(with_jitter(kind, 5.0, **measured, limits__missed_cycles=1)).verdicts
    assert verdict.deciding.verdict == "fits"
    first = verdict.rests_on[0]
    assert (first.key, first.words) == (beside(kind.key, "cycles"), "a wake-up measured, worst of 900,000 cycles")
    # No acceptance mends a cycle that does not fit even so.
    late = decided(with_jitter(kind, 31_990.0, cycles=900_000, cycle__period_us=32_000.0, limits__missed_cycles=1))
    assert late.verdict == "does not fit"


@SOME
def test_a_grid_says_what_capacity_says(kind: Kind) -> None:
    profile = with_jitter(kind, 5.0, cycles=1000, cycle__period_us=64_000.0)
    values = [0.0, 200.0]
    table = busplan.sweep(profile, vary={kind.key: values})
    said = [decided(busplan.load_profile(profile, changes={kind.key: value})).verdict for value in values]
    rows = table.to_dict()["rows"]
    assert [row["verdict"] for row in rows if row["verdict"]] == said
    assert said == ["fits", "not shown to fit"]


def test_the_gate_reports_it_at_its_key(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    text = machine_text(Machine(shared_out(2, nodes=2), 10_000.0, 4, "real-time"), kind="can", name="line", file="x")
    path.write_text(text)
    place = text.splitlines().index(next(line for line in text.splitlines() if line.startswith("sync_jitter_us"))) + 1
    (finding,) = [one.finding for one in busplan.check(path, circle=False).findings if one.finding.code == "BP114"]
    assert (finding.key, finding.line) == ("bus.sync_jitter_us", place)
    assert "limits.missed_cycles = 1" in str(finding.help)
    # Another machine's worst is assumed of this one; its own is measured.
    assert given_as(busplan.load_profile(path), "bus.sync_jitter_us").grade == "assumed"
    path.write_text(text.replace("# assumed: latest start", "# latest start"))
    assert given_as(busplan.load_profile(path), "bus.sync_jitter_us").grade == "measured"


@pytest.mark.parametrize("kind", kind_names())
def test_a_new_profile_has_the_host_that_is_asked_for(kind: str) -> None:
    bus = kind_named(kind)
    key = bus.key_of("wake-up")
    assert bool(bus.hosts()) is bool(key)
    for name, host in bus.hosts().items():
        machine = Machine(shared_out(2, nodes=2), 1_000_000.0, 4, name)
        profile = tomllib.loads(machine_text(machine, kind=kind, name="line", file="x"))["bus"]
        said = {one.partition(".")[2]: profile.get(one.partition(".")[2]) for one in (key, beside(key, "cycles"))}
        assert [*said.values()] == [host.jitter_us or None, host.jitter_cycles or None]
    without = tomllib.loads(machine_text(Machine(shared_out(2, nodes=2), 1e6, 4), kind=kind, name="line", file="x"))
    assert not any("jitter" in name for name in without["bus"])


def test_the_hosts_are_those_that_were_measured() -> None:
    # Longest periods of a 2 ms loop over 30 minutes, in ms.
    longest_ms = {"real-time": 2.78, "low-latency": 3.21, "stock": 237.0}
    found: dict[str, Any] = {
        name: (host.jitter_us, host.jitter_cycles) for name, host in hosts().items() if host.jitter_us
    }
    assert found == {name: (pytest.approx(1000 * (ms - 2)), 30 * 60 * 500) for name, ms in longest_ms.items()}


@SOME
def test_the_sensitivity_has_its_row(kind: Kind) -> None:
    (verdict,) = busplan.capacity(kind.profile, sensitivity=True).to_dict()["verdicts"]
    (row,) = [row for row in verdict["sensitivity"] if row["key"] == kind.key]
    assert row["margin_change_us"] == pytest.approx(-kind.share * (row["to"] - row["from"]))
