"""Derive the figures of `circle-test`.

Figures of the bus come from its equations. The path, the linear loop and the simulation have no equation to show: such
a figure is one step that names its method, and its inputs are all inputs of that method.
"""

from collections.abc import Iterable, Iterator
from typing import Final

from busplan.elementwise import Traced
from busplan.progress import Progress
from busplan.questions.circle.figures import CIRCLE_FIGURES, JITTER, CircleFigures
from busplan.questions.circle.roundness import circle_test
from busplan.questions.explain.bus import capacity_figures, remembered
from busplan.questions.explain.formulas import result_of
from busplan.questions.fit.inputs import traced, traced_profile
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.machine import CONTOUR_MEASURES, AxisKeys
from busplan.sections.profile import Profile
from busplan.sourced import Input

_GIVEN: Final = {
    "period_us": "cycle.period_us",
    "feed_mm_per_min": "circle.feed_mm_per_min",
    "radius_mm": "circle.radius_mm",
    "step_us": "servo.step_us",
    "loop": "servo.loop",
    "path": "circle.path",
    "update": "servo.update",
}
"""Figures that are keys of the profile."""
_OF_BUS: Final = {
    "bus_fits": "fits",
    "verdict": "verdict",
    "required_us": "required_us",
    "available_us": "available_us",
}
"""Figures that `capacity` has, too, with their key there."""
_PATH: Final = ("duration_s", "setpoints", "steps")
_LOOP: Final = ("stable", "phase_margin_deg", "gain_margin_db", "crossover_hz")
_DELAYS: Final = ("delay_us", "delay_x_us", "delay_y_us")
_VERDICT: Final = ("passed", "failures")
_LOOP_KEYS: Final = ("position_gain_per_s", "integral_gain_per_s2", "derivative_gain", "drive_lag_us")
"""Servo parameters of the linear loop."""
_SIMULATION: Final = "a simulation of both axes, step by step, on the set-points that the bus delivers"
_WAYS: Final = {
    **dict.fromkeys(_PATH, "a count along the path: every turn at the feed, with both ramps, in whole periods"),
    **dict.fromkeys(_LOOP, "the linear position loop of both axes: its poles and its frequency response"),
    **dict.fromkeys(_VERDICT, "a comparison of bus, loop and simulation with what they must hold"),
    "circular_deviation_mm": f"{_SIMULATION}; needs a whole turn: circle.path",
    "settled": "the slowest pole of the linear loops, from the lag v / kp down to a thousandth of the least tolerance",
    "servo_grade": "the weakest grade of the servo values that the profile gives",
    "ideal_drive": "whether the profile has a section [servo]",
    "contributions": "a simulation of the same circle without each error source in turn",
}
"""Method of a figure, if it is not a single simulation."""


def circle_figures(
    profile: Profile, *, with_contributions: bool = False, progress: Progress | None = None
) -> dict[str, Traced]:
    """Derive every figure of `circle-test` at the profile's own period.

    Parameters
    ----------
    profile
        The network, its servo and its circle.
    with_contributions
        If True, rank the error sources, too.
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
    (result,) = test.results
    bus = capacity_figures(profile, model=result.timing_model)
    derived = {
        **{key: traced(profile, given) for key, given in _GIVEN.items()},
        "timing_model": result_of(result.timing_model, "the timing model that decides, whichever leads", ()),
        **{key: bus[own] for key, own in _OF_BUS.items()},
        **{key: _delay(profile, key, result, bus["required_us"]) for key in _DELAYS},
        JITTER.key: _jitter(profile, result),
    }
    for figure in CIRCLE_FIGURES:
        if figure.key not in derived:
            derived[figure.key] = _found(profile, figure.key, result, bus)
    for figure in CIRCLE_FIGURES:
        derived[figure.key].named(figure.key, figure.symbol)
    return derived


def simulated_inputs(profile: Profile) -> tuple[Input, ...]:
    """Inputs of a profile's circle test; nothing is simulated."""
    return tuple(number.given for number in _simulation_inputs(profile) if number.given is not None)


def _delay(profile: Profile, key: str, result: CircleFigures, required: Traced) -> Traced:
    loop, value = traced(profile, "servo.loop"), getattr(result, key)
    if result.loop == "node":
        return result_of(value, "none: the loop is closed on the node", (loop,))
    update, period_us = traced(profile, "servo.update"), traced(profile, "cycle.period_us")
    if result.update == "next_sync":
        words = (
            "T_s: the synchronous packet triggers the sample and the update with the last command (paper, III-C); "
            "and the periods that the kind of bus and its host add"
        )
        return result_of(value, words, (loop, update, period_us))
    words = "from the sample to the end of the command's execution on the axis: x on the first node, y on the last"
    return result_of(value, words, (loop, update, required, period_us))


