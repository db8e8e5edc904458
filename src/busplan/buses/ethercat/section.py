"""Keys of [bus], [node] and [[group]] that only an EtherCAT bus has."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field, field_validator

from busplan.buses.ethercat.equations import (
    SEPARATE,
    Master,
    Port,
    ProcessData,
    Starts,
    c,
    room_bytes,
)
from busplan.buses.ethercat.frames import MOST_CYCLES, checked_hyperperiod
from busplan.elementwise import Number
from busplan.errors import BusplanError
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MISSING, Bytes, Count, Problem, TimeUs, groups_field, refused
from busplan.sections.cycle import (
    BusSection,
    Execution,
    GroupAxes,
    GroupSection,
    NodeSection,
    PayloadSection,
    time_uncertainty_us,
    worst_of_cycles,
)
from busplan.sections.profile import Profile

HousekeepingBytes = Annotated[int, Field(ge=0, le=int(room_bytes(1)))]
_LONGEST_CABLE_M = 1e5
_MOST_PIPELINE_CYCLES = 1000


class EthercatBus(BusSection):
    """Section [bus]: an EtherCAT segment at 100 Mbit/s."""

    kind: Literal["ethercat"] = Field(description="Kind of bus", examples=["ethercat"])
    nodes: Count | None = Field(default=None, description="Devices N, the master not counted", examples=[8])
    master: Master | None = Field(
        default=None,
        description="Master, which sets process_data and housekeeping_bytes; without it the most bytes of those "
        "known but ethercrab",
        examples=["SOEM"],
    )
    process_data: ProcessData | None = Field(
        default=None,
        description="Datagrams of process data; LRW-separate: separate bytes for inputs and outputs; LRW-shared: "
        "the same bytes; LRD-LWR: two datagrams; without it by the master",
        examples=[SEPARATE],
    )
    housekeeping_bytes: Annotated[tuple[HousekeepingBytes, ...], Field(strict=False)] | None = Field(
        default=None,
        description="Data of each datagram that the master adds to a cycle, distributed clocks included; without it "
        "by the master [bytes]",
        examples=[[2, 8]],
    )
    distributed_clocks: bool = Field(
        default=False,
        description="Whether devices have distributed clocks: one more datagram, and drives act at SYNC0",
        examples=[True],
    )
    sync_shift: Annotated[float, Field(ge=0, le=0.999, allow_inf_nan=False)] = Field(
        default_factory=lambda: float(c.SYNC_SHIFT),
        description="SYNC0 after the master's task, a share of the period, 0..0.999; 0 is the next task; with "
        "distributed clocks only",
        examples=[0.5],
    )
    mailbox_polls: Annotated[int, Field(ge=0, le=MAX_COUNT)] = Field(
        default=0, description="Mailbox polls in each cycle, each in its own frame", examples=[1]
    )
    mailbox_bytes: Annotated[int, Field(ge=1, le=int(room_bytes(1)))] = Field(
        default_factory=lambda: int(c.MAILBOX_BYTES),
        description="Data of each mailbox poll [bytes]",
        examples=[int(c.unchanged["MAILBOX_BYTES"])],
    )
    master_us: TimeUs = Field(
        default=0.0,
        description="The master's own time in each cycle: from its task to the wire, and from the last byte to its "
        "task [us]",
        examples=[30],
    )
    master_grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description='Grade of master_us; the gate warns of "assumed"', examples=["measured"]
    )
    master_uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of master_us; without it 10 % where that is graded other than assumed, "
        "else master_us / sqrt(3) [us]",
        examples=[5],
    )
    master_jitter_us: TimeUs = Field(
        default=0.0, description="Latest start of the frames after the task [us]", examples=[20]
    )
    master_jitter_cycles: Count | None = worst_of_cycles("master_jitter_us")
    pipeline_cycles: Annotated[int, Field(ge=0, le=_MOST_PIPELINE_CYCLES)] = Field(
        default_factory=lambda: int(c.PIPELINE_CYCLES),
        description="Cycles from feedback to the command computed from it; for latency, and a loop on the host",
        examples=[1],
    )
    units: Literal["spread", "together"] = Field(
        default="spread",
        description="Groups with every > 1: spread evenly over cycles, or together in one",
        examples=["together"],
    )

    @property
    def master_doubt_us(self) -> Number:
        """Standard uncertainty of the master's own time [us]."""
        is_guess = self.master_grade in (None, "assumed")
        return time_uncertainty_us(self.master_us, is_guess=is_guess, given_us=self.master_uncertainty_us)


