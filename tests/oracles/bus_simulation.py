"""The IEEE 1394 bus as it runs, packet by packet: what a cycle takes, simulated and not computed.

    python tests/oracles/bus_simulation.py

It is written from the description of the bus and knows none of busplan's closed forms. The bus is busy or idle, and
idle time counts from the last activity:

- A packet starts when the bus has been idle for the subaction gap, and its sender still has its turn. Each node, the
  host among them, has one turn in a fairness interval. When the bus has been idle for the arbitration reset gap, the
  interval ends and all have a new turn. A response may also go with priority: it then needs no turn.
- A cycle start goes before all others and takes no turn. The idle time that has run when it goes is lost.
- The host sends a broadcast, reads each node, and writes to each. It has its own time before each request that follows
  an answer, and before the next broadcast; the broadcast is followed by a request that is ready, and so is a busy
  acknowledge by its retry.
- A node that has acknowledged executes, while the bus goes on, and then has its response ready.

A bus has one clock and one place here: all nodes see the bus become idle at once. Times are in us.
"""

from collections.abc import Callable, Sequence
from typing import Final, Literal, NamedTuple

Answer = Literal["split", "concatenated", "unified"]
Execution = Callable[[int, int], float]
"""From the cycle and the place of a request in it, 0 for the first read, to what the node takes to execute it."""

BASE_MBIT_S: Final = 98.304
CYCLE_START_BITS: Final = 160
CYCLE_START_EVERY_US: Final = 125.0
BROADCAST_BYTES: Final = 20
WRITE_RESPONSE_BYTES: Final = 16
MAX_HOLD_US: Final = 1.63
DATA_END_US: Final = 0.25
HOST: Final = 0


class Node(NamedTuple):
    """One node, and what it exchanges with the host."""

    hops: int
    read_bytes: int
    write_bytes: int


class Scene(NamedTuple):
    """A bus and what runs on it."""

    nodes: tuple[Node, ...]
    """In the order in which the host reads them and writes to them."""
    hops: int
    """Of the farthest node."""
    rate_mbit_s: float = 393.216
    gap_count: int = 63
    cable_length_m: float = 4.5
    read: Answer = "split"
    write: Answer = "split"
    hold_us: float = 0.0
    """From the acknowledge to a concatenated response."""
    host_us: float = 0.0
    """Time of the host itself before a request."""
    priority: bool = False
    """Whether responses go with priority."""
    busy: tuple[int, ...] = ()
    """Places of requests in the cycle: each time that a place stands here, its request is acknowledged as busy once."""
    first_start_us: float | None = None
    """When the first cycle start is due; None for a bus without."""
    start_waits: bool = True
    """Whether a cycle start waits for the subaction gap; else it goes as soon as the bus is idle."""
    isochronous_us: float = 0.0
    """Traffic behind each cycle start."""
    root_hops: int | None = None
    """Where the root of a chain lies, in hops from the host: a sender asks it for the bus. None has a packet arbitrate
    over its own way, as equation (4) may be read."""

    @property
    def hop_us(self) -> float:
        """Cable and PHY of one hop."""
        return 0.023 * self.cable_length_m / 4.5 + 14 / BASE_MBIT_S

    @property
    def subaction_gap_us(self) -> float:
        """T_sub."""
        return (29 + 16 * self.gap_count) / BASE_MBIT_S

    @property
    def reset_gap_us(self) -> float:
        """T_reset."""
        return (53 + 32 * self.gap_count) / BASE_MBIT_S

    def arbitration_us(self, hops: int) -> float:
        """Equation (4)."""
        return hops * self.hop_us + 4 * self.gap_count / BASE_MBIT_S + MAX_HOLD_US

    def asking_us(self, sender_hops: int, way_hops: int) -> float:
        """Arbitration of a packet whose sender is some hops from the host, and whose way is some hops long."""
        return self.arbitration_us(way_hops if self.root_hops is None else abs(sender_hops - self.root_hops))

    def data_us(self, hops: int, packet_bytes: int) -> float:
        """Equation (5)."""
        return hops * self.hop_us + 8 * packet_bytes / self.rate_mbit_s

    def acknowledge_us(self, hops: int) -> float:
        """Equation (6)."""
        return hops * self.hop_us + DATA_END_US

    @property
    def cycle_start_us(self) -> float:
        """A cycle start on the wire, at S100, and the isochronous traffic behind it."""
        data_us = self.hops * self.hop_us + CYCLE_START_BITS / BASE_MBIT_S
        return self.arbitration_us(self.hops) + data_us + self.isochronous_us


