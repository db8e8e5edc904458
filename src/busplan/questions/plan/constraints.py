"""Constraints of a plan, and the nodes and payloads of a profile as planning reads and writes them."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import product
from math import ceil, inf
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.elementwise import within
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import TIME, certainty
from busplan.questions.fit.circle_refusal import circle_refusals, step_refusals
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.base import MIN_STEP_US
from busplan.sections.profile import Profile
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

Changes = Mapping[str, Value]
"""New values of a profile by dotted key."""
NODES_KEY: Final = "bus.nodes"
"""Key of the number of nodes, where all are alike."""
_PAYLOADS: Final = tuple(f"{kind}_bytes{part}" for kind in TRANSACTION_KINDS for part in ("", "_per_axis"))


class Room(NamedTuple):
    """A network with as many nodes as a key of [limits] asks the bus to carry."""

    key: str
    network: Network
    words: str
    """How many nodes these are."""


def payload_keys(profile: Profile) -> tuple[str, ...]:
    """Every key that a payload of a network has, or may have."""
    sections = [f"group.{group.name}" for group in profile.group] or ["payload"]
    return tuple(f"{section}.{key}" for section in sections for key in _PAYLOADS)


def nodes_for_axes(profile: Profile, axes: int) -> int:
    """Nodes that a number of axes takes, with the profile's axes of each node [1].

    Raises
    ------
    BusplanError
        Nodes differ, so that axes do not say how many of which.
    """
    if profile.group:
        own = {alike: int(alike.nodes) * int(alike.node.axes) for alike in profile.alike_nodes}
        needed = {alike: axes - sum(own.values()) + own[alike] for alike in own if alike.node.axes}
        each = ", or ".join(
            f"set {alike.nodes_key}={ceil(of_group / int(alike.node.axes))}"
            for alike, of_group in needed.items()
            if of_group > 0
        )
        instead = f"say instead: {each}" if each else "set the nodes of a group instead"
        raise BusplanError(f"axes {axes}: the nodes of {profile.name} differ; {instead}")
    (alike,) = profile.alike_nodes
    return ceil(axes / int(alike.node.axes))


def with_nodes(nodes: int) -> Changes:
    """The change to a number of nodes, where all are alike [1]."""
    return {NODES_KEY: nodes}


def rooms(profile: Profile) -> Iterator[Room]:
    """The network with the nodes that [limits] asks the bus to carry: more of each group, the others as they are."""
    limits, network = profile.limits, network_of(profile)
    for alike in profile.alike_nodes:
        more = {"limits.min_spare_nodes": limits.min_spare_nodes}
        if limits.min_spare_axes is not None and alike.node.axes:
            more["limits.min_spare_axes"] = ceil(limits.min_spare_axes / int(alike.node.axes))
        for key, spare in more.items():
            if spare is not None:
                nodes = int(alike.nodes) + spare
                of = f" of {alike.name}" if alike.name else ""
                yield Room(key, network.asking(alike.name).with_nodes(nodes), f"{nodes} nodes{of}")


def with_payload_within(profile: Profile, most_bytes: int, *, kept: Collection[str] = ()) -> Changes | None:
    """The change to payloads of so many bytes or less; empty where they are, None where no payload would be left.

    Parameters
    ----------
    profile
        The network.
    most_bytes
        The most that a transaction may carry, what all axes of its node add among it [bytes].
    kept
        Keys that must stay.
    """
    changes: dict[str, Value] = {}
    for alike, kind in product(profile.alike_nodes, TRANSACTION_KINDS):
        over, (key, bytes_cut) = int(alike.bytes_of(kind)) - most_bytes, _cut(alike, kind)
        if over > 0 and key not in kept:
            changes[key] = getattr(alike.payload, key.rpartition(".")[2]) - ceil(over / bytes_cut)
    return changes if all(int(value) > 0 for value in changes.values()) else None


def least_cut_bytes(profile: Profile, *, kept: Collection[str] = ()) -> int:
    """Smallest step by which a payload can be cut; with payloads that follow axes, a byte for each axis [bytes]."""
    cuts = (_cut(alike, kind) for alike, kind in product(profile.alike_nodes, TRANSACTION_KINDS))
    return min((cut for key, cut in cuts if key not in kept), default=1)


def _cut(alike: AlikeNodes, kind: TransactionKind) -> tuple[str, int]:
    """The key that a payload is cut by, and what a byte of it takes away [bytes]; without axes it is the fixed part."""
    key, axes = alike.payload_key(kind), int(alike.node.axes)
    return (key, axes) if axes and key.endswith("_per_axis") else (key.removesuffix("_per_axis"), 1)


def with_payload(profile: Profile, size_bytes: int) -> Changes | None:
    """The change to one payload for reads and writes alike [bytes]; None where it follows axes, or is a group's own."""
    if profile.group or profile.alike_nodes[0].payload.follows_axes:
        return None
    return {f"payload.{kind}_bytes": size_bytes for kind in TRANSACTION_KINDS}


