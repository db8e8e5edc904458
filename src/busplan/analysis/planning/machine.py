"""What planning reads and writes of a profile's nodes and payloads: the one place that knows their keys."""

from collections.abc import Collection, Mapping
from math import ceil
from typing import Final

from busplan.analysis.network import network_of
from busplan.buses.bus import Value
from busplan.sections.profile import Profile
from busplan.sections.transactions import TRANSACTION_KINDS

Changes = Mapping[str, Value]
"""New values of a profile by dotted key."""
NODES_KEYS: Final = ("bus.nodes",)
PAYLOAD_KEYS: Final = tuple(f"payload.{kind}_bytes{part}" for kind in TRANSACTION_KINDS for part in ("", "_per_axis"))


def nodes_for_axes(profile: Profile, axes: int) -> int:
    """Nodes that a number of axes takes, with the profile's axes of each node [1]."""
    return ceil(axes / profile.node.axes)


def with_nodes(nodes: int) -> Changes:
    """The change to a number of nodes [1]."""
    return {"bus.nodes": nodes}


def asked_nodes(profile: Profile) -> dict[str, int]:
    """Nodes that [limits] asks the bus to carry, its own among them, by the key that asks [1]."""
    limits, network = profile.limits, network_of(profile)
    nodes, axes = int(network.nodes), int(network.axes)
    found = {}
    if limits.min_spare_nodes is not None:
        found["limits.min_spare_nodes"] = nodes + limits.min_spare_nodes
    if limits.min_spare_axes is not None:
        found["limits.min_spare_axes"] = max(nodes, nodes_for_axes(profile, axes + limits.min_spare_axes))
    return found


def with_payload_within(profile: Profile, most_bytes: int, *, kept: Collection[str] = ()) -> Changes | None:
    """The change to payloads of so many bytes or less; empty where they are, None where no payload would be left.

    Parameters
    ----------
    profile
        The network.
    most_bytes
        The most that a transaction may carry, what all axes of its node add among it [bytes].
    kept
        Keys that must stay.
    """
    payload, axes = profile.payload, profile.node.axes
    found: dict[str, Value] = {}
    for kind in TRANSACTION_KINDS:
        over = int(payload.bytes_of(kind, axes=axes)) - most_bytes
        key = payload.key_of(kind)
        if over > 0 and key not in kept:
            each = axes if key.endswith("_per_axis") else 1
            found[key] = getattr(payload, key.removeprefix("payload.")) - ceil(over / each)
    return found if all(int(value) > 0 for value in found.values()) else None


def with_payload(profile: Profile, size_bytes: int) -> Changes | None:
    """The change to one payload for reads and writes alike [bytes]; None where it follows the axes of a node."""
    if profile.payload.follows_axes:
        return None
    return {f"payload.{kind}_bytes": size_bytes for kind in TRANSACTION_KINDS}
