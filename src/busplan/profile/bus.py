"""The sections that describe the bus and its cycle: [bus], [cycle], [payload], [node].

The bus standard's own limits are not checked here: a profile that breaks them loads, and the analysis says why it
does not fit.
"""

from bisect import bisect_left
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, ValidatorFunctionWrapHandler, WrapValidator, model_validator

from busplan.buses.ieee1394.constants import (
    DATA_RATE_MBIT_S,
    MAX_GAP_COUNT,
    MAX_PAYLOAD_BYTES,
    PACKET_OVERHEAD_BYTES,
    PING_PER_NODE_US,
    PING_US,
    REFERENCE_CABLE_M,
    SLICE_RATIO,
    Speed,
    gap_count_by_hops,
)
from busplan.buses.ieee1394.timing import Link, TimingModelName
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US, Bytes, Count, Problem, Section, TimeUs, refused


def _known_speed(value: object) -> object:
    if isinstance(value, str) and value in ("S800", "S1600", "S3200"):
        raise refused(
            Problem(
                f"{value} arbitrates by BOSS, which has no gaps: equations (4) and (10) do not hold. "
                'Expected "S100", "S200" or "S400"'
            )
        )
    return value


def _gap_count(value: object, handler: ValidatorFunctionWrapHandler) -> object:
    # One message for the whole union, instead of one for each of its members.
    try:
        return handler(value)
    except ValueError:
        raise refused(Problem(f'expected a whole number from 0 to {MAX_GAP_COUNT}, or "optimal"')) from None


GapCount = Annotated[Annotated[int, Field(ge=0, le=MAX_GAP_COUNT)] | Literal["optimal"], WrapValidator(_gap_count)]


class Ieee1394Bus(Section):
    """Section [bus]: an IEEE 1394 (FireWire) bus up to S400."""

    kind: Literal["ieee1394"] = Field(description="Kind of bus", examples=["ieee1394"])
    speed: Annotated[Speed, BeforeValidator(_known_speed)] = Field(
        description="Speed code of all packets: S100, S200 or S400", examples=["S400"]
    )
    gap_count: GapCount = Field(
        default=MAX_GAP_COUNT,
        description='Gap count of all nodes, 0..63, or "optimal": the smallest safe one for the hops',
        examples=[MAX_GAP_COUNT],
    )
    nodes: Count = Field(description="Distributed nodes N, host not counted", examples=[2])
    max_hops: Count | None = Field(
        default=None,
        description="Most cable hops between any two nodes of a tree, the host counted among them; "
        "without it the bus is a chain with the host at its end",
        examples=[3],
    )
    cable_length_m: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = Field(
        default=float(REFERENCE_CABLE_M), description="Length of one cable [m]", examples=[4.5]
    )
    timing_model: TimingModelName = Field(
        default="standard",
        description="Timing model that decides, paper or standard; reports show both",
        examples=["standard"],
    )

    @model_validator(mode="after")
    def _table_holds_for_the_cable(self) -> Self:
        if self.gap_count == "optimal" and not self.cable_is_standard:
            raise refused(
                Problem(
                    f"the table behind it holds for cables of up to {REFERENCE_CABLE_M:g} m, "
                    f"and cable_length_m is {self.cable_length_m:g}: give the gap count as a number",
                    key="bus.gap_count",
                    kind="inconsistent",
                )
            )
        return self

    @property
    def cable_is_standard(self) -> bool:
        """Whether the cable is no longer than those that the gap-count table holds for."""
        return self.cable_length_m <= REFERENCE_CABLE_M

    def hops(self, nodes: int) -> int:
        """Most cable hops with that many nodes on the bus [1].

        In a chain they lie between the host and the farthest node. In a tree they are `max_hops`, which the host's own
        way to a node never exceeds.
        """
        return nodes if self.max_hops is None else self.max_hops

    def gap_count_for(self, nodes: int) -> int:
        """Gap count in force with that many nodes on the bus [1]."""
        return gap_count_by_hops(self.hops(nodes)) if isinstance(self.gap_count, str) else self.gap_count

    def link(self, nodes: int) -> Link:
        """Rate, gap count and distance with that many nodes on the bus."""
        return Link(
            data_rate_mbit_s=float(DATA_RATE_MBIT_S[self.speed]),
            gap_count=self.gap_count_for(nodes),
            hops=self.hops(nodes),
            cable_length_m=self.cable_length_m,
        )

    @property
    def max_payload_bytes(self) -> int:
        """Largest payload of an asynchronous packet at this speed [bytes]."""
        return int(MAX_PAYLOAD_BYTES[self.speed])


class Sync(Section):
    """Section [cycle.sync]: the synchronous packet that opens a cycle, CTS of equation (2)."""

    ping_us: TimeUs = Field(
        default=float(PING_US), description="Latency of a ping to one node, measured [us]", examples=[0.3]
    )
    ping_per_node_us: TimeUs = Field(
        default=float(PING_PER_NODE_US), description="What each further node adds, measured [us]", examples=[0.1]
    )

    def sync_us(self, nodes: int) -> float:
        """CTS with that many nodes on the bus [us]."""
        return self.ping_us + self.ping_per_node_us * (nodes - 1)