class EthercatNode(NodeSection):
    """Section [node]: one device, and the cable to it."""

    port: Port = Field(
        default="100BASE-TX",
        description="Ports, which set the delay: 100BASE-TX, or E-bus between the terminals of a block",
        examples=["E-bus"],
    )
    delay_us: TimeUs | None = Field(
        default=None,
        description="Measured delay of the device one way, without cable; without it by the port [us]",
        examples=[0.7],
    )
    cable_length_m: Annotated[float, Field(ge=0, le=_LONGEST_CABLE_M, allow_inf_nan=False)] = Field(
        default=0.0, description="Cable from the device before it, or from the master [m]", examples=[2]
    )
    sync_window_us: Annotated[float, Field(gt=0, le=MAX_TIME_US, allow_inf_nan=False)] | None = Field(
        default=None,
        description="Largest movement of a frame against SYNC0 from cycle to cycle before the device reports an "
        "error, up "
        "to the period; used only with distributed clocks [us]",
        examples=[50],
    )


def _no_time_without_axes(group: dict[str, Any]) -> dict[str, Any] | None:
    """Default execution of a group: 0 for devices without axes, None for others, which must give it."""
    if group.get("axes", 1):
        return None
    return {"kind": "linear", "grade": "assumed", "base_us": 0.0, "per_byte_us": 0.0}


class EthercatGroup(EthercatNode, GroupSection):
    """One of the sections [[group]]: devices that are alike, in the order of the segment."""

    axes: GroupAxes = Field(examples=[4])
    every: Annotated[int, Field(ge=1, le=MOST_CYCLES)] = Field(
        default=1, description="The group's process data go in every n-th cycle [1]", examples=[4]
    )
    starts: Starts | None = Field(
        default=None,
        description="Start of the group: a datagram of its own, as of a domain of IgH, or a frame of its own, "
        "as of a task of TwinCAT; without it its data follow in the datagram of the group before",
        examples=["datagram"],
    )
    execution: Execution = Field(
        default_factory=_no_time_without_axes,
        validate_default=True,
        description="Execution time T_exec in the device, measured; without axes it may be left out: couplers and "
        "terminals take the data of their frame at once, which is assumed",
    )
    read_bytes: Bytes | None = Field(
        default=None, description="Inputs of each device, or their fixed part; 0 of a coupler [bytes]", examples=[12]
    )
    write_bytes: Bytes | None = Field(
        default=None, description="Outputs of each device, or their fixed part; 0 of a coupler [bytes]", examples=[12]
    )

    @field_validator("execution", mode="before")
    @classmethod
    def _has_execution(cls, value: object) -> object:
        if value is None:
            raise refused(Problem(MISSING, kind="missing-key"))
        return value

    # Couplers have no data, and most terminals have inputs only or outputs only.
    may_be_empty: ClassVar[bool] = True


class EthercatProfile(Profile):
    """A whole profile: one motion network and its cycle."""

    bus: EthercatBus = Field(description="The bus")
    payload: PayloadSection | None = Field(default=None, description="Payload of a cycle, where nodes are alike")
    node: EthercatNode | None = Field(default=None, description="One device, where nodes are alike")
    group: Annotated[tuple[EthercatGroup, ...], groups_field()] = Field(
        default=(), description="Groups of unlike nodes, instead of bus.nodes, [node] and [payload]"
    )

    def _problems(self) -> Iterator[Problem]:
        sections = {"node": self.node, **{f"group.{place}": group for place, group in enumerate(self.group)}}
        for section, nodes in sections.items():
            window_us = None if nodes is None else nodes.sync_window_us
            if window_us is not None and window_us > self.cycle.period_us:
                why = f"is over cycle.period_us, {self.cycle.period_us:g}: a window about SYNC0 is within a period"
                yield Problem(why, key=f"{section}.sync_window_us", kind="inconsistent")
        try:
            checked_hyperperiod([group.every for group in self.group])
        except BusplanError as error:
            slowest = max(range(len(self.group)), key=lambda index: self.group[index].every)
            yield Problem(str(error), key=f"group.{slowest}.every", kind="inconsistent")


PROFILE: Final = EthercatProfile
