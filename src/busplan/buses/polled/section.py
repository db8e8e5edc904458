"""Keys of [bus] that only polled buses have."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Discriminator, Field, Tag

from busplan.buses.polled.protocols import ADAPTERS, PROTOCOLS, UNLIMITED, UNLIMITED_KBIT_S, Requests, c, protocol_of
from busplan.elementwise import Number
from busplan.english import listed
from busplan.sections.base import Bytes, Count, Problem, Section, TimeUs
from busplan.sections.cycle import BusSection, time_uncertainty_us, worst_of_cycles
from busplan.sections.profile import Profile

BitTimes = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Tolerance = Annotated[float, Field(ge=0, le=0.05, allow_inf_nan=False)]
if TYPE_CHECKING:
    ProtocolName = str
    AdapterName = str
else:
    ProtocolName = Literal[tuple(PROTOCOLS)]
    AdapterName = Literal[ADAPTERS]


def _table_or_name(value: object) -> str:
    """Tag of a key that is a name or a table."""
    return "(a table)" if isinstance(value, dict | Section) else "(a name)"


class Protocol(Section):
    """Section [bus.protocol]: a serial protocol of the user's own; a size is without data, 0 for no such telegram."""

    bits_per_byte: Annotated[float, Field(ge=8, le=12)] = Field(description="Bits of a byte on the wire", examples=[10])
    word_bytes: Annotated[int, Field(ge=1, le=64)] = Field(
        default=1,
        description="Data of a telegram are whole words of this size, as registers of Modbus [bytes]",
        examples=[2],
    )
    read_request_bytes: Bytes = Field(default=0, description="Request to read one node [bytes]", examples=[8])
    read_answer_bytes: Bytes = Field(default=0, description="Answer to it, without its data [bytes]", examples=[6])
    write_request_bytes: Bytes = Field(
        default=0, description="Request to write one node, without its data [bytes]", examples=[7]
    )
    write_answer_bytes: Bytes = Field(
        default=0, description="Answer to it; 0 where nodes do not answer a write [bytes]", examples=[6]
    )
    exchange_request_bytes: Bytes = Field(
        default=0, description="Request that writes and reads one node, without its data [bytes]", examples=[9]
    )
    exchange_answer_bytes: Bytes = Field(default=0, description="Answer to it, without its data [bytes]", examples=[9])
    sync_read_bytes: Bytes = Field(default=0, description="Request that reads many nodes [bytes]", examples=[8])
    sync_write_bytes: Bytes = Field(default=0, description="Request that writes many nodes [bytes]", examples=[8])
    sync_node_bytes: Bytes = Field(default=0, description="Each node's part of these requests [bytes]", examples=[1])
    fast_answer_bytes: Bytes = Field(
        default=0,
        description="One answer of all nodes to a request that reads many, without their parts; 0 where each answers "
        "by itself [bytes]",
        examples=[8],
    )
    fast_node_bytes: Bytes = Field(
        default=0, description="Each node's part of this answer, without its data [bytes]", examples=[4]
    )
    global_bytes: Bytes = Field(
        default=0, description="Broadcast that may open a cycle, such as Global Control [bytes]", examples=[13]
    )
    silence_bits: BitTimes = Field(default=0.0, description="Silence that ends every telegram [bits]", examples=[38.5])
    silence_us: TimeUs = Field(default=0.0, description="Least of that silence [us]", examples=[1750])
    min_turn_bits: BitTimes = Field(default=0.0, description="Shortest wait for an answer [bits]", examples=[10])
    max_turn_bits: BitTimes = Field(default=0.0, description="Longest wait for an answer [bits]", examples=[70])
    master_turns: bool = Field(
        default=False,
        description="Whether the master waits for max_turn_bits, too, before its next telegram, as in WorldFIP",
        examples=[True],
    )
    clock_tolerance: Tolerance = Field(
        default_factory=lambda: float(c["SHARES[CLOCK_TOLERANCE]"]),
        description="Largest error of the bit rate, a share of it",
        examples=[0.01],
    )
    return_delay_us: TimeUs = Field(
        default=0.0, description="Delay of an answer that is set in a new node [us]", examples=[500]
    )
    max_nodes: Count = Field(default=UNLIMITED, description="Most nodes of a bus", examples=[253])
    max_bytes: Count = Field(default=UNLIMITED, description="Most data of a telegram [bytes]", examples=[249])
    max_bit_rate_kbit_s: Annotated[float, Field(gt=0, le=1e9)] = Field(
        default=UNLIMITED_KBIT_S, description="Highest bit rate [kbit/s]", examples=[1000]
    )


class Adapter(Section):
    """Section [bus.adapter]: an adapter that gathers bytes for the host and sends them in packets, as USB serial ones.

    Bytes go when a packet is full, and when a timer ends that runs from the last packet.
    """

    timer_us: TimeUs = Field(
        description="Latency timer; 0 where the adapter sends each answer at once, as with an event character [us]",
        examples=[1000],
    )
    packet_bytes: Count = Field(
        default_factory=lambda: int(c["ADAPTER_PACKET_BYTES[ftdi]"]),
        description="Data of a full packet [bytes]",
        examples=[62],
    )
    frame_us: TimeUs = Field(
        default_factory=lambda: float(c["ADAPTER_FRAME_US[ftdi]"]),
        description="USB frame, the longest time that a packet waits for the host: 1000 at full speed, 125 at high "
        "speed [us]",
        examples=[125],
    )