CIRCLE: Final = "circle"
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
        """Say what is asked, and the longest period there is.

        Parameters
        ----------
        ratio
            Slice ratio [1].
        most_us
            The longest period [us].
        """
        if self.least_us > self.slice_us / ratio:
            needs = f"needs a period of {self.least_us:.3f} us"
            return self.why or f"{self.key} {needs}, and {most_us:.3f} us is the longest"
        needs = f"needs a slice of {self.slice_us:.3f} us"
        who = f"the cycle {needs} to be shown to fit" if self.key == TIME else f"{self.key} {needs}"
        return self.why or f"{who}, and at most {ratio * most_us:.3f} us can be given"


def shown(network: Network, *, is_safe: bool = True) -> Iterator[Need]:
    """Need of a network to be shown to fit, with bias, uncertainty and reserve.

    Time first, and then each limit that asks for a longer period than all before it.

    Parameters
    ----------
    network
        The network; its own period plays no part.
    is_safe
        Whether the bus must be set safely, too.
    """
    bus = bus_of(network.profile)
    time = Need(float(certainty(bus.cycle(network, model=bus.deciding_model)).safe_required_us), TIME)
    yield time
    least_us = 0.0
    for limit in bus.limits:
        if limit.is_of_period or (limit.is_safety and not is_safe):
            continue
        # A limit that a period cures is asked at the shortest one that the others allow with any slice ratio.
        at_us = max(time.slice_us, least_us, MIN_STEP_US)
        at = network if limit.kept_from_us is None else network._replace(period_us=at_us)
        if limit.shown.is_broken(at):
            kept_us = inf if limit.kept_from_us is None else limit.kept_from_us(at)
            if kept_us == inf:
                way_out = f" ({limit.way_out})" if limit.way_out else ""
                yield Need(inf, limit.key, f"{limit.words(at)}{way_out}", inf)
                return
            least_us = max(least_us, kept_us)
            yield Need(0.0, limit.key, least_us=kept_us)


def most_asking(needs: Iterable[Need], *, ratio: float) -> Need:
    """The need that asks for the longest period with a slice ratio, the first of equals."""
    return max(needs, key=lambda need: need.period_us(ratio))


def keeps_limits(network: Network) -> bool:
    """Whether a network keeps the limits that depend on the period, at its own period and slice ratio."""
    limits = bus_of(network.profile).limits
    return not any(limit.kept_from_us is not None and limit.shown.is_broken(network) for limit in limits)


def verdict(profile: Profile) -> Iterator[Need]:
    """The network itself."""
    yield from shown(network_of(profile))


def utilisation(profile: Profile) -> Iterator[Need]:
    """[limits] max_utilisation: the share of the slice that may be used."""
    most, key = profile.limits.max_utilisation, "limits.max_utilisation"
    if most is not None:
        bus = bus_of(profile)
        required_us = float(bus.cycle(network_of(profile), model=bus.deciding_model).required_us)
        us = required_us / most if most * _MOST_SLICE_US > required_us else inf
        yield Need(us, key, f"{key} = {most:g} leaves no time" if us == inf else "")


def spare(profile: Profile) -> Iterator[Need]:
    """[limits] min_spare_nodes and min_spare_axes: more nodes must be shown to fit, too."""
    for room in rooms(profile):
        for need in shown(room.network):
            why = need.why and f"{room.key} asks for room for {room.words}: {need.why}"
            yield need._replace(key=room.key, why=why)


CONSTRAINTS: Final[tuple[Callable[[Profile], Iterator[Need]], ...]] = (verdict, utilisation, spare)


def missed_limits(profile: Profile) -> tuple[Need, ...]:
    """Needs of [limits] that the slice of a profile does not meet; the verdict is not among them."""
    if not profile.has_cycle:
        return ()
    cycle = profile.cycle
    asked = (need for constraint in CONSTRAINTS[1:] for need in constraint(profile))
    missed = (need for need in asked if not within(need.period_us(cycle.slice_ratio), cycle.period_us))
    return tuple({need.key: need for need in missed}.values())


def needs(profile: Profile) -> list[Need]:
    """Needs of every constraint, those of the verdict first."""
    return [need for constraint in CONSTRAINTS for need in constraint(profile)]


def refused_period(profile: Profile) -> Need | None:
    """Why a period is none of the bus, or why the circle that a profile asks for cannot be run, if so.

    Parameters
    ----------
    profile
        The network.
    """
    network, bus = network_of(profile), bus_of(profile)
    broken = next((limit for limit in bus.limits if limit.is_of_period and limit.is_broken(network)), None)
    if broken is not None:
        return Need(inf, broken.key, broken.words(network))
    causes = circle_refusals(profile)
    return Need(inf, causes[0].name, causes[0].message) if causes else None


def goes_with_step(profile: Profile, period_us: float) -> bool:
    """Whether a period goes with the step of the circle that a profile asks for, if it does.

    Parameters
    ----------
    profile
        The network.
    period_us
        Communication period [us].
    """
    return not profile.asks_for_circle or not any(step_refusals(profile, period_us))
