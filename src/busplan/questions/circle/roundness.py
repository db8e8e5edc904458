"""The circle test: is the circle still round at this period?

The bus is checked first: a cycle that does not fit its period delivers no set-points to simulate. Then stability: the
delay of a host loop can make the circle rounder while it reduces the margins, so a circle without margins fails.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from busplan.profile.toml import at_periods
from busplan.progress import Progress
from busplan.questions.circle.failures import (
    bus_failures,
    circle_failures,
    tightest_margins,
)
from busplan.questions.circle.figures import NEGLIGIBLE_MM, CircleFigures, CircleTest
from busplan.questions.circle.setup import Contribution, Setup, announce, bus, contributions, estimate, setup, sources
from busplan.questions.fit.circle_refusal import loop_timing, path_setpoints, require_circle
from busplan.questions.fit.figures import CapacityFigures
from busplan.questions.fit.loop_delays import jitter_us, loop_delays_us
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.circle import CircleRun, simulate_circle
from busplan.servo.parameters import LoopTiming

_LEAST_ARC_DEG: Final = 270.0
"""Shortest arc of a trapezoid for a least-squares centre and radius."""


def failed_measure(result: CircleFigures) -> str | None:
    """Name of the first contour measure that misses its tolerance; None if there is none.

    Parameters
    ----------
    result
        The circle test at one period.
    """
    failed = (failure for failure in result.failures if failure.name in CONTOUR_MEASURES)
    return next((failure.name for failure in failed if failure.value is not None), None)


def to_attack(result: CircleFigures) -> tuple[Contribution, float] | None:
    """Find the source whose removal reduces the first failed contour measure most, and the reduction [mm].

    Parameters
    ----------
    result
        The circle test at one period, with contributions.

    Returns
    -------
    tuple or None
        None if no contour measure fails, or no removal reduces it.
    """
    measure = failed_measure(result)
    if measure is None or not result.contributions:
        return None
    first = min(result.contributions, key=lambda source: float(getattr(source, measure)))
    removed_mm = float(getattr(result, measure)) - float(getattr(first, measure))
    return (first, removed_mm) if removed_mm > 0 else None


def circle_test(
    profile: Profile,
    *,
    periods_us: Sequence[float] | None = None,
    with_contributions: bool = False,
    explain: bool = True,
    progress: Progress | None = None,
) -> CircleTest:
    """Run the circle test of a profile.

    Parameters
    ----------
    profile
        The network, its servo and its circle.
    periods_us
        Communication periods T_s [us]; by default the profile's own.
    with_contributions
        If True, rank the error sources, which takes one more simulation for each.
    explain
        If True, a failed contour tolerance ranks the error sources, too.
    progress
        Called now and then with the steps simulated so far and those known to be needed.

    Returns
    -------
    CircleTest
        One result for each period.

    Raises
    ------
    BusplanError
        A circle that cannot be run: the period is no multiple of the step, say, or the drive cannot reach the feed.

    References
    ----------
    ISO 230-4 for the measures; the paper's section IV-B for the test.
    """
    variants = at_periods(profile, periods_us)
    counter = _Counter(progress)
    # Set up every period before the first simulation, so that errors come at once. A period that does not fit the bus
    # needs no path.
    capacities = [bus(variant) for variant in variants]
    setups = [
        setup(variant) if capacity.fits else _timing(variant)
        for variant, capacity in zip(variants, capacities, strict=True)
    ]
    simulated = [prepared for prepared in setups if isinstance(prepared, Setup)]
    ranked = [sources(prepared) if with_contributions and isinstance(prepared, Setup) else {} for prepared in setups]
    passing = [source for without in ranked for source in without.values()]
    counter.expect(*simulated, *passing)
    announce(estimate(simulated, passing))
    pairs = [
        _test(variant, capacity, prepared, without if with_contributions else None, explain=explain, counter=counter)
        for variant, capacity, prepared, without in zip(variants, capacities, setups, ranked, strict=True)
    ]
    return CircleTest(profile, tuple(result for result, _ in pairs), tuple(run for _, run in pairs), with_contributions)


def _timing(profile: Profile) -> LoopTiming:
    """Timing of a circle that could be run, on a bus that does not carry it."""
    require_circle(profile)
    return loop_timing(profile)


class _Counter:
    """Adds up the steps of many runs as one progress."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._expected = 0
        self._done = 0

    def expect(self, *setups: Setup) -> None:
        self._expected += sum(2 * prepared.steps for prepared in setups)

    def run(self, setup: Setup) -> CircleRun:
        before = self._done

        def report(done: int, _total: int) -> None:
            self._done = before + done
            if self._progress is not None:
                self._progress(self._done, max(self._expected, self._done))

        run = simulate_circle(
            setup.path,
            x=setup.x,
            y=setup.y,
            timing=setup.timing,
            delivery=setup.delivery,
            mechanics=setup.mechanics,
            progress=report,
        )
        self._done = before + 2 * setup.steps
        return run


