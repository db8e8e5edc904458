"""Inputs of a cycle: groups of nodes, the period, and the kind's own keys."""

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from math import lcm
from typing import TYPE_CHECKING, Any, NamedTuple

from busplan.elementwise import Number, choose, is_everywhere, larger, total
from busplan.sections.base import TransactionKind
from busplan.sections.machine import ProfileGroup

if TYPE_CHECKING:
    from busplan.buses.bus import Bus


class Rate(NamedTuple):
    """Rate of a group that has data in every n-th cycle, in plain numbers."""

    every: int
    """Distance n of the cycles with its data [cycles]."""
    first: int = 1
    """First cycle with the data, from 1 to n."""

    def is_due(self, number: int) -> bool:
        """Whether a cycle has the data; cycles are numbered from 1."""
        return (number - self.first) % self.every == 0


def hyperperiod(rates: Iterable[Rate]) -> int:
    """Number of cycles after which the groups repeat, the hyperperiod [1]."""
    return lcm(*(rate.every for rate in rates))


def numbers_by_due(rates: Sequence[Rate]) -> Mapping[tuple[bool, ...], tuple[int, ...]]:
    """Cycles of the hyperperiod, by the groups that are due in them.

    Examples
    --------
    >>> numbers_by_due([Rate(1), Rate(3, first=2)]), numbers_by_due([])
    ({(True, False): (1, 3), (True, True): (2,)}, {(): (1,)})
    """
    cycles, numbers = range(1, hyperperiod(rates) + 1), dict[tuple[bool, ...], list[int]]()
    of_rate = {rate: [rate.is_due(number) for number in cycles] for rate in set(rates)}
    for number, due in zip(cycles, zip(*map(of_rate.get, rates), strict=True) if rates else [()], strict=True):
        numbers.setdefault(due, []).append(number)
    return {due: tuple(cycles) for due, cycles in numbers.items()}


class Group(NamedTuple):
    """Nodes that are alike; floats, arrays or traced numbers."""

    members: tuple[ProfileGroup, ...]
    """Groups of the profile that this one merges: adjacent ones that differ only in name and number of nodes."""
    nodes: Number
    axes: Number
    """Axes of each node [1]."""
    read_bytes: Number
    """Payload that is read from each node [bytes]."""
    write_bytes: Number
    """Payload that is written to each node [bytes]."""
    read_execution_us: Number
    """Execution time of a read in a node [us]."""
    write_execution_us: Number
    """Execution time of a write in a node [us]."""
    worst_extra_us: Number = 0.0
    """Extra time of the slowest execution [us]."""
    read_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a read [us]."""
    write_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a write [us]."""

    def bytes_of(self, kind: TransactionKind) -> Number:
        """Payload of a transaction with each node [bytes]."""
        return self.read_bytes if kind == "read" else self.write_bytes

    def nodes_with(self, kind: TransactionKind) -> Number:
        """Nodes that have data in a direction: all or, where it has 0 bytes, none [1]."""
        return self.if_any(kind, self.nodes)

    def has(self, kind: TransactionKind) -> bool:
        """Whether there are data in a direction; in an array, at any point."""
        return not is_everywhere(self.bytes_of(kind) <= 0)

    def if_any(self, kind: TransactionKind, number: Number) -> Number:
        """A number of a direction with data; 0 where there are none."""
        if not self.has(kind):
            return 0
        has_data: Number = self.bytes_of(kind) > 0
        return number if is_everywhere(has_data) else choose(has_data, number, 0)

    def slowest_us(self, kind: TransactionKind) -> Number:
        """Execution time of the slowest read or write; 0 where there is none [us]."""
        us = self.read_execution_us if kind == "read" else self.write_execution_us
        return self.if_any(kind, us + self.worst_extra_us)

    @property
    def node(self) -> Any:
        """A node of the group, an object of the kind's own model, with its execution and answers."""
        return self.members[0].node

    @property
    def payload(self) -> Any:
        """Payloads of a node, an object of the kind's own model."""
        return self.members[0].payload

    @property
    def every(self) -> Number:
        """Distance n of the cycles with the group's data [cycles]."""
        number: Number = getattr(self.payload, "every", 1)
        return number

    @property
    def is_slower(self) -> bool:
        """Whether there are cycles without its data; in an array, at any point."""
        return not is_everywhere(self.every <= 1)

    @property
    def name(self) -> str:
        """Name of the group, or names of its members; empty for the nodes of [node]."""
        return " and ".join(nodes.name for nodes in self.members)

    def key(self, name: str) -> str:
        """Dotted key in the profile for a key of [node], such as "execution.worst_extra_us"."""
        return self.members[0].node_key(name)

    def payload_key(self, name: str) -> str:
        """Dotted key in the profile for a key of [payload], such as "every"."""
        return f"group.{self.members[0].name}.{name}" if self.members[0].name else f"payload.{name}"


class Network(NamedTuple):
    """Inputs of the cycle of a profile: floats, arrays or traced numbers."""

    profile: Any
    """The profile, an object of the kind's own model; its numbers are floats, arrays or traced numbers."""
    bus: "Bus"
    groups: tuple[Group, ...]
    period_us: Number
    slice_ratio: Number
    nonperiodic_us: Number

    @property
    def nodes(self) -> Number:
        """Number N of distributed nodes, host not counted [1]."""
        return total(group.nodes for group in self.groups)

    @property
    def axes(self) -> Number:
        """Axes of all nodes [1]."""
        return total(group.nodes * group.axes for group in self.groups)

    @property
    def largest_payload_bytes(self) -> Number:
        """Largest payload of any transaction [bytes]."""
        sizes = [size for group in self.groups for size in (group.read_bytes, group.write_bytes)]
        return reduce(larger, sizes)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the profile's groups, in the order of the chain; a single empty name for the nodes of [node]."""
        return tuple(group.name for group in self.profile.node_groups)

    @property
    def is_uniform(self) -> bool:
        """Whether the profile has no groups: all nodes are those of [node]."""
        return self.names == ("",)

    def group_named(self, name: str) -> ProfileGroup:
        """A group of the profile, with its own number of nodes; an empty name for the nodes of [node]."""
        groups: tuple[ProfileGroup, ...] = self.profile.node_groups
        return next(group for group in groups if group.name == name)

    def with_nodes(self, nodes: Number, *, group: str = "") -> "Network":
        """The network with another number of nodes in a group of the profile; this object with its own number [1]."""
        own = self.group_named(group).nodes
        if isinstance(own, int) and isinstance(nodes, int) and nodes == own:
            return self
        return self._replace(groups=tuple(_with_nodes(run, group, nodes) for run in self.groups))


def _with_nodes(run: Group, name: str, nodes: Number) -> Group:
    """A run of groups with another number of nodes in the one of a name, if it has that."""
    others = [member.nodes for member in run.members if member.name != name]
    if len(others) == len(run.members):
        return run
    return run._replace(nodes=total((nodes, *others)) if others else nodes)
