"""Needs of a network, the [limits] that it misses, and the smallest period at which all holds."""

from collections.abc import Iterable, Iterator
from math import ceil, inf
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.elementwise import within
from busplan.questions.fit.certainty import TIME, available_us, certainty
from busplan.questions.fit.network import at_period
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US

_MOST_SLICE_US: Final = 1e12
"""Longer than any slice of a profile: it keeps quotients finite."""


class Need(NamedTuple):
    """Time that one constraint asks of the slice, or of the period itself."""

    slice_us: float
    """Length that the slice must have; infinite where none is enough [us]."""
    key: str
    """Source of the need: time, the key of a limit of the bus, or a key of the profile."""
    why: str = ""
    """Reason that no slice and no period helps, in words."""
    least_us: float = 0.0
    """The shortest period, whatever the slice ratio; 0 where any will do [us]."""

    def period_us(self, ratio: float) -> float:
        """The shortest period that gives what is asked, with a slice ratio [us]."""
        return max(self.slice_us / ratio, self.least_us)

    def words(self, *, ratio: float, most_us: float) -> str:
        """Words for the need, at a slice ratio and with the longest period there is [us]."""
        if self.why:
            return self.why
        if self.least_us > self.slice_us / ratio:
            return f"{self.key} needs a period of {self.least_us:.3f} us, and {most_us:.3f} us is the longest"
        needs = f"needs a slice of {self.slice_us:.3f} us"
        who = f"the cycle {needs} to be shown to fit" if self.key == TIME else f"{self.key} {needs}"
        return f"{who}, and at most {ratio * most_us:.3f} us can be given"


class Room(NamedTuple):
    """A network with as many nodes as a key of [limits] asks the bus to carry."""

    key: str
    network: Network
    group: str
    """Name of the group that has more nodes; empty where all are alike."""
    words: str
    """How many nodes these are."""


def rooms(network: Network) -> Iterator[Room]:
    """The network with the nodes that [limits] asks the bus to carry: more of each group, the others as they are."""
    limits = network.profile.limits
    for group in network.profile.node_groups:
        more = {"limits.min_spare_nodes": limits.min_spare_nodes}
        if limits.min_spare_axes is not None and group.node.axes:
            more["limits.min_spare_axes"] = ceil(limits.min_spare_axes / int(group.node.axes))
        for key, spare in more.items():
            if spare is not None:
                nodes = int(group.nodes) + spare
                of = f" of {group.name}" if group.name else ""
                yield Room(key, network.with_nodes(nodes, group=group.name), group.name, f"{nodes} nodes{of}")


def to_be_shown(network: Network, *, is_safe: bool = True) -> Iterator[Need]:
    """Needs of a network to be shown to fit, with bias, uncertainty and reserve.

    Time first, and then each limit that asks for a longer period than all before it. The network's own period plays no
    part; with `is_safe` the bus must be set safely, too.
    """
    bus = network.bus
    time = Need(float(certainty(bus.cycle(network, model=bus.deciding_model)).safe_required_us), TIME)
    yield time
    least_us = 0.0
    for limit in bus.limits:
        if limit.role == "period" or (limit.role == "safety" and not is_safe):
            continue
        # A limit that a period cures is asked at the shortest one that the others allow with any slice ratio.
        at_us = max(time.slice_us, least_us, MIN_STEP_US)
        at = network._replace(period_us=at_us) if limit.has_period else network
        if limit.shown.is_broken(at):
            kept_us = limit.shown.shortest_period_us(at)
            if kept_us == inf:
                way_out = f" ({limit.advice(at)})" if limit.way_out else ""
                yield Need(inf, limit.key, f"{limit.words(at)}{way_out}", inf)
                return
            least_us = max(least_us, kept_us)
            yield Need(0.0, limit.key, least_us=kept_us)


def most_asking(needs: Iterable[Need], *, ratio: float) -> Need:
    """The need that asks for the longest period with a slice ratio, the first of equals."""
    return max(needs, key=lambda need: need.period_us(ratio))


def _of_use(network: Network) -> Iterator[Need]:
    """The need of `limits.max_utilisation`: the share of the slice that may be used."""
    most, key = network.profile.limits.max_utilisation, "limits.max_utilisation"
    if most is not None:
        bus = network.bus
        required_us = float(bus.cycle(network, model=bus.deciding_model).required_us)
        us = required_us / most if most * _MOST_SLICE_US > required_us else inf
        yield Need(us, key, f"{key} = {most:g} leaves no time" if us == inf else "")


