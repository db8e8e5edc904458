"""The circle that a profile asks for, without simulating it: why it cannot be run, its loops and its length."""

from collections.abc import Iterator, Sequence
from itertools import accumulate
from math import inf
from typing import Any, Final, Literal

from busplan.buses.cycle import BusCycle
from busplan.buses.network import Network
from busplan.elementwise import plain
from busplan.questions.fit.certainty import available_us, deciding_cycle, fits_in
from busplan.sections.base import Section, value_at
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.checks import LARGEST, ParameterError, Refused, dividing_step_us, parameters
from busplan.servo.parameters import FINEST_ENCODER_MM, LONGEST_DELAY_PERIODS, Axis, Delivery, LoopTiming
from busplan.servo.runnable import (
    LONGEST_SETTLING_US,
    Move,
    move_along,
    out_of_reach,
    unfit_delivery,
    unfit_move,
    unfit_steps,
)


def loop_delays_us(network: Network) -> tuple[float, float]:
    """Bus delay inside the loops of x and y: none on a node [us].

    On the host it is one period, for the synchronous packet triggers both the sample and the update with the last
    command; more where the kind of bus says so. Where nodes apply their commands on arrival it lasts from the sample to
    the end of the command's execution: x is taken to be on the first node of the cycle with axes and y on the last,
    which differ most.

    References
    ----------
    Paper, section III-C.
    """
    if network.profile.servo.loop == "node":
        return 0.0, 0.0
    cycle = deciding_cycle(network)
    at_sync = network.profile.servo.update == "next_sync"
    whole_us = cycle.loop_periods(at_sync=at_sync) * network.profile.cycle.period_us
    if at_sync:
        return whole_us, whole_us
    since_us = whole_us - cycle.sampled_us()
    first_us, last_us = _first_and_last_us(cycle)
    return since_us + first_us, since_us + last_us


def skew_us(network: Network) -> float:
    """How much later the last node with axes takes its set-point than the first, where no clock is common to them [us].

    A loop on the host has it in its delays.
    """
    clock = network.bus.key_of("clock")
    if network.profile.servo.loop == "host" or not clock or value_at(network.profile, clock):
        return 0.0
    first_us, last_us = _first_and_last_us(deciding_cycle(network))
    return last_us - first_us


def jitter_us(network: Network) -> float:
    """Jitter of the synchronous packet, either way of its mean: the profile's own and what the bus adds [us]."""
    return plain(network.profile.delivery.jitter_us + deciding_cycle(network).sync_jitter_us())


def _first_and_last_us(cycle: BusCycle) -> tuple[float, float]:
    """When the commands of the first and the last node with axes take effect, from the start of the cycle [us]."""
    network = cycle.network
    ends = list(accumulate(int(plain(group.nodes)) for group in network.groups))
    with_axes = [place for place, group in enumerate(network.groups) if group.axes] or range(len(ends))
    moved = [place for place in with_axes if not network.groups[place].is_slower] or with_axes

    def effect_us(place: int, node: int) -> float:
        # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
        return min(cycle.arrival_us(node), plain(network.period_us)) + cycle.taking_us(network.groups[place])

    first = moved[0]
    return effect_us(first, [0, *ends][first] + 1), effect_us(moved[-1], ends[moved[-1]])


AxisName = Literal["x", "y"]
AXIS_NAMES: Final[tuple[AxisName, ...]] = ("x", "y")


def refusals(network: Network) -> tuple[Refused, ...]:
    """Why the circle of a network cannot be run, each cause by its dotted key; empty if it can.

    A cycle that does not fit its bus has no circle: then nothing is asked of drives, delivery and move.
    """
    if not network.groups:
        return (Refused("bus.nodes", "none", "messages alone have no axes that could move"),)
    causes = (*_setpoints_of_several_cycles(network), *_loop_over_the_bus(network))
    fits = fits_in(deciding_cycle(network).required_us, available_us=available_us(network))
    if not fits or network.bus.broken(network):
        return causes
    return (*causes, *_of_run(network, is_loop_refused=bool(causes)))


def require_circle(network: Network) -> None:
    """Refuse a circle that cannot be run.

    Raises
    ------
    ParameterError
        Its `refusals`.
    """
    causes = refusals(network)
    if causes:
        raise ParameterError(*causes)


