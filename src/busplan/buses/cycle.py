"""A cycle of any bus: events in the order of the wire, from which terms and timeline follow.

Each kind writes its cycle once, as runs: a run is a sequence of events, repeated for some rounds. Terms are sums over
runs and multiply by the rounds, so a million nodes cost no more than one. The timeline lays out every event of a run.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, Final, Literal, NamedTuple, TypeAlias

from busplan.buses.figure import REQUIRED, Figure, OwnFigures, term_name
from busplan.buses.network import Group, Network, Rate
from busplan.elementwise import Number, is_off, total
from busplan.sections.base import beside

Rounds: TypeAlias = Literal["all", "first", "but first"]
ALL: Final[Rounds] = "all"
FIRST: Final[Rounds] = "first"
BUT_FIRST: Final[Rounds] = "but first"


class Term(NamedTuple):
    """A part of the cycle; all terms add up to the time that the cycle needs."""

    key: str
    """Key of the term's figure."""
    us: Number
    rests_on: str = ""
    """Dotted key of the profile that alone sets the term; empty where several do, or none."""

    @property
    def name(self) -> str:
        """Short name: the key without prefix and unit."""
        return term_name(self.key)


class BusEvent(NamedTuple):
    """A stretch of the cycle that begins where the event before it ends; the events of a term add up to it."""

    kind: str
    """Key of its `EventKind`."""
    term: str
    """Key of the term that the event is a part of."""
    us: Number
    """Duration [us]: a float once the event is laid out; in a run also an array or a traced number."""
    label: str
    """Name of the event, with the node or device that causes it."""
    node: int | None = None
    """Node number, from 1, where the cycle is laid out; None for an event of the whole bus."""
    transaction: str | None = None
    """Key of the `EventKind` of the transaction or frame that the event is a part of. In a run of a group, an event
    without it belongs to no node.
    """
    packet: str | None = None
    """Packet of the transaction that the event belongs to."""
    rests_on: str = ""
    """Dotted key of the profile that alone sets the event; empty where several do, or none."""
    rounds: Rounds = ALL
    """Rounds of the run that have the event."""


class Run(NamedTuple):
    """A sequence of events, repeated for some rounds."""

    events: tuple[BusEvent, ...]
    """Events of a round, or of the mean round where rounds differ."""
    times: Number | None = None
    """Number of rounds [1]; None for a single round."""
    group: int | None = None
    """Index of the group whose nodes take turns, each for the same number of rounds; None for the whole bus."""
    laid_out: Callable[[Number], Iterable[BusEvent]] | None = None
    """Events of a round, by its number from 0: in more detail for a timeline, or for rounds that differ.

    Summed over all rounds they equal `events`. Where rounds differ, the function must also take a mean number, such as
    1.5.
    """

    def events_us(self) -> Iterator[tuple[str, Number]]:
        """Term and duration of each event of a single round [us], without events of no duration."""
        return ((event.term, event.us) for event in self.events if not is_off(event.us))

    def counted_us(self, times: Number) -> Iterator[tuple[str, Number]]:
        """Term and duration of all rounds together [us], one sum for the events with the same term and `rounds`."""
        parts: dict[tuple[str, Rounds], list[Number]] = {}
        for event in self.events:
            if not is_off(event.us):
                parts.setdefault((event.term, event.rounds), []).append(event.us)
        for (term, rounds), parts_us in parts.items():
            first_us = parts_us[0]
            are_equal = len(parts_us) > 1 and all(us is first_us for us in parts_us)
            round_us = len(parts_us) * first_us if are_equal else total(parts_us)  # A product is a shorter derivation.
            if rounds != FIRST:
                round_us = (times if rounds == ALL else times - 1) * round_us
            yield term, round_us


def summed(runs: Iterable[Run], keys: Iterable[str]) -> dict[str, Number]:
    """Time of each term: the sum of its events in the order of the runs, 0.0 for a term without events [us].

    An event whose term is not in `keys` raises KeyError.
    """
    sums: dict[str, Number | None] = dict.fromkeys(keys)
    for run in runs:
        for term, us in run.events_us() if run.times is None else run.counted_us(run.times):
            before_us = sums[term]
            sums[term] = us if before_us is None else before_us + us
    return {term: 0.0 if us is None else us for term, us in sums.items()}


