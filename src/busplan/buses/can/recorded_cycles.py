"""PDOs of a CAN log beside the SYNCs that asked for them, emergencies, and the names of those who send them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from math import inf, isfinite
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.can.due import due_pdos
from busplan.buses.can.equations import BASE_BITS
from busplan.buses.can.streams import Stream
from busplan.buses.can.traffic import SYNC
from busplan.buses.network import Network
from busplan.english import plural
from busplan.recordings.can import CanFrames
from busplan.recordings.can_timing import SentFrames
from busplan.recordings.statistics import Floats, PeriodicEvents

Ints = npt.NDArray[np.int64]
EMERGENCY: Final = 0x80
"""Identifier of an emergency less the node-ID (CiA 301, predefined connection set)."""
_NODE_IDS: Final = range(1, 0x80)
"""Numbers that nodes have, the last 7 bits of their identifiers (CiA 301)."""
_OF_NODES: Final = range(0x180, 0x580)
"""Identifiers of the PDOs of the predefined connection set (CiA 301)."""
_EMERGENCY_BYTES: Final = 8
"""Data of an emergency: error code, error register and five bytes of the maker [bytes]."""


class SenderNames:
    """Streams of a plan, and the names of those who send their identifiers."""

    def __init__(self, network: Network, sent: Sequence[Stream]) -> None:
        self.sent = sent
        labels = [stream.label for stream in sent]
        self.labels = [
            f"{label} {labels[: place + 1].count(label)}" if labels.count(label) > 1 else label
            for place, label in enumerate(labels)
        ]
        """Name of each stream; those of a PDO with several frames are numbered."""
        self.nodes = {
            group.name: [
                f"{nodes.name or 'node'} {number}"
                for nodes in group.members
                for number in range(1, int(nodes.nodes) + 1)
            ]
            for group in network.groups
        }
        """Names of the nodes of each group."""
        self.all_nodes = [*chain.from_iterable(self.nodes.values())]

    def pdos(self) -> Iterator[tuple[Stream, int]]:
        """Each identifier of a PDO with its stream."""
        for stream in self.sent:
            if stream.name != SYNC and not stream.is_message:
                yield from ((stream, identifier) for identifier in range(stream.first, stream.last + 1))

    def name(self, stream: Stream, identifier: int) -> str:
        """Name of an identifier of a stream, with that of its node.

        Feedback of drives 3 (0x183) is one of the third node of a group.
        """
        label = self.labels[self.sent.index(stream)].removeprefix(f"{stream.group} ")
        is_of_nodes = stream.identifiers > 1 if stream.is_message else stream.name != SYNC
        node = f" of {self.node(stream, identifier - stream.first)}" if is_of_nodes else ""
        return f"{label}{node} ({identifier:#x})"

    def node(self, stream: Stream, place: int) -> str:
        """Name of the node that sends the identifier at a place, from 0."""
        nodes = self.all_nodes if stream.is_message else self.nodes[stream.group]
        each = max(int(stream.identifiers) // len(nodes), 1)
        number, axis = divmod(place, each)
        return nodes[number] + (f", axis {axis + 1}" if each > 1 else "")

    @cached_property
    def by_node_id(self) -> Mapping[int, str]:
        """Name of each node whose PDOs have the identifiers of the predefined connection set, by its node-ID."""
        return {
            identifier & _NODE_IDS[-1]: self.node(stream, identifier - stream.first)
            for stream, identifier in self.pdos()
            if identifier in _OF_NODES and stream.identifier_bits == BASE_BITS
        }


class SentPdos(NamedTuple):
    """PDOs of an identifier beside their SYNCs; frames are indexes into the log."""

    stream: Stream
    name: str
    """Name, with that of the node."""
    due: int
    """Number of PDOs that were due."""
    cycles: Ints
    """Number of the SYNC at which each of n PDOs was due."""
    late_us: Floats
    """Time of each after this SYNC [us]."""
    frames: Ints
    missing: Ints
    """SYNC of each PDO that never came."""
    twice: Ints
    """PDOs that came again for one SYNC."""


def pdos_beside_sync(
    sync: SentFrames,
    periods: PeriodicEvents,
    planned_us: float,
    senders: "SenderNames",
    by_identifier: Mapping[tuple[int, bool], SentFrames],
) -> Iterator[SentPdos]:
    """PDOs of each identifier beside SYNC, of which the recorded periods and the planned one are given [us]."""
    cycles = np.arange(periods.places[-1] + 1)
    sync_us, is_sent = np.interp(cycles, periods.places, sync.times_us), np.isin(cycles, periods.places)
    sync_frames = np.zeros(len(cycles), dtype=np.int64)
    sync_frames[periods.places] = sync.frames
    for stream, identifier in senders.pdos():
        sent = by_identifier.get((identifier, stream.identifier_bits > BASE_BITS))
        times_us = np.zeros(0) if sent is None else sent.times_us
        frames = np.zeros(0, dtype=np.int64) if sent is None else sent.frames
        every = round(stream.period_us / planned_us)
        pdos = due_pdos(sync_us, times_us, every=every, is_sent=is_sent)
        yield SentPdos(
            stream,
            senders.name(stream, identifier),
            pdos.due,
            pdos.cycles,
            pdos.late_us,
            frames[pdos.pdos],
            sync_frames[pdos.missing],
            frames[pdos.twice],
        )


def last_pdos_us(pdos: Sequence[SentPdos]) -> Floats:
    """Time of the last PDO of each cycle after its SYNC, of the cycles that have one [us]."""
    cycles, late_us = joined(sent.cycles for sent in pdos), joined(sent.late_us for sent in pdos)
    behind_us = np.full(int(cycles.max(initial=-1)) + 1, -inf)
    np.maximum.at(behind_us, cycles, late_us)
    return behind_us[behind_us >= 0]


def joined(parts: Iterable[npt.NDArray[np.generic]]) -> npt.NDArray[Any]:
    """Arrays one after the other; an empty one of none."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def finite(us: float) -> float | None:
    """A planned time; None where a bus that is too full has none [us]."""
    return us if isfinite(us) else None


