"""Inputs of a cycle: groups of nodes, the period, and the kind's own keys."""

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from math import lcm
from typing import TYPE_CHECKING, Any, NamedTuple

from busplan.elementwise import Number, is_everywhere, larger, total
from busplan.sections.machine import ProfileGroup

if TYPE_CHECKING:
    from busplan.buses.bus import Bus


class Rate(NamedTuple):
    """Rate of a group whose data go in every n-th cycle; of plain numbers."""

    every: int
    """n: one cycle in n has the data [1]."""
    first: int = 1
    """First cycle with the data, from 1 to n."""

    def is_due(self, number: int) -> bool:
        """Whether a cycle has the data; cycles are numbered from 1."""
        return (number - self.first) % self.every == 0


def hyperperiod(rates: Iterable[Rate]) -> int:
    """Cycles after which the groups repeat: the hyperperiod [1]."""
    return lcm(*(rate.every for rate in rates))


def numbers_by_due(rates: Sequence[Rate]) -> Mapping[tuple[bool, ...], tuple[int, ...]]:
    """Cycles of the hyperperiod, by which groups are due in them.

    Examples
    --------
    >>> numbers_by_due([Rate(1), Rate(3, first=2)])
    {(True, False): (1, 3), (True, True): (2,)}
    """
    numbers: dict[tuple[bool, ...], list[int]] = {}
    for number in range(1, hyperperiod(rates) + 1):
        numbers.setdefault(tuple(rate.is_due(number) for rate in rates), []).append(number)
    return {due: tuple(cycles) for due, cycles in numbers.items()}


class Group(NamedTuple):
    """Nodes that are alike. The numbers may be of any sort."""

    members: tuple[ProfileGroup, ...]
    """The profile's groups merged into this one: adjacent ones that differ only in name and number of nodes."""
    nodes: Number
    """Number of nodes [1]."""
    axes: Number
    """Axes of each node [1]."""
    read_bytes: Number
    """Payload that is read from each node [bytes]."""
    write_bytes: Number
    """Payload that is written to each node [bytes]."""
    read_execution_us: Number
    """Execution time of a read in the node [us]."""
    write_execution_us: Number
    """Execution time of a write in the node [us]."""
    worst_extra_us: Number = 0.0
    """Extra time of the slowest execution [us]."""
    read_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a read [us]."""
    write_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a write [us]."""

    @property
    def node(self) -> Any:
        """A node of the group, an object of the kind's own model: how it executes and answers."""
        return self.members[0].node

    @property
    def payload(self) -> Any:
        """Payloads of a node, an object of the kind's own model."""
        return self.members[0].payload

    @property
    def every(self) -> Number:
        """n: the data of the group are in every n-th cycle [1]."""
        number: Number = getattr(self.payload, "every", 1)
        return number

    @property
    def is_slower(self) -> bool:
        """Whether there are cycles without its data; of an array, at any point."""
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
    """Inputs of the cycle of a profile. The numbers may be of any sort: floats, arrays, traced numbers."""

    profile: Any
    """The profile, an object of the kind's own model. Its values may be numbers of any sort."""
    bus: "Bus"
    """The kind of bus."""
    groups: tuple[Group, ...]
    period_us: Number
    slice_ratio: Number
    nonperiodic_us: Number
    varied: str | None = None
    """Name of the profile's group that `with_nodes` changes; None where groups differ and none has been chosen."""

    @property
    def nodes(self) -> Number:
        """Distributed nodes N, host not counted [1]."""
        return total(group.nodes for group in self.groups)

    @property
    def axes(self) -> Number:
        """Axes of all nodes [1]."""
        return total(group.nodes * group.axes for group in self.groups)

    @property
    def largest_payload_bytes(self) -> Number:
        """The largest payload of any transaction [bytes]."""
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

    @property
    def varied_group(self) -> ProfileGroup:
        """The profile's group that `with_nodes` changes."""
        groups: tuple[ProfileGroup, ...] = self.profile.node_groups
        return next(group for group in groups if group.name == self.varied)

    def varying(self, name: str) -> "Network":
        """The same network, with the group of the profile chosen that `with_nodes` changes.

        Parameters
        ----------
        name
            Name of the group; empty for the nodes of [node].
        """
        return self._replace(varied=name)

    def with_nodes(self, nodes: Number) -> "Network":
        """The same network with another number of nodes in its varied group.

        Parameters
        ----------
        nodes
            Nodes of that group; of any sort [1].
        """
        return self._replace(groups=tuple(self._with_nodes(group, nodes) for group in self.groups))

    def _with_nodes(self, group: Group, nodes: Number) -> Group:
        others = [member.nodes for member in group.members if member.name != self.varied]
        if len(others) == len(group.members):
            return group
        return group._replace(nodes=total((nodes, *others)) if others else nodes)
