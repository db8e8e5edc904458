"""How the figures of `circle-test` are computed: the bus by its equations, the rest from one simulation.

A simulation has no formula. Its lines say what was measured of it, at which step, and everything that went in.
"""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from busplan.analysis.circle.failures import CONTOUR_MEASURES, LEAST_ARC_DEG
from busplan.analysis.circle.figures import CIRCLE_FIGURES
from busplan.analysis.circle.roundness import CircleFigures, circle_test
from busplan.analysis.derivation.capacity import capacity_figures
from busplan.analysis.derivation.inputs import traced
from busplan.analysis.derivation.simulation import SimulationNumbers
from busplan.analysis.derivation.trace import Input, Traced, short
from busplan.buses.figure import by_key
from busplan.progress import Progress
from busplan.sections.machine import AxisKeys
from busplan.sections.profile import Profile
from busplan.servo.circle import CircleRun

Figures = dict[str, Traced]
_LOOP_KEYS: Final = ("position_gain_per_s", "integral_gain_per_s2", "derivative_gain", "drive_lag_us")
"""What of the servo the linear loop holds."""


class _Test(NamedTuple):
    """One circle test, and what its lines are made of."""

    profile: Profile
    result: CircleFigures
    run: CircleRun | None
    bus: dict[str, Traced]
    simulation: tuple[Traced, ...]
    """Inputs of the simulation."""


def circle_figures(profile: Profile, *, with_contributions: bool = False, progress: Progress | None = None) -> Figures:
    """Derive every figure of `circle-test` at the profile's own period.

    Parameters
    ----------
    profile
        The network, its servo and its circle.
    with_contributions
        Run again without each error source in turn.
    progress
        As for `circle_test`.

    Returns
    -------
    dict
        By the keys of `CIRCLE_FIGURES`.

    Raises
    ------
    BusplanError
        As `circle_test`.
    """
    test = circle_test(profile, with_contributions=with_contributions, explain=False, progress=progress)
    bus = capacity_figures(profile, model=profile.bus.timing_model)
    one = _Test(profile, test.results[0], test.runs[0], bus, tuple(_simulation_inputs(profile)))
    found: dict[str, Traced] = {}
    known = by_key(CIRCLE_FIGURES)
    for derive in (_given, _path, _bus_figures, _loop, _contour, _verdict):
        found |= derive(one, found)
        for key in found:
            found[key].named(key, known[key].symbol)
    return found


def simulated_inputs(profile: Profile) -> tuple[Input, ...]:
    """What the circle test of a profile starts from, each with its grade; nothing is simulated."""
    return tuple(one.given for one in _simulation_inputs(profile) if one.given is not None)


def _idle(profile: Profile) -> Iterator[str]:
    """Keys of [delivery] that nothing asks: what a node does on a loss that never comes, the seed of no chance."""
    loses = profile.delivery.loss_probability > 0
    if not loses:
        yield "on_loss"
    if not loses and not profile.delivery.jitter_us:
        yield "seed"


def _simulation_inputs(profile: Profile) -> Iterator[Traced]:
    """Everything that is not zero: zero in a resolution, a lag or a disturbance means that there is none."""
    yield traced(profile, "cycle.period_us")
    for name in ("circle", "servo", "delivery", "mechanics"):
        section = getattr(profile, name)
        unused = {"x", "y", "grade", *_idle(profile)}
        keys = [key for key in type(section).model_fields if key not in unused and getattr(section, key)]
        yield from (traced(profile, f"{name}.{key}") for key in keys)
    for axis in ("x", "y"):
        own = getattr(profile.servo, axis).model_fields_set
        yield from (traced(profile, f"servo.{axis}.{key}") for key in AxisKeys.model_fields if key in own)


def _given(one: _Test, _found: Figures) -> Figures:
    profile = one.profile
    return {
        "period_us": traced(profile, "cycle.period_us"),
        "feed_mm_per_min": traced(profile, "circle.feed_mm_per_min"),
        "radius_mm": traced(profile, "circle.radius_mm"),
        "step_us": traced(profile, "servo.step_us"),
        "loop": traced(profile, "servo.loop"),
        "timing_model": traced(profile, "bus.timing_model"),
        "servo_grade": traced(profile, "servo.grade"),
    }


def _path(one: _Test, found: Figures) -> Figures:
    result, ramp = one.result, traced(one.profile, "circle.ramp_periods")
    period, feed, radius, step = (found[key] for key in ("period_us", "feed_mm_per_min", "radius_mm", "step_us"))
    setpoints = Traced(
        result.setpoints,
        formula="2 pi r / (F / 60) / (T_s / 1e6) + ramp, rounded up",
        numbers=f"2 pi * {short(radius.value)} / ({short(feed.value)} / 60) / ({short(period.value)} / 1e6) "
        f"+ {short(ramp.value)}, rounded up",
        parts=(radius, feed, period, ramp),
    ).named("setpoints", "n")
    return {
        "setpoints": setpoints,
        # The result's own expression, given traced numbers.
        "duration_s": setpoints * period / 1e6,
        "steps": Traced(
            result.steps,
            formula="n T_s / h",
            numbers=f"{short(setpoints.value)} * {short(period.value)} / {short(step.value)}",
            parts=(setpoints, period, step),
        ),
    }


def _bus_figures(one: _Test, found: Figures) -> Figures:
    required = one.bus["required_us"]
    if one.profile.servo.loop == "node":
        words, parts = "none: the loop is closed on the node", (found["loop"],)
    else:
        words = "T_need: the loop is closed on the host, the cycle lies inside it; at most T_s"
        parts = (required,)
    return {
        "delay_us": Traced(one.result.delay_us, formula=words, numbers=short(one.result.delay_us), parts=parts),
        "bus_fits": one.bus["fits"],
        "required_us": required,
        "available_us": one.bus["available_us"],
    }


