"""What a cycle is computed from: groups of nodes, the period, and the kind's own keys."""

from functools import reduce
from typing import Any, NamedTuple

from busplan.elementwise import Number, larger, total


class Group(NamedTuple):
    """Nodes that are alike. The numbers may be of any sort."""

    node: Any
    """What the profile says of one of them, of its kind's own model: how it executes and answers."""
    nodes: Number
    """How many [1]."""
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
    """What the slowest execution takes beyond these [us]."""
    read_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a read [us]."""
    write_uncertainty_us: Number = 0.0
    """Standard uncertainty of the execution time of a write [us]."""
    name: str = ""
    """Name of the group; empty for the nodes of [node]."""
    payload: Any = None
    """What the profile says of the payload of one of them, of its kind's own model."""

    def key(self, name: str) -> str:
        """Dotted key of what the profile says of its nodes.

        Parameters
        ----------
        name
            The key within it, as "execution.worst_extra_us".
        """
        return f"group.{self.name}.{name}" if self.name else f"node.{name}"


class Network(NamedTuple):
    """A profile as its cycle sees it. The numbers may be of any sort: plain, arrays, traced, polynomials."""

    profile: Any
    """The profile, of its kind's own model. Its values may be numbers of any sort."""
    groups: tuple[Group, ...]
    period_us: Number
    slice_ratio: Number
    nonperiodic_us: Number

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

    def with_nodes(self, nodes: Number) -> "Network":
        """The same network with another number of nodes in its one group."""
        (group,) = self.groups
        return self._replace(groups=(group._replace(nodes=nodes),))