class Cycle(Section):
    """Section [cycle]: the communication period and what of it is for communication."""

    period_us: Annotated[float, Field(ge=MIN_STEP_US, le=MAX_TIME_US, allow_inf_nan=False)] = Field(
        description="Communication period T_s [us]", examples=[4000]
    )
    slice_ratio: Annotated[float, Field(ge=1e-6, le=1, allow_inf_nan=False)] = Field(
        default=float(SLICE_RATIO),
        description="Share alpha of the period that is for communication, 0..1",
        examples=[0.5],
    )
    nonperiodic_us: TimeUs = Field(
        default=0.0, description="Time kept for non-periodic data in each cycle T_npd [us]", examples=[0]
    )
    sync: Sync = Field(default_factory=Sync, description="The synchronous packet that opens a cycle")


class Payload(Section):
    """Section [payload]: what is read from and written to each node in a cycle."""

    read_bytes: Count = Field(description="Payload of the read transaction [bytes]", examples=[12])
    write_bytes: Count = Field(description="Payload of the write transaction [bytes]", examples=[12])
    overhead_bytes: Bytes = Field(
        default=int(PACKET_OVERHEAD_BYTES),
        description="Overhead of a packet in the paper model; the standard model uses real sizes [bytes]",
        examples=[20],
    )


class GradedExecution(Section):
    """What both forms of the execution time share."""

    grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description="How the execution time is known; the gate warns of assumed", examples=["measured"]
    )


class LinearExecution(GradedExecution):
    """Section [node.execution] of kind "linear": base_us + per_byte_us * payload."""

    kind: Literal["linear"] = Field(description="Form of the execution time", examples=["linear"])
    base_us: TimeUs = Field(description="Execution time of an empty payload [us]", examples=[30])
    per_byte_us: TimeUs = Field(description="What each byte of payload adds [us/byte]", examples=[0.35])

    def execution_us(self, payload_bytes: int) -> float:
        """Execution time T_exec of one transaction with that payload [us]."""
        return self.base_us + self.per_byte_us * payload_bytes


class TableExecution(GradedExecution):
    """Section [node.execution] of kind "table": measured times, linear between them, nothing beyond them."""

    kind: Literal["table"] = Field(description="Form of the execution time", examples=["table"])
    # Strictness would refuse TOML's arrays for a tuple; their elements stay strict.
    payload_bytes: Annotated[tuple[Bytes, ...], Field(strict=False, min_length=1)] = Field(
        description="Payloads that were measured, ascending [bytes]", examples=[[4, 16]]
    )
    time_us: Annotated[tuple[TimeUs, ...], Field(strict=False, min_length=1)] = Field(
        description="Execution time T_exec of each [us]", examples=[[36.7, 36.3]]
    )

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        problems = [
            Problem(
                f"payloads must ascend, and this follows {one}",
                key=f"node.execution.payload_bytes.{index}",
                kind="inconsistent",
            )
            for index, (one, other) in enumerate(pairwise(self.payload_bytes), start=1)
            if one >= other
        ]
        if len(self.payload_bytes) != len(self.time_us):
            values = f"has {len(self.time_us)} values and payload_bytes has {len(self.payload_bytes)}"
            problems.append(
                Problem(f"{values}: the two must be of one length", key="node.execution.time_us", kind="inconsistent")
            )
        if problems:
            raise refused(*problems)
        return self

    def covers(self, payload_bytes: int) -> bool:
        """Tell whether the execution time of that payload is known."""
        return self.payload_bytes[0] <= payload_bytes <= self.payload_bytes[-1]

    @property
    def range_bytes(self) -> str:
        """The payloads the table covers, in words."""
        return f"{self.payload_bytes[0]} to {self.payload_bytes[-1]} bytes"

    def execution_us(self, payload_bytes: int) -> float:
        """Execution time T_exec of one transaction with that payload [us].

        Raises
        ------
        ValueError
            The payload lies outside the table (see `covers`): nothing is extrapolated.
        """
        if not self.covers(payload_bytes):
            raise ValueError(f"{payload_bytes} bytes is outside the execution table, {self.range_bytes}")
        index = bisect_left(self.payload_bytes, payload_bytes)
        x1, y1 = self.payload_bytes[index], self.time_us[index]
        if x1 == payload_bytes:
            return y1
        x0, y0 = self.payload_bytes[index - 1], self.time_us[index - 1]
        return y0 + (y1 - y0) * (payload_bytes - x0) / (x1 - x0)


Execution = Annotated[LinearExecution | TableExecution, Field(discriminator="kind")]


class Node(Section):
    """Section [node]: one distributed node."""

    axes: Count = Field(description="Axes that one node controls", examples=[4])
    execution: Execution = Field(description="Execution time T_exec in the node, measured")
