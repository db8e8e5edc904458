"""MDT and AT of a network on SERCOS III, filled as the master does."""

from typing import Final, NamedTuple

from busplan.buses.network import Group, Network
from busplan.buses.sercos import word_bytes
from busplan.buses.sercos3.equations import (
    ALIGNED_BYTES,
    CHANNEL_BYTES,
    CONNECTION_BYTES,
    DEVICE_BYTES,
    EXTENDED_BYTES,
    HOT_PLUG_BYTES,
    Filling,
    Items,
    filled,
)
from busplan.elementwise import Number, alike
from busplan.sections.transactions import TransactionKind

SORTS: Final[dict[TransactionKind, str]] = {"write": "mdt", "read": "at"}
"""Which telegrams carry a node's payloads, in the order of the cycle."""


class Telegrams(NamedTuple):
    """All MDT or all AT of a network. The numbers may be of any sort."""

    first_bytes: Number
    """Fields at the start of the first telegram [bytes]."""
    next_bytes: Number
    """Fields at the start of each further telegram [bytes]."""
    items: tuple[Items, ...]
    """Service channels, control or status, then the data of each group."""
    name: str
    """Name in a derivation."""

    @property
    def filling(self) -> Filling:
        """The telegrams, filled."""
        return filled(self.items, first_bytes=self.first_bytes, next_bytes=self.next_bytes, name=self.name)


def telegrams_of(network: Network, kind: TransactionKind) -> Telegrams:
    """The telegrams that carry one of a node's payloads.

    Parameters
    ----------
    network
        The network.
    kind
        "write" for MDT, "read" for AT.
    """
    is_in_all = network.profile.bus.hot_plug_field == "all"
    first_bytes = alike(HOT_PLUG_BYTES, network.nodes)
    if kind == "write":
        first_bytes = first_bytes + EXTENDED_BYTES + (ALIGNED_BYTES if is_in_all else 0)
    return Telegrams(
        first_bytes,
        HOT_PLUG_BYTES if is_in_all else 0,
        (
            Items(network.nodes, CHANNEL_BYTES),
            Items(network.nodes, DEVICE_BYTES),
            *(Items(group.nodes, data_bytes(network, size)) for group, size in sizes(network, kind)),
        ),
        SORTS[kind].upper(),
    )


def sizes(network: Network, kind: TransactionKind) -> list[tuple[Group, Number]]:
    """Each group of nodes with its payload [bytes]."""
    return [(group, group.write_bytes if kind == "write" else group.read_bytes) for group in network.groups]


def data_bytes(network: Network, payload_bytes: Number) -> Number:
    """Cyclic data of a device in whole words, with the control of its connection [bytes]."""
    words: Number = word_bytes(payload_bytes)
    return words + CONNECTION_BYTES if has_connections(network) else words


def has_connections(network: Network) -> bool:
    """Tell whether the cyclic data of a device are a connection with a control of its own: from V1.1 on."""
    return bool(network.profile.bus.version != "V1.0")
