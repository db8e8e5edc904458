"""Keys of [bus], [cycle] and [payload] that only an IEEE 1394 bus has."""

from collections.abc import Iterator
from typing import Annotated, Final, Literal

from pydantic import Field, ValidatorFunctionWrapHandler, WrapValidator

from busplan.buses.ieee1394.constants import (
    MAX_GAP_COUNT,
    Speed,
    c,
)
from busplan.elementwise import Number, choose
from busplan.sections.base import MAX_COUNT, Bytes, Count, Problem, Section, TimeUs, groups_field, refused
from busplan.sections.cycle import (
    BusSection,
    CycleSection,
    GroupAxes,
    GroupSection,
    LinearExecution,
    NodeSection,
    PayloadSection,
    SliceRatio,
    TableExecution,
    time_uncertainty_us,
    worst_of_cycles,
)
from busplan.sections.profile import Profile


def _gap_count(value: object, handler: ValidatorFunctionWrapHandler) -> object:
    # The union has one message, not one for each of its members.
    try:
        return handler(value)
    except ValueError:
        raise refused(Problem(f'expected a whole number from 0 to {MAX_GAP_COUNT}, or "optimal"')) from None


GapCount = Annotated[Annotated[int, Field(ge=0, le=MAX_GAP_COUNT)] | Literal["optimal"], WrapValidator(_gap_count)]


class Ieee1394Bus(BusSection):
    """Section [bus]: an IEEE 1394 (FireWire) bus; from S800 on a lower bound."""

    kind: Literal["ieee1394"] = Field(description="Kind of bus", examples=["ieee1394"])
    speed: Speed = Field(
        description="Speed code of all packets. From S800 on no time of the arbitration is published: the cycle is a "
        "lower bound, and no plan is shown to fit",
        examples=["S400"],
    )
    gap_count: GapCount = Field(
        default=MAX_GAP_COUNT,
        description='Gap count of all nodes; "optimal": the smallest safe one for the hops. Not used from S800 on',
        examples=[MAX_GAP_COUNT],
    )
    nodes: Count | None = Field(default=None, description="Distributed nodes N, host not counted", examples=[2])
    max_hops: Count | None = Field(
        default=None,
        description="Most cable hops between any two nodes of a tree, host included; without it the bus is a chain "
        "with the host at its end",
        examples=[3],
    )
    cable_length_m: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = Field(
        default_factory=lambda: float(c.REFERENCE_CABLE_M), description="Length of one cable [m]", examples=[4.5]
    )
    charge_hops: Literal["farthest", "own"] = Field(
        default="farthest",
        description="Hops in the times of each node: those of the farthest, or its own. A broadcast always goes to the "
        "farthest",
        examples=["own"],
    )
    root: Literal["host"] | None = Field(
        default=None,
        description="Root, which grants arbitration; without it any node may be the root, so that arbitration always "
        "counts the hops of the whole chain",
        examples=["host"],
    )
    cycle_master: bool = Field(
        default=True,
        description="Whether a node sends cycle start packets, one every 125 us: an OHCI host does by default "
        "(Linux, ohci.c), so without the key the standard model counts them, assumed; the paper model has no term "
        "for them",
        examples=[True],
    )
    isochronous_us: Annotated[float, Field(ge=0, le=float(c.unchanged["CYCLE_US"]), allow_inf_nan=False)] = Field(
        default=0.0,
        description="Isochronous traffic after each cycle start; 100 us at most (Linux, core.h: 80 % of a cycle) [us]",
        examples=[20],
    )
    sync_jitter_us: TimeUs = Field(
        default=0.0,
        description="Latest start of a cycle by the host; the cycle ends before the next one. Cycle starts are the "
        "bus's own and stay punctual [us]",
        examples=[50],
    )
    sync_jitter_cycles: Count | None = worst_of_cycles("sync_jitter_us")
    phy_delay_us: Annotated[float, Field(gt=0, le=10, allow_inf_nan=False)] | None = Field(
        default=None,
        description="Repeat delay of one PHY; without it 14 ticks of the base rate, 0.142 us (TI TSB12LV41: 0.144 us "
        "in the worst case), and from S800 on none [us]",
        examples=[0.144],
    )

    def _problems(self) -> Iterator[Problem]:
        if self.gap_count == "optimal" and not self.cable_is_standard:
            message = (
                f"the table behind it holds for cables of up to {c.REFERENCE_CABLE_M:g} m, "
                f"and cable_length_m is {self.cable_length_m:g}: give the gap count as a number"
            )
            yield Problem(message, "gap_count", "inconsistent")
        if self.isochronous_us and not self.cycle_master:
            message = "isochronous traffic follows cycle starts, and cycle_master is false: set bus.cycle_master = true"
            yield Problem(message, "isochronous_us", "inconsistent")

    @property
    def cable_is_standard(self) -> bool:
        """Whether the gap-count table holds for the cable: it is no longer than the table's."""
        return self.cable_length_m <= c.REFERENCE_CABLE_M


