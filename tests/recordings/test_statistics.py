"""Periods, lateness and quantiles of stamps, against repetitions and known truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.recordings.statistics import (
    Events,
    PeriodicEvents,
    ahead,
    expanded,
    lateness,
    line,
    periodic_events,
    policed,
    quantile,
    steady_rate,
    step,
)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=200), st.floats(0.5, 1))
def test_a_quantile_is_not_exceeded_by_its_share(values: list[float], share: float) -> None:
    result = quantile(np.array(values), share)
    assert result.value in values
    assert sum(value <= result.value for value in values) >= share * len(values) - 1e-6
    assert sum(value < result.value for value in values) < share * len(values) + 1e-6


def test_the_uncertainty_of_a_quantile_is_what_repetitions_scatter() -> None:
    random = np.random.default_rng(2)
    quantiles = [quantile(random.exponential(10, 2000), 0.95) for _ in range(300)]
    scatter = float(np.std([sample.value for sample in quantiles]))
    assert np.mean([sample.uncertainty for sample in quantiles]) == pytest.approx(scatter, rel=0.15)
    medians = [quantile(random.normal(0, 3, 400), 0.5) for _ in range(300)]
    assert np.mean([sample.uncertainty for sample in medians]) == pytest.approx(
        np.std([sample.value for sample in medians]), rel=0.15
    )


@given(st.integers(1, 10**6), st.floats(0.01, 0.15), st.integers(50, 3000), st.integers(0, 5))
def test_a_period_is_found_whatever_is_missing(seed: int, scatter: float, count: int, missing: int) -> None:
    random = np.random.default_rng(seed)
    places = np.arange(count + missing)
    kept = np.sort(random.choice(places[1:-1], count - 2, replace=False))
    kept = np.concatenate(([0], kept, [count + missing - 1]))
    times = kept * 100.0 + random.uniform(0, 100 * scatter, count)
    periodic = periodic_events(times - times[0])
    assert periodic is not None
    assert periodic.missing == missing
    assert periodic.period_us == pytest.approx(100, abs=8 * periodic.uncertainty_us + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["uniform", "normal", "exponential"])
@pytest.mark.parametrize("count", [10, 40, 400, 4000])
def test_the_latest_event_is_found_within_its_u(shape: str, count: int) -> None:
    random, within, ever_more = np.random.default_rng(3), 0, 0.0
    for _ in range(100):
        late = getattr(random, shape)(size=count)
        periodic = periodic_events(np.arange(count) * 1000.04 + late - late[0])
        assert periodic is not None
        latest, spread = lateness(periodic, 1), float(late.max() - late.min())
        assert latest.uncertainty is not None
        within += abs(latest.value - spread) <= 2 * latest.uncertainty
        ever_more = max(ever_more, latest.value / spread)
    assert within >= 90
    # By the kindest clock it is no more than there was.
    assert ever_more <= 1 + 1e-3


def test_clocks_that_drift_are_in_the_u_of_the_latest_event() -> None:
    random, within = np.random.default_rng(4), 0
    for _ in range(30):
        late, count = random.uniform(0, 10, 5_000), 5_000
        times = np.arange(count) * 1000.0 + late
        periodic = periodic_events(times + 20e-6 * times**2 / (2 * times[-1]) - times[0])
        assert periodic is not None
        latest = lateness(periodic, 1)
        assert latest.uncertainty is not None
        within += abs(latest.value - float(late.max() - late.min())) <= 2 * latest.uncertainty
    assert within >= 27


def test_a_clock_that_bends_is_followed() -> None:
    # Three bends in eight blocks: fewer pieces would take 100 us of the clock for lateness.
    random, count = np.random.default_rng(5), 4_000
    late, places = random.uniform(0, 1, count), np.arange(count)
    clock = np.interp(places, np.linspace(0, count, 5), [0, 100, 0, 100, 0])
    periodic = periodic_events(places * 1000.0 + clock + late)
    assert periodic is not None
    latest = lateness(periodic, 1)
    assert latest.uncertainty is not None
    assert latest.value == pytest.approx(1, abs=2 * latest.uncertainty)
    assert latest.uncertainty < 30


def test_a_bend_is_followed_as_soon_as_it_shows() -> None:
    # Means of 500 events scatter by 0.13 us, and a bend of 2 us by 0.6.
    random, places = np.random.default_rng(9), np.arange(20_000)
    clock = np.interp(places, [0, 10_000, 20_000], [0, 2, 0])
    periodic = periodic_events(places * 1000.0 + clock + random.uniform(0, 10, 20_000))
    assert periodic is not None
    means = periodic.late_us.reshape(40, 500).mean(axis=1)
    assert np.std(means) == pytest.approx(0.13, abs=0.05)


def test_the_doubt_of_a_clock_that_bends_is_as_large_as_its_errors() -> None:
    random, count, ratios = np.random.default_rng(10), 4_000, []
    clock = np.interp(np.arange(count), [0, count / 2, count], [0, 100, 0])
    for _ in range(20):
        late = random.uniform(0, 10, count)
        periodic = periodic_events(np.arange(count) * 1000.0 + clock + late)
        assert periodic is not None
        errors = periodic.late_us - late
        ratios.append(float(np.ptp(errors)) / 2 / periodic.doubt_us)
    assert max(ratios) < 2
    assert 0.4 < np.mean(ratios) < 0.8


def test_the_uncertainty_of_a_period_is_that_of_the_slope_of_a_line() -> None:
    # Of n points a period apart with errors of sigma: sigma sqrt(12 / n^3); of uniform ones of 10 us sigma is 2.89.
    random, count = np.random.default_rng(6), 20_000
    periodic = periodic_events(np.arange(count) * 1000.0 + random.uniform(0, 10, count))
    assert periodic is not None
    assert periodic.uncertainty_us == pytest.approx(10 / np.sqrt(12) * np.sqrt(12 / count**3), rel=0.03)


def test_an_even_clock_has_no_doubt_of_its_bends() -> None:
    random, count = np.random.default_rng(6), 20_000
    periodic = periodic_events(np.arange(count) * 1000.0 + random.uniform(0, 10, count))
    assert periodic is not None
    assert periodic.doubt_us == pytest.approx(0, abs=0.2)


@pytest.mark.parametrize("bend_us", [0.0, 300.0])
def test_a_period_and_its_uncertainty_are_the_same_backwards(bend_us: float) -> None:
    # Late events become early ones: outliers of both sides count alike.
    clock_us = np.interp(np.arange(4_000), [0, 700, 2500, 4_000], [0, bend_us, -bend_us, 0])
    times = np.arange(4_000) * 1000.0 + clock_us + np.random.default_rng(7).exponential(10, 4_000)
    times -= times[0]
    forwards, backwards = periodic_events(times), periodic_events(times[-1] - times[::-1])
    assert forwards is not None
    assert backwards is not None
    assert backwards.period_us == pytest.approx(forwards.period_us, abs=1e-9)
    assert backwards.uncertainty_us == pytest.approx(forwards.uncertainty_us, rel=1e-6)
    assert backwards.doubt_us == pytest.approx(forwards.doubt_us, rel=1e-6)
    assert backwards.late_us[::-1] == pytest.approx(-forwards.late_us, abs=1e-6)


def test_the_latest_event_is_that_of_the_kindest_clock_and_of_others_that_may_be() -> None:
    """By hand: delays of 0, 0, 0, 0 and 10 us against a period that may be 1 us off."""
    late_us = np.array([0.0, 0, 0, 0, 10])
    # Against a period of s us more they are 2 s, s, 0, -s and 10 - 2 s: over the least range where 2 s is 10 - 2 s.
    found = lateness(PeriodicEvents(100.0, 1.0, late_us, 3.0, np.arange(5)), 1)
    assert found.value == pytest.approx(7.5, abs=1e-3)
    # With s of -2 the range is 18; half of what it is more, beside the drift.
    assert found.uncertainty == pytest.approx(np.hypot((18 - 7.5) / 2, 3.0), abs=1e-3)
    assert found.late_us == pytest.approx([0, 0, 0, 0, 7.5], abs=1e-3)
    # Where the period is known, it is 10 us, and nothing is in doubt.
    found = lateness(PeriodicEvents(100.0, 0.0, late_us, 0.0, np.arange(5)), 1)
    assert (found.value, found.uncertainty, found.late_us.tolist()) == (10, 0, late_us.tolist())
    # Of most of the events none is late.
    assert lateness(PeriodicEvents(100.0, 0.0, late_us, 0.0, np.arange(5)), 0.8).value == 0


def test_the_line_of_medians_is_numpys_weighted_fit() -> None:
    random = np.random.default_rng(8)
    sizes = np.repeat([10.0, 20.0, 40.0, 80.0], 15)
    values = 5 + 0.25 * sizes + random.normal(0, 0.02 * sizes)
    of_each = [quantile(values[sizes == size], 0.5) for size in (10, 20, 40, 80)]
    errors = np.hypot([median.uncertainty or 0.0 for median in of_each], 0.3)
    medians = [median.value for median in of_each]
    (slope, level), covariance = np.polyfit((10, 20, 40, 80), medians, 1, w=1 / errors, cov="unscaled")
    found = line(sizes, values, 0.3)
    assert found is not None
    left = (medians - level - slope * np.array([10, 20, 40, 80])) / errors
    birge = max(float(np.sqrt(np.sum(left**2) / 2)), 1.0)
    assert found == pytest.approx((slope, birge * np.sqrt(covariance[0, 0])), rel=1e-9)
    # Fewer than ten values of a size show no median, and one size no line.
    assert line(np.append(sizes, [160.0] * 9), np.append(values, [1e6] * 9), 0.3) == found
    assert line(sizes[:15], values[:15], 0.3) is None
    # Two sizes lie on their line: nothing enlarges its uncertainty.
    slope, uncertainty = line(sizes[:30], values[:30], 0.3) or (0.0, 0.0)
    assert slope == pytest.approx((medians[1] - medians[0]) / 10)
    assert uncertainty == pytest.approx(np.hypot(*errors[:2]) / 10)


def test_too_few_events_or_all_at_once_have_no_period() -> None:
    assert periodic_events(np.arange(0.0, 900.0, 100.0)) is None
    assert periodic_events(np.zeros(20)) is None
    fast = periodic_events(np.arange(40) / 2)
    assert fast is not None
    assert fast.period_us == pytest.approx(0.5)
    found = periodic_events(np.arange(0.0, 1000.0, 100.0))
    assert found is not None
    assert found.period_us == pytest.approx(100)
    assert (found.missing, found.places.tolist()) == (0, [*range(10)])
    # Of two behind each other, and of three.
    places = [0, 1, 2, 4, 5, 6, 7, 8, 9, 10, 14, 15]
    found = periodic_events(np.array([100.0 * place for place in places]))
    assert found is not None
    assert (found.missing, [part.tolist() for part in found.gaps]) == (4, [[2, 9], [1, 3]])
    # Where half of the events are missing, an estimate tells the period.
    assert [
        found and (found.missing, round(found.period_us))
        for found in (periodic_events(np.arange(0.0, 4000.0, 200.0), near_us) for near_us in (None, 100.0))
    ] == [(0, 200), (19, 100)]


def test_the_earliest_event_is_the_first_frame_of_its_time() -> None:
    events = Events(np.ones(4), np.array([3.0, 1.0000000004, 1.0, 2.0]), np.array([1, 4, 7, 5]))
    assert events.earliest(np.array([True, True, True, True])) == (1.0, 7)
    assert events.earliest(np.array([True, True, False, True])) == (1.0, 4)
    assert events._replace(times_s=np.ones(4)).earliest(np.array([False, True, True, True])) == (1.0, 4)


times = st.lists(st.integers(0, 400), min_size=1, max_size=25).map(lambda us: np.array(sorted(us), dtype=float))


@given(times_us=times, period_us=st.integers(1, 60), allowed_us=st.integers(0, 60))
def test_an_event_is_too_early_by_its_worst_distance_to_one_before(
    times_us: np.ndarray, period_us: int, allowed_us: int
) -> None:
    def early_us(kept: list[int], place: int) -> float:
        """By which k events, the last at a place, span less than k - 1 periods."""
        spans = (times_us[place] - times_us[first] for first in kept)
        return max((len(kept) - nth) * period_us - span for nth, span in enumerate(spans)) if kept else 0.0

    found = ahead(times_us, period_us)
    assert found.tolist() == [max(early_us([*range(at)], at), 0.0) for at in range(len(times_us))]
    # One that is too early by more than is allowed counts for none behind it.
    kept: list[int] = []
    for place, early in enumerate(policed(times_us, period_us, allowed_us).tolist()):
        assert early == max(early_us(kept, place), 0.0)
        if early <= allowed_us:
            kept.append(place)


@given(times_us=times, window_us=st.integers(0, 500))
def test_no_rate_and_burst_bound_the_events_of_a_window_more_closely(times_us: np.ndarray, window_us: int) -> None:
    """By the most events in each time, counted: the least b + r w of all lines b + r t over them."""
    count = len(times_us)
    least_us = {number: min(times_us[number - 1 :] - times_us[: count - number + 1]) for number in range(1, count + 1)}

    def most(rate: float) -> float:
        return float(max(number - rate * us for number, us in least_us.items()) + rate * window_us)

    rate = steady_rate(times_us, window_us)
    slopes = {
        (more - fewer) / (us - before)
        for fewer, before in least_us.items()
        for more, us in least_us.items()
        if us > before
    }
    if times_us[-1] - times_us[0] <= window_us:
        assert rate == 0
    else:
        assert most(rate) == pytest.approx(min(map(most, slopes)))


def test_steps_and_expanded_uncertainties_are_those_of_a_hand_calculation() -> None:
    assert step(np.array([0, 3000, 1500, 12_000])) == 1.5
    assert step(np.array([5, 5])) == 0
    assert expanded(3.0, 4.0) == 10
    assert expanded(3.0, 4.0, stamps_us=0.5) == 10.5
    assert expanded(3.0, None) is None