def _test(
    profile: Profile,
    capacity: CapacityFigures,
    prepared: Setup | LoopTiming,
    without: Mapping[str, Setup] | None,
    *,
    explain: bool,
    counter: _Counter,
) -> tuple[CircleFigures, CircleRun | None]:
    """Test one period; `without` has the setup without each error source, if they are to be ranked."""
    if isinstance(prepared, LoopTiming):
        return _figures(profile, prepared, capacity, None, settled=True), None
    run = counter.run(prepared)
    result = _figures(profile, prepared.timing, capacity, run, settled=prepared.settled)
    if without is None and explain and failed_measure(result):
        without = sources(prepared)
        counter.expect(*without.values())
        announce(estimate((), tuple(without.values())))
    if without is not None:
        ranked = contributions(without, max_contour_error_mm=run.contour.max_contour_error_mm, simulate=counter.run)
        result = result._replace(contributions=ranked)
    return result, run


def _figures(
    profile: Profile, timing: LoopTiming, capacity: CapacityFigures, run: CircleRun | None, *, settled: bool
) -> CircleFigures:
    phase_deg, gain_db, crossover_hz = tightest_margins(run) if run else (None, None, None)
    contour = run.contour if run and settled else None
    is_turn = profile.circle.path != "trapezoid"
    # The least-squares centre of a short arc is meaningless.
    round_ = contour if run and run.constant_speed_deg >= _LEAST_ARC_DEG else None
    delay_x_us, delay_y_us = loop_delays_us(profile)
    circle = profile.circle
    setpoints = path_setpoints(profile)
    judged = profile.tolerance.judged
    measures = [getattr(contour, key) for key in judged or ("max_contour_error_mm",)] if contour else []
    matter = any(value is None or value >= NEGLIGIBLE_MM for value in measures) if contour else None
    circle_fails = () if run is None else circle_failures(profile, run, settled=settled)
    failures = (*bus_failures(profile, capacity), *circle_fails)
    return CircleFigures(
        period_us=profile.cycle.period_us,
        feed_mm_per_min=circle.feed_mm_per_min,
        radius_mm=circle.radius_mm,
        path=circle.path,
        duration_s=setpoints * timing.period_us / 1e6,
        setpoints=setpoints,
        steps=setpoints * timing.steps_per_period,
        step_us=timing.step_us,
        loop=timing.loop,
        update=profile.servo.update,
        delay_us=max(delay_x_us, delay_y_us),
        delay_x_us=delay_x_us,
        delay_y_us=delay_y_us,
        jitter_us=jitter_us(profile),
        timing_model=capacity.timing_model,
        bus_fits=capacity.fits,
        verdict=capacity.verdict or "",
        required_us=capacity.required_us,
        available_us=capacity.available_us,
        servo_grade=profile.servo.grades_given[0],
        ideal_drive="servo" not in profile.model_fields_set,
        stable=run.margins_x.stable and run.margins_y.stable if run else None,
        phase_margin_deg=phase_deg,
        gain_margin_db=gain_db,
        crossover_hz=crossover_hz,
        settled=settled if run and is_turn else None,
        mean_contour_error_mm=contour.mean_contour_error_mm if contour else None,
        max_contour_error_mm=contour.max_contour_error_mm if contour else None,
        radial_deviation_min_mm=contour.radial_deviation_min_mm if contour else None,
        radial_deviation_max_mm=contour.radial_deviation_max_mm if contour else None,
        circular_deviation_mm=contour.circular_deviation_mm if contour else None,
        radius_deviation_mm=round_.radius_deviation_mm if round_ else None,
        centre_offset_mm=round_.centre_offset_mm if round_ else None,
        constant_speed_deg=run.constant_speed_deg if run else None,
        sources_matter=matter,
        passed=False if failures else True if judged and matter else None,
        failures=failures,
        contributions=None,
    )
