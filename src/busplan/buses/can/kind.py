"""CAN as a kind of bus."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.can.cycle import EVENTS, NO_STUFFING, STRETCHES, WORST_STUFFING, CanCycle, can_cycle
from busplan.buses.can.equations import (
    BASE_BITS,
    BIT_RATES,
    DATA_BIT_RATES,
    FIGURES,
    MAX_IDENTIFIER,
    c,
)
from busplan.buses.can.rules import LIMITS, RULES
from busplan.buses.can.streams import streams
from busplan.buses.can.traffic import traffic_of
from busplan.buses.network import Network
from busplan.buses.parts import Cost, Key, PayloadRange, Perturbation, Setting, Starter, TimingModel
from busplan.buses.rule import Recorded
from busplan.buses.waterfall import RecordedCycles
from busplan.progress import Progress

if TYPE_CHECKING:
    from pathlib import Path


def _pdo_per(network: Network) -> Setting:
    """PDOs of each axis, where a node has several: its parameters map them."""
    keys = {
        nodes.name: f"group.{nodes.name}.pdo_per" if nodes.name else "payload.pdo_per"
        for nodes in network.profile.node_groups
    }
    several = {
        keys[nodes.name]: "axis"
        for nodes in network.profile.node_groups
        if nodes.payload.pdo_per == "node" and nodes.node.axes > 1
    }
    values = (several,) if several else ()
    return Setting("pdo_per", "PDOs of each axis", Cost.REGISTER, tuple(keys.values()), values)


def _higher(name: str, rate_kbit_s: float, rates_kbit_s: Sequence[float]) -> Setting:
    """Higher bit rates, the next higher first: cable, and for the data of CAN FD transceivers, must carry them."""
    key = f"bus.{name}_kbit_s"
    higher = tuple({key: rate} for rate in rates_kbit_s if rate > rate_kbit_s)
    return Setting(name, name.replace("_", " "), Cost.SCHEDULE, (key,), higher)


def _identifier_bits(network: Network) -> Setting:
    """Identifiers of 11 bits, where all are small enough."""
    key, traffic = "bus.identifier_bits", traffic_of(network)
    last = [stream.last for stream in streams(traffic) if stream.identifier_bits == traffic.identifier_bits]
    is_larger = traffic.identifier_bits != BASE_BITS
    values = ({key: BASE_BITS},) if is_larger and last and max(last) <= MAX_IDENTIFIER[BASE_BITS] else ()
    return Setting("identifier_bits", "length of identifiers", Cost.SCHEDULE, (key,), values)


_HOST_STEP_US: Final = 10.0
_MOTORS: Final = """\
[bus]
kind = "can"
bit_rate_kbit_s = 1000     # assumed: most robot motors
access = "polled"          # a command, its answer, the next motor; "burst": all commands at once
host_us = 20               # assumed: the host's time for each command; measure it"""
_MOTORS_EXECUTION: Final = """\
kind = "linear"
grade = "assumed"          # between 0 and twice its value
base_us = 150              # assumed: from a command to the queued answer; a CyberGear answers within 250 us
per_byte_us = 0
"""