class Doubt(NamedTuple):
    """An input of a cycle that is not known exactly."""

    key: str
    """Dotted key of the profile, or another name."""
    label: str
    us: Number
    """Standard uncertainty of the cycle due to this input: that of the input times the sensitivity [us]."""


class RestsOn(NamedTuple):
    """An assumption of a verdict about something that the profile does not give, or gives as measured."""

    key: str
    """Dotted key that would give it, or gives it; empty where no key does."""
    words: str
    """The assumption in a few words."""


class Premise(NamedTuple):
    """A row of a kind's table of assumptions, made while the profile does not give the key."""

    key: str
    """Dotted key, with "node" for each group; empty where no key gives it."""
    words: str
    usual: object = None
    """A value that a machine usually has, valid in a new profile."""
    applies: Callable[[Any], bool] = lambda cycle: True  # noqa: ARG005 - of every cycle
    """Whether the assumption matters in a cycle of plain numbers."""


SHARED_PREMISES: Final = (
    Premise("node.execution.worst_extra_us", "no slower execution", 5.0, lambda cycle: cycle.executes),
    Premise("cycle.nonperiodic_us", "no other traffic", 10.0, lambda cycle: bool(cycle.network.groups)),
)
"""Rows that every kind has."""


class BusLatency(NamedTuple):
    """A latency on the bus, part by part."""

    name: str
    payload_bytes: Number | None
    phases: Mapping[str, Number]
    """Figures by key, of the kind's `figures.latency_table`; infinite where the phase does not exist."""
    group: str = ""
    """Name of the group; empty where all nodes are alike."""

    @property
    def label(self) -> str:
        """Name of the latency, with that of its group."""
        return f"{self.group} {self.name}" if self.group else self.name