def _of_run(network: Network, *, is_loop_refused: bool) -> tuple[Refused, ...]:
    """Why the drives, the delivery or the move of a profile cannot be simulated."""
    profile = network.profile
    causes: list[Refused] = []
    axes: list[Axis] = []
    for name in AXIS_NAMES:
        try:
            axes.append(Axis(**profile.servo.axis_keys(name)))
            refused = [*out_of_reach(axes[-1], name=name, feed_mm_per_min=profile.circle.feed_mm_per_min)]
        except ParameterError as error:
            refused = [*error.refused]
        causes += (_at_key(cause, profile, name) for cause in refused)
    causes += _out_of_order(network)
    if not (causes or is_loop_refused):
        causes += _move(network, axes)
    # Both axes may refuse one key.
    return tuple({cause.name: cause for cause in reversed(causes)}.values())[::-1]


def _setpoints_of_several_cycles(network: Network) -> Iterator[Refused]:
    """Refuse axes whose set-points do not come in every cycle."""
    key, every = network.bus.setpoints_every(network)
    if every > 1:
        whole = f"a period of {every * network.profile.cycle.period_us:g} us with 1 has the same set-points"
        yield Refused(key, every, f"the circle test has a set-point in every cycle; {whole}")


def _loop_over_the_bus(network: Network) -> Iterator[Refused]:
    """Refuse a loop on the host with more of the bus in it than its controller is made for."""
    period_us, delay_us = network.profile.cycle.period_us, max(loop_delays_us(network))
    most_us = LONGEST_DELAY_PERIODS * period_us
    if delay_us > most_us:
        most = f"{LONGEST_DELAY_PERIODS} periods, {most_us:g} us, at most"
        why = f"the bus puts {delay_us:g} us into a loop over it, and the circle test knows {most}"
        key, profile = network.bus.key_of("pipeline"), network.profile
        less = f"less {key}, now {value_at(profile, key)}, or " if key and value_at(profile, key) else ""
        right = f'{why}; {less}close the loop on the node, servo.loop = "node"'
        yield Refused("servo.loop", '"host"', right)


def _out_of_order(network: Network) -> Iterator[Refused]:
    """Refuse set-points that would change their order: by what the bus adds, where only that does it."""
    profile, period_us = network.profile, network.profile.cycle.period_us
    delivery = Delivery(**parameters_in(profile.delivery, Delivery))
    causes = [*unfit_delivery(delivery, period_us=period_us)]
    if causes:
        yield from (_at_key(cause, profile) for cause in causes)
    elif any(unfit_delivery(delivery_of(network), period_us=period_us)):
        most = f"which the circle test knows up to half the period, {period_us / 2:g} us, with jitter and skew"
        if apart_us := skew_us(network):
            right = f"the last axis then takes its set-points {apart_us:g} us after the first, {most}"
            yield Refused(network.bus.key_of("clock"), "false", f"{right}; set it true if the drives have a clock")
        else:
            added_us = jitter_us(network) - delivery.jitter_us
            right = f"the bus adds {added_us:g} us of jitter either way, {most}; a longer period has room"
            yield Refused("cycle.period_us", period_us, right)


def _move(network: Network, axes: Sequence[Axis]) -> list[Refused]:
    """Refuse a move that is too short for its feed or too long for memory; a lead-in makes it longer."""
    profile = network.profile
    is_turn = profile.circle.path != "trapezoid"
    least = [*_unfit(profile, axes, 0.0 if is_turn else None)]
    if least or not is_turn or not any(_unfit(profile, axes, LONGEST_SETTLING_US)):
        return least
    return [*_unfit(profile, axes, path_settling_us(network))]


def _unfit(profile: Profile, axes: Sequence[Axis], settling_us: float | None) -> Iterator[Refused]:
    """Reasons why the move of a lead-in cannot be made."""
    move, radius_mm = move_of(profile, settling_us), profile.circle.radius_mm
    timing = LoopTiming(period_us=profile.cycle.period_us, step_us=step_us(profile))
    yield from (_at_key(cause, profile) for cause in unfit_move(move, radius_mm=radius_mm))
    for name, axis in zip(AXIS_NAMES, axes, strict=True):
        causes = unfit_steps(move.setpoints, reach_mm=radius_mm, axis=axis, timing=timing)
        yield from (_at_key(cause, profile, name) for cause in causes)


