"""Setup of a profile's circle test: delays, skew and jitter by the bus, why it cannot be run, inputs and length."""

from collections.abc import Iterator, Sequence
from itertools import accumulate
from math import inf
from typing import Any, Final, Literal

from busplan.buses.cycle import BusCycle
from busplan.buses.network import Network
from busplan.elementwise import within
from busplan.questions.fit.certainty import available_us, deciding_cycle
from busplan.sections.base import TRANSACTION_KINDS, Section, value_at
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.parameters import (
    FINEST_ENCODER_MM,
    LARGEST,
    LONGEST_DELAY_PERIODS,
    Axis,
    Delivery,
    LoopTiming,
    ParameterError,
    Refused,
    dividing_step_us,
    parameters,
)
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
    """Bus delay inside the position loops of x and y; 0 for loops on the node [us].

    The bus delay of a loop on the host is one period, because the synchronous packet triggers both the sample and the
    update with the last command; it is longer on some kinds of bus. If nodes apply their commands on arrival, the delay
    lasts from the sample to the end of the command's execution. Then x is taken to be on the first node with axes and y
    on the last, which differ most.

    References
    ----------
    Paper, section III-C.
    """
    if network.profile.servo.loop == "node":
        return 0.0, 0.0
    cycle = deciding_cycle(network)
    whole_us = cycle.loop_periods(at_sync=cycle.takes_at_sync) * network.profile.cycle.period_us
    if cycle.takes_at_sync:
        return whole_us, whole_us
    since_us = whole_us + cycle.host_lag_us() - cycle.sampled_us()
    first_us, last_us = _command_effects_us(cycle)
    return since_us + first_us, since_us + last_us


def skew_us(network: Network) -> float:
    """Skew: how much later the last node with axes takes its set-point than the first [us].

    0 unless the profile says that nodes have no common clock; 0 for a loop on the host, whose delays include it.
    """
    clock = network.bus.key_of("clock")
    if network.profile.servo.loop == "host" or not clock or value_at(network.profile, clock):
        return 0.0
    first_us, last_us = _command_effects_us(deciding_cycle(network))
    return last_us - first_us


def jitter_us(network: Network) -> float:
    """Jitter of the synchronous packet, +/- about its mean: the profile's own and what the bus adds [us]."""
    return float(network.profile.delivery.jitter_us + deciding_cycle(network).sync_jitter_us())


def _command_effects_us(cycle: BusCycle) -> tuple[float, float]:
    """Effect of the commands of the first and the last node with axes, from the start of the cycle [us]."""
    network = cycle.network
    ends = list(accumulate(int(group.nodes) for group in network.groups))
    with_axes = _moved(network) or range(len(ends))
    in_every_cycle = [place for place in with_axes if not network.groups[place].is_slower] or with_axes

    def effect_us(place: int, node: int) -> float:
        # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
        return min(cycle.arrival_us(node), network.period_us) + cycle.taking_us(network.groups[place])

    first, last = in_every_cycle[0], in_every_cycle[-1]
    return effect_us(first, [0, *ends][first] + 1), effect_us(last, ends[last])


def _moved(network: Network) -> list[int]:
    """Places of the groups whose axes can be on the circle: they get commands and, of a loop on the host, feedback."""
    kinds = TRANSACTION_KINDS if network.profile.servo.loop == "host" else ("write",)
    return [place for place, group in enumerate(network.groups) if group.axes and all(map(group.has, kinds))]


AxisName = Literal["x", "y"]
AXIS_NAMES: Final[tuple[AxisName, ...]] = ("x", "y")


def refusals(network: Network) -> tuple[Refused, ...]:
    """Reasons why the circle of a network cannot be run, each with its dotted key; empty if it can.

    A cycle that does not fit its bus has no circle: then drives, delivery and move are not checked.
    """
    if not network.groups:
        return (Refused("bus.nodes", "none", "messages alone have no axes that could move"),)
    if any(group.axes for group in network.groups) and not _moved(network):
        return (_no_loop(network),)
    causes = (*_slow_setpoints(network), *_long_bus_delay(network))
    fits = within(deciding_cycle(network).required_us, available_us(network))
    if not fits or network.bus.broken(network):
        return causes
    return (*causes, *_servo_refusals(network, is_loop_refused=bool(causes)))


