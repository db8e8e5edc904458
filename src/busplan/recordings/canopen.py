"""CANopen in a log: what its predefined connection set calls an identifier (CiA 301)."""

from collections.abc import Iterable
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from busplan.recordings.can import CanFrames
from busplan.recordings.can_timing import SentFrames

NMT, SYNC, TIME = "NMT", "SYNC", "TIME"
EMERGENCY, HEARTBEAT, SDO_ANSWER, SDO_REQUEST = "emergency", "heartbeat", "SDO answer", "SDO request"
_OF_NETWORK: Final = MappingProxyType({0x000: (NMT, 2), 0x080: (SYNC, 1), 0x100: (TIME, 6)})
"""Name and most data bytes of the messages of no node, by identifier."""
_OF_NODES: Final = MappingProxyType(
    {
        0x080: (EMERGENCY, range(8, 9)),
        **{0x180 + 0x100 * place: (f"TPDO{place + 1}", range(9)) for place in range(4)},
        **{0x200 + 0x100 * place: (f"RPDO{place + 1}", range(9)) for place in range(4)},
        0x580: (SDO_ANSWER, range(8, 9)),
        0x600: (SDO_REQUEST, range(8, 9)),
        0x700: (HEARTBEAT, range(1, 2)),
    }
)
"""Name and possible data bytes of the messages of each node, by the identifier of node 0."""
_NODE_BITS: Final = 0x7F
_STATES: Final = (0, 4, 5, 127)
"""States of a node in its heartbeat: starting, stopped, operational, pre-operational."""
_TOGGLE: Final = 0x80
"""Bit of a heartbeat that changes with each answer to node guarding."""


class Role(NamedTuple):
    """What CANopen calls a message."""

    name: str
    node: int | None
    """Node-ID; None for a message of no node."""


def role(sent: SentFrames) -> Role | None:
    """What the predefined connection set calls a message of this identifier and length; None where it has no name."""
    if sent.extended or sent.is_fd:
        return None
    if sent.identifier in _OF_NETWORK:
        name, most_bytes = _OF_NETWORK[sent.identifier]
        return Role(name, None) if sent.most_bytes <= most_bytes else None
    node = sent.identifier & _NODE_BITS
    name, sizes = _OF_NODES.get(sent.identifier - node, ("", range(0)))
    return Role(name, node) if node and sent.most_bytes in sizes else None


def is_likely(messages: Iterable[SentFrames], frames: CanFrames) -> bool:
    """Whether a log looks like CANopen: a SYNC, a heartbeat with states of a node, or SDOs of a node both ways."""
    found = set[Role]()
    for sent in messages:
        what = role(sent)
        if what is None:
            continue
        if what.name == SYNC:
            return True
        states = (frames.data[sent.frames] >> np.uint64(56)).astype(np.int64) & ~_TOGGLE
        if what.name == HEARTBEAT and np.isin(states, _STATES).all():
            return True
        found.add(what)
    return any(Role(SDO_REQUEST, what.node) in found for what in found if what.name == SDO_ANSWER)
