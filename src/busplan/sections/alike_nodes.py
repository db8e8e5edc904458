"""Nodes that are alike, whichever way a profile says them: in [node] and [payload], or in a section [[group]]."""

from typing import Any, NamedTuple

from busplan.elementwise import Number
from busplan.sections.transactions import TransactionKind


class AlikeNodes(NamedTuple):
    """Nodes that are alike, as a profile says them: in a section [[group]], or in [node] and [payload]."""

    name: str
    """Of the group; empty for the nodes of [node]."""
    nodes: Any
    """Number of nodes [1]."""
    node: Any
    """A node of the group, of its kind's own model: how it executes and answers."""
    payload: Any
    """Payloads of a node, of its kind's own model."""

    @property
    def nodes_key(self) -> str:
        """Dotted key of their number."""
        return f"group.{self.name}.nodes" if self.name else "bus.nodes"

    def node_key(self, key: str) -> str:
        """Dotted key of a node's value in the profile, as of "execution.base_us"."""
        return f"group.{self.name}.{key}" if self.name else f"node.{key}"

    def payload_key(self, kind: TransactionKind) -> str:
        """Dotted key that a payload is changed by first: what each axis adds, where it adds something."""
        key = self.payload.key_of(kind)
        return f"group.{self.name}.{key}" if self.name else f"payload.{key}"

    def bytes_of(self, kind: TransactionKind) -> Number:
        """Payload of a transaction with a node [bytes]."""
        size: Number = self.payload.bytes_of(kind, axes=self.node.axes)
        return size