def require_circle(network: Network) -> None:
    """Refuse a circle that cannot be run: ParameterError of its `refusals`."""
    causes = refusals(network)
    if causes:
        raise ParameterError(*causes)


def _servo_refusals(network: Network, *, is_loop_refused: bool) -> tuple[Refused, ...]:
    """Reasons why the drives, the delivery or the move of a profile cannot be simulated."""
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
        causes += _unfit_move(network, axes)
    # Both axes may refuse one key.
    return tuple({cause.name: cause for cause in reversed(causes)}.values())[::-1]


def _no_loop(network: Network) -> Refused:
    """Refuse a network in which no axis gets commands or, of a loop on the host, gives feedback."""
    group = max(network.groups, key=lambda group: int(group.nodes * group.axes))
    missing = "write" if not group.has("write") else "read"
    why = "an axis that gets no commands moves along no circle"
    if missing == "read":
        why = 'a loop on the host needs feedback; close it on the node, servo.loop = "node"'
    return Refused(group.payload_key(group.payload.key_of(missing)), 0, why)


def _slow_setpoints(network: Network) -> Iterator[Refused]:
    """Refuse axes that do not get a set-point in every cycle."""
    key, every = network.bus.setpoints_every(network)
    if every > 1:
        same = f"1 with a period of {every * network.profile.cycle.period_us:g} us gives the same set-points"
        yield Refused(key, every, f"the circle test has a set-point in every cycle; {same}")


def _long_bus_delay(network: Network) -> Iterator[Refused]:
    """Refuse a loop on the host with a longer bus delay than the circle test models."""
    period_us, delay_us = network.profile.cycle.period_us, max(loop_delays_us(network))
    most_us = LONGEST_DELAY_PERIODS * period_us
    if delay_us > most_us:
        most = f"at most {LONGEST_DELAY_PERIODS} periods, {most_us:g} us"
        why = f"the bus puts {delay_us:g} us into a loop closed over it, and the circle test models {most}"
        key, profile = network.bus.key_of("pipeline"), network.profile
        less = f"less {key}, now {value_at(profile, key)}, or " if key and value_at(profile, key) else ""
        yield Refused("servo.loop", '"host"', f'{why}; {less}close the loop on the node, servo.loop = "node"')


def _out_of_order(network: Network) -> Iterator[Refused]:
    """Refuse jitter and skew that would change the order of set-points: the profile's own, then with the bus's."""
    profile, period_us = network.profile, network.profile.cycle.period_us
    delivery = Delivery(**parameters_in(profile.delivery, Delivery))
    causes = [*unfit_delivery(delivery, period_us=period_us)]
    if causes:
        yield from (_at_key(cause, profile) for cause in causes)
    elif any(unfit_delivery(delivery_of(network), period_us=period_us)):
        most = f"and the circle test models jitter and skew up to half the period, {period_us / 2:g} us, together"
        if apart_us := skew_us(network):
            why = f"the last axis then takes its set-points {apart_us:g} us after the first, {most}"
            yield Refused(network.bus.key_of("clock"), "false", f"{why}; set it true if the drives have a clock")
        else:
            added_us = jitter_us(network) - delivery.jitter_us
            why = f"the bus adds +/- {added_us:g} us of jitter, {most}; a longer period has room"
            yield Refused("cycle.period_us", period_us, why)


def _unfit_move(network: Network, axes: Sequence[Axis]) -> list[Refused]:
    """Refuse a move that is too short for its feed or too long for memory; a lead-in makes it longer."""
    profile = network.profile
    is_turn = profile.circle.path != "trapezoid"
    without_lead_in = [*_unfit_with(profile, axes, 0.0 if is_turn else None)]
    if without_lead_in or not is_turn or not any(_unfit_with(profile, axes, LONGEST_SETTLING_US)):
        return without_lead_in
    return [*_unfit_with(profile, axes, path_settling_us(network))]


