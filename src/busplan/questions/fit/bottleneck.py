"""The next bottleneck: what binds once the largest term, or the limit of the nodes, is gone."""

from collections.abc import Iterator
from typing import NamedTuple

from busplan.buses.cycle import BusCycle, Term
from busplan.buses.network import Network
from busplan.elementwise import plain
from busplan.profile.toml import override
from busplan.questions.fit.certainty import certainty
from busplan.questions.fit.network import bus_of, network_of, without_execution
from busplan.questions.fit.node_limit import safe_nodes
from busplan.sections.profile import Profile


class NextLimit(NamedTuple):
    """What limits the nodes of one group now, and what would next, the other groups as they are."""

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
    """What binds now, and what would bind next, by the timing model that decides."""

    limits: tuple[NextLimit, ...]
    """One for each group of nodes."""
    binding_term: Term
    """The largest term of the cycle."""
    is_gone: bool
    """Whether something would take that term out of the cycle. If so, the figures below are of the cycle without it;
    else they are of the cycle as it is."""
    next_binding_term: Term
    """The largest other term."""
    next_margin_corrected_us: float | None
    """Corrected margin without the largest term; None where nothing takes it out."""


def next_bottleneck(profile: Profile) -> NextBottleneck:
    """Find what binds a network once its first bottleneck is gone.

    A term is taken out at its cause, and the cycle is computed anew: without execution, for one, the bus is idle for
    longer.

    Parameters
    ----------
    profile
        The network.
    """
    network, bus = network_of(profile), bus_of(profile)
    cycle = bus.cycle(network, model=bus.deciding_model)
    binding = _largest(cycle)
    cycles = (bus.cycle(one, model=bus.deciding_model) for one in _relieved(network))
    without = next((one for one in cycles if not _of(one, binding.key)), None)
    return NextBottleneck(
        limits=tuple(_next_limit(profile, name) for name in network.names),
        binding_term=binding,
        is_gone=without is not None,
        next_binding_term=_largest(without or cycle, but=binding.key),
        next_margin_corrected_us=None if without is None else plain(certainty(without).margin_corrected_us),
    )


def _next_limit(profile: Profile, group: str) -> NextLimit:
    nodes, limit = safe_nodes(profile, group=group)
    return NextLimit(group, nodes, limit, *safe_nodes(profile, group=group, without=limit))


def _relieved(network: Network) -> Iterator[Network]:
    """The network without each cause of a term that can be taken away."""
    yield without_execution(network)
    yield network._replace(nonperiodic_us=0.0)
    for changes in bus_of(network.profile).term_removals:
        yield network_of(override(network.profile, dict(changes)))


def _largest(cycle: BusCycle, *, but: str = "") -> Term:
    return max((one for one in cycle.terms if one.key != but), key=lambda one: plain(one.us))


def _of(cycle: BusCycle, key: str) -> float:
    return next(plain(one.us) for one in cycle.terms if one.key == key)
