"""The kinds of events: what they are called, where they come from, and how they are drawn."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.analysis.quantities import FIGURES
from busplan.analysis.timeline.schedule import Event, EventKind
from busplan.buses.ieee1394.timing import TransactionKind


class KindStyle(NamedTuple):
    """How one kind of event is shown."""

    label: str
    equation: str
    """Number of the paper's equation, or where else the time comes from."""
    mark: str
    """Its character in the terminal."""
    light: str
    """Its colour on white."""
    dark: str
    """Its colour on black."""


def _by(key: str) -> str:
    """Where the time of a kind comes from, as the registry of figures says."""
    return {**FIGURES["capacity"], **FIGURES["latency"]}[key].reference


KINDS: Final[Mapping[EventKind, KindStyle]] = MappingProxyType(
    {
        "sync": KindStyle("synchronous packet", _by("sync_us"), "S", "#7c3aed", "#a78bfa"),
        "arbitration": KindStyle("arbitration", _by("arbitration_us"), "a", "#e08a00", "#f5b041"),
        "request_data": KindStyle("request data", _by("request_data_us"), ">", "#1d6fd8", "#5aa9ff"),
        "acknowledge": KindStyle("acknowledge", _by("acknowledge_us"), "k", "#c8327c", "#ff7fb5"),
        "execution": KindStyle("execution", _by("execution_us"), "=", "#5aa845", "#6fbf5a"),
        "response_data": KindStyle("response data", _by("response_data_us"), "<", "#0a8f94", "#38c6c4"),
        "subaction_gap": KindStyle("subaction gap", _by("subaction_gap_us"), ".", "#b4bcc6", "#6b7685"),
        "arbitration_reset_gap": KindStyle(
            "arbitration reset gap", _by("arbitration_reset_gap_us"), ":", "#8792a0", "#4d5765"
        ),
        "nonperiodic": KindStyle("non-periodic window", _by("nonperiodic_us"), "N", "#9a5b2e", "#d39a6a"),
        "idle": KindStyle("idle", _by("margin_us"), "~", "#e6eaef", "#252d38"),
    }
)
"""Every kind of event, in the order of the protocol."""


class StripStyle(NamedTuple):
    """How a stretch of the cycle is shown in the strip of the whole slice."""

    label: str
    mark: str
    light: str
    dark: str


def _alike(kind: EventKind) -> StripStyle:
    style = KINDS[kind]
    return StripStyle(style.label, style.mark, style.light, style.dark)


STRIP: Final[Mapping[EventKind | TransactionKind, StripStyle]] = MappingProxyType(
    {
        "sync": _alike("sync"),
        "read": StripStyle("reads", "R", "#4668a8", "#7c9fe0"),
        "write": StripStyle("writes", "W", "#2a9d8f", "#5cc9bb"),
        "nonperiodic": _alike("nonperiodic"),
        "idle": _alike("idle"),
    }
)
"""What the strip is made of: whole transactions, and what belongs to no node."""


def event_label(event: Event) -> str:
    """Name one event of a transaction by who is at work: host, node, or the bus itself.

    The request is the host's, and the acknowledge behind it the node's; the response the other way round.
    """
    label = KINDS[event.kind].label
    if event.kind == "execution":
        return f"node {label}"
    if event.packet is None:
        return label
    by_host = (event.packet == "request") != (event.kind == "acknowledge")
    return f"{'host' if by_host else 'node'} {label.removeprefix('request ').removeprefix('response ')}"


def event_title(event: Event) -> str:
    """Name one event with the transaction it belongs to."""
    owner = f"{event.transaction} of node {event.node}: " if event.node is not None else ""
    return f"{owner}{event_label(event)}"