class Sync(Section):
    """Section [cycle.sync]: the synchronous packet that opens a cycle, CTS of equation (2)."""

    ping_us: TimeUs = Field(
        default_factory=lambda: float(c.PING_US),
        description="Latency of a ping to one node, measured; used by the paper model alone [us]",
        examples=[0.3],
    )
    ping_per_node_us: TimeUs = Field(
        default_factory=lambda: float(c.PING_PER_NODE_US),
        description="Measured time per further node; used by the paper model alone [us]",
        examples=[0.1],
    )


class Ieee1394CycleSection(CycleSection):
    """Section [cycle]: the communication period and what of it is for communication."""

    slice_ratio: SliceRatio = Field(default_factory=lambda: float(c.SLICE_RATIO))
    schedule: Literal["individual", "broadcast"] = Field(
        default="individual",
        description="individual: a read and a write of each node; broadcast: one query, after which each node "
        "broadcasts its data, one read of the hub that collected them, and one write",
        examples=["broadcast"],
    )
    broadcast_request: Literal["isochronous", "priority", "timed"] = Field(
        default="priority",
        description="priority: each node broadcasts after a subaction gap (JHU firmware Rev 9); isochronous: without "
        "one (Rev 8); timed: at a time of its own (up to Rev 7)",
        examples=["isochronous"],
    )
    retries: Annotated[int, Field(ge=0, le=MAX_COUNT)] = Field(
        default=0,
        description="Busy retries of the longest request that a cycle must have time for (IEEE 1394, ack_busy)",
        examples=[1],
    )
    sync: Sync = Field(default_factory=Sync, description="The synchronous packet that opens a cycle")


class Ieee1394Payload(PayloadSection):
    """Section [payload]: what is read from and written to each node in a cycle."""

    overhead_bytes: Bytes = Field(
        default_factory=lambda: int(c.PACKET_OVERHEAD_BYTES),
        description="Overhead of a packet in the paper model; the standard model uses real sizes [bytes]",
        examples=[20],
    )


class FittedExecution(Section):
    """Keys of an execution time that was fitted against a timing model, and so contains that model's error."""

    residual: Literal["none", "paper", "standard"] = Field(
        default="none",
        description="Timing model whose packet times were subtracted from the latency; none where they were measured "
        "(busplan calibrate writes it)",
        examples=["standard"],
    )
    measured_gap_count: Annotated[int, Field(ge=0, le=MAX_GAP_COUNT)] = Field(
        default=MAX_GAP_COUNT,
        description="Gap count of the bus that the latency was measured on; used only with a residual other than none",
        examples=[63],
    )


class Ieee1394LinearExecution(LinearExecution, FittedExecution):
    """Section [node.execution] of kind "linear": base_us + per_byte_us * payload."""


class Ieee1394TableExecution(TableExecution, FittedExecution):
    """Section [node.execution] of kind "table": measured times, linear between them, nothing beyond them."""


