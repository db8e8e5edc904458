"""Circle test: is the circle still round at this period?

The bus is checked first: a cycle that does not fit its period delivers no set-points to simulate. Then stability: the
delay of a host loop can make the circle rounder while it reduces the margins, so a circle without margins fails.
"""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import inf
from typing import Any, Final, NamedTuple

from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.questions.circle import NEGLIGIBLE_MM, CircleFigures, CircleTestAnswer, Contribution, telling_measures
from busplan.questions.circle.failures import bus_failures, circle_failures, tightest_margins
from busplan.questions.fit.circle_setup import (
    delivery_of,
    jitter_us,
    loop_axes,
    loop_delays_us,
    loop_timing,
    parameters_in,
    path_setpoints,
    path_settling_us,
    path_steps,
    require_circle,
)
from busplan.questions.fit.figures import CycleFigures, cycle_figures
from busplan.questions.fit.network import at_periods
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.servo.axis import compiled_kernel
from busplan.servo.circle import CircleRun, simulate_circle
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics
from busplan.servo.path import CirclePath, circle_path
from busplan.servo.runnable import MAX_SETPOINTS, MAX_STEPS


class Setup(NamedTuple):
    """Input of one simulation of the circle test."""

    path: CirclePath
    x: Axis
    y: Axis
    timing: LoopTiming
    delivery: Delivery
    mechanics: Mechanics
    settled: bool = True
    """Whether the loops settle before the measured turn; True on a trapezoid, which has no such turn."""

    @property
    def steps(self) -> int:
        """Simulated steps of each axis."""
        return self.path.setpoints * self.timing.steps_per_period

    def with_axes(self, **changes: Any) -> "Setup":
        """Copy with parameters replaced on both axes."""
        return self._replace(x=replace(self.x, **changes), y=replace(self.y, **changes))


def _with_setpoints_every_step(setup: Setup) -> Setup:
    """The setup with a set-point at every step; unchanged if the period has effects beyond the path's chords."""
    path, timing, delivery = setup.path, setup.timing, setup.delivery
    # A host's loop, jitter, skew and losses act once per period, and a shorter period would change these, too.
    irregular = delivery.jitter_us or delivery.skew_us or delivery.loss_probability
    if timing.loop == "host" or irregular or timing.steps_per_period == 1 or setup.steps >= MAX_SETPOINTS:
        return setup
    return setup._replace(
        path=circle_path(
            path.radius_mm,
            feed_mm_per_min=path.feed_mm_per_min,
            period_us=timing.step_us,
            ramp_periods=round(path.constant_from_us / timing.step_us),
            direction=path.direction,
            settling_us=path.settling_us,
        ),
        timing=replace(timing, period_us=timing.step_us),
    )


_REMOVALS: Mapping[str, Callable[[Setup], Setup]] = {
    "velocity_feedforward": lambda setup: setup.with_axes(velocity_feedforward=1.0),
    "acceleration_feedforward": lambda setup: setup.with_axes(acceleration_feedforward_s=0.0),
    "drive_lag": lambda setup: setup.with_axes(drive_lag_us=0.0),
    "drive_offset": lambda setup: setup.with_axes(drive_offset_mm_s=0.0),
    "dac_resolution": lambda setup: setup.with_axes(dac_bits=0),
    "encoder_resolution": lambda setup: setup.with_axes(encoder_resolution_mm=0.0),
    "reversal": lambda setup: setup.with_axes(reversal_mm_s=0.0),
    "axis_mismatch": lambda setup: setup._replace(y=replace(setup.x, delay_us=setup.y.delay_us)),
    "hold": lambda setup: setup._replace(timing=replace(setup.timing, interpolation="linear")),
    "period": _with_setpoints_every_step,
    "bus_delay": lambda setup: setup.with_axes(delay_us=0.0),
    "jitter": lambda setup: setup._replace(delivery=replace(setup.delivery, jitter_us=0.0)),
    "skew": lambda setup: setup._replace(delivery=replace(setup.delivery, skew_us=0.0)),
    "loss": lambda setup: setup._replace(delivery=replace(setup.delivery, loss_probability=0.0)),
    "backlash": lambda setup: setup._replace(mechanics=replace(setup.mechanics, backlash_mm=0.0)),
    "scale": lambda setup: setup._replace(mechanics=replace(setup.mechanics, scale_x_ppm=0.0, scale_y_ppm=0.0)),
    "squareness": lambda setup: setup._replace(mechanics=replace(setup.mechanics, squareness_um_per_m=0.0)),
}
"""Functions that each remove an error source. A velocity feed-forward of 1 has no error of its own."""