def _loop(one: _Test, found: Figures) -> Figures:
    result, loop = one.result, ("loop", "step_us", "period_us")
    keys = {f"servo.{key}" for key in _LOOP_KEYS} | {f"servo.{axis}.{key}" for axis in ("x", "y") for key in _LOOP_KEYS}
    gains = (part for part in one.simulation if part.given and part.given.name in keys)
    starts = (*(found[key] for key in loop), *gains, found["delay_us"])
    control = "T_s" if one.profile.servo.loop == "host" else "h"
    gain = Traced(
        "as below",
        formula=f"(kp + ki {control} z / (z - 1) + kd (z - 1) / ({control} z)) G(z)",
        numbers=f"G(z) is exp(-s T_d) / (s (tau s + 1)) behind a hold, sampled each {control}",
        parts=starts,
    ).named("loop_gain", "L(z)")
    parts = (gain,)
    axes = {} if one.run is None else {"x": one.run.margins_x, "y": one.run.margins_y}

    def each(name: str) -> str:
        return ", ".join(f"{axis}: {short(getattr(margins, name))}" for axis, margins in axes.items())

    return {
        key: _measured(one, getattr(result, key), words, each(name), parts)
        for key, name, words in (
            ("stable", "stable", "all poles of 1 / (1 + L(z)) inside the unit circle, on both axes"),
            ("phase_margin_deg", "phase_margin_deg", "180 deg + arg L where |L| = 1, the smaller of both axes"),
            ("gain_margin_db", "gain_margin_db", "-20 log10 |L| where arg L = 180 deg, the smaller of both axes"),
            ("crossover_hz", "crossover_hz", "where |L| = 1, of the axis with the smaller phase margin"),
        )
    }


def _measured(one: _Test, value: Any, formula: str, numbers: str, parts: tuple[Traced, ...]) -> Traced:
    """A line that a simulation gives, or why there is none."""
    if one.run is None:
        return Traced(
            None, formula="not simulated: the cycle does not fit the bus", numbers="-", parts=(one.bus["fits"],)
        )
    return Traced(value, formula=formula, numbers=numbers if value is not None else "does not exist", parts=parts)


def _simulated(one: _Test, found: Figures) -> tuple[Traced, ...]:
    """What the simulation starts from: the bus too, where its delay lies inside the loop."""
    return (*one.simulation, found["delay_us"]) if one.profile.servo.loop == "host" else one.simulation


def _contour(one: _Test, found: Figures) -> Figures:
    result, words = one.result, SimulationNumbers(one.result, one.run)
    round_ = "" if words.is_round else f"; needs {LEAST_ARC_DEG:g} deg at constant speed"
    error, steady = "sqrt(x^2 + y^2) - r", "at constant speed"
    lowest, highest = "radial_deviation_min_mm", "radial_deviation_max_mm"
    rows = (
        ("mean_contour_error_mm", f"mean of |{error}| over all steps", words.mean()),
        ("max_contour_error_mm", f"largest |{error}| of all steps", words.at("max_contour_error_mm")),
        (lowest, f"smallest {error} {steady}", words.at(lowest)),
        (highest, f"largest {error} {steady}", words.at(highest)),
        (
            "circular_deviation_mm",
            f"largest less smallest distance from the least-squares centre {steady}{round_}",
            words.range(),
        ),
        ("radius_deviation_mm", f"least-squares radius {steady} less r{round_}", words.radius()),
        ("centre_offset_mm", f"centre of the least-squares circle {steady}{round_}", words.centre()),
        ("constant_speed_deg", f"arc that the table covers {steady}, the loops settled", words.constant_speed()),
    )
    parts = _simulated(one, found)
    measured = {}
    for key, formula, numbers in rows:
        value = getattr(result, key)
        plain = list(value) if isinstance(value, tuple) else value
        measured[key] = _measured(one, plain, formula, numbers, parts)
    return measured


def _verdict(one: _Test, found: Figures) -> Figures:
    result, tolerance = one.result, one.profile.tolerance
    limits = tuple(
        traced(one.profile, f"tolerance.{name}")
        for name in type(tolerance).model_fields
        if getattr(tolerance, name) is not None
    )
    measures = tuple(found[key] for key in ("bus_fits", "stable", "phase_margin_deg", "gain_margin_db"))
    contour = (found[key] for key in CONTOUR_MEASURES if getattr(tolerance, key) is not None)
    parts = (*measures, *contour, *limits)
    said = "; ".join(failure.text for failure in result.failures) or "none"
    failures = Traced(
        [failure.document() for failure in result.failures],
        formula="what of the bus, the loop and the tolerances does not hold",
        numbers=said,
        parts=parts,
    )
    ranked = result.contributions
    return {
        "failures": failures,
        "passed": Traced(
            result.passed,
            formula="no failures: bus, loop, turn and tolerances hold",
            numbers=f"failures: {said}",
            parts=(failures,),
        ),
        "contributions": _measured(
            one,
            [source._asdict() for source in ranked] if ranked is not None else None,
            "the largest contour error less that of the same circle without the source, in mm, for each source",
            "; ".join(
                f"{source.source}: {short(result.max_contour_error_mm)} - {short(source.max_contour_error_mm)}"
                for source in ranked or ()
            )
            or "the profile has no source",
            _simulated(one, found),
        ),
    }
