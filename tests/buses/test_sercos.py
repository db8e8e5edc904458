"""What both kinds of SERCOS hold: periods that they know, every question in some form, and a start of their own."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.limits import ANY_PERIOD, Periods
from tests.registers import at_least

Run = Callable[..., Any]
FEW = settings(max_examples=at_least(3, 28))
KINDS = pytest.mark.parametrize("kind", ["sercos3", "sercos2"])
KNOWN = Periods((31.25, 62.5, 125.0, 250.0, 500.0))


@given(st.floats(1.0, 600.0))
def test_the_next_period_is_the_first_that_is_no_shorter(least_us: float) -> None:
    longer = [one for one in KNOWN.us if one >= least_us]
    assert KNOWN.shortest_us(least_us) == (longer[0] if longer else float("inf"))
    assert np.asarray(KNOWN.shortest_us(np.array([least_us])))[0] == KNOWN.shortest_us(least_us)
    assert ANY_PERIOD.shortest_us(least_us) == least_us
    neighbours = KNOWN.neighbours(least_us)
    assert all(one in KNOWN.us and one != least_us for one in neighbours)
    assert not [one for one in KNOWN.us if min(neighbours) < one < max(neighbours) and one != least_us]


def test_rounding_asks_for_no_longer_period() -> None:
    assert KNOWN.shortest_us(250.0 * (1 + 1e-14)) == 250.0
    assert KNOWN.shortest_us(250.0 * (1 + 1e-9)) == 500.0


@KINDS
@pytest.mark.parametrize("period_us", [40.0, 300.0, 70_000.0])
def test_capacity_check_and_sweep_name_an_unknown_period(kind: str, period_us: float, run: Run, tmp_path: Path) -> None:
    name, bus = f"{kind}-servo-8", kind_named(kind)
    profile = busplan.load_profile(name, changes={"cycle.period_us": period_us, "servo.step_us": period_us})
    assert profile.cycle.period_us == period_us  # it loads
    for found in busplan.capacity(profile).results:
        assert "period" in found.exceeded
        assert (found.max_nodes, found.limited_by) == (0, "period")
    assert busplan.capacity(profile).verdicts[0].deciding.verdict == "does not fit"
    neighbours = bus.periods.neighbours(period_us)
    assert neighbours
    done = run("check", name, "--set", f"cycle.period_us={period_us}", "--no-circle", "--format", "json", cwd=tmp_path)
    findings = {one["code"]: one["problem"] for one in json.loads(done.stdout)["files"][0]["findings"]}
    problem = findings[{"sercos3": "BP141", "sercos2": "BP151"}[kind]]
    assert done.returncode == 1
    assert f"no period of {period_us:g} us; the next" in problem
    assert all(f"{one:g}" in problem.partition("the next")[2] for one in neighbours)
    known_us = neighbours[-1]
    done = run("sweep", name, "--vary", f"cycle.period_us={period_us},{known_us}", "--format", "json", cwd=tmp_path)
    rows = json.loads(done.stdout)["rows"]
    marked = {one["cycle.period_us"]: one for one in rows}
    assert "period" in marked[period_us]["exceeded"]
    assert marked[period_us]["limited_by"] == "period"
    assert "period" not in marked[known_us]["exceeded"]


@KINDS
@FEW
@given(st.data())
def test_the_smallest_period_is_known_and_the_one_before_is_too_short(kind: str, data: st.DataObject) -> None:
    nodes = data.draw(st.integers(1, 60))
    # With a guess of the execution time the one before is only not shown.
    known_time = {"bus.nodes": nodes, "node.execution.grade": "measured"}
    profile = busplan.load_profile(f"{kind}-servo-8", changes=known_time)
    for found in busplan.capacity(profile).results:
        smallest_us, known = found.min_period_us, kind_named(kind).periods
        assert smallest_us is not None
        assert known.allows(smallest_us)
        before = [one for one in known.us if one < smallest_us][-1:]
        fits = busplan.capacity(profile, period_us=[*before, smallest_us], timing_model=found.timing_model).results
        assert [one.fits for one in fits] == [*(False for _ in before), True]
        assert found.safe_min_period_us is None or found.safe_min_period_us >= smallest_us


@KINDS
def test_no_known_period_is_long_enough_for_everything(kind: str, run: Run, tmp_path: Path) -> None:
    options = ("--set", "bus.nodes=40000", "--all")
    for form in ("table", "json", "csv", "markdown"):
        done = run("capacity", f"{kind}-servo-8", *options, "--format", form, cwd=tmp_path)
        assert (done.returncode, done.stderr, "inf" in done.stdout.split()) == (0, "", False)
    document = json.loads(run("capacity", f"{kind}-servo-8", *options, "--format", "json", cwd=tmp_path).stdout)
    assert document["results"][0]["min_period_us"] is None
    assert document["results"][0]["safe_min_period_us"] is None
    done = run("sweep", f"{kind}-servo-8", "--vary", "bus.nodes=8,40000", "--format", "json", cwd=tmp_path)
    rows = json.loads(done.stdout)["rows"]
    assert [one["min_period_us"] is None for one in rows] == [False, False, True, True]
    done = run("explain", f"{kind}-servo-8", "min_period_us", "--set", "bus.nodes=40000", cwd=tmp_path)
    assert done.returncode == 0
    assert "inf" not in done.stdout.split()


@KINDS
def test_every_row_of_a_sweep_equals_capacity_of_its_point(kind: str, run: Run, tmp_path: Path) -> None:
    vary = {"bus.nodes": "1,61", "cycle.period_us": "260,3000", "payload.read_bytes": "3,150"}
    options = [word for key, ones in vary.items() for word in ("--vary", f"{key}={ones}")]
    done = run("sweep", f"{kind}-servo-8", *options, "--format", "json", cwd=tmp_path)
    rows = json.loads(done.stdout)["rows"]
    assert len(rows) == 2 * 2 * 2 * 2
    for row in rows:
        own = busplan.load_profile(f"{kind}-servo-8", changes={key: row.pop(key) for key in vary})
        (figures,) = busplan.capacity(own, timing_model=row["timing_model"]).results
        found = figures.by_key()
        for key, value in row.items():
            expected = found[key]
            assert value == (pytest.approx(expected, rel=1e-12) if isinstance(expected, float) else expected), key


@KINDS
@pytest.mark.parametrize("axes", [12, 60, 110])
def test_a_plan_takes_a_known_period(kind: str, axes: int) -> None:
    found = busplan.plan(f"{kind}-servo-8", axes=axes)
    known = kind_named(kind).periods
    assert found.recommended is not None
    changes = found.recommended.changes
    assert known.allows(float(changes.get("cycle.period_us", busplan.load_profile(f"{kind}-servo-8").cycle.period_us)))
    after = busplan.load_profile(f"{kind}-servo-8", changes={"bus.nodes": axes, **changes})
    assert busplan.capacity(after).results[0].verdict == "fits"


@KINDS
def test_a_plan_leaves_an_unknown_period_for_the_nearest(kind: str) -> None:
    own = busplan.load_profile(f"{kind}-servo-8")
    longer = busplan.load_profile(own, changes={"cycle.period_us": own.cycle.period_us * 1.1})
    found = busplan.plan(longer)
    assert found.recommended is not None
    assert found.recommended.changes == {"cycle.period_us": own.cycle.period_us}


def test_the_period_of_a_plan_may_be_no_whole_number(tmp_path: Path) -> None:
    text = (
        'schema_version = 1\nname = "six"\n[bus]\nkind = "sercos3"\nnodes = 6\nring_grade = "measured"\n'
        "[cycle]\nperiod_us = 31.25\n"
        "[payload]\nread_bytes = 8\nwrite_bytes = 8\n[node]\naxes = 1\n"
        '[node.execution]\nkind = "linear"\nbase_us = 5\nper_byte_us = 0\n'
    )
    (tmp_path / "six.toml").write_text(text, encoding="utf-8")
    assert busplan.plan(tmp_path / "six.toml").recommended_changes == {"cycle.period_us": 62.5}


@KINDS
def test_each_period_that_is_asked_for_is_named(kind: str, run: Run, tmp_path: Path) -> None:
    done = run("capacity", f"{kind}-servo-8", "--period", "300us,260us", cwd=tmp_path)
    assert "allows no period of 300 us" in done.stdout
    assert "allows no period of 260 us" in done.stdout


@KINDS
def test_a_map_has_known_periods(kind: str) -> None:
    periods = busplan.map_(f"{kind}-servo-8").y
    assert periods is not None
    assert periods.key == "cycle.period_us"
    assert len(periods.values) > 1
    assert all(kind_named(kind).periods.allows(float(one)) for one in periods.values)


@KINDS
def test_nobody_s_execution_time_is_in_the_cycle(kind: str) -> None:
    profile = busplan.load_profile(f"{kind}-servo-8")
    slower = busplan.load_profile(profile, changes={"node.execution.base_us": 999.0})
    assert busplan.capacity(slower).results[0].required_us == busplan.capacity(profile).results[0].required_us
    assert "The execution time behind these figures is assumed." in str(busplan.latency(profile))


@KINDS
def test_groups_of_unlike_nodes_are_answered(kind: str, run: Run, tmp_path: Path) -> None:
    assert run("init", "press", "--bus", kind, "--axes", "10", cwd=tmp_path).returncode == 0
    found = busplan.load_profile(tmp_path / "press.toml")
    assert (found.bus.kind, len(found.group)) == (kind, 2)
    one, _ = busplan.capacity(found).results
    assert len(one.groups) == 2
    assert one.required_us == pytest.approx(
        sum(event.duration_us for event in busplan.timeline(found).cycle_events if event.term)
    )


@KINDS
def test_constants_have_sources(kind: str) -> None:
    assert all(one.source and one.grade for one in kind_named(kind).constants.values())


@pytest.mark.parametrize(
    ("name", "nodes", "has_doubts"),
    [("sercos3-servo-8", 8, True), ("sercos2-servo-8", 1, False), ("sercos2-servo-8", 2, True)],
)
def test_a_margin_without_doubts_says_that_no_uncertainty_is_known(
    run: Run, name: str, nodes: int, has_doubts: bool
) -> None:
    said = run("capacity", name, "--set", f"bus.nodes={nodes}", "--all").stdout
    assert "the error of this timing model is not known" in said
    assert "\n  correction      none: " in said
    assert ("+/-" in said) == has_doubts