def sources(setup: Setup) -> dict[str, Setup]:
    """Error sources of a setup, each with the setup without it."""
    without = {source: remove(setup) for source, remove in _REMOVALS.items()}
    if setup.timing.loop == "host":
        # A host's loop holds its command between periods, so interpolation does not apply.
        del without["hold"]
    return {source: left for source, left in without.items() if left != setup}


def setup_of(network: Network) -> Setup:
    """Setup of the circle simulation of a network, whose circle must be one that can be run."""
    profile, settling_us = network.profile, path_settling_us(network)
    circle = profile.circle
    x, y = loop_axes(network)
    return Setup(
        path=circle_path(
            circle.radius_mm,
            feed_mm_per_min=circle.feed_mm_per_min,
            period_us=profile.cycle.period_us,
            ramp_periods=circle.ramp_periods,
            direction=circle.direction,
            settling_us=0.0 if settling_us == inf else settling_us,
        ),
        x=x,
        y=y,
        timing=loop_timing(profile),
        delivery=delivery_of(network),
        mechanics=Mechanics(**parameters_in(profile.mechanics, Mechanics)),
        settled=settling_us != inf,
    )


_AXES: Final = 2
_STEP_US: Final = {True: 0.08, False: 0.5}
"""Time for a step of one axis with its measures [us], by whether the kernel is compiled; measured on a machine of 2024.
"""
_SETPOINT_US: Final = 1.5
_STEP_BYTES: Final = 18
"""Memory for a step: positions of both axes, and what is computed from them at a time [bytes]."""
_SETPOINT_BYTES: Final = 200
_LONG_S: Final = 5.0


class Estimate(NamedTuple):
    """Approximate cost of simulations."""

    steps: int
    """Simulated steps, those of each axis counted."""
    time_s: float
    memory_bytes: float


def estimate(kept: Sequence[Setup], only_measured: Iterable[Setup] = ()) -> Estimate:
    """Approximate cost of simulations: of those whose positions are kept, and of those that are only measured."""
    rate_us = _STEP_US[compiled_kernel("auto") is not None]
    # Only their sizes are held, because each setup takes memory; an iterator makes them one by one.
    sizes = [(setup.steps, setup.path.setpoints) for setup in chain(kept, only_measured)]
    memory_bytes = [_STEP_BYTES * steps + _SETPOINT_BYTES * setpoints for steps, setpoints in sizes]
    return Estimate(
        steps=_AXES * sum(steps for steps, _ in sizes),
        time_s=sum(_AXES * rate_us * steps + _SETPOINT_US * setpoints for steps, setpoints in sizes) / 1e6,
        memory_bytes=sum(memory_bytes[: len(kept)]) + max(memory_bytes[len(kept) :], default=0),
    )


def announce(cost: Estimate) -> None:
    """Log the cost of a long run. Without a handler, `logging` writes it to standard error."""
    if cost.time_s > _LONG_S:
        engine = "" if compiled_kernel("auto") else ", in plain Python"
        words = f"about {cost.time_s:.0f} s and {cost.memory_bytes / 1e9:.2g} GB{engine}"
        logging.getLogger("busplan").warning("circle test: %s steps, %s", f"{cost.steps:,}", words)


_LEAST_ARC_DEG: Final = 270.0
"""Shortest arc of a trapezoid for a least-squares centre and radius [deg]."""
_CONTOUR_FIGURES: Final = (*CONTOUR_MEASURES, "radial_deviation_min_mm", "radial_deviation_max_mm")


def run_circles(
    network: Network,
    *,
    periods_us: Sequence[float] | None = None,
    with_contributions: bool = False,
    explain: bool = True,
    progress: Progress | None = None,
) -> CircleTestAnswer:
    """Run the circle test of a network, whose profile has the servo and the circle.

    Periods T_s are in us; None stands for the profile's own. `with_contributions` ranks the error sources, which takes
    a simulation for each; `explain` ranks them where a contour tolerance fails. Progress is called with the steps
    simulated and the steps known to be needed. A circle that cannot be run, for example at a feed that the drive cannot
    reach, raises BusplanError.

    References
    ----------
    ISO 230-4 for the measures; the paper's section IV-B for the test.
    """
    variants = at_periods(network, periods_us)
    counter = _Counter(progress)
    # Every period is set up before the first simulation, so that errors come at once. A period that does not fit the
    # bus needs no path.
    for variant in variants:
        require_circle(variant)
    fits = [cycle_figures(variant, model=variant.bus.deciding_model) for variant in variants]
    _require_few([variant for variant, fit in zip(variants, fits, strict=True) if fit.fits])
    setups = [setup_of(variant) if fit.fits else None for variant, fit in zip(variants, fits, strict=True)]
    simulated = [setup for setup in setups if setup]
    to_rank = [sources(setup) if with_contributions and setup else {} for setup in setups]
    without_one = [setup for without in to_rank for setup in without.values()]
    counter.expect(*simulated, *without_one)
    announce(estimate(simulated, without_one))
    pairs = [
        _test(variant, fit, setup, without if with_contributions else None, explain=explain, counter=counter)
        for variant, fit, setup, without in zip(variants, fits, setups, to_rank, strict=True)
    ]
    return CircleTestAnswer(
        network.profile, tuple(result for result, _ in pairs), tuple(run for _, run in pairs), with_contributions
    )


