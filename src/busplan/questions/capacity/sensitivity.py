"""Sensitivity of the margin: the effect of each small change, and the next bottleneck after the first."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import chain
from math import floor, inf, log10
from typing import Any, Final, NamedTuple

from busplan.buses.cycle import BusCycle, Term
from busplan.buses.network import Network
from busplan.buses.parts import Perturbation
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import FITS, TIME, certainty
from busplan.questions.fit.figures import CapacityFigures, CycleFigures, GroupCapacity, cycle_figures
from busplan.questions.fit.most_nodes import safe_nodes
from busplan.questions.fit.network import at_once, changed, trial, with_payloads
from busplan.sections.base import TRANSACTION_KINDS, value_at
from busplan.sections.machine import ProfileGroup


class NextLimit(NamedTuple):
    """Limit of the nodes of one group now, and the next limit after it; the other groups stay as they are."""

    group: str
    """Empty where all nodes are alike."""
    safe_nodes: int
    """Most nodes that are shown to fit."""
    limited_by: str
    """Key of the limit that keeps them from being more."""
    next_safe_nodes: int
    """Most nodes without that limit."""
    next_limited_by: str
    """Key of the limit that keeps those from being more."""


class NextBottleneck(NamedTuple):
    """The bottleneck now and the next one after it, by the timing model that decides."""

    limits: tuple[NextLimit, ...]
    """One for each group of nodes."""
    binding_term: Term
    """The largest term of the cycle."""
    next_binding_term: Term
    """The next term: the largest of a cycle without the largest term, or the second largest if nothing takes it out."""
    next_margin_corrected_us: float | None
    """Corrected margin without the largest term; None if nothing takes it out."""


def next_bottleneck(network: Network, counts: Iterable[GroupCapacity]) -> NextBottleneck:
    """The largest term of a network once its first bottleneck is gone; `counts` are its most nodes.

    A term is taken out at its cause, and the cycle is computed anew: without execution, for example, the bus is idle
    for longer.
    """
    bus = network.bus
    cycle = bus.cycle(network, model=bus.deciding_model)
    binding = _largest(cycle)
    without_causes = (
        network._replace(groups=tuple(map(at_once, network.groups))),
        network._replace(nonperiodic_us=0.0),
        *(trial(network, changes) for changes in bus.term_removals),
    )
    cycles = (bus.cycle(without_cause, model=bus.deciding_model) for without_cause in without_causes)
    without = next(
        (cycle for cycle in cycles if not any(term.us for term in cycle.terms if term.key == binding.key)), None
    )
    return NextBottleneck(
        limits=tuple(
            NextLimit(group, nodes, limit, *safe_nodes(network, group=group, without=limit))
            for group, nodes, limit in map(_shown, counts)
        ),
        binding_term=binding,
        next_binding_term=_largest(without or cycle, but=binding.key),
        next_margin_corrected_us=None if without is None else certainty(without).margin_corrected_us,
    )


def _shown(count: GroupCapacity) -> tuple[str, int, str]:
    """Name of a group, its most nodes that are shown to fit, and the key of the limit, by the model that decides."""
    return count.name, count.safe_nodes or 0, str(count.safe_limited_by)


def _largest(cycle: BusCycle, *, but: str = "") -> Term:
    return max((term for term in cycle.terms if term.key != but), key=lambda term: term.us)


_MORE_EXECUTION: Final = 0.1
_PAYLOAD_STEP_BYTES: Final = 4
"""A quadlet: payloads are padded to it."""


class Perturbed(NamedTuple):
    """A network with one small change."""

    change: str
    key: str
    """Key of the profile, or figure of `latency`, that changes."""
    before: Any
    """Value of the key before; None if groups differ."""
    after: Any
    network: Network | None
    """None where the change cannot be made."""
    note: str
    """Why the change cannot be made, or why the margin stays as it is if it does."""


def perturbed(network: Network) -> Iterator[Perturbed]:
    """Make every small change of a network, one at a time.

    For every kind of bus: 10 % more execution time, one more node and one more axis in each group, four more bytes in
    every payload. Then the changes that a single kind of bus has, and a bus reset if it changes settings.
    """
    bus = network.bus
    yield _slower(network)
    yield from (_one_node_more(network, group) for group in network.profile.node_groups)
    yield from (_one_axis_more(network, group) for group in network.profile.node_groups)
    yield _more_bytes(network)
    yield from (_with_keys(network, change) for change in bus.perturbations(network))
    if bus.safety.after_reset:
        reset = Perturbation("a bus reset", bus.safety.after_reset, if_nothing="it is set so already")
        yield _with_keys(network, reset)


def slower(network: Network, factor: float) -> Network:
    """The network with longer execution times."""
    groups = []
    for group in network.groups:
        read_us, write_us = factor * group.read_execution_us, factor * group.write_execution_us
        read_u_us, write_u_us = map(group.node.execution.standard_uncertainty_us, (read_us, write_us))
        longer = group._replace(read_execution_us=read_us, write_execution_us=write_us)
        groups.append(longer._replace(read_uncertainty_us=read_u_us, write_uncertainty_us=write_u_us))
    return network._replace(groups=tuple(groups))


def _slower(network: Network) -> Perturbed:
    slowed = slower(network, 1 + _MORE_EXECUTION)
    before, after = (
        _common_value(us for group in at.groups for us in (group.read_execution_us, group.write_execution_us))
        for at in (network, slowed)
    )
    note = "" if network.bus.has_execution(network) else "no execution time is on the bus"
    return Perturbed(f"execution time +{_MORE_EXECUTION:.0%}", "execution_us", before, after, slowed, note)


def _one_node_more(network: Network, group: ProfileGroup) -> Perturbed:
    more = group.nodes + 1
    grown = network.with_nodes(more, group=group.name)
    return Perturbed(f"one more node{_in(group)}", group.nodes_key, group.nodes, more, grown, "")


def _one_axis_more(network: Network, group: ProfileGroup) -> Perturbed:
    key, axes = group.node_key("axes"), group.node.axes + 1
    grown, unknown = _if_known(lambda: trial(network, {key: axes}))
    note = unknown or ("" if group.payload.follows_axes else "no payload follows the axes")
    return Perturbed(f"one more axis per node{_in(group)}", key, axes - 1, axes, grown, note)


def _more_bytes(network: Network) -> Perturbed:
    sizes = [tuple(group.bytes_of(kind) for kind in TRANSACTION_KINDS) for group in network.profile.node_groups]
    longer = [
        (read_bytes + _PAYLOAD_STEP_BYTES, write_bytes + _PAYLOAD_STEP_BYTES) for read_bytes, write_bytes in sizes
    ]
    before, after = (_common_value(chain.from_iterable(pairs)) for pairs in (sizes, longer))
    grown, unknown = _if_known(lambda: with_payloads(network, longer))
    return Perturbed(f"payload +{_PAYLOAD_STEP_BYTES} bytes", "payload_bytes", before, after, grown, unknown)


def _with_keys(network: Network, perturbation: Perturbation) -> Perturbed:
    """Make a change that a kind of bus gives as new values by key of the profile."""
    key = ", ".join(perturbation.changes)
    after = perturbation.changes.get(key)
    before = None if after is None else value_at(network.profile, key)
    if perturbation.why_not:
        return Perturbed(perturbation.label, key, before, None, None, perturbation.why_not)
    try:
        set_anew = changed(network, perturbation.changes)
    except BusplanError as error:
        return Perturbed(perturbation.label, key, before, after, None, "; ".join(error.problems))
    return Perturbed(perturbation.label, key, before, after, set_anew, perturbation.if_nothing)


def _if_known(change: Callable[[], Network]) -> tuple[Network | None, str]:
    """The network after a change, or why its execution time is not known."""
    try:
        return change(), ""
    except ValueError as error:
        return None, f"not known: {error}"


def _in(group: ProfileGroup) -> str:
    return f" in {group.name}" if group.name else ""


def _common_value(values: Iterable[Any]) -> Any:
    """The value that all share; None where they differ."""
    first, *rest = values
    return first if all(value == first for value in rest) else None


class Effect(NamedTuple):
    """Effect of one small change on the margin."""

    change: str
    """The change, in words."""
    key: str
    """A key of the profile, or a figure of `latency`."""
    before: Any
    """Value of the key before, in the key's unit; None if groups differ."""
    after: Any
    margin_change_us: float | None
    """By how much the corrected margin grows; None if the change cannot be made."""
    then: CycleFigures | None
    """Figures of the network with the change; None if it cannot be made."""
    note: str
    """Why the change cannot be made; or why the margin stays as it is, and how much nearer other limits come."""


