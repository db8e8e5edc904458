"""A cycle of any bus: events in the order of the wire, from which terms and the timeline come.

Each kind writes its cycle once, as runs: a run is a sequence of events, repeated for some rounds. Terms are sums over
runs and multiply by the rounds, so a million nodes cost no more than one. The timeline lays out every event of a run.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, Final, Literal, NamedTuple, TypeAlias

from busplan.buses.figure import REQUIRED, Figure, term_name
from busplan.buses.network import Group, Network, Rate
from busplan.elementwise import Number, is_off, total

Rounds: TypeAlias = Literal["all", "first", "but first"]
ALL: Final[Rounds] = "all"
FIRST: Final[Rounds] = "first"
BUT_FIRST: Final[Rounds] = "but first"


class Term(NamedTuple):
    """A part of the cycle. All terms add up to what the cycle needs."""

    key: str
    """Key of its figure."""
    us: Number
    rests_on: str = ""
    """Dotted key of the profile that it comes from; empty unless it is a single key."""

    @property
    def name(self) -> str:
        """Short name: the key without prefix and unit."""
        return term_name(self.key)


class BusEvent(NamedTuple):
    """A stretch of the cycle; it begins where the one before it ends. The events of a term add up to it."""

    kind: str
    """Key of its `EventKind`."""
    term: str
    """Key of the term that it is a part of."""
    us: Number
    """Duration [us]: a float once it is laid out; in a run it may be an array or a traced number."""
    label: str
    """Name of the event, with the node or device that causes it."""
    node: int | None = None
    """Node number, from 1, where the cycle is laid out; None for an event of the whole bus."""
    transaction: str | None = None
    """Key of the `EventKind` of the transaction or frame that the event is a part of. In a run of a group, an event
    without it belongs to no node."""
    packet: str | None = None
    """Packet of the transaction that the event belongs to."""
    rests_on: str = ""
    """Dotted key of the profile that it comes from; empty unless it is a single key."""
    rounds: Rounds = ALL
    """Rounds of its run in which it happens."""


class Run(NamedTuple):
    """A sequence of events, repeated for some rounds."""

    events: tuple[BusEvent, ...]
    """Events of a round, or of the mean round where rounds differ."""
    times: Number | None = None
    """Number of rounds [1]; None for a single round."""
    group: int | None = None
    """Index of the group whose nodes take turns, each for the same number of rounds; None for the whole bus."""
    laid_out: Callable[[Number], Iterable[BusEvent]] | None = None
    """Gives the events of a round by its number, from 0: in more detail for a timeline, or for rounds that differ.

    Summed over all rounds they equal `events`. Where rounds differ, it must also take a mean number, such as 1.5.
    """

    def events_us(self) -> Iterator[tuple[str, Number]]:
        """Term and duration of each event of a single round, without events of no duration [us]."""
        return ((event.term, event.us) for event in self.events if not is_off(event.us))

    def counted_us(self, times: Number) -> Iterator[tuple[str, Number]]:
        """Term and duration of all rounds together, one sum for the events with the same term and `rounds` [us]."""
        parts: dict[tuple[str, Rounds], list[Number]] = {}
        for event in self.events:
            if not is_off(event.us):
                parts.setdefault((event.term, event.rounds), []).append(event.us)
        for (term, rounds), parts_us in parts.items():
            first_us = parts_us[0]
            are_equal = len(parts_us) > 1 and all(us is first_us for us in parts_us)
            round_us = len(parts_us) * first_us if are_equal else total(parts_us)  # a product is a shorter derivation
            if rounds != FIRST:
                round_us = (times if rounds == ALL else times - 1) * round_us
            yield term, round_us


def summed(runs: Iterable[Run], keys: Iterable[str]) -> dict[str, Number]:
    """Time of each term: the sum of its events in the order of the runs, 0.0 for a term without events [us].

    Parameters
    ----------
    runs
        The runs; an event whose term is not in `keys` raises a KeyError.
    keys
        Keys of the terms, in their order.
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
    """What a verdict takes for granted because the profile does not give it."""

    key: str
    """Dotted key that would give it; empty where no key does."""
    words: str
    """What is taken instead, in a few words."""


