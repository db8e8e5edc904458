"""Interface of a kind of bus: all questions that an analysis may ask of it.

An analysis calls these methods and never reads a kind's own keys. Cycles, figures and limits use operators and the
functions of `busplan.elementwise`, so they take floats, arrays and traced numbers; they branch on strings only. A
function "in plain numbers" takes floats alone.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from busplan.buses.cycle import BusCycle
from busplan.buses.emulation import Emulator
from busplan.buses.figure import BusFigures
from busplan.buses.hosts import KnownHost, hosts
from busplan.buses.limits import ANY_PERIOD, Limit, Periods
from busplan.buses.network import Network
from busplan.buses.parts import (
    IDLE,
    EventKind,
    Key,
    KeyRole,
    MeasuredLatencies,
    PayloadRange,
    Perturbation,
    Safety,
    Setting,
    Starter,
    TimingModel,
    Value,
)
from busplan.buses.rule import Recorded, Rule
from busplan.buses.waterfall import RecordedCycles
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.sourced import Constants

if TYPE_CHECKING:
    from pathlib import Path

    from busplan.sections.profile import Profile


class Bus(ABC):
    """A kind of bus; it has no state."""

    kind: ClassVar[str]
    title: ClassVar[str]
    """Name of the kind in texts."""
    also_called: ClassVar[tuple[str, ...]] = ()
    """Further names that users type; case, spaces and punctuation do not count."""
    timing_models: ClassVar[tuple[TimingModel, ...]]
    """Timing models in the order of reports. The first is the conservative one, which always gives the verdict."""
    figures: ClassVar[BusFigures]
    safety: ClassVar[Safety] = Safety()
    limits: ClassVar[tuple[Limit, ...]]
    """Limits in the order of reports; at least one grows with the nodes."""
    periods: ClassVar[Periods] = ANY_PERIOD
    """Periods that the bus allows; a kind with a list has a `period_limit` and a rule on `unknown_period`."""
    starter: ClassVar[Starter]
    """Defaults of a new profile."""
    rules: ClassVar[tuple[Rule, ...]] = ()
    event_kinds: ClassVar[tuple[EventKind, ...]]
    """Kinds of events in the order of the cycle."""
    stretch_kinds: ClassVar[tuple[EventKind, ...]] = ()
    """Kinds of stretches, each a sequence of events, such as a transaction or a frame."""
    rate_keys: ClassVar[tuple[str, ...]] = ()
    """Bit rates that a profile gives [kbit/s]: all times on the wire follow from them."""
    constants: ClassVar[Constants] = Constants()
    """Constants of the kind, each with its source, by name."""
    keys: ClassVar[Mapping[str, Key]] = {}
    """Facts about the kind's own keys, by dotted key; those of [[group]] stand under `node.` or `payload.`."""
    calibration: ClassVar[MeasuredLatencies | None] = None
    """Calibration of execution times from measured latencies; None where latencies do not show them."""
    recordings: ClassVar[str] = ""
    """Recordings that the kind compares with a plan, for messages; empty if it reads none."""
    term_removals: ClassVar[tuple[Mapping[str, Value], ...]] = ()
    """Changes that each take a term out of the cycle: new values by dotted key."""
    modules: ClassVar[tuple[str, ...]] = ()
    """Further modules, each imported by one command: `evidence` with `FUNCTIONS`, `emulated` with `EMULATOR`."""
    evidence_data: ClassVar[tuple[str, ...]] = ()
    """Data files in busplan/data with figures of the kind that others have published or measured."""

    @property
    def deciding_model(self) -> str:
        """Name of the timing model that gives the verdict."""
        return self.timing_models[0].name

    def profile_model(self) -> "type[Profile]":
        """Pydantic model of its profiles: `PROFILE` of module `section`, imported only here since it loads pydantic."""
        module = type(self).__module__.removesuffix("kind")
        model: type[Profile] = import_module(f"{module}section").PROFILE
        return model

    @abstractmethod
    def cycle(self, network: Network, *, model: str) -> BusCycle:
        """Cycle of a network under a timing model."""

    def latency_subject(self, network: Network) -> str:
        """Words for the way that the latencies cover, and for the settings in force."""
        return ", ".join(("the whole cycle", *self.setup_words(network)))

    def evidence_for(self, network: Network) -> tuple[str, ...]:  # noqa: ARG002 - most are tested as a whole
        """Data files whose figures test such a network."""
        return self.evidence_data

    def cannot_express(self, network: Network, *, model: str) -> tuple[str, ...]:  # noqa: ARG002 - most can
        """Keys in the profile for which a timing model has no term; with any, the model does not apply."""
        return ()

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - most have
        """Whether the cycle contains an execution time of the nodes; with `of_latency`, whether a latency does."""
        return True

    def key_of(self, role: KeyRole) -> str:
        """Dotted key with a role; empty where the kind has none."""
        return next((name for name, key in self.keys.items() if key.role == role), "")

    def hosts(self, variant: str = "") -> dict[str, KnownHost]:
        """Hosts that a new profile may have, by name: those of which its keys can say all that is known."""
        timed = {name: host for name, host in hosts().items() if self.kind in host.own_us}
        has_jitter = self.key_of("wake-up") and variant not in self.starter.without_wake_up
        return timed or {name: host for name, host in hosts().items() if host.jitter_us and has_jitter}

    def new_section(self, host: str | None = None, variant: str = "") -> str:
        """Section [bus] of a new profile, without its nodes, with the lines of a host, by default the kind's usual."""
        name = host or self.starter.host
        keys = {"own": self.key_of("host"), "jitter": self.key_of("wake-up")}
        return self.starter.section(hosts()[name].lines(self.kind, **keys) if name else (), variant)

    def settings(self, network: Network) -> tuple[Setting, ...]:  # noqa: ARG002 - a kind may have none
        """Settings of the bus that a plan may change; asked again after each change of the network."""
        return ()

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:  # noqa: ARG002 - a kind may have none
        """Small changes for the sensitivity of this kind, in addition to those of every kind."""
        return ()

    @abstractmethod
    def payloads(self, network: Network) -> PayloadRange:
        """Payloads that a plan may choose from."""

    def setpoints_every(self, network: Network) -> tuple[str, int]:
        """Cycles between set-points of the fastest axes that get commands: the key that sets them, and their number."""
        with_axes = [group for group in network.groups if group.axes and group.has("write")] or network.groups
        fastest = min(with_axes, key=lambda group: group.every)
        return fastest.payload_key("every"), int(fastest.every)

    def counted(self, network: Network) -> tuple[tuple[int, str], ...]:
        """Size of a network in plain numbers, each with its noun."""
        return (int(network.nodes), "node"), (int(network.axes), "axis")

    def path_words(self, network: Network) -> str:  # noqa: ARG002 - a kind may have a single way
        """Words for the distance on the wire that each node is charged with, where the kind has a choice."""
        return ""

    def setup_words(self, network: Network) -> tuple[str, ...]:  # noqa: ARG002 - a kind may have none
        """Settings in force, each in a few words."""
        return ()

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:  # noqa: ARG002 - a kind may have none
        """Warnings that do not depend on the verdict, for each number of nodes in `nodes`."""
        return []

    def evidence_functions(self) -> Mapping[str, Callable[..., Any]]:
        """Functions by the name that a row of evidence has; each takes a cycle and the values of the row."""
        return self._of("evidence", "FUNCTIONS") or {}

    def title_of(self, network: Network) -> str:  # noqa: ARG002 - of every network the same, unless a kind has several
        """Name of the network's bus, for people."""
        return self.title

    def recorded(
        self,
        network: Network,  # noqa: ARG002 - a kind may have none
        path: "Path",
        *,
        share: float,  # noqa: ARG002
        channel: str | None,  # noqa: ARG002
        progress: Progress,  # noqa: ARG002
    ) -> Recorded:
        """Comparison of a recording of the machine with the plan.

        `network` has plain numbers. `share` is the quantile of the events for worst cases, 0.5..1. `channel` names the
        one that is compared, in a recording of several. `progress` is called with the bytes read and the size of the
        file [bytes]. Raises `BusplanError` where the file is no recording of the kind, or the kind reads none.
        """
        latencies = "; latencies in a CSV file are for busplan calibrate" if self.calibration else ""
        raise BusplanError(f"{path}: busplan reads no recordings of bus.kind {self.kind}{latencies}")

    def recorded_cycles(
        self,
        network: Network,  # noqa: ARG002 - a kind may have none
        path: "Path",
        *,
        channel: str | None,  # noqa: ARG002
        progress: Progress,  # noqa: ARG002
    ) -> RecordedCycles:
        """The whole cycles of a recording beside those of the plan; arguments and errors as in `recorded`."""
        raise BusplanError(f"{path}: busplan reads no recordings of bus.kind {self.kind}")

    def emulator(self) -> Emulator | None:
        """Emulator of the kind; None if it writes no recordings."""
        emulator: Emulator | None = self._of("emulated", "EMULATOR")
        return emulator

    def _of(self, module: str, name: str) -> Any:
        """Object of a further module by name, imported only here; None where the kind has no such module."""
        package = type(self).__module__.removesuffix("kind")
        return getattr(import_module(f"{package}{module}"), name) if module in self.modules else None

    def limit(self, key: str) -> Limit | None:
        """Limit by its key; None for time, which is no limit of the bus."""
        return next((limit for limit in self.limits if limit.key == key), None)

    def broken(self, network: Network) -> tuple[Limit, ...]:
        """Limits that a network breaks, safety limits left out, in plain numbers."""
        return tuple(limit for limit in self.limits if limit.role != "safety" and limit.is_surely_broken(network))

    def is_safe(self, network: Network) -> bool:
        """Whether a network keeps every safety limit, in plain numbers."""
        return not any(limit.is_surely_broken(network) for limit in self.limits if limit.role == "safety")

    def event_kind(self, key: str) -> EventKind:
        """Name and colour of an event or a stretch of events."""
        return next(kind for kind in (*self.event_kinds, IDLE, *self.stretch_kinds) if kind.key == key)
