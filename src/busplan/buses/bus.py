"""What an analysis may ask of a kind of bus.

An analysis asks a bus, never its keys. `terms`, `figures` and limits are written with operators and the functions of
`busplan.elementwise`, so that they serve floats, arrays and traced numbers alike. They branch on words, never on
numbers.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from busplan.buses.figure import NODES, REQUIRED, TIMING_MODEL, TRANSACTION, Figure
from busplan.buses.network import Group, Network
from busplan.buses.periods import ANY_PERIOD, Periods
from busplan.buses.rule import Rule
from busplan.elementwise import Number, plain
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.buses.published import EvidenceSection
    from busplan.sections.profile import Profile
    from busplan.sourced import Grade, Sourced
from busplan.buses.cycle import BusCycle, Term
from busplan.buses.parts import (
    IDLE,
    EventKind,
    Halves,
    Limit,
    PayloadRange,
    Perturbation,
    Setting,
    Starter,
    TimingModel,
    Value,
)


class Bus(ABC):
    """A kind of bus: no state, only answers."""

    kind: ClassVar[str]
    title: ClassVar[str]
    """What the kind is called."""
    timing_models: ClassVar[tuple[TimingModel, ...]]
    """In the order reports show them."""
    deciding_model: ClassVar[str]
    """The conservative timing model: the verdict is by this one, always."""
    term_figures: ClassVar[tuple[Figure, ...]]
    """One for each term, in the order of the wire."""
    capacity_figures: ClassVar[tuple[Figure, ...]]
    """Of `capacity`, in the order of its document; `figure.capacity_figures` puts them together."""
    setup_figures: ClassVar[tuple[Figure, ...]] = ()
    """Those of them that say how the bus is set."""
    compared_figures: ClassVar[tuple[Figure, ...]] = ()
    """Figures of its own that `diff` compares under each timing model."""
    planned_figures: ClassVar[tuple[str, ...]] = ()
    """Keys of its own figures that a plan's options show."""
    facts: ClassVar[tuple[str, ...]] = ()
    """Keys of the set-up figures that a page's heading shows."""
    safety: ClassVar[str] = "setting"
    """What an unsafe bus has set wrongly, in words."""
    safety_figure: ClassVar[Figure | None] = None
    """The figure that says whether every safety limit holds."""
    table_figures: ClassVar[tuple[Figure, ...]] = ()
    """Rows of its own in the table of `capacity`."""
    latency_table_figures: ClassVar[tuple[Figure, ...] | None] = None
    """Rows of the table of `latency`; without them its terms."""
    has_many_transactions: ClassVar[bool] = False
    """Whether the table of `latency` has a row for each transaction, and a column for each figure."""
    limits: ClassVar[tuple[Limit, ...]]
    """In the order in which they are reported; at least one grows with the nodes."""
    periods: ClassVar[Periods] = ANY_PERIOD
    """Communication periods that it knows. One that knows some alone has a limit and a rule of `known_period`."""
    clock_key: ClassVar[str] = ""
    """Key that says whether a clock is common to the nodes, where a profile may do without."""
    starter: "ClassVar[Starter]"
    """What a new profile starts from."""
    rules: ClassVar[tuple[Rule, ...]] = ()
    event_kinds: ClassVar[tuple[EventKind, ...]]
    """In the order of the cycle."""
    command_events: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Transaction and kind of the events that end with a node's command, the last of them; without them the whole
    cycle."""
    stretch_kinds: ClassVar[tuple[EventKind, ...]] = ()
    """What several events make together."""
    constants: ClassVar[Mapping[str, "Sourced"]] = {}
    """Its figures with a source, by name."""
    key_sources: ClassVar[Mapping[str, "Sourced"]] = {}
    """Keys of a profile whose default is a figure with a source."""
    key_grades: ClassVar[Mapping[str, "Grade"]] = {}
    """How well what a profile says of its keys can be known, where that is less than given."""
    key_symbols: ClassVar[Mapping[str, str]] = {}
    """What stands for its keys in formulas, where it is not by their name."""
    choosing_keys: ClassVar[tuple[str, ...]] = ("execution.grade",)
    """Keys of a node whose word chooses between numbers by `choose`, so that a derivation has them among its inputs."""
    warning_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that its warnings look at."""
    warning_constants: "ClassVar[tuple[Sourced, ...]]" = ()
    """Constants that its warnings look at."""
    loop_key: ClassVar[str] = ""
    """Key that puts whole periods into a loop on the host."""
    change_meanings: ClassVar[Mapping[str, str]] = {}
    """What a change of a key means on the machine, where the key does not say so."""
    reset_changes: ClassVar[Mapping[str, Value]] = {}
    """Keys as they are after a bus reset, until somebody sets them again."""
    cable_key: ClassVar[str] = ""
    """Key of the length of a cable [m]: of the bus, or of each node; empty where the kind has none."""
    host_keys: ClassVar[tuple[str, ...]] = ()
    """Keys of the host's own time in the cycle: what is assumed of it is no ground to rank a kind."""
    term_removals: ClassVar[tuple[Mapping[str, Value], ...]] = ()
    """What would take a term of its own out of the cycle, each new values by dotted key."""
    change_words: ClassVar[Mapping[str, str]] = {}
    """How a table of plans writes a key with its value: a format of the value."""

    evidence_data: ClassVar[tuple[str, ...]] = ()
    """Data files, in busplan/data, with figures of it that others have published or measured."""
    evidence_profiles: ClassVar[tuple[str, ...]] = ()
    """Shipped profiles that these figures are compared on."""
    model_error: ClassVar[str] = "how far the bus is from this timing model is not known"
    """What is known of the model that decides, where no bias of it is."""

    @abstractmethod
    def profile_model(self) -> "type[Profile]":
        """The model of its profiles."""

    @abstractmethod
    def cycle(self, network: Network, *, model: str) -> BusCycle:
        """The cycle of a network under one timing model."""

    def term_label(self, name: str | None) -> str:
        """What tables call a term, by its name beside the other terms; empty without one."""
        return next((one.label for one in self.term_figures if Term(one.key, 0.0).name == name), "")

    @property
    def latency_figures(self) -> tuple[Figure, ...]:
        """Of `latency`, in the order of its document."""
        return (TIMING_MODEL, TRANSACTION, NODES, *self.term_figures, REQUIRED)

    def latency_subject(self, network: Network) -> str:
        """Say whose latency it is."""
        return ", ".join(("the whole cycle", *self.setup_words(network)))

    def halves(self, network: Network, *, group: str, model: str, kind: str, payload_bytes: int) -> Halves:  # noqa: ARG002
        """What a transaction's packets take.

        Parameters
        ----------
        network
            The network.
        group
            Name of the group of nodes.
        model
            Timing model.
        kind
            Name of the transaction.
        payload_bytes
            Its payload [bytes].

        Raises
        ------
        BusplanError
            The kind has no transactions whose latency could be measured.
        """
        raise BusplanError(f"bus.kind {self.kind}: {self.title} has no transactions to find an execution time from")

    def fit_keys(self, network: Network, *, model: str | None) -> dict[str, Value]:  # noqa: ARG002 - a kind may have none
        """Keys of [node.execution] that say what an execution time was fitted against.

        Parameters
        ----------
        network
            The network that was measured.
        model
            Timing model whose packets were taken off; None where their time was measured.
        """
        return {}

    def cannot_express(self, network: Network, *, model: str) -> tuple[str, ...]:  # noqa: ARG002 - most can
        """Keys of a profile that a timing model has no term for: its figures are not applicable then."""
        return ()

    def has_execution(self, network: Network) -> bool:  # noqa: ARG002 - most have
        """Whether the cycle holds an execution time of the nodes."""
        return True

    def arrival_us(self, cycle: BusCycle, node: int) -> float:
        """When a node has its command, from the start of a cycle of plain numbers [us].

        The last of its `command_events` has ended then; what belongs to no one node is the command of all.

        Parameters
        ----------
        cycle
            The cycle.
        node
            Number of the node, from 1.
        """
        return cycle.arrival_us(node, self.command_events)

    def taking_us(self, group: Group, network: Network) -> float:  # noqa: ARG002 - most take commands alike
        """From a command's arrival at a node of a group to its effect: the slowest execution of a write [us]."""
        return plain(group.write_execution_us + group.worst_extra_us)

    def sampled_us(self, cycle: BusCycle) -> float:  # noqa: ARG002 - most sample when the cycle starts
        """When nodes sample what a loop on the host rests on, from the start of the cycle that carries it [us].

        Parameters
        ----------
        cycle
            A cycle of plain numbers.
        """
        return 0.0

    def loop_periods(self, network: Network, *, at_sync: bool) -> int:  # noqa: ARG002 - most read and write in a cycle
        """Whole periods inside a loop on the host, from the cycle of a sample to that of its command [1].

        Parameters
        ----------
        network
            The network, of plain numbers.
        at_sync
            Whether commands take effect at the next synchronous point, which is counted; otherwise they do when they
            arrive, which comes on top.
        """
        return 1 if at_sync else 0

    def acts_at_once(self, network: Network) -> bool:  # noqa: ARG002 - most have a synchronous packet
        """Whether the nodes take their set-points at one time; otherwise each does when it has its own."""
        return True

    def sync_jitter_us(self, network: Network) -> Number:  # noqa: ARG002 - most have none
        """Jitter of the synchronous packet that its own traffic makes, either way of its mean [us]."""
        return 0.0

    def shortest_period_us(self, network: Network, needed_us: Number) -> Number:
        """The shortest period that gives a cycle its time, of those that the bus knows; infinite where none does [us].

        A kind with a limit that a longer period keeps adds what that asks for, where operators alone give it and the
        limit has no share of the period.

        Parameters
        ----------
        network
            The network; its own period plays no part. Its numbers may be of any sort.
        needed_us
            What the cycle needs [us].
        """
        return self.periods.from_us(needed_us / network.slice_ratio)

    def latency_has_execution(self, network: Network) -> bool:
        """Whether a latency holds an execution time of the nodes."""
        return self.has_execution(network)

    def settings(self, network: Network) -> tuple[Setting, ...]:  # noqa: ARG002 - a kind may have none
        """What of the bus a plan may turn; it is asked again after each change of the network."""
        return ()

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:  # noqa: ARG002 - a kind may have none
        """Small changes that only this kind of bus has, beside those of every kind."""
        return ()

    @abstractmethod
    def payloads(self, network: Network) -> PayloadRange:
        """Payloads that a plan may choose from."""

    def way_charged(self, network: Network) -> str:  # noqa: ARG002 - most charge all alike
        """Say which way on the wire each node is charged."""
        return "every node alike"

    def setup_words(self, network: Network) -> tuple[str, ...]:  # noqa: ARG002 - a kind may have none
        """How the bus is set, each in a few words."""
        return ()

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:  # noqa: ARG002 - a kind may have none
        """What to beware of, whatever the verdict, with each of some numbers of nodes on the bus."""
        return []

    def evidence(
        self,
        networks: Mapping[str, Network],  # noqa: ARG002 - a kind may have none
        published: Mapping[str, Mapping[str, Any]],  # noqa: ARG002
    ) -> "tuple[EvidenceSection, ...]":
        """Compare figures that others have published or measured with what its equations give.

        Parameters
        ----------
        networks
            Those of `evidence_profiles`, by name.
        published
            What each of `evidence_data` holds, by name.
        """
        return ()

    def limit(self, key: str) -> Limit | None:
        """The limit of a key; None for time, which is no limit of the bus."""
        return next((one for one in self.limits if one.key == key), None)

    def broken(self, network: Network) -> tuple[Limit, ...]:
        """The limits that plain numbers break, but for safety."""
        return tuple(one for one in self.limits if not one.is_safety and one.is_broken(network))

    def is_safe(self, network: Network) -> bool:
        """Whether plain numbers keep every safety limit."""
        return not any(one.is_broken(network) for one in self.limits if one.is_safety)

    def event_kind(self, key: str) -> EventKind:
        """How an event or a stretch of events is called and drawn."""
        return next(one for one in (*self.event_kinds, IDLE, *self.stretch_kinds) if one.key == key)
