"""Sensitivity of the margin: the effect of each small change, and the next bottleneck after the first."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple

from busplan.buses.cycle import BusCycle, Term
from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, NOT_SHOWN_KEPT, Perturbation
from busplan.elementwise import existing, plain
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import (
    TIME,
    VERDICTS,
    VerdictWord,
    available_us,
    certainty,
    fits_in,
    limit_codes,
    time_code,
    verdict_code,
)
from busplan.questions.fit.network import changed, network_of, with_execution, with_payloads, without_execution
from busplan.questions.fit.node_limit import safe_nodes
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.base import value_at, with_unchecked


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
    is_gone: bool
    """Whether something would take that term out of the cycle. If so, the figures below are of the cycle without it;
    else they are of the cycle as it is."""
    next_binding_term: Term
    """The largest of the other terms."""
    next_margin_corrected_us: float | None
    """Corrected margin without the largest term; None where nothing takes it out."""


def next_bottleneck(network: Network) -> NextBottleneck:
    """Find what binds a network once its first bottleneck is gone.

    A term is taken out at its cause, and the cycle is computed anew: without execution, for
    example, the bus is idle for longer.

    Parameters
    ----------
    network
        The network.
    """
    bus = network.bus
    cycle = bus.cycle(network, model=bus.deciding_model)
    binding = _largest(cycle)
    cycles = (bus.cycle(relieved, model=bus.deciding_model) for relieved in _relieved(network))
    without = next((cycle for cycle in cycles if not _of(cycle, binding.key)), None)
    return NextBottleneck(
        limits=tuple(_next_limit(network, name) for name in network.names),
        binding_term=binding,
        is_gone=without is not None,
        next_binding_term=_largest(without or cycle, but=binding.key),
        next_margin_corrected_us=None if without is None else plain(certainty(without).margin_corrected_us),
    )


def _next_limit(network: Network, group: str) -> NextLimit:
    nodes, limit = safe_nodes(network, group=group)
    return NextLimit(group, nodes, limit, *safe_nodes(network, group=group, without=limit))


def _relieved(network: Network) -> Iterator[Network]:
    """The network without each cause of a term that can be taken away."""
    yield without_execution(network)
    yield network._replace(nonperiodic_us=0.0)
    for changes in network.bus.term_removals:
        yield changed(network, changes)


def _largest(cycle: BusCycle, *, but: str = "") -> Term:
    return max((term for term in cycle.terms if term.key != but), key=lambda term: plain(term.us))


def _of(cycle: BusCycle, key: str) -> float:
    return next(plain(term.us) for term in cycle.terms if term.key == key)


_EXECUTION_SHARE: Final = 0.1
_PAYLOAD_STEP_BYTES: Final = 4
"""A quadlet: payloads are padded to it."""


class Perturbed(NamedTuple):
    """A network with one small change."""

    change: str
    key: str
    """Key of the profile, or figure of `latency`, that changes."""
    before: Any
    """Value of the key before; None where groups differ."""
    after: Any
    network: Network | None
    """None where the change cannot be made."""
    note: str
    """Why it cannot be made, or why the margin stays as it is, where it does."""


def perturbed(network: Network) -> Iterator[Perturbed]:
    """Make every small change of a network, one at a time.

    Those of every kind of bus are 10 % more execution time, a node and an axis more of each group, four bytes more of
    every payload, and a bus reset; a kind has its own before the last.
    """
    bus = network.bus
    yield _slower(network, if_nothing="" if bus.has_execution(network) else "no execution time is on the bus")
    yield from (_one_node_more(network, alike) for alike in network.alike)
    yield from (_one_axis_more(network, alike) for alike in network.alike)
    yield _more_bytes(network)
    own = bus.perturbations(network)
    reset = Perturbation("a bus reset", bus.safety.after_reset, if_nothing="it is set so already")
    yield from (_with_keys(network, change) for change in (*own, *((reset,) if bus.safety.after_reset else ())))


def _slower(network: Network, *, if_nothing: str) -> Perturbed:
    factor = 1 + _EXECUTION_SHARE
    groups = tuple(
        with_execution(group, read_us=factor * group.read_execution_us, write_us=factor * group.write_execution_us)
        for group in network.groups
    )
    before, after = (
        _common_value(us for group in state for us in (group.read_execution_us, group.write_execution_us))
        for state in (network.groups, groups)
    )
    label = f"execution time +{_EXECUTION_SHARE:.0%}"
    return Perturbed(label, "execution_us", before, after, network._replace(groups=groups), if_nothing)


def _one_node_more(network: Network, alike: AlikeNodes) -> Perturbed:
    more = alike.nodes + 1
    then = network.asking(alike.name).with_nodes(more)
    return Perturbed(f"one node more{_in(alike)}", alike.nodes_key, alike.nodes, more, then, "")


def _one_axis_more(network: Network, alike: AlikeNodes) -> Perturbed:
    key, axes = alike.node_key("axes"), alike.node.axes + 1
    then, unknown = _if_known(lambda: network_of(with_unchecked(network.profile, key, axes)))
    note = unknown or ("" if alike.payload.follows_axes else "no payload follows the axes")
    return Perturbed(f"one axis more per node{_in(alike)}", key, axes - 1, axes, then, note)


def _more_bytes(network: Network) -> Perturbed:
    sizes = [
        (group.read_bytes + _PAYLOAD_STEP_BYTES, group.write_bytes + _PAYLOAD_STEP_BYTES) for group in network.groups
    ]

    def change() -> Network:
        pairs = zip(network.groups, sizes, strict=True)
        return network._replace(
            groups=tuple(with_payloads(group, read_bytes=read, write_bytes=write) for group, (read, write) in pairs)
        )

    before = _common_value(size for group in network.groups for size in (group.read_bytes, group.write_bytes))
    changed, unknown = _if_known(change)
    after = _common_value(size for pair in sizes for size in pair)
    return Perturbed(f"payload +{_PAYLOAD_STEP_BYTES} bytes", "payload_bytes", before, after, changed, unknown)


def _with_keys(network: Network, perturbation: Perturbation) -> Perturbed:
    """A change that a kind of bus names by keys of the profile."""
    key, before, after = ", ".join(perturbation.changes), None, None
    if len(perturbation.changes) == 1:
        ((_, after),) = perturbation.changes.items()
        before = value_at(network.profile, key)
    if perturbation.why_not:
        return Perturbed(perturbation.label, key, before, None, None, perturbation.why_not)
    try:
        then = changed(network, perturbation.changes)
    except BusplanError as error:
        return Perturbed(perturbation.label, key, before, after, None, "; ".join(error.problems))
    return Perturbed(perturbation.label, key, before, after, then, perturbation.if_nothing)


def _if_known(change: Callable[[], Network]) -> tuple[Network | None, str]:
    """The network after a change, or why its execution time is not known."""
    try:
        return change(), ""
    except ValueError as error:
        return None, f"not known: {error}"


def _in(alike: AlikeNodes) -> str:
    return f" in {alike.name}" if alike.name else ""


def _common_value(values: Iterable[Any]) -> Any:
    """The value that all share; None where they differ."""
    first, *rest = values
    return first if all(value == first for value in rest) else None


class Standing(NamedTuple):
    """Where a network stands under the timing model that decides."""

    margin_corrected_us: float
    uncertainty_us: float | None
    """None where nothing is known of it."""
    verdict: VerdictWord
    safe: bool
    """Whether the bus is set so that it works reliably."""
    exceeded: tuple[str, ...]
    """Keys of the limits that are broken."""
    not_shown: tuple[str, ...]
    """Keys of the limits that are neither broken nor shown to be kept, time among them."""


class Effect(NamedTuple):
    """Effect of one small change on the margin."""

    change: str
    """The change, in words."""
    key: str
    """A key of the profile, or a figure of `latency`."""
    before: Any
    """Value of the key before, in the key's unit; None where groups differ."""
    after: Any
    margin_change_us: float | None
    """By how much the corrected margin grows; None where the change cannot be made."""
    then: Standing | None
    """Where the network stands with the change."""
    note: str
    """Why the change cannot be made, or why the margin stays as it is, and which limits come nearer then."""