def _of_limits(network: Network) -> Iterator[Need]:
    """Needs of [limits]: the share of the slice that may be used, and more nodes that must be shown to fit, too."""
    yield from _of_use(network)
    for room in rooms(network):
        for need in to_be_shown(room.network):
            why = need.why and f"{room.key} asks for room for {room.words}: {need.why}"
            yield need._replace(key=room.key, why=why)


class MissedLimit(NamedTuple):
    """A key of [limits] that a network does not keep at its own period."""

    key: str
    group: str
    """Name of the group that has too little room; empty where all nodes are alike, and for other keys."""
    words: str
    """The reason."""


def missed_limits(network: Network) -> tuple[MissedLimit, ...]:
    """The keys of [limits] that a network does not keep at its own period, whatever its verdict.

    Room is there where the network with so many nodes more is shown to fit, on a bus that is set safely.
    """
    if not network.groups:
        return ()
    ratio, period_us = float(network.slice_ratio), float(network.period_us)
    missed = [
        MissedLimit(need.key, "", need.words(ratio=ratio, most_us=period_us))
        for need in _unmet(_of_use(network), network)
    ]
    for room in rooms(network):
        broken = next((limit for limit in network.bus.limits if limit.shown.is_broken(room.network)), None)
        time = next(to_be_shown(room.network))
        if broken is not None or not within(time.slice_us, float(available_us(network))):
            why = time.words(ratio=ratio, most_us=period_us) if broken is None else broken.words(room.network)
            missed.append(MissedLimit(room.key, room.group, f"{room.key} asks for room for {room.words}: {why}"))
    return tuple(missed)


def needs_of(network: Network) -> tuple[Need, ...]:
    """All that a plan asks of a network's period; its own period plays no part."""
    return (*to_be_shown(network), *_of_limits(network))


def unmet(network: Network, needs: Iterable[Need] | None = None) -> list[Need]:
    """Needs that a network does not meet at its own period; empty where every constraint of a plan holds.

    `needs` are those of `needs_of`, if they are known.
    """
    limits = network.bus.limits
    broken = [limit for limit in limits if limit.role == "period" and limit.is_surely_broken(network)]
    found = list(_unmet(needs_of(network) if needs is None else needs, network))
    if not broken and not found:
        # What a limit needs of the slice was computed at the shortest period.
        broken = [limit for limit in limits if limit.has_period and limit.shown.is_broken(network)]
        found = [Need(inf, missed.key, missed.words) for missed in missed_limits(network)]
    return [*(Need(inf, limit.key, limit.words(network)) for limit in broken), *found]


def _unmet(needs: Iterable[Need], network: Network) -> Iterator[Need]:
    ratio, period_us = float(network.slice_ratio), float(network.period_us)
    return (need for need in needs if not within(need.period_us(ratio), period_us))


class SmallestPeriod(NamedTuple):
    """The smallest period at which a network holds every constraint, of those that its bus allows."""

    us: float | None
    """None if there is none [us]."""
    need: Need
    """What asks for it, or why there is none."""


_MOST_TRIES: Final = 64
"""Each try keeps one more limit, so that a few are enough."""
_NEXT: Final = 1 + 1e-9
"""A limit that rounding alone breaks is kept a little later."""


def smallest_period(network: Network, *, is_safe: bool = True, with_limits: bool = True) -> SmallestPeriod:
    """Smallest period at which a network is shown to fit.

    Its own period plays no part. With `is_safe` the bus must be set safely, with `with_limits` [limits] must hold, too.
    """
    bus, ratio = network.bus, float(network.slice_ratio)

    def most(at: Network) -> Need:
        more = _of_limits(at) if with_limits else ()
        return most_asking((*to_be_shown(at, is_safe=is_safe), *more), ratio=ratio)

    def missing(period_us: float) -> Need | None:
        at = at_period(network, period_us)
        need = most(at)
        broken = any(limit.has_period and limit.shown.is_broken(at) for limit in bus.limits)
        is_missed = broken or not within(need.period_us(ratio), period_us) or (with_limits and missed_limits(at))
        return need if is_missed else None

    need, longest_us = most(network), min(bus.periods.longest_us, MAX_TIME_US)
    found_us = _allowed_us(network, need.period_us(ratio))
    for _ in range(_MOST_TRIES):
        if found_us > longest_us:
            break
        lacking = missing(found_us)
        if lacking is None:
            return SmallestPeriod(found_us, need)
        need, found_us = lacking, _allowed_us(network, max(lacking.period_us(ratio), found_us * _NEXT))
    why = need.words(ratio=ratio, most_us=longest_us)
    return SmallestPeriod(None, need._replace(why=why))


def _allowed_us(network: Network, least_us: float) -> float:
    """The shortest period of at least a time that a bus allows; infinite where there is none [us]."""
    return float(network.bus.periods.shortest_us(max(MIN_STEP_US, least_us)))