class BusCycle(ABC):
    """One communication cycle of a network under a timing model.

    The time that it needs does not depend on the period or the slice ratio, which set the time that it is given. So the
    smallest period and ratio follow from it.
    """

    network: Network
    number: int | None = None
    """Cycle of the hyperperiod (the common multiple of the rates), from 1; None for the cycle of the verdict."""
    term_figures: ClassVar[tuple[Figure, ...]]
    """Figures of the terms, in their order."""
    record: ClassVar[type[OwnFigures]]
    """Record of the `figures` and, where the network has a cycle, of the terms."""
    premises: ClassVar[tuple[Premise, ...]] = ()
    """Assumptions of the kind while a profile does not give a key, the most important first."""
    command_events: ClassVar[tuple[tuple[str | None, str], ...]] = ()
    """Transaction and kind of the events that bring a node its command, complete at the end of the last; empty if it is
    complete at the end of the cycle. Events without a node bring the command of all.
    """

    @property
    def rates(self) -> tuple[Rate, ...]:
        """Rate of each group, which sets the cycles that carry its data, in plain numbers."""
        return tuple(Rate(1) for _ in self.network.groups)

    @property
    def fullest(self) -> int:
        """First cycle of the hyperperiod in which most is sent, from 1, in plain numbers."""
        return 1

    def at(self, number: int) -> "BusCycle":  # noqa: ARG002 - most kinds have a single rate
        """Cycle `number` of the hyperperiod, from 1, in plain numbers."""
        return self

    @abstractmethod
    def written(self) -> Iterator[BusEvent | Run]:
        """The cycle in the order of the wire: single events, and runs. A part that is off takes 0.0 or is left out."""

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The cycle, written only once, so that terms and derivations hold the same number objects."""
        return tuple(part if isinstance(part, Run) else Run((part,)) for part in self.written())

    @cached_property
    def by_term(self) -> Mapping[str, Number]:
        """Time of each term by its key, in the order of the terms [us]."""
        return summed(self.runs, (figure.key for figure in self.term_figures))

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """All terms in their order, 0.0 where a term is off."""
        keys: dict[str, set[str]] = {}
        for event in chain.from_iterable(run.events for run in self.runs):
            keys.setdefault(event.term, set()).add(event.rests_on)
        alone = {term: min(causes) for term, causes in keys.items() if len(causes) == 1}
        return tuple(Term(key, us, alone.get(key, "")) for key, us in self.by_term.items())

    @cached_property
    def required_us(self) -> Number:
        """Time that the whole cycle needs, the sum of its terms: N times equation (2) of the paper [us]."""
        return total(self.by_term.values())

    @property
    def required_time_slice_us(self) -> Number:
        """Time slice that each node needs [us]."""
        return self.required_us / self.network.nodes

    @property
    def most_required_us(self) -> Number:
        """Upper bound of `required_us` over all smaller node counts [us]: one more node can shorten a cycle."""
        return self.required_us

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:  # noqa: ARG002 - most just grow by it
        """Growth of the whole cycle when its transmissions take longer [us].

        The growth `extra_us` of the transmissions comes on top of `after_us`, by which they already take longer.
        """
        return extra_us

    def bias_us(self) -> Number | None:
        """Mean time that the bus takes beyond the timing model [us]; None where it is unknown."""
        return None

    def possible_us(self) -> Number:
        """Part of the cycle that is only possible [us]: a cycle that fits without it may fit."""
        return 0.0

    def sync_jitter_us(self) -> Number:
        """Jitter of the synchronous packet from the traffic of the cycle, +/- about its mean [us]."""
        return 0.0

    def taking_us(self, group: Group) -> float:
        """Time from a command's arrival at a node to its effect: the slowest execution of a write [us]."""
        return float(group.slowest_us("write"))

    def sampled_us(self) -> float:
        """Time from the start of a cycle at which nodes sample the feedback that it carries, in plain numbers [us]."""
        return 0.0

    @property
    def takes_at_sync(self) -> bool:
        """Whether commands of a loop on the host take effect at the next synchronous point, not on arrival."""
        return bool(self.network.profile.servo.update == "next_sync")

    def loop_periods(self, *, at_sync: bool) -> int:
        """Whole periods inside a loop on the host, from the cycle of a sample to that of its command [1].

        With `at_sync`, commands take effect at the next synchronous point, and the wait for it counts. Otherwise they
        take effect on arrival, and the caller adds that time.
        """
        return 1 if at_sync else 0

    def host_lag_us(self) -> float:
        """Time of the host's adapter in a loop on the host that is in no cycle, in plain numbers [us]."""
        return 0.0

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubts of inputs that are not known exactly; different inputs are independent."""
        return ()

    @property
    def executes(self) -> bool:
        """Whether a node's execution time counts in any figure."""
        return True

    def rests_on(self) -> tuple[RestsOn, ...]:
        """A measured wake-up, and assumptions about keys that the profile does not give, the most important first."""
        return (
            *self._measured_wake_up(),
            *(
                RestsOn(key, premise.words)
                for premise in (*self.premises, *SHARED_PREMISES)
                if premise.applies(self)
                for key in self._not_given(premise.key)
            ),
        )

    def _measured_wake_up(self) -> Iterator[RestsOn]:
        key, bus = self.network.bus.key_of("wake-up"), self.network.profile.bus
        name = key.removeprefix("bus.")
        cycles = getattr(bus, beside(name, "cycles")) if key else None
        if cycles is not None and getattr(bus, name):
            yield RestsOn(beside(key, "cycles"), f"a wake-up measured, worst of {int(cycles):,} cycles")

    def _not_given(self, key: str) -> Iterator[str]:
        """Dotted keys behind a key of the table that the profile does not give, for each group; 0 counts as given."""
        section, _, name = key.partition(".")
        if section == "node":
            yield from (group.key(name) for group in self.network.groups if not _is_given(group.node, name))
        elif section == "message" and name:
            messages = self.network.profile.message
            yield from (f"message.{one.name}.{name}" for one in messages if not _is_given(one, name))
        elif not key or not _is_given(self.network.profile, key):
            yield key

    def events(self) -> Iterator[BusEvent]:
        """All events of the cycle, one by one, in plain numbers."""
        return chain.from_iterable(self.each_round())

    def each_round(self) -> Iterator[Iterable[BusEvent]]:
        """Events of each round, which nothing interrupts, in plain numbers."""
        for run in self.runs:
            count = 1 if run.times is None else int(run.times)
            first, rounds = self._turns(run)
            for number in range(count):
                yield _round(run, number, None if run.group is None else first + number // rounds)

    def _turns(self, run: Run) -> tuple[int, int]:
        """First node of a run, and number of rounds of each node, in plain numbers."""
        if run.group is None:
            return 1, 1
        nodes = [int(group.nodes) for group in self.network.groups]
        return sum(nodes[: run.group]) + 1, int(run.times or 1) // nodes[run.group]

    def arrival_us(self, node: int) -> float:
        """Time from the start of a cycle of plain numbers to the command of node `node`, which counts from 1 [us]."""
        arrived_us, now_us = None, 0.0
        for run in self.runs:
            first, rounds = self._turns(run)
            count = 1 if run.times is None else int(run.times)
            last = (node - first + 1) * rounds - 1 if run.group is not None else count - 1
            if 0 <= last < count:
                until_us = _until_us(run, last, self.command_events)
                if until_us is not None:
                    begins_us = now_us + _rounds_us(run, last)
                    arrived_us = begins_us + self.added_before_us(begins_us) + until_us
            now_us += _rounds_us(run, count)
        return now_us + self.added_before_us(now_us) if arrived_us is None else arrived_us

    def added_before_us(self, sent_us: float) -> float:  # noqa: ARG002 - most runs follow each other at once
        """Time of packets that the bus inserts between rounds, such as cycle starts of 1394, in plain numbers [us].

        `sent_us` is the time of the runs up to a round; packets inserted before that round count.
        """
        return 0.0

    def figures(self) -> Mapping[str, Number | None]:
        """Figures of this kind other than the terms, by key; None for a figure that these groups do not have."""
        return {}

    def card_lines(self, fits: Callable[[Network], bool]) -> tuple[tuple[str, str], ...]:  # noqa: ARG002 - not of all
        """Lines of this kind in the summary card of `capacity`, as labels and words, in plain numbers.

        `fits` tells whether a network is shown to fit, for lines on how much more still fits.
        """
        return ()

    def latencies(self) -> tuple[BusLatency, ...]:
        """Latencies on the bus; a kind without transactions has one, the cycle."""
        phases = {term.key: term.us for term in self.terms} | {REQUIRED.key: self.required_us}
        return (BusLatency("cycle", None, phases),)


def _is_given(section: Any, key: str) -> bool:
    """Whether a key stands in the profile."""
    *outer, name = key.split(".")
    for part in outer:
        section = getattr(section, part)
    return section is not None and name in section.model_fields_set


def _round(run: Run, number: int, node: int | None) -> Iterator[BusEvent]:
    """Events of a round, in plain numbers."""
    for event in run.events if run.laid_out is None else run.laid_out(number):
        if event.rounds == ALL or (event.rounds == FIRST) == (number == 0):
            has_node = node is not None and event.transaction is not None
            yield event._replace(node=node) if has_node else event


def _until_us(run: Run, number: int, commands: Container[tuple[str | None, str]]) -> float | None:
    """Time from the start of a round to the end of a command's last event [us]; None without a command."""
    if not any((event.transaction, event.kind) in commands for event in run.events):
        return None
    if len(run.events) == 1:
        return run.events[0].us
    until_us = now_us = 0.0
    for event in _round(run, number, None):
        now_us += event.us
        if (event.transaction, event.kind) in commands:
            until_us = now_us
    return until_us


def _rounds_us(run: Run, count: int) -> float:
    """Time of the first `count` rounds of a run [us]: `count` times their mean, in plain numbers."""
    if not count:
        return 0.0
    events: Iterable[BusEvent] = run.events
    # Rounds may differ, so the mean one is taken.
    if run.laid_out is not None and run.group is not None and len(run.events) > 1:
        events = run.laid_out((count - 1) / 2)
    counts = {ALL: count, FIRST: 1, BUT_FIRST: count - 1}
    return sum(counts[event.rounds] * event.us for event in events)