def _at_key(cause: Refused, profile: Profile, axis: AxisName | None = None) -> Refused:
    """A cause by the dotted keys of its parameters; a key that an axis sets is the key of the axis."""

    def key(parameter: str) -> str:
        if axis is not None and parameter in getattr(profile.servo, axis).model_fields_set:
            return f"servo.{axis}.{parameter}"
        sections = ("servo", "circle", "delivery", "cycle")
        return next(f"{name}.{parameter}" for name in sections if hasattr(getattr(profile, name), parameter))

    return cause._replace(name=key(cause.name), beside=tuple(map(key, cause.beside)))


# --- parts of the simulation that need no numpy -----------------------------------------------------------------


def delivery_of(network: Network) -> Delivery:
    """How set-points arrive, with the skew and the jitter that the bus adds."""
    delivery = network.profile.delivery
    late = {"skew_us": delivery.skew_us + skew_us(network), "jitter_us": jitter_us(network)}
    return Delivery(
        **parameters_in(delivery, Delivery) | {key: max(-LARGEST, min(us, LARGEST)) for key, us in late.items()}
    )


def move_of(profile: Profile, settling_us: float | None) -> Move:
    """The move of a profile's circle.

    Parameters
    ----------
    profile
        The network.
    settling_us
        Time of its lead-in: None on a trapezoid; infinite if the loops do not settle, and none is waited for [us].
    """
    circle = profile.circle
    return move_along(
        circle.radius_mm,
        feed_mm_per_min=circle.feed_mm_per_min,
        period_us=profile.cycle.period_us,
        ramp_periods=circle.ramp_periods,
        settling_us=0.0 if settling_us == inf else settling_us,
    )


def parameters_in(section: Section, of: type) -> dict[str, Any]:
    """The parameters of the servo core in a section, to which a kind of bus may have added keys."""
    return section.model_dump(include={parameter.name for parameter in parameters(of)})


_REST_SHARE: Final = 1e-3
"""Rest after settling, as a share of the smallest contour tolerance."""


def step_us(profile: Profile) -> float:
    """Step of the position loops: the longest one up to servo.step_us that divides the period [us].

    Drives run their loops in step with the bus, so a period that servo.step_us does not divide has a shorter step.
    """
    return dividing_step_us(profile.cycle.period_us, most_us=profile.servo.step_us)


def loop_timing(profile: Profile) -> LoopTiming:
    """Timing of a profile's position loops, in a circle that can be run."""
    servo = profile.servo
    return LoopTiming(
        period_us=profile.cycle.period_us, step_us=step_us(profile), loop=servo.loop, interpolation=servo.interpolation
    )


def loop_axes(network: Network) -> tuple[Axis, Axis]:
    """Both axes of a profile with the delays of their loops, in a circle that can be run."""
    keys, (x_us, y_us) = network.profile.servo.axis_keys, loop_delays_us(network)
    return Axis(**keys("x"), delay_us=x_us), Axis(**keys("y"), delay_us=y_us)


def path_steps(network: Network) -> int:
    """Count the simulated steps of each axis; nothing is simulated [1].

    Raises
    ------
    ParameterError
        The circle cannot be run.
    """
    require_circle(network)
    return path_setpoints(network) * loop_timing(network.profile).steps_per_period


def path_setpoints(network: Network) -> int:
    """Count the set-points of a profile's circle, which can be run [1]."""
    return move_of(network.profile, path_settling_us(network)).setpoints


def path_settling_us(network: Network) -> float | None:
    """Time of the lead-in at constant speed: None on a trapezoid, infinite if the loops do not settle [us]."""
    profile = network.profile
    if profile.circle.path == "trapezoid":
        return None
    from busplan.servo.measured_part import REST_MM, settling_time_us  # only what the lead-in decides loads numpy

    tolerances_mm = [getattr(profile.tolerance, name) for name in CONTOUR_MEASURES]
    least_mm = min((tolerance_mm for tolerance_mm in tolerances_mm if tolerance_mm), default=None)
    x, y = loop_axes(network)
    settling_us = settling_time_us(
        x,
        y,
        timing=loop_timing(profile),
        feed_mm_per_min=profile.circle.feed_mm_per_min,
        rest_mm=REST_MM if least_mm is None else max(_REST_SHARE * least_mm, FINEST_ENCODER_MM),
    )
    return inf if settling_us is None else settling_us