class Emergencies(NamedTuple):
    """Emergencies of nodes: n frames of the predefined connection set."""

    frames: Ints
    """Index of each in the log."""
    nodes: Ints
    """Node-ID of each."""
    codes: Ints
    """Error code of each; 0 says that an error is gone."""
    registers: Ints
    """Error register of each."""

    def words(self, frames: CanFrames, names: Mapping[int, str], most: int) -> str:
        """Node, error code and register of those that are alike, and when the first of them came, in this order.

        `names` are those of nodes by their node-ID; the most that are listed are given.
        """
        sort = self.nodes << 24 | self.codes << 8 | self.registers
        _, first, often = np.unique(sort, return_index=True, return_counts=True)
        order = np.argsort(self.frames[first], kind="stable")
        found = []
        for place in order[:most].tolist():
            event = int(first[place])
            node, code, register = (int(part[event]) for part in self[1:])
            at_s, frame = frames.events(np.ones(1), self.frames[event : event + 1]).earliest(np.ones(1, dtype=np.bool_))
            times = f", {plural(int(often[place]), 'time')}, first" if often[place] > 1 else ""
            words = f"error {code:#06x}, register {register:#04x}" if code else "no error any more"
            found.append(f"{names.get(node, f'node-ID {node}')}: {words}{times} at {at_s:.6f} s, frame {frame}")
        return "; ".join(found) + (f" and {len(order) - most:,} more" if len(order) > most else "")


def emergencies(frames: CanFrames, some: Ints) -> Emergencies:
    """Emergencies among some frames of the log, by their indexes.

    References
    ----------
    CiA 301, emergency object: error code in bytes 0 and 1, the lower one first, error register in byte 2.
    """
    nodes = frames.identifiers[some] - EMERGENCY
    is_one = ~frames.extended[some] & (nodes >= _NODE_IDS[0]) & (nodes <= _NODE_IDS[-1])
    some = some[is_one & (frames.sizes[some] == _EMERGENCY_BYTES)]
    first, second, third = (frames.data[some] >> np.uint64(shift) & np.uint64(0xFF) for shift in (56, 48, 40))
    codes, registers = (first | second << np.uint64(8)).astype(np.int64), third.astype(np.int64)
    return Emergencies(some, frames.identifiers[some] - EMERGENCY, codes, registers)
