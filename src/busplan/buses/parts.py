"""What a kind of bus names: timing models, events, limits, what a plan may turn, and what a new profile starts from."""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Final, NamedTuple

from busplan.buses.figure import MARGIN, Ink
from busplan.buses.network import Network
from busplan.elementwise import FIT_ROUNDING, Number

Value = int | float | str
"""A value of a profile's key."""


class TimingModel(NamedTuple):
    """One way to count the cycle of a kind of bus."""

    name: str
    meaning: str


class EventKind(NamedTuple):
    """How one kind of event, or a stretch of several, is called and drawn."""

    key: str
    label: str
    reference: str
    """Number of the equation that its time comes from, or where else it comes from."""
    mark: str
    """Its character in a terminal."""
    ink: Ink


IDLE: Final = EventKind("idle", "idle", MARGIN.reference, "~", "idle")
"""What is left of the slice."""


class Limit(NamedTuple):
    """What must not be exceeded. Its value never falls with the number of nodes."""

    key: str
    over: str
    """What is said of a broken one, a format of `value`, `most` and the profile's `bus`."""
    value: Callable[[Network], Number]
    most: Callable[[Network], Number]
    way_out: str = ""
    """What makes room where this limit keeps nodes out."""
    failure: str = ""
    """What a circle test calls a broken one, where not by its key."""
    has_rule: bool = False
    """A rule of the kind reports a broken one; otherwise the rule of the verdict does."""
    is_safety: bool = False
    """A cycle fits without it, but nothing is advised that breaks it."""
    says: Callable[[Network], str] | None = None
    """What is said of a broken one, where more than its value is: instead of `over`."""

    is_of_period: bool = False
    """The period alone breaks it: a plan takes no period that does."""
    slice_us: Callable[[Network], float] | None = None
    """The slice from which on plain numbers keep it, the slice ratio as it is, where a longer period is a cure [us];
    without it no period is."""

    def is_broken(self, network: Network) -> Number:
        """Whether a network breaks it: a truth, or an array of them."""
        return self.value(network) > self.bound(network)

    def bound(self, network: Network) -> Number:
        """The largest value that keeps it: `most`, but for the rounding of floats."""
        return self.most(network) * (1 + FIT_ROUNDING)

    def words(self, network: Network) -> str:
        """Say by how much a network breaks it."""
        if self.says is not None:
            return self.says(network)
        return self.over.format(value=self.value(network), most=self.most(network), bus=network.profile.bus)


class Starter(NamedTuple):
    """What of a new profile is a matter of the kind."""

    bus: str
    """Section [bus], as TOML without its nodes."""
    period: str = "1ms"
    """Communication period, unless another is asked for."""
    slice_ratio: str = "1            # the whole period is for communication"
    """Value of cycle.slice_ratio, with a comment."""
    measure: str = "measure it on a node"
    """How execution times are found, a format of `file`, the profile, and `group`, an option of `calibrate`."""
    base: str = "what a node does in each cycle"
    """What execution.base_us is."""


class Cost(IntEnum):
    """What a change of a network costs, the cheapest first: the one order of plans, of advice and of cures."""

    SIMULATION = 0
    """A number that the circle test alone knows."""
    REGISTER = 1
    """A number in the nodes, such as a gap count."""
    HOST_TIME = 2
    """The slice ratio: the host computes in the rest of the period."""
    RESPONSES = 3
    """How nodes answer: their firmware."""
    SCHEDULE = 4
    """How the host asks them: the firmware of all."""
    PAYLOAD = 5
    """What travels in a cycle."""
    PERIOD = 6
    """A requirement of the machine."""
    NODES = 7
    """Nodes that go to a second bus."""


class Setting(NamedTuple):
    """What of the bus a plan may turn without new parts."""

    name: str
    """What a user calls it who lets a plan turn it: gap_count."""
    label: str
    """What it is called in a sentence: gap count."""
    cost: Cost
    keys: tuple[str, ...]
    """Dotted keys that it turns."""
    values: tuple[Mapping[str, Value], ...]
    """What it may be for this very network and is not yet, safe and the smallest change first: new values by key."""
    reason: str = ""
    """Why there is none."""


class Perturbation(NamedTuple):
    """A small change of a profile, made to see what it does to the margin."""

    label: str
    changes: Mapping[str, Value]
    """New value by dotted key."""
    why_not: str = ""
    """Why it cannot be made here; empty where it can."""
    if_nothing: str = ""
    """Why the margin stays as it is, where it does."""


class PayloadRange(NamedTuple):
    """Payloads that a plan may choose from: the largest, and the step between them."""

    step_bytes: int
    most_bytes: int
    bound: str
    """What keeps the largest from being larger."""
    carrier: str = "a packet"
    """What carries no more."""


class Halves(NamedTuple):
    """What a measured latency holds beside the execution [us]."""

    latency_us: float
    """All of it."""
    request_and_acknowledge_us: float
    """Up to the first acknowledge."""
    shortest_us: float = 0.0
    """The bus waits so long whatever the node does: a shorter execution cannot be told from a latency."""

    @property
    def response_and_acknowledge_us(self) -> float:
        """Behind the execution."""
        return self.latency_us - self.request_and_acknowledge_us
