"""The best value of a setting is the one that an exhaustive search in exact arithmetic finds."""

from collections.abc import Callable
from fractions import Fraction
from itertools import count

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from busplan.analysis.capacity.node_limit import safe_nodes
from busplan.analysis.circle.check import CircleCheck
from busplan.analysis.circle.roundness import circle_test
from busplan.analysis.planning.best_values import largest_payload, smallest_period, smallest_ratio
from busplan.profile.toml import override
from busplan.sections.profile import Profile

Make = Callable[..., Profile]
Safely = Callable[[Profile, int], Fraction]

ROUNDING = Fraction(1, 10**12)
PAYLOAD = {"S100": 512, "S200": 1024, "S400": 2048}
GAP_COUNTS = [5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62]


def fit(required: Fraction, *, ratio: float | Fraction, period: float | Fraction) -> bool:
    return required <= Fraction(ratio) * Fraction(period) * (1 + ROUNDING)


def safe(hops: int) -> int:
    return GAP_COUNTS[hops - 1] if hops <= len(GAP_COUNTS) else 63


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_smallest_ratio(data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely) -> None:
    profile = data.draw(any_profile)
    required = safely(profile, profile.alike_nodes[0].nodes)
    period = profile.cycle.period_us
    found = smallest_ratio(profile)
    needed = required / (Fraction(period) * (1 + ROUNDING)) * 10_000
    steps = next((n for n in range(1, 10_001) if n >= needed), None)
    assert (found > 1) if steps is None else found == steps / 10_000


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_smallest_period_of_the_bus(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely
) -> None:
    profile = data.draw(any_profile)
    required = safely(profile, profile.alike_nodes[0].nodes)
    ratio = profile.cycle.slice_ratio
    found = smallest_period(profile)
    assert (found.bounded_by, found.proven) == ("time", True)
    # Cycle starts that leave next to no time ask for periods beyond any profile's.
    assume(found.period_us is not None and found.period_us < 50_000)
    needed = required / (Fraction(ratio) * (1 + ROUNDING))
    assert found.period_us == next(n for n in count(1) if n >= needed)


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_smallest_period_that_passes_a_circle_of_any_kind(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely
) -> None:
    step = data.draw(st.sampled_from([0.1, 12.5, 100.0, 333.3]))
    profile = override(data.draw(any_profile), {"servo.step_us": step, "bus.nodes": 3})
    ratio, required = profile.cycle.slice_ratio, safely(profile, 3)
    first = next(
        n
        for n in count(max(1, int(required / Fraction(ratio) / Fraction(str(step))) - 2))
        if fit(required, ratio=ratio, period=n * Fraction(str(step)))
    )
    # What passes is no monotone function of the period, and is not treated as one.
    passing = {first + n for n in data.draw(st.sets(st.integers(0, 12), min_size=1))}
    tried = []

    def circle(variant: Profile) -> tuple[str, ...]:
        tried.append(variant.cycle.period_us)
        return () if round(variant.cycle.period_us / step) in passing else ("fails",)

    found = smallest_period(profile, circle=circle, max_circles=8)
    smallest = min(passing)
    if smallest < first + 8:
        assert found.period_us == pytest.approx(smallest * step, rel=1e-12)
        assert (found.bounded_by, found.proven) == ("circle" if smallest > first else "time", True)
    else:
        assert not found.proven
        assert found.period_us is None or round(found.period_us / step) in passing
    assert len(tried) < 60


def test_three_steps_of_a_tenth_are_written_as_three_tenths(make: Make) -> None:
    profile = make(servo={"step_us": 0.1}, cycle__slice_ratio=1.0, bus__nodes=1)
    found = smallest_period(profile, circle=lambda _: ())
    assert found.period_us is not None
    assert len(str(found.period_us)) <= len("123.4")