class Premise(NamedTuple):
    """A row of a kind's table of what is taken for granted while the profile does not give it."""

    key: str
    """Dotted key, with "node" for each group; empty where no key gives it."""
    words: str
    usual: object = None
    """A value that a machine usually has, valid in a new profile."""
    applies: Callable[[Any], bool] = lambda cycle: True  # noqa: ARG005 - of every cycle
    """Whether it plays a part in a cycle of plain numbers."""


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
    """Name of its group of nodes; empty where all nodes are alike."""

    @property
    def label(self) -> str:
        """Name with that of its group."""
        return f"{self.group} {self.name}" if self.group else self.name


class BusCycle(ABC):
    """One communication cycle of a network under a timing model.

    The time that it needs does not depend on the period or the slice ratio, which say what it is given. So the smallest
    period and ratio follow from it.
    """

    network: Network
    number: int | None = None
    """Which cycle of the hyperperiod (the common multiple of the rates) it is, from 1; None for that of the verdict."""
    term_figures: ClassVar[tuple[Figure, ...]]
    """One for each term, in their order."""
    premises: ClassVar[tuple[Premise, ...]] = ()
    """Table of the kind: what is taken for granted while a profile does not give it, what matters most first."""
    command_events: ClassVar[tuple[tuple[str | None, str], ...]] = ()
    """Transaction and kind of the events that bring a node its command, complete at the end of the last; empty if it is
    complete at the end of the cycle. Events without a node bring the command of all."""

    @property
    def rates(self) -> tuple[Rate, ...]:
        """The rate of each group: in which cycles its data are sent; of plain numbers."""
        return tuple(Rate(1) for _ in self.network.groups)

    @property
    def fullest(self) -> int:
        """The first cycle of the hyperperiod in which most is sent, from 1; of plain numbers."""
        return 1

    def at(self, number: int) -> "BusCycle":  # noqa: ARG002 - most kinds have a single rate
        """The cycle with a number, from 1; of plain numbers."""
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
        """Time of each term, by its key in the order of the terms [us]."""
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
        """Upper bound over all smaller node counts, where one node more can make a cycle shorter [us]."""
        return self.required_us

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:  # noqa: ARG002 - most just grow by it
        """Growth of the whole cycle if its transmissions take longer [us].

        Parameters
        ----------
        extra_us
            By how much it takes longer [us].
        after_us
            By how much it took longer before [us].
        """
        return extra_us

    def bias_us(self) -> Number | None:
        """Mean time that the bus takes in addition to the timing model [us]; None where it is unknown."""
        return None

    def possible_us(self) -> Number:
        """Part of the cycle that is only possible: without it, a cycle that fits is not shown not to fit [us]."""
        return 0.0

    def sync_jitter_us(self) -> Number:
        """Jitter of the synchronous packet due to the traffic of the cycle, +/- about its mean [us]."""
        return 0.0

    def taking_us(self, group: Group) -> float:
        """Time from a command's arrival at a node to its effect: the slowest execution of a write [us]."""
        return group.write_execution_us + group.worst_extra_us

    def sampled_us(self) -> float:
        """When nodes sample the feedback that a cycle carries, from its start; of plain numbers [us]."""
        return 0.0

    def loop_periods(self, *, at_sync: bool) -> int:
        """Whole periods inside a loop on the host, from the cycle of a sample to that of its command [1].

        Parameters
        ----------
        at_sync
            Whether commands take effect at the next synchronous point: the wait for it is counted. Otherwise they take
            effect on arrival, and the caller adds that time.
        """
        return 1 if at_sync else 0

    def doubts(self) -> tuple[Doubt, ...]:
        """Inputs that are not known exactly; different ones are independent."""
        return ()

    @property
    def executes(self) -> bool:
        """Whether the time that a node takes plays a part in any figure."""
        return True

    def rests_on(self) -> tuple[RestsOn, ...]:
        """What the profile does not give and is taken for granted; what matters most first."""
        return tuple(
            RestsOn(key, premise.words)
            for premise in (*self.premises, *SHARED_PREMISES)
            if premise.applies(self)
            for key in self._not_given(premise.key)
        )

    def _not_given(self, key: str) -> Iterator[str]:
        """Dotted keys behind a key of the table that the profile does not give, of each group; not even as 0."""
        section, _, name = key.partition(".")
        if section == "node":
            yield from (group.key(name) for group in self.network.groups if not _is_given(group.node, name))
        elif section == "message" and name:
            messages = self.network.profile.message
            yield from (f"message.{one.name}.{name}" for one in messages if not _is_given(one, name))
        elif not key or not _is_given(self.network.profile, key):
            yield key

    def events(self) -> Iterator[BusEvent]:
        """All events of the cycle, one by one; of plain numbers."""
        return chain.from_iterable(self.each_round())

    def each_round(self) -> Iterator[Iterable[BusEvent]]:
        """The events of each round, which are never interrupted; of plain numbers."""
        for run in self.runs:
            count = 1 if run.times is None else int(run.times)
            first, rounds = self._turns(run)
            for number in range(count):
                yield _round(run, number, None if run.group is None else first + number // rounds)

    def _turns(self, run: Run) -> tuple[int, int]:
        """First node of a run, and the number of rounds of each node; of plain numbers."""
        if run.group is None:
            return 1, 1
        nodes = [int(group.nodes) for group in self.network.groups]
        return sum(nodes[: run.group]) + 1, int(run.times or 1) // nodes[run.group]

    def arrival_us(self, node: int) -> float:
        """When a node has its command, from the start of a cycle of plain numbers [us].

        Parameters
        ----------
        node
            Number of the node, from 1.
        """
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
        """Time of packets that the bus inserts between rounds, such as cycle starts of 1394; of plain numbers [us].

        Parameters
        ----------
        sent_us
            Time of the runs up to a round [us]: what was inserted before it counts.
        """
        return 0.0

    def figures(self) -> Mapping[str, Number | None]:
        """Figures of this kind other than the terms, by key; None for a figure that these groups do not have."""
        return {}

    def card_lines(self, fits: Callable[[Network], bool]) -> tuple[tuple[str, str], ...]:  # noqa: ARG002 - not of all
        """Lines of this kind in the summary card of `capacity`: labels and words; of plain numbers.

        Parameters
        ----------
        fits
            Whether a network is shown to fit, for lines that say how much more still does.
        """
        return ()

    def latencies(self) -> tuple[BusLatency, ...]:
        """The latencies; a kind without transactions has one, the cycle."""
        phases = {term.key: term.us for term in self.terms} | {REQUIRED.key: self.required_us}
        return (BusLatency("cycle", None, phases),)


def _is_given(section: Any, key: str) -> bool:
    """Whether a key stands in the profile."""
    *outer, name = key.split(".")
    for part in outer:
        section = getattr(section, part)
    return section is not None and name in section.model_fields_set


def _round(run: Run, number: int, node: int | None) -> Iterator[BusEvent]:
    """The events of a round, of plain numbers."""
    for event in run.events if run.laid_out is None else run.laid_out(number):
        if event.rounds == ALL or (event.rounds == FIRST) == (number == 0):
            has_node = node is not None and event.transaction is not None
            yield event._replace(us=event.us, node=node if has_node else event.node)


def _until_us(run: Run, number: int, commands: Container[tuple[str | None, str]]) -> float | None:
    """From the start of a round to the end of the last event of a command [us]; None without a command."""
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
    """Time of the first `count` rounds of a run [us]: `count` times their mean; of plain numbers."""
    if not count:
        return 0.0
    events: Iterable[BusEvent] = run.events
    if run.laid_out is not None and run.group is not None and len(run.events) > 1:  # rounds may differ: the mean one
        events = run.laid_out((count - 1) / 2)
    counts = {ALL: count, FIRST: 1, BUT_FIRST: count - 1}
    return sum(counts[event.rounds] * event.us for event in events)