class Packet(NamedTuple):
    """One stretch of busy bus."""

    what: str
    start_us: float
    end_us: float


class Run(NamedTuple):
    """What has happened."""

    starts_us: tuple[float, ...]
    """When each cycle has started, and when the one after the last could."""
    packets: tuple[Packet, ...]


class _Bus:
    """A wire with its fairness interval and its cycle starts; idle for the arbitration reset gap at time 0."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._idle_since_us = -scene.reset_gap_us
        self._without_turn: set[int] = set()
        self._start_due_us = scene.first_start_us
        self.packets: list[Packet] = []

    def send(
        self,
        what: str,
        sender: int,
        *,
        ready_us: float,
        wire_us: float,
        priority: bool = False,
        isochronous: bool = False,
    ) -> float:
        """Send a packet with all that follows it without a gap, and whatever goes before it; gives its end.

        An isochronous request waits for no gap and takes no turn.
        """
        has_turn = priority or isochronous or sender not in self._without_turn
        while True:
            # A sender gets its turn back when the arbitration reset gap ends the interval, and not otherwise.
            gap_us = self._scene.subaction_gap_us if has_turn else self._scene.reset_gap_us
            gap_us = 0.0 if isochronous else gap_us
            at_us = max(ready_us, self._idle_since_us + gap_us)
            start_at_us = self._cycle_start_us()
            if start_at_us is None or start_at_us > at_us:
                break
            self._occupy("cycle start", start_at_us, self._scene.cycle_start_us)
            assert self._start_due_us is not None
            self._start_due_us += CYCLE_START_EVERY_US
            has_turn = priority or sender not in self._without_turn
        self._occupy(what, at_us, wire_us)
        if not (priority or isochronous):
            self._without_turn.add(sender)
        return self._idle_since_us

    def _cycle_start_us(self) -> float | None:
        """When the next cycle start goes."""
        if self._start_due_us is None:
            return None
        gap_us = self._scene.subaction_gap_us if self._scene.start_waits else 0.0
        return max(self._start_due_us, self._idle_since_us + gap_us)

    def _occupy(self, what: str, start_us: float, wire_us: float) -> None:
        if start_us >= self._idle_since_us + self._scene.reset_gap_us:
            self._without_turn.clear()
        self._idle_since_us = start_us + wire_us
        self.packets.append(Packet(what, start_us, self._idle_since_us))


def simulate(scene: Scene, execution: Execution, *, cycles: int = 1) -> Run:
    """Run cycles one after the other, each as soon as the bus lets it."""
    bus, ready_us, starts_us = _Bus(scene), 0.0, []
    broadcast_us = scene.asking_us(0, scene.hops) + scene.data_us(scene.hops, BROADCAST_BYTES)
    for cycle in range(cycles + 1):
        ready_us = bus.send("broadcast", HOST, ready_us=ready_us, wire_us=broadcast_us)
        starts_us.append(bus.packets[-1].start_us)
        if cycle == cycles:
            break
        requests = [(kind, number) for kind in ("read", "write") for number in range(1, len(scene.nodes) + 1)]
        for place, (kind, number) in enumerate(requests):
            node = scene.nodes[number - 1]
            if not (node.read_bytes if kind == "read" else node.write_bytes):
                continue
            answer: Answer = scene.read if kind == "read" else scene.write
            for _ in range(scene.busy.count(place)):
                ready_us = bus.send(
                    f"{kind} {number}, busy", HOST, ready_us=ready_us, wire_us=_request_us(scene, node, kind)
                )
            done_us = _transaction(
                bus, scene, answer, kind, number, ready_us=ready_us, execution_us=execution(cycle, place)
            )
            ready_us = done_us + scene.host_us
    return Run(tuple(starts_us), tuple(bus.packets))


def simulate_broadcasts(scene: Scene, *, isochronous: bool, slot_us: float = 0.0, cycles: int = 1) -> Run:
    """Run cycles of the broadcast schedule: a query, a packet of each node, one read of the hub, one write.

    Node 1 is the hub here, at its own hops. Each node starts when it has heard the node before it, the first when
    its clock has counted 150 from the query; with slots, no node before its own time behind that. The host knows only
    its own clock: it waits 10 us and 5 us a node behind the acknowledge of its query, and has its own time before each
    request.
    """
    bus, ready_us, starts_us = _Bus(scene), 0.0, []
    (hub, *_), number = scene.nodes, len(scene.nodes)
    both_us = scene.arbitration_us(hub.hops) + scene.acknowledge_us(hub.hops)
    collected = sum(-(-node.read_bytes // 4) * 4 + 4 for node in scene.nodes) + 4
    commands = sum(-(-node.write_bytes // 4) * 4 + 4 for node in scene.nodes)
    for cycle in range(cycles + 1):
        asked_us = bus.send("query", HOST, ready_us=ready_us, wire_us=both_us + scene.data_us(hub.hops, 20))
        starts_us.append(bus.packets[-1].start_us)
        if cycle == cycles:
            break
        turn_us = first_us = asked_us + 150 / 49.152
        for place, node in enumerate(scene.nodes, start=1):
            packet = 24 + -(-node.read_bytes // 4) * 4 + 4
            # All must hear it: the farthest does.
            arbitration_us = (
                scene.hops * scene.hop_us + MAX_HOLD_US if isochronous else scene.arbitration_us(scene.hops)
            )
            wire_us = arbitration_us + scene.data_us(scene.hops, packet)
            ready_us = max(turn_us, first_us + (place - 1) * slot_us)
            turn_us = bus.send(f"data {place}", place, ready_us=ready_us, wire_us=wire_us, isochronous=isochronous)
        # The host's own time follows its wait, or the last broadcast if that is later.
        ready_us = max(turn_us, asked_us + 10 + 5 * number) + scene.host_us
        answer_us = scene.data_us(hub.hops, 24 + collected) + scene.acknowledge_us(hub.hops)
        wire_us = both_us + scene.data_us(hub.hops, 20) + answer_us
        ready_us = bus.send("hub", HOST, ready_us=ready_us, wire_us=wire_us) + scene.host_us
        wire_us = both_us + scene.data_us(hub.hops, 24 + commands)
        ready_us = bus.send("write", HOST, ready_us=ready_us, wire_us=wire_us) + scene.host_us
    return Run(tuple(starts_us), tuple(bus.packets))


def _transaction(
    bus: _Bus, scene: Scene, answer: Answer, kind: str, number: int, *, ready_us: float, execution_us: float
) -> float:
    """One transaction; gives its end."""
    node = scene.nodes[number - 1]
    request_us, name = _request_us(scene, node, kind), f"{kind} {number}"
    response_us = scene.data_us(node.hops, _packets(node, kind)[1]) + scene.acknowledge_us(node.hops)
    if answer == "unified":
        return bus.send(name, HOST, ready_us=ready_us, wire_us=request_us)
    if answer == "concatenated":
        return bus.send(name, HOST, ready_us=ready_us, wire_us=request_us + scene.hold_us + response_us)
    acknowledged_us = bus.send(name, HOST, ready_us=ready_us, wire_us=request_us)
    return bus.send(
        f"{name}, response",
        number,
        ready_us=acknowledged_us + execution_us,
        wire_us=scene.asking_us(node.hops, node.hops) + response_us,
        priority=scene.priority,
    )


def _request_us(scene: Scene, node: Node, kind: str) -> float:
    """A request and its acknowledge."""
    packet_us = scene.asking_us(0, node.hops) + scene.data_us(node.hops, _packets(node, kind)[0])
    return packet_us + scene.acknowledge_us(node.hops)


def _packets(node: Node, kind: str) -> tuple[int, int]:
    """Bytes on the wire of a request and its response: quadlets for four bytes, else blocks of whole quadlets."""
    size = node.read_bytes if kind == "read" else node.write_bytes
    padded = -(-size // 4) * 4
    if kind == "read":
        return (16, 20) if size == 4 else (20, 24 + padded)
    return (20 if size == 4 else 24 + padded), WRITE_RESPONSE_BYTES


def timeline(packets: Sequence[Packet]) -> str:
    """The packets as text, each with the idle bus before it."""
    lines, idle_since_us = [], 0.0
    for packet in packets:
        idle_us = packet.start_us - idle_since_us
        lines.append(f"{packet.start_us:9.3f} ..{packet.end_us:9.3f}  {packet.what:20s} after {idle_us:7.3f} idle")
        idle_since_us = packet.end_us
    return "\n".join(lines)


if __name__ == "__main__":
    chain = Scene(nodes=tuple(Node(hops, 12, 12) for hops in (1, 2)), hops=2)
    print(timeline(simulate(chain, lambda _cycle, _place: 36.433).packets))  # noqa: T201