_HoldUs = Annotated[float, Field(ge=0, le=float(c.unchanged["ARBITRATION_HOLD_US"]), allow_inf_nan=False)]


class Ieee1394Node(NodeSection):
    """Section [node]: a distributed node, and how it answers."""

    execution: Annotated[Ieee1394LinearExecution | Ieee1394TableExecution, Field(discriminator="kind")] = Field(
        description="Execution time T_exec in the node, measured"
    )
    read_response: Literal["split", "concatenated"] = Field(
        default="split",
        description="Answer of a node to a read; split: it arbitrates for its response; concatenated: the response "
        "follows its acknowledge",
        examples=["split"],
    )
    write_response: Literal["split", "unified"] = Field(
        default="split",
        description="Answer of a node to a write; split: it sends a response; unified: its acknowledge is the answer",
        examples=["unified"],
    )
    response_us: _HoldUs = Field(
        default_factory=lambda: float(c.ARBITRATION_HOLD_US),
        description="Time from the acknowledge to a concatenated response; hardware slower than MAX_BUS_HOLD, 1.63 us "
        "(recalled), answers split. Used only for concatenated answers [us]",
        examples=[0.5],
    )


class Ieee1394Group(Ieee1394Node, Ieee1394Payload, GroupSection):
    """One of the sections [[group]]: nodes that are alike, in the order of the chain."""

    axes: GroupAxes = Field(examples=[4])
    hops: Count | None = Field(
        default=None,
        description="Cable hops from the host to each node of the group, in a tree; not given in a chain",
        examples=[2],
    )


class Host(Section):
    """Section [host]: the host that sends the requests."""

    transaction_us: TimeUs = Field(
        default=0.0, description="The host's own time between a response and its next request [us]", examples=[5]
    )
    grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description="Grade of transaction_us", examples=["measured"]
    )
    uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of transaction_us; without it 10 % of it, where it is assumed "
        "transaction_us / sqrt(3) [us]",
        examples=[0.5],
    )

    @property
    def standard_uncertainty_us(self) -> Number:
        """Standard uncertainty u(host) [us]."""
        if self.uncertainty_us is not None:
            return self.uncertainty_us
        unknown_us = time_uncertainty_us(self.transaction_us, is_guess=self.grade == "assumed")
        # A time of 0 rests on no assumption.
        return choose(self.transaction_us == 0, 0.0, unknown_us)


class Ieee1394Profile(Profile):
    """A whole profile: one motion network and its cycle."""

    node: Ieee1394Node | None = Field(default=None, description="One distributed node, where nodes are alike")
    group: Annotated[tuple[Ieee1394Group, ...], groups_field(c.unchanged["MAX_NODES"])] = Field(
        default=(), description="Groups of unlike nodes, instead of bus.nodes, [node] and [payload]"
    )
    host: Host = Field(default_factory=Host, description="The host that sends the requests")
    bus: Ieee1394Bus = Field(description="The bus")
    cycle: Ieee1394CycleSection = Field(description="The communication cycle")
    payload: Ieee1394Payload | None = Field(default=None, description="Payload of a cycle, where nodes are alike")

    def _problems(self) -> Iterator[Problem]:
        most, is_charged = self.bus.max_hops, self.bus.charge_hops == "own"
        for place, group in enumerate(self.group):
            key = f"group.{place}.hops"
            if group.hops is None and most is not None and is_charged:
                message = 'missing key: bus.charge_hops = "own" needs the hops of each group of a tree'
                yield Problem(message, key, "missing-key")
            if group.hops is not None and most is None:
                message = "the order of the groups says it in a chain; set bus.max_hops for a tree"
                yield Problem(message, key, "inconsistent")
            if group.hops is not None and most is not None and group.hops > most:
                yield Problem(f"is over the {most} hops of bus.max_hops", key, "inconsistent")
        if most is not None and is_charged and not self.group:
            message = "needs the hops of each node of a tree: describe them as groups, [[group]] with hops"
            yield Problem(message, "bus.charge_hops", "inconsistent")


PROFILE: Final = Ieee1394Profile
