"""What a kind of bus says of itself: timing models, keys, events, settings of a plan, the start of a new profile."""

from collections.abc import Callable, Iterable, Mapping
from enum import IntEnum, unique
from typing import Final, Literal, NamedTuple

from busplan.buses.figure import MARGIN, Figure, Ink
from busplan.buses.network import Network
from busplan.sourced import Grade

Value = int | float | str
"""Value of a profile's key."""


class TimingModel(NamedTuple):
    """One way to count the cycle of a kind of bus."""

    name: str
    meaning: str
    error: str = "the error of this timing model is not known"
    """Error of the model in words, where its bias is not known."""


class Safety(NamedTuple):
    """A setting of a bus that is safe or not, whether or not the cycle fits."""

    setting: str = "setting"
    """Name of the setting in sentences."""
    figure: Figure | None = None
    """Figure that tells whether every safety limit holds."""
    after_reset: Mapping[str, Value] = {}
    """Values of keys after a bus reset, until somebody sets them again."""


KeyRole = Literal["cable", "clock", "host", "pipeline", "wake-up"]
"""Part of a machine that a key of any kind stands for.

It is the length of a cable [m], a common clock of the nodes, the host's own time from what it receives to what it
sends, the whole periods that the host adds to a loop, or the latest start of a cycle by the host.
"""


class Key(NamedTuple):
    """Facts about a key of a profile that its schema does not have."""

    symbol: str = ""
    """Symbol in formulas, if not the key's name."""
    default: str = ""
    """Name of the constant that is the default."""
    grade: Grade | None = None
    """Best grade that the value can have, if below the grade "given"."""
    meaning: str = ""
    """Meaning of a change on the machine, where the key does not give it."""
    chooses: bool = False
    """Whether the value selects a formula; a derivation then lists it among its inputs."""
    role: KeyRole | None = None
    """Part of the machine that the key describes, if other kinds have a key for it, too."""


class EventKind(NamedTuple):
    """Name and colour of a kind of event, or of a stretch of several."""

    key: str
    label: str
    reference: str
    """Number of the equation that gives its time, or another source."""
    mark: str
    """Character of the event in a terminal."""
    ink: Ink


IDLE: Final = EventKind("idle", "idle", MARGIN.reference, ".", "idle")
"""Rest of the slice."""


class Starter(NamedTuple):
    """Parts of a new profile that the kind decides."""

    bus: str
    """Section [bus] in TOML, without its nodes and its host."""
    host: str = ""
    """Host of a new profile, unless another is asked for; empty where the profile says nothing of its host."""
    period: str = "1ms"
    """Communication period, unless another is asked for."""
    slice_ratio: str = "1            # the whole period is for communication"
    """Value of cycle.slice_ratio, with a comment."""
    measure: str = "measure it on a node"
    """Advice on finding execution times: a format with `file`, the profile, and `group`, an option of `calibrate`."""
    node: str = ""
    """Commented lines of a node, for keys that have no right default."""
    variants: Mapping[str, str] = {}
    """Other buses of the kind by name: further lines of [bus], as of "can-fd", or a whole section, "profibus"."""
    without_wake_up: tuple[str, ...] = ()
    """Variants that have no key of the host's wake-up."""
    servos: Mapping[str, Mapping[str, tuple[int, str]]] = {}
    """Variants whose nodes are servos of one axis: their data by direction [bytes], each with its meaning."""
    rate: str = ""
    """Key of [bus] with a bit rate that a user is asked for; empty where there is only one."""
    base: str = "time of a node's work in each cycle"
    """Meaning of execution.base_us."""
    bases_us: Mapping[str, int] = {}
    """Value of execution.base_us in variants whose nodes are known to take longer than others [us]."""
    table: str = ""
    """Keys of a published execution time, in place of a guess."""
    tables: Mapping[str, str] = {}
    """The same by variant, where one has its own."""
    more: str = ""
    """Commented lines at the end of the profile."""

    def execution(self, variant: str = "") -> str:
        """Keys of a node's execution time, which is assumed unless the kind, or the variant, has a better one."""
        return (
            self.tables.get(variant)
            or self.table
            or f"""\
kind = "linear"
grade = "assumed"          # between 0 and twice its value
base_us = {self.bases_us.get(variant, 20)}               # assumed: {self.base}
per_byte_us = 0.1          # assumed: time per byte
"""
        )

    def section(self, host: Iterable[str], variant: str) -> str:
        """Section [bus] with lines on the host and those of a variant, or the variant's own section."""
        more = self.variants.get(variant, "")
        bus, more = (more, "") if more.startswith("[bus]") else (self.bus, more)
        given = tuple(host)
        # A commented key is a proposal.
        proposed = tuple(f"# {line.partition('=')[0]}=" for line in given)
        kept = (line for line in bus.splitlines() if not line.startswith(proposed))
        return "\n".join(filter(None, (*kept, *given, more)))


@unique
class Cost(IntEnum):
    """Cost of a change of a network, the cheapest first: the order of plans, of advice and of cures."""

    REGISTER = 1
    """A number in the nodes, such as a gap count."""
    HOST_TIME = 2
    """The slice ratio: the host computes in the rest of the period."""
    RESPONSES = 3
    """The way nodes answer: their firmware."""
    SCHEDULE = 4
    """The way the host asks nodes: the firmware of host and nodes."""
    PAYLOAD = 5
    """Data of a cycle."""
    PERIOD = 6
    """A requirement of the machine."""
    NODES = 7
    """Nodes moved to a second bus."""


class Setting(NamedTuple):
    """A setting of the bus that a plan may change without new parts."""

    name: str
    """Name in options, such as gap_count."""
    label: str
    """Name in a sentence, such as gap count."""
    cost: Cost
    keys: tuple[str, ...]
    """Dotted keys that the setting changes."""
    values: tuple[Mapping[str, Value], ...]
    """Other values for this network, as new values by key: safe ones first, then the smallest change."""


class Perturbation(NamedTuple):
    """A small change of a profile that shows its effect on the margin."""

    label: str
    changes: Mapping[str, Value]
    """New value by dotted key."""
    why_not: str = ""
    """Reason why the change cannot be made here; empty where it can."""
    if_nothing: str = ""
    """Reason for an unchanged margin, where there is one."""


class PayloadRange(NamedTuple):
    """Payloads that a plan may choose from: the largest, and the step between them."""

    step_bytes: int
    most_bytes: int
    carrier: str = "a packet"
    """Name, in messages, of the carrier that bounds a payload."""


class PacketTime(NamedTuple):
    """Part of a measured latency that is not the execution [us]."""

    us: float
    """Time of the packets."""
    shortest_us: float = 0.0
    """Shortest time that the bus waits for the node: a latency does not show a shorter execution."""


class MeasuredLatencies(NamedTuple):
    """Calibration of execution times from latencies that were measured on a kind of bus."""

    packets: Callable[[Network, str, str, str, int], PacketTime]
    """Time of the packets of a transaction, by network, name of the group, timing model, "read" or "write", and payload
    [bytes]; raises a BusplanError where its latency could not be measured.
    """
    fit_keys: Callable[[Network, str], dict[str, Value]]
    """Keys of [node.execution] that record how an execution time was fitted, by network and by the timing model whose
    packet times were subtracted.
    """