class Reach(NamedTuple):
    """Growth of one quantity alone, until the plan is no longer shown to fit or the bus is unsafe."""

    quantity: str
    key: str
    """Key of the profile; "execution" for the factor of all execution times."""
    now: float
    most: float
    """The largest value that is shown to fit, in three digits; the largest that the profile takes, if none is too
    large."""
    limited_by: tuple[str, ...]
    """What breaks beyond it: limits of the bus, time, or the setting that is unsafe; empty if nothing does."""


_FINE: Final = 1e-3
"""Relative step to which a value is found that has fractions."""
_REACH_DIGITS: Final = 3
_FARTHEST: Final = 1e6
"""Largest factor of execution times that is tried."""


def reaches(network: Network, counts: Iterable[GroupCapacity]) -> Iterator[Reach]:
    """Room of a network that is shown to fit: for execution times, nodes and each number of the bus, one at a time."""
    bus = network.bus
    if any(group.read_execution_us or group.write_execution_us for group in network.groups):
        yield _reach("execution times, factor", "execution", 1.0, partial(slower, network))
    for group, (_, nodes, limit) in zip(network.profile.node_groups, map(_shown, counts), strict=True):
        yield Reach(f"nodes{_in(group)}", group.nodes_key, int(group.nodes), nodes, (limit,))
    for change in bus.perturbations(network):
        ((key, after), *more) = change.changes.items()
        now = value_at(network.profile, key)
        if more or change.why_not or isinstance(after, bool | str) or not isinstance(now, int | float) or after <= now:
            continue
        reach = _reach(key, key, now, partial(_with_value, network, key))
        if reach.limited_by or reach.most > now:  # some keys take a few values alone
            yield reach