def test_no_period_beyond_the_schema(make: Make) -> None:
    profile = make(cycle__slice_ratio=1e-6, cycle__nonperiodic_us=2000.0)
    assert smallest_period(profile).period_us is None
    always = smallest_period(profile, circle=lambda _: ())
    assert (always.period_us, always.bounded_by, always.proven) == (None, "time", True)


def test_a_circle_that_never_passes_ends_the_search_without_a_proof(make: Make) -> None:
    found = smallest_period(make(), circle=lambda _: ("no",), max_circles=5)
    assert (found.period_us, found.bounded_by, found.proven) == (None, "circle", False)


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_largest_payload(data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely) -> None:
    profile = override(data.draw(any_profile), {"bus.nodes": data.draw(st.integers(1, 6))})
    cycle = profile.cycle

    def fits(size: int) -> bool:
        both = override(profile, {"payload.read_bytes": size, "payload.write_bytes": size})
        return fit(safely(both, both.alike_nodes[0].nodes), ratio=cycle.slice_ratio, period=cycle.period_us)

    limit = PAYLOAD[profile.bus.speed]
    largest = max((size for size in range(4, limit + 1, 4) if fits(size)), default=0)
    assert largest_payload(profile) == (largest, "speed" if largest == limit else "time")


def test_payload_stays_inside_the_execution_table_which_need_not_ascend(make: Make) -> None:
    def table(times: list[float], *, sizes: tuple[int, ...] = (10, 100, 203), period: float) -> Profile:
        execution = {"kind": "table", "payload_bytes": list(sizes), "time_us": times}
        payload = {"read_bytes": sizes[0], "write_bytes": sizes[0]}
        return make(node__execution=execution, cycle__period_us=period, payload=payload)

    assert largest_payload(table([30.0, 60.0, 90.0], period=1e4)) == (200, "execution")
    # 100 bytes take longer than 200: a search that takes the time for monotone stops below them.
    assert largest_payload(table([30.0, 500.0, 40.0], period=1000.0)) == (200, "execution")
    assert largest_payload(table([30.0, 60.0, 90.0], period=10.0)) == (0, "time")
    assert largest_payload(table([9.0, 9.1, 9.2], sizes=(9, 10, 11), period=1e4)).value == 0


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_most_nodes_are_safe_for_their_gap_count(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely, start: Safely
) -> None:
    profile = override(data.draw(any_profile), {"payload.read_bytes": 12, "payload.write_bytes": 12})
    bus, cycle = profile.bus, profile.cycle

    def good(nodes: int) -> bool:
        hops = bus.max_hops or nodes
        gap_count = safe(hops) if bus.gap_count == "optimal" else bus.gap_count
        in_time = fit(safely(profile, nodes), ratio=cycle.slice_ratio, period=cycle.period_us)
        return hops <= 16 and gap_count >= safe(hops) and in_time and start(profile, nodes) <= 124

    assert safe_nodes(profile)[0] == max(filter(good, range(1, 63)), default=0)


def test_the_circle_is_that_of_the_circle_test_at_every_period(make: Make) -> None:
    # The mean error falls with the period here, because the ramps grow: a bisection from above would not find this.
    circle = {"radius_mm": 20.0, "feed_mm_per_min": 3000.0, "ramp_periods": 20}
    profile = make(
        servo={"position_gain_per_s": 50.0, "velocity_feedforward": 0.0, "step_us": 500.0},
        circle=circle,
        cycle__period_us=4000.0,
        bus__gap_count=7,
    )
    grid = [500.0 * n for n in range(1, 40)]
    means = circle_test(profile, periods_us=grid, explain=False).results
    wanted_mm = next(one.mean_contour_error_mm for one in means if one.period_us == 5000.0)
    strict = override(profile, {"tolerance.mean_contour_error_mm": wanted_mm})
    passing = [one.period_us for one in circle_test(strict, periods_us=grid, explain=False).results if one.passed]
    found = smallest_period(strict, circle=CircleCheck())
    assert (found.period_us, found.bounded_by, found.proven) == (passing[0], "circle", True)
    assert 500.0 < passing[0] <= 5000.0