class PolledBus(BusSection):
    """Section [bus]: a serial bus whose master asks its nodes one by one."""

    kind: Literal["polled"] = Field(description="Kind of bus", examples=["polled"])
    protocol: Annotated[
        Annotated[ProtocolName, Tag("(a name)")] | Annotated[Protocol, Tag("(a table)")],
        Discriminator(_table_or_name),
    ] = Field(
        description=f"Protocol: {listed(tuple(PROTOCOLS), 'or')}, or a table [bus.protocol] of your own",
        examples=["dynamixel-2"],
    )
    bit_rate_kbit_s: Annotated[float, Field(ge=1, le=100_000, allow_inf_nan=False)] = Field(
        description="Bit rate [kbit/s]", examples=[1000]
    )
    nodes: Count | None = Field(default=None, description="Nodes N, master not counted", examples=[14])
    requests: Requests | None = Field(
        default=None,
        description="Way to ask the nodes; exchange: both ways in one request; sync: all nodes of a group in one; "
        "fast-sync: the same with one answer of all; single: one node one way; without it the first of exchange, sync "
        "and single that the protocol has",
        examples=["sync"],
    )
    reads: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=1, description="Requests that share the data read from a node", examples=[3]
    )
    writes: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=1, description="Requests that share the data written to a node", examples=[1]
    )
    return_delay_us: TimeUs | None = Field(
        default=None,
        description="Delay of an answer set in the nodes, in addition to node.execution; by default that of a new "
        "node [us]",
        examples=[0],
    )
    max_turn_bits: BitTimes | None = Field(
        default=None,
        description="Longest wait for an answer, as max T_SDR of the slowest slave's GSD; beside silence, return delay "
        "and node.execution. Without it the protocol's [bits]",
        examples=[100],
    )
    clock_tolerance: Tolerance | None = Field(
        default=None,
        description="Largest error of the bit time, a share 0..0.05: a doubt of the "
        "cycle; 0 for exact clocks. Without it the protocol's; where that says nothing 0.005, assumed",
        examples=[0.0001],
    )
    adapter: (
        Annotated[
            Annotated[AdapterName, Tag("(a name)")] | Annotated[Adapter, Tag("(a table)")],
            Discriminator(_table_or_name),
        ]
        | None
    ) = Field(
        default=None,
        description=f"Adapter of the host: {listed(ADAPTERS, 'or')}, or a table [bus.adapter]; without it none",
        examples=["ftdi-low-latency"],
    )
    host_us: TimeUs = Field(
        default=0.0, description="The host's own time in a cycle, between feedback and commands [us]", examples=[200]
    )
    host_grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description="Grade of host_us", examples=["measured"]
    )
    host_uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of host_us; without it 10 %, where it is assumed host_us / sqrt(3) [us]",
        examples=[5],
    )
    master_jitter_us: TimeUs = Field(
        default=0.0,
        description="Latest start of a cycle by the master; the cycle ends before the next one [us]",
        examples=[50],
    )
    master_jitter_cycles: Count | None = worst_of_cycles("master_jitter_us")
    global_control: bool = Field(
        default=False,
        description="Whether a broadcast opens the cycle, as Global Control of isochronous PROFIBUS",
        examples=[True],
    )
    retries: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="Requests of a cycle that get no answer and are repeated", examples=[1]
    )
    timeout_us: TimeUs | None = Field(
        default=None,
        description="Time that the master waits for an answer that does not come; of PROFIBUS without it T_SL [us]",
        examples=[2000],
    )

    @property
    def host_doubt_us(self) -> Number:
        """Standard uncertainty of the host's own time [us]."""
        is_guess = self.host_grade == "assumed"
        return time_uncertainty_us(self.host_us, is_guess=is_guess, given_us=self.host_uncertainty_us)

    def _problems(self) -> Iterator[Problem]:
        protocol = protocol_of(self)
        ways = protocol.requests
        if not ways:
            yield Problem("has no request that reads a node; give read_request_bytes", "protocol")
        elif self.requests is not None and self.requests not in ways:
            yield Problem(f"the protocol has none of these; it has {', '.join(ways)}", "requests")
        if self.global_control and not protocol.global_bytes:
            yield Problem("the protocol has no broadcast that opens a cycle", "global_control")
        if self.retries and self.timeout_us is None and not protocol.has_token:
            yield Problem("a repeated request waits for a timeout; give bus.timeout_us", "retries")
        if self.return_delay_us is not None and protocol.has_token:
            yield Problem("PROFIBUS has no return delay; give max_turn_bits", "return_delay_us")


class PolledProfile(Profile):
    """A whole profile: one motion network and its cycle."""

    bus: PolledBus = Field(description="The bus")


PROFILE: Final = PolledProfile