def _with_value(network: Network, key: str, value: float) -> Network:
    return changed(network, {key: value})


def _reach(quantity: str, key: str, now: float, network_at: Callable[[float], Network]) -> Reach:
    """Double the distance until something breaks, and halve what is in doubt."""
    whole = isinstance(now, int)
    kept, step, broken = float(now), 1.0 if whole else max(now, 1.0), inf
    why: tuple[str, ...] = ()
    while kept < _FARTHEST and broken == inf:
        reasons = _broken_at(network_at, kept + step, whole=whole)
        if reasons is None:
            break
        kept, broken, why = (kept + step, inf, ()) if not reasons else (kept, kept + step, reasons)
        step *= 2
    while broken < inf and broken - kept > (1 if whole else _FINE * broken):
        middle = (kept + broken) // 2 if whole else (kept + broken) / 2
        reasons = _broken_at(network_at, middle, whole=whole)
        kept, broken, why = (middle, broken, why) if reasons == () else (kept, middle, reasons or why)
    # Rounded down: no larger value is said to fit.
    step = 10.0 ** (floor(log10(kept)) - _REACH_DIGITS + 1) if kept else 1.0
    return Reach(quantity, key, now, int(kept) if whole else round(floor(kept / step) * step, 9), why)


def _broken_at(network_at: Callable[[float], Network], value: float, *, whole: bool) -> tuple[str, ...] | None:
    """Limits that break at a value; empty if nothing does, None if a profile cannot have it."""
    try:
        network = network_at(int(value) if whole else value)
    except BusplanError:
        return None
    then = cycle_figures(network, model=network.bus.deciding_model)
    if then.verdict == FITS:
        return () if then.safe else (network.bus.safety.setting,)
    return then.behind or (TIME,)


class Sensitivity(NamedTuple):
    """Effects of small changes on the margin at one period, by the timing model that decides."""

    now: CycleFigures
    effects: tuple[Effect, ...]
    """The largest first; changes that cannot be made come last."""
    next_bottleneck: NextBottleneck
    reaches: tuple[Reach, ...]
    """Empty for a network that is not shown to fit."""


_MOST_GROUPS: Final = 50
_MOST_MESSAGES: Final = 1000


def too_large(profile: Any) -> str:
    """Why a profile is too large for its sensitivity; empty if it is not."""
    groups, messages = len(profile.node_groups), len(getattr(profile, "message", ()))
    if groups > _MOST_GROUPS:
        return f"{groups:,} groups: sensitivity changes each by itself, of up to {_MOST_GROUPS}"
    if messages > _MOST_MESSAGES:
        return f"{messages:,} messages: sensitivity computes all of them for each change, up to {_MOST_MESSAGES:,}"
    return ""


def sensitivity_of(network: Network, now: CapacityFigures) -> Sensitivity:
    """Every small change of a network, with its cycle computed anew; `now` has the figures of the model that decides.

    BusplanError: the network has too many groups or messages.
    """
    if reason := too_large(network.profile):
        raise BusplanError(reason)
    effects = [_effect(change, now, network) for change in perturbed(network)]
    effects.sort(key=lambda effect: (effect.margin_change_us is None, -abs(effect.margin_change_us or 0.0)))
    is_well = now.verdict == FITS and now.safe
    far = tuple(reaches(network, now.counts)) if is_well else ()
    return Sensitivity(now, tuple(effects), next_bottleneck(network, now.counts), far)


def _effect(cause: Perturbed, now: CycleFigures, network: Network) -> Effect:
    change_us, then = None, None
    if cause.network is not None:
        then = cycle_figures(cause.network, model=now.timing_model)
        change_us = (then.margin_corrected_us or 0.0) - (now.margin_corrected_us or 0.0)
    notes = [] if change_us else [cause.note]
    if cause.network is not None and not change_us:
        notes += _nearer(network, cause.network)
    return Effect(*cause[:4], change_us, then, "; ".join(filter(None, notes)))


def _nearer(network: Network, changed: Network) -> Iterator[str]:
    """Say how much nearer a change comes to each limit that is a time; the distance is from its value plus U."""
    for limit in network.bus.limits:
        if not limit.has_doubt:
            continue
        left_us, then_us = (limit.most(of) - limit.shown.value(of) for of in (network, changed))
        if then_us < left_us and left_us > 0:
            yield f"it takes {left_us - then_us:.1f} us of the {left_us:.1f} us before the limit of {limit.key}"
        elif then_us < left_us:
            yield f"it adds {left_us - then_us:.1f} us to the {-left_us:.1f} us beyond the limit of {limit.key}"
