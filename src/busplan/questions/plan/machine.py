"""What planning reads and writes of a profile's nodes and payloads: the one place that knows their keys."""

from collections.abc import Collection, Iterator, Mapping
from itertools import product
from math import ceil
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.errors import BusplanError
from busplan.questions.fit.network import network_of
from busplan.sections.alike_nodes import AlikeNodes
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
    sections = [f"group.{one.name}" for one in profile.group] or ["payload"]
    return tuple(f"{section}.{key}" for section in sections for key in _PAYLOADS)


def nodes_for_axes(profile: Profile, axes: int) -> int:
    """Nodes that a number of axes takes, with the profile's axes of each node [1].

    Raises
    ------
    BusplanError
        Nodes differ, so that axes do not say how many of which.
    """
    if profile.group:
        keys = ", ".join(one.nodes_key for one in profile.alike_nodes)
        raise BusplanError(f"axes {axes}: the nodes of {profile.name} differ; set the nodes of a group instead: {keys}")
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
    found: dict[str, Value] = {}
    for alike, kind in product(profile.alike_nodes, TRANSACTION_KINDS):
        over, (key, each) = int(alike.bytes_of(kind)) - most_bytes, _cut(alike, kind)
        if over > 0 and key not in kept:
            found[key] = getattr(alike.payload, key.rpartition(".")[2]) - ceil(over / each)
    return found if all(int(value) > 0 for value in found.values()) else None


def least_cut_bytes(profile: Profile, *, kept: Collection[str] = ()) -> int:
    """The least that any payload is cut by: what a byte of each axis makes of it, where axes add to it [bytes]."""
    cuts = (_cut(alike, kind) for alike, kind in product(profile.alike_nodes, TRANSACTION_KINDS))
    return min((each for key, each in cuts if key not in kept), default=1)


def _cut(alike: AlikeNodes, kind: TransactionKind) -> tuple[str, int]:
    """The key that a payload is cut by, and what a byte of it takes away [bytes]; without axes it is the fixed part."""
    key, axes = alike.payload_key(kind), int(alike.node.axes)
    return (key, axes) if axes and key.endswith("_per_axis") else (key.removesuffix("_per_axis"), 1)


def with_payload(profile: Profile, size_bytes: int) -> Changes | None:
    """The change to one payload for reads and writes alike [bytes]; None where it follows axes, or is a group's own."""
    if profile.group or profile.alike_nodes[0].payload.follows_axes:
        return None
    return {f"payload.{kind}_bytes": size_bytes for kind in TRANSACTION_KINDS}