def _require_few(networks: Sequence[Network]) -> None:
    """Refuse circles that are held in memory together, and are longer than one may be."""
    for what, count, most in (("set-points", path_setpoints, MAX_SETPOINTS), ("steps", path_steps, MAX_STEPS)):
        together = sum(map(count, networks))
        if together > most:
            raise BusplanError(
                f"the circles of {len(networks):,} periods take {together:,} {what} together, more than {most:,}; give "
                "fewer periods"
            )


class _Counter:
    """Sum of the steps of several simulations, reported as one progress."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._expected = 0
        self._done = 0

    def expect(self, *setups: Setup) -> None:
        self._expected += sum(_AXES * setup.steps for setup in setups)

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
        self._done = before + _AXES * setup.steps
        return run


def _test(
    network: Network,
    fit: CycleFigures,
    setup: Setup | None,
    without: Mapping[str, Setup] | None,
    *,
    explain: bool,
    counter: _Counter,
) -> tuple[CircleFigures, CircleRun | None]:
    """Test one period; `without` has the setup without each error source, if they are to be ranked."""
    if setup is None:
        return _figures(network, fit, None, settled=True), None
    run = counter.run(setup)
    result = _figures(network, fit, run, settled=setup.settled)
    if without is None and explain and result.failed_measure:
        without = sources(setup)
        counter.expect(*without.values())
        announce(estimate((), tuple(without.values())))
    if without is not None:
        result = result._replace(contributions=_ranked(run, without, counter=counter))
    return result, run


def _ranked(run: CircleRun, without: Mapping[str, Setup], *, counter: _Counter) -> tuple[Contribution, ...]:
    """Contributions of a circle's error sources, the largest first.

    Sources interact: their contributions need not add up to the whole error.
    """
    contributions = []
    for source, setup in without.items():
        left = counter.run(setup).contour
        removed_mm = run.contour.max_contour_error_mm - left.max_contour_error_mm
        contributions.append(
            Contribution(
                source,
                left.max_contour_error_mm,
                removed_mm,
                left.mean_contour_error_mm,
                left.circular_deviation_mm,
            )
        )
    return tuple(sorted(contributions, key=lambda contribution: -contribution.removed_mm))


def _figures(network: Network, fit: CycleFigures, run: CircleRun | None, *, settled: bool) -> CircleFigures:
    profile, timing = network.profile, loop_timing(network.profile)
    phase_deg, gain_db, crossover_hz = tightest_margins(run) if run else (None, None, None)
    contour = run.contour if run and settled else None
    is_turn = profile.circle.path != "trapezoid"
    # The least-squares centre of a short arc is meaningless.
    long_arc = contour if run and run.constant_speed_deg >= _LEAST_ARC_DEG else None
    delay_x_us, delay_y_us = loop_delays_us(network)
    circle = profile.circle
    setpoints = path_setpoints(network)
    measures = [getattr(contour, key) for key in telling_measures(profile)] if contour else []
    matter = any(value is None or value >= NEGLIGIBLE_MM for value in measures) if contour else None
    of_circle = () if run is None else circle_failures(profile, run, settled=settled)
    failures = (*bus_failures(network, fit), *of_circle)
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
        jitter_us=jitter_us(network),
        timing_model=fit.timing_model,
        bus_fits=fit.fits,
        verdict=fit.verdict or "",
        required_us=fit.required_us,
        available_us=fit.available_us,
        servo_grade=profile.servo.grades_given[0],
        ideal_drive="servo" not in profile.model_fields_set,
        stable=run.margins_x.stable and run.margins_y.stable if run else None,
        phase_margin_deg=phase_deg,
        gain_margin_db=gain_db,
        crossover_hz=crossover_hz,
        settled=settled if run and is_turn else None,
        **{key: getattr(contour, key, None) for key in _CONTOUR_FIGURES},
        radius_deviation_mm=long_arc.radius_deviation_mm if long_arc else None,
        centre_offset_mm=long_arc.centre_offset_mm if long_arc else None,
        constant_speed_deg=run.constant_speed_deg if run else None,
        sources_matter=matter,
        passed=False if failures else True if profile.tolerance.judged and matter else None,
        failures=failures,
        contributions=None,
    )
