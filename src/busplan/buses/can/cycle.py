"""The cycle of a CAN network: of SYNC, of requests and answers, or none beside messages alone; and its events."""

from typing import Final

from busplan.buses.can.alone import NO_STUFFING, WORST_STUFFING, CanCycle, MessagesAlone, TimingModelName
from busplan.buses.can.equations import BUS_LOAD
from busplan.buses.can.requests import RequestCycle
from busplan.buses.can.sync import SyncCycle
from busplan.buses.can.traffic import Traffic, traffic_of
from busplan.buses.figure import NONPERIODIC
from busplan.buses.network import Network
from busplan.buses.parts import EventKind

__all__ = [
    "EVENTS",
    "NO_STUFFING",
    "STRETCHES",
    "WORST_STUFFING",
    "CanCycle",
    "SyncCycle",
    "TimingModelName",
    "can_cycle",
]

_DAVIS: Final = BUS_LOAD.reference
EVENTS: Final = (
    EventKind("jitter", "SYNC's jitter", "profile", "j", "contention"),
    EventKind("sync", "SYNC", _DAVIS, "S", "sync"),
    EventKind("wait", "wait for nodes", "profile", "=", "work"),
    EventKind("feedback_frame", "feedback PDO", _DAVIS, "<", "in"),
    EventKind("command_frame", "command PDO", _DAVIS, ">", "out"),
    EventKind("adapter", "adapter of the host", "profile", "a", "acknowledge"),
    EventKind("host", "host", "profile", "h", "idle"),
    EventKind("blocking", "lower-priority frame", _DAVIS, "b", "gap"),
    EventKind("message", "higher-priority frame", _DAVIS, "m", "contention"),
    EventKind("repeated", "repeated frame", "Tindell 1994", "r", "contention"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events, in the order of the cycle."""
STRETCHES: Final = (
    EventKind("feedback", "feedback", "", "F", "in"),
    EventKind("command", "command", "", "C", "out"),
)
"""Stretches that several events make together."""


def can_cycle(network: Network, model: str, *, traffic: Traffic | None = None) -> CanCycle:
    """The cycle of a network under a timing model; its traffic is by default that of the network."""
    sent = traffic or traffic_of(network)
    sort = MessagesAlone if not sent.has_cycle else SyncCycle if sent.has_sync else RequestCycle
    return sort.made(network, model, sent)