def _jitter(profile: Profile, result: CircleFigures) -> Traced:
    """The profile's own jitter, and what the bus adds."""
    own_us = traced(profile, "delivery.jitter_us")
    bus = bus_of(profile)
    bus_us = bus.cycle(network_of(traced_profile(profile)), model=bus.deciding_model).sync_jitter_us()
    both_us = remembered(own_us + bus_us, JITTER.key, JITTER.symbol)
    if both_us.value == result.jitter_us:
        return both_us
    return result_of(
        result.jitter_us, "no more than leaves set-points in their order: half the period", (own_us, bus_us)
    )


def _found(profile: Profile, key: str, result: CircleFigures, bus: dict[str, Traced]) -> Traced:
    """A figure without an equation."""
    value = _plain(result, key)
    if key in ("servo_grade", "ideal_drive"):
        graded = sorted(profile.servo.grades.model_fields_set) if key == "servo_grade" else ()
        keys = ("servo.grade", *(f"servo.grades.{name}" for name in graded))
        return result_of(value, _WAYS[key], tuple(traced(profile, key) for key in keys))
    if key in _PATH:
        return result_of(value, _WAYS[key], tuple(_path_inputs(profile, key)))
    if not result.bus_fits:
        words = _WAYS[key] if key in _VERDICT else "not simulated: the cycle does not fit the bus"
        return result_of(value, words, (bus["fits"], bus["verdict"]) if key in _VERDICT else (bus["fits"],))
    parts = _loop_inputs(profile) if key in _LOOP else _simulation_inputs(profile)
    delay = (_delay(profile, "delay_us", result, bus["required_us"]),) if result.loop == "host" or key in _LOOP else ()
    verdict = (bus["fits"], bus["verdict"], *_tolerances(profile)) if key in _VERDICT else ()
    if key == "settled":
        verdict = tuple(_tolerances(profile, CONTOUR_MEASURES))
    return result_of(value, _WAYS.get(key, _SIMULATION), (*parts, *delay, *verdict))


def _plain(result: CircleFigures, key: str) -> object:
    """A figure as in the JSON document."""
    if key == "failures":
        return [failure.document() for failure in result.failures]
    if key == "contributions":
        return None if result.contributions is None else [source._asdict() for source in result.contributions]
    value = getattr(result, key)
    return list(value) if isinstance(value, tuple) else value


def _path_inputs(profile: Profile, key: str) -> Iterator[Traced]:
    yield from (traced(profile, f"circle.{name}") for name in ("path", "radius_mm", "feed_mm_per_min", "ramp_periods"))
    yield traced(profile, "cycle.period_us")
    if profile.circle.path != "trapezoid":
        yield from (*_loop_inputs(profile), *_tolerances(profile, CONTOUR_MEASURES))
    if key == "steps":
        yield traced(profile, "servo.step_us")


def _loop_inputs(profile: Profile) -> Iterator[Traced]:
    """Inputs of the linear loop of an axis."""
    sampled = "cycle.period_us" if profile.servo.loop == "host" else "servo.step_us"
    yield from (traced(profile, key) for key in ("servo.loop", sampled))
    keys = {f"servo.{axis}{key}" for axis in ("", "x.", "y.") for key in _LOOP_KEYS}
    yield from (number for number in _simulation_inputs(profile) if number.given and number.given.name in keys)


def _simulation_inputs(profile: Profile) -> Iterator[Traced]:
    """Inputs of the simulation, except zero resolutions, lags and disturbances: zero means none."""
    yield traced(profile, "cycle.period_us")
    for name in ("circle", "servo", "delivery", "mechanics"):
        section = getattr(profile, name)
        unused = {"x", "y", "grade", "grades", *_idle(profile)}
        keys = [key for key in type(section).model_fields if key not in unused and getattr(section, key)]
        yield from (traced(profile, f"{name}.{key}") for key in keys)
    for axis in ("x", "y"):
        own = getattr(profile.servo, axis).model_fields_set
        yield from (traced(profile, f"servo.{axis}.{key}") for key in AxisKeys.model_fields if key in own)


def _idle(profile: Profile) -> Iterator[str]:
    """Keys without effect.

    These are `on_loss` without losses, `seed` without random numbers, `interpolation` or
    `update` by the place of the loop.
    """
    yield "interpolation" if profile.servo.loop == "host" else "update"
    loses = profile.delivery.loss_probability > 0
    if not loses:
        yield "on_loss"
    if not loses and not profile.delivery.jitter_us:
        yield "seed"


def _tolerances(profile: Profile, names: Iterable[str] | None = None) -> Iterator[Traced]:
    """Tolerances of the circle, all or some."""
    for name in type(profile.tolerance).model_fields if names is None else names:
        if getattr(profile.tolerance, name) is not None:
            yield traced(profile, f"tolerance.{name}")