class Can(Bus):
    """CAN, classical or FD, whose nodes send at SYNC or at a command of the host."""

    kind = "can"
    title = "CAN"
    also_called = ("CANopen", "CAN 2.0")
    timing_models = (
        TimingModel(
            WORST_STUFFING,
            "as many stuff bits as a frame of its length can have",
            error="this timing model gives 8 to 20% more than measured frames",
        ),
        TimingModel(NO_STUFFING, "no stuff bits"),
    )
    figures = FIGURES
    limits = LIMITS
    rules = RULES
    starter = Starter(
        """\
[bus]
kind = "can"
bit_rate_kbit_s = 1000     # assumed: the cable decides, 1000 for less than 40 m or so
pipeline_cycles = 1        # assumed: the host computes in the next cycle; 0: in the same one, in bus.host_us""",
        period="10ms",
        slice_ratio="1            # assumed: the whole period is for communication",
        measure="measure both on a node: SYNC, or its command, to its frame; command to effect",
        base="from SYNC to a queued feedback PDO, and from a command PDO to its effect",
        variants={
            "can-fd": "data_bit_rate_kbit_s = 2000 # assumed: transceivers and cable decide, up to 8000",
            "can-motors": _MOTORS,
        },
        servos={"can-motors": {"read": (8, "one frame of position, velocity and torque"), "write": (8, "one frame")}},
        tables={"can-motors": _MOTORS_EXECUTION},
        without_wake_up=("can-motors",),
        rate="bit_rate_kbit_s",
        more="""\
# What else goes over the bus? Without it the load is too small. For example of CANopen nodes, each on its own:
# [[message]]
# name = "sdo-response"
# identifier = 0x580       # and the node's number
# per_node = true
# payload_bytes = 8
# period_us = 50000
# [[message]]
# name = "heartbeat"
# identifier = 0x700       # and the node's number
# per_node = true
# payload_bytes = 1
# period_us = 100000
""",
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    rate_keys = ("bus.bit_rate_kbit_s", "bus.data_bit_rate_kbit_s")
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.nodes": Key(meaning="move the other nodes to a second bus"),
        "bus.access": Key(chooses=True, meaning="if the host's software can"),
        "bus.bit_rate_kbit_s": Key("f", meaning="if the cable is short enough"),
        "bus.data_bit_rate_kbit_s": Key("f_data", meaning="if transceivers and cable carry it"),
        "bus.identifier_bits": Key("id_bits", meaning="all identifiers fit"),
        "bus.host_us": Key("host", role="host"),
        "bus.host_write_us": Key("t_write", meaning="if another adapter or driver is as fast"),
        "bus.host_read_us": Key("t_read", meaning="if another adapter or driver is as fast"),
        "bus.max_frames_s": Key("f_max"),
        "bus.pipeline_cycles": Key("n", "PIPELINE_CYCLES", role="pipeline"),
        "bus.clock_tolerance": Key("df"),
        "bus.sync_jitter_us": Key("J_SYNC", role="wake-up"),
        "bus.error_period_us": Key("T_error"),
        "bus.error_burst": Key("n_burst"),
        "bus.sync_identifier": Key(default="SYNC_IDENTIFIER"),
        "limits.max_load": Key(default="MAX_LOAD"),
        "payload.every": Key("every"),
        "node.execution.worst_extra_us": Key("T_extra"),
        "message.payload_bytes": Key("s"),
        "message.period_us": Key("T"),
        "message.burst": Key("b"),
        "message.jitter_us": Key("J"),
        "message.deadline_us": Key("D"),
        "message.identifier": Key("id"),
    }
    term_removals: ClassVar[tuple[Mapping[str, float], ...]] = (
        {"bus.host_us": 0.0},
        {"bus.host_write_us": 0.0, "bus.host_read_us": 0.0},
        {"bus.sync_jitter_us": 0.0},
    )
    modules = ("evidence", "emulated")
    recordings = "a log of candump, ASC, BLF or TRC, or a capture of SocketCAN,"
    evidence_data = ("can", "paper")

    def cycle(self, network: Network, *, model: str) -> CanCycle:
        """The cycle of a network under a timing model."""
        return can_cycle(network, model)

    def latency_subject(self, network: Network) -> str:
        """Subject of a response time, in words."""
        if not network.groups:
            return ", ".join(("worst case of every message", *self.setup_words(network)))
        nodes = "all nodes" if network.is_uniform else "each group"
        sync = "SYNC, of " if network.profile.bus.access == "sync" else ""
        return ", ".join((f"worst case of {sync}the last PDO of {nodes}", *self.setup_words(network)))

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - of every network
        """A response time ends when the frame has arrived, and begins when it is queued."""
        return not of_latency

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """PDOs of each axis, a higher bit rate, of CAN FD a higher data bit rate, identifiers of 11 bits."""
        bus = network.profile.bus
        rate, data_rate = bus.bit_rate_kbit_s, bus.data_bit_rate_kbit_s
        most = BIT_RATES[-1] if data_rate is None else data_rate
        at_once = ({"bus.access": "burst"},) if bus.access == "polled" else ()
        access = Setting("access", "way to ask", Cost.SCHEDULE, ("bus.access",), at_once)
        return (
            *((_pdo_per(network),) if any(nodes.node.axes > 1 for nodes in network.profile.node_groups) else ()),
            _higher("bit_rate", rate, [higher for higher in BIT_RATES if higher <= most]),
            *(() if data_rate is None else (_higher("data_bit_rate", data_rate, DATA_BIT_RATES),)),
            _identifier_bits(network),
            *(() if bus.access == "sync" else (access,)),
        )

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """A slower host or adapter, SYNC later or with its counter, and identifiers of 29 bits; beside a cycle."""
        bus, is_sync = network.profile.bus, network.profile.bus.access == "sync"
        counted = "SYNC has its counter already" if bus.sync_counter else "" if is_sync else "there is no SYNC"
        extended = "they have 29 bits already" if bus.identifier_bits > BASE_BITS else ""
        elsewhere = "the host computes in cycles of its own" if is_sync and bus.pipeline_cycles else ""
        step, of_sync = f"+{_HOST_STEP_US:g} us", "" if is_sync else "there is no SYNC"
        return (
            Perturbation(f"host {step}", {"bus.host_us": bus.host_us + _HOST_STEP_US}, elsewhere),
            Perturbation(f"adapter to the wire {step}", {"bus.host_write_us": bus.write_us + _HOST_STEP_US}, elsewhere),
            Perturbation(f"adapter from the wire {step}", {"bus.host_read_us": bus.read_us + _HOST_STEP_US}, elsewhere),
            Perturbation(f"SYNC's jitter {step}", {"bus.sync_jitter_us": bus.sync_jitter_us + _HOST_STEP_US}, of_sync),
            Perturbation("SYNC with counter", {"bus.sync_counter": True}, counted),
            Perturbation("identifiers of 29 bits", {"bus.identifier_bits": 29}, extended),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Whole bytes up to four frames of each PDO."""
        most_bytes = min(pdos.most_bytes for pdos in traffic_of(network).pdos)
        axes = (int(group.axes) for group in network.groups if group.payload.pdo_per == "axis")
        return PayloadRange(1, most_bytes * max(min(axes, default=1), 1), carrier="four frames")

    def counted(self, network: Network) -> tuple[tuple[int, str], ...]:
        """Nodes and axes; of a network without them its messages."""
        return super().counted(network) if network.groups else ((len(network.profile.message), "message"),)

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """The bit rate, or both of CAN FD, and PDOs that are not in every cycle."""
        bus = network.profile.bus
        data = "" if bus.data_bit_rate_kbit_s is None else f", {bus.data_bit_rate_kbit_s:g} kbit/s of data"
        seldom = (
            f"PDOs {nodes.name and f'of {nodes.name} '}every {int(nodes.payload.every)} cycles"
            for nodes in network.profile.node_groups
            if nodes.payload.every > 1
        )
        access = {"polled": ("motors asked one by one",), "burst": ("all commands at once",)}.get(bus.access, ())
        return (f"{bus.bit_rate_kbit_s:g} kbit/s{data}", *access, *seldom)

    def title_of(self, network: Network) -> str:
        """CAN, or CAN FD where it has a data bit rate."""
        return self.title if network.profile.bus.data_bit_rate_kbit_s is None else f"{self.title} FD"

    def recorded(
        self, network: Network, path: "Path", *, share: float, channel: str | None, progress: Progress
    ) -> Recorded:
        """Compare a CAN log with the plan."""
        from busplan.buses.can.recorded import recorded  # a single command asks for it, and numpy loads

        return recorded(network, path, share=share, channel=channel, progress=progress)

    def recorded_cycles(
        self, network: Network, path: "Path", *, channel: str | None, progress: Progress
    ) -> RecordedCycles:
        """The whole cycles of a CAN log beside those of the plan."""
        from busplan.buses.can.waterfall import recorded_cycles  # as above

        return recorded_cycles(network, path, channel=channel, progress=progress)


BUS: Final = Can()
