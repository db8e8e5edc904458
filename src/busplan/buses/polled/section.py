"""The keys that only profiles of polled buses have, in [bus]."""

from collections.abc import Iterator
from typing import Annotated, Final, Literal

from pydantic import Discriminator, Field, Tag

from busplan.buses.polled.protocols import BitTimes, Protocol, ProtocolName, Requests, Tolerance, protocol_of
from busplan.sections.base import Count, Problem, TimeUs
from busplan.sections.cycle import BusSection
from busplan.sections.profile import Profile


class PolledBus(BusSection):
    """Section [bus]: a serial bus whose master asks its nodes one by one."""

    kind: Literal["polled"] = Field(description="Kind of bus", examples=["polled"])
    protocol: Annotated[
        Annotated[ProtocolName, Tag("(a name)")] | Annotated[Protocol, Tag("(a table)")],
        Discriminator(lambda value: "(a table)" if isinstance(value, dict | Protocol) else "(a name)"),
    ] = Field(
        description="Protocol: profibus-dp, modbus-rtu, dynamixel-2, feetech or worldfip, or a table [bus.protocol] "
        "of your own",
        examples=["dynamixel-2"],
    )
    bit_rate_kbit_s: Annotated[float, Field(ge=1, le=100_000, allow_inf_nan=False)] = Field(
        description="Bit rate [kbit/s]", examples=[1000]
    )
    nodes: Count | None = Field(default=None, description="Nodes N, master not counted", examples=[14])
    requests: Requests | None = Field(
        default=None,
        description="How nodes are asked: exchange, both ways in one request; sync, all nodes of a group in one; "
        "single, one node one way; without it the first of these that the protocol has",
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
        description="Delay of an answer that is set in the nodes, beside node.execution; without it that of a new "
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
        description="How much longer or shorter than they should be all bits may be, a share 0..0.05: a doubt of the "
        "cycle; 0 for exact clocks. Without it the protocol's: 0.01 of modbus-rtu, else 0.005, assumed",
        examples=[0.0001],
    )
    adapter_us: TimeUs = Field(
        default=0.0,
        description="Time that the host's adapter adds to each request with answers, as a USB latency timer [us]",
        examples=[1000],
    )
    host_us: TimeUs = Field(
        default=0.0, description="The host's own time in a cycle, between feedback and commands [us]", examples=[200]
    )
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
        description="How long the master waits for an answer that does not come; of PROFIBUS without it T_SL [us]",
        examples=[2000],
    )

    def _problems(self) -> Iterator[Problem]:
        protocol = protocol_of(self)
        ways = protocol.requests
        if not ways:
            yield Problem("has no request that reads a node; give read_request_bytes", "protocol")
        elif self.requests is not None and self.requests not in ways:
            yield Problem(f"the protocol has none of these; it has {', '.join(ways)}", "requests")
        if self.global_control and not protocol.global_bytes:
            yield Problem("the protocol has no broadcast that opens a cycle", "global_control")
        if self.retries and self.timeout_us is None and self.protocol != "profibus-dp":
            yield Problem("a repeated request waits for a timeout; give bus.timeout_us", "retries")
        if self.return_delay_us is not None and self.protocol == "profibus-dp":
            yield Problem("PROFIBUS has no return delay; give max_turn_bits", "return_delay_us")


class PolledProfile(Profile):
    """A whole profile: one motion network and its cycle."""

    bus: PolledBus = Field(description="The bus")


PROFILE: Final = PolledProfile