def _unfit_with(profile: Profile, axes: Sequence[Axis], settling_us: float | None) -> Iterator[Refused]:
    """Reasons why the move with a lead-in of this time cannot be made."""
    move, radius_mm = move_of(profile, settling_us), profile.circle.radius_mm
    timing = LoopTiming(period_us=profile.cycle.period_us, step_us=step_us(profile))
    yield from (_at_key(cause, profile) for cause in unfit_move(move, radius_mm=radius_mm))
    for name, axis in zip(AXIS_NAMES, axes, strict=True):
        causes = unfit_steps(move.setpoints, reach_mm=radius_mm, axis=axis, timing=timing)
        yield from (_at_key(cause, profile, name) for cause in causes)


def _at_key(cause: Refused, profile: Profile, axis: AxisName | None = None) -> Refused:
    """The cause with dotted keys instead of parameter names, such as servo.x.dac_bits where the x axis sets it."""

    def key(parameter: str) -> str:
        if axis is not None and parameter in getattr(profile.servo, axis).model_fields_set:
            return f"servo.{axis}.{parameter}"
        sections = ("servo", "circle", "delivery", "cycle")
        return next(f"{name}.{parameter}" for name in sections if hasattr(getattr(profile, name), parameter))

    return cause._replace(name=key(cause.name), beside=tuple(map(key, cause.beside)))


# --- inputs of the simulation, without numpy --------------------------------------------------------------------


def delivery_of(network: Network) -> Delivery:
    """Delivery of set-points, with the skew and the jitter that the bus adds."""
    delivery = network.profile.delivery
    late = {"skew_us": delivery.skew_us + skew_us(network), "jitter_us": jitter_us(network)}
    return Delivery(
        **parameters_in(delivery, Delivery) | {key: max(-LARGEST, min(us, LARGEST)) for key, us in late.items()}
    )


def move_of(profile: Profile, settling_us: float | None) -> Move:
    """The move of a profile's circle.

    `settling_us` is the time of its lead-in: None on a trapezoid; infinite if the loops do not settle, which takes no
    lead-in [us].
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
    """The parameters of the servo core in a section, without keys that a kind of bus adds."""
    return section.model_dump(include={parameter.name for parameter in parameters(of)})


_REST_SHARE: Final = 1e-3
"""Residual error after settling, as a share of the smallest contour tolerance."""


def step_us(profile: Profile) -> float:
    """Step of the position loops: the longest one up to servo.step_us that divides the period [us].

    Drives run their loops in step with the bus, so a period that servo.step_us does not divide has a shorter step.
    """
    return dividing_step_us(profile.cycle.period_us, most_us=profile.servo.step_us)


def loop_timing(profile: Profile) -> LoopTiming:
    """Timing of a profile's position loops; its circle must be one that can be run."""
    servo = profile.servo
    return LoopTiming(
        period_us=profile.cycle.period_us, step_us=step_us(profile), loop=servo.loop, interpolation=servo.interpolation
    )


def loop_axes(network: Network) -> tuple[Axis, Axis]:
    """Both axes of a profile with the delays of their loops; its circle must be one that can be run."""
    keys, (x_us, y_us) = network.profile.servo.axis_keys, loop_delays_us(network)
    return Axis(**keys("x"), delay_us=x_us), Axis(**keys("y"), delay_us=y_us)


def path_steps(network: Network) -> int:
    """Number of simulated steps of each axis; nothing is simulated [1].

    ParameterError: the circle cannot be run.
    """
    require_circle(network)
    return path_setpoints(network) * loop_timing(network.profile).steps_per_period


def path_setpoints(network: Network) -> int:
    """Count the set-points of a profile's circle; it must be one that can be run [1]."""
    return move_of(network.profile, path_settling_us(network)).setpoints


def path_settling_us(network: Network) -> float | None:
    """Time of the lead-in at constant speed: None on a trapezoid, infinite if the loops do not settle [us]."""
    profile = network.profile
    if profile.circle.path == "trapezoid":
        return None
    from busplan.servo.path import REST_MM, settling_time_us  # loads numpy, which only a lead-in needs

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