class Sensitivity(NamedTuple):
    """Effects of small changes on the margin at one period, by the timing model that decides."""

    network: Network
    """At that period."""
    timing_model: str
    now: Standing
    effects: tuple[Effect, ...]
    """The largest first; changes that cannot be made are the last."""
    next_bottleneck: NextBottleneck


def sensitivity_of(network: Network) -> Sensitivity:
    """Make every small change of a network, and compute its cycle anew.

    Parameters
    ----------
    network
        The network.
    """
    now = standing(network)
    effects = [_effect(change, now, network) for change in perturbed(network)]
    effects.sort(key=lambda effect: (effect.margin_change_us is None, -abs(effect.margin_change_us or 0.0)))
    return Sensitivity(network, network.bus.deciding_model, now, tuple(effects), next_bottleneck(network))


def standing(network: Network) -> Standing:
    """Compute where a network stands: what `capacity` says of a profile, of any network."""
    bus = network.bus
    cycle = bus.cycle(network, model=bus.deciding_model)
    sure, codes = certainty(cycle), limit_codes(network)
    broken = tuple(key for key, code in codes.items() if code == BROKEN)
    codes[TIME] = time_code(sure, network)
    late = not fits_in(cycle.required_us, available_us=available_us(network))
    return Standing(
        margin_corrected_us=plain(sure.margin_corrected_us),
        uncertainty_us=existing(sure.known_uncertainty_us),
        verdict=VERDICTS[int(verdict_code(codes))],
        safe=bus.is_safe(network),
        exceeded=(*broken, *((TIME,) if late else ())),
        not_shown=tuple(key for key, code in codes.items() if code == NOT_SHOWN_KEPT),
    )


def _effect(cause: Perturbed, now: Standing, network: Network) -> Effect:
    change_us, then = None, None
    if cause.network is not None:
        then = standing(cause.network)
        change_us = then.margin_corrected_us - now.margin_corrected_us
    note = ""
    if not change_us:
        note = "; ".join(
            filter(None, (cause.note, *(() if cause.network is None else _nearer(network, cause.network))))
        )
    return Effect(cause.change, cause.key, cause.before, cause.after, change_us, then, note)


def _nearer(network: Network, changed: Network) -> Iterator[str]:
    """Say how much nearer a change comes to limits that are times, each with its doubt as a shown verdict has it."""
    for limit in network.bus.limits:
        if limit.bound.doubt is None:
            continue
        bound = limit.bound
        left_us, then_us = (plain(bound.most(of)) - plain(bound.shown.value(of)) for of in (network, changed))
        if then_us < left_us and left_us > 0:
            yield f"it takes {left_us - then_us:.1f} us of the {left_us:.1f} us before the limit of {limit.key}"
        elif then_us < left_us:
            yield f"it adds {left_us - then_us:.1f} us to the {-left_us:.1f} us beyond the limit of {limit.key}"
