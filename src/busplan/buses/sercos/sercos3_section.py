"""Keys of [bus] that only SERCOS III has."""

from typing import Annotated, Final, Literal

from pydantic import Field

from busplan.buses.sercos.sercos3 import (
    HotPlug,
    TimingMethod,
    Version,
    c,
)
from busplan.buses.sercos.shared import MOST_PIPELINE
from busplan.sections.base import Count, TimeUs
from busplan.sections.cycle import BusSection, worst_of_cycles
from busplan.sections.profile import Profile


class Sercos3Bus(BusSection):
    """Section [bus]: a SERCOS III network, ring or line."""

    kind: Literal["sercos3"] = Field(description="Kind of bus", examples=["sercos3"])
    nodes: Count | None = Field(default=None, description="Devices N, master not counted", examples=[8])
    version: Version = Field(
        default="V1.1",
        description="Protocol version; V1.1 has 2 bytes of connection control for each device",
        examples=["V1.0"],
    )
    hot_plug_field: HotPlug = Field(
        default="all",
        description="Telegrams with a hot-plug field: all (before V1.3), or the first (from V1.3)",
        examples=["first"],
    )
    timing_method: TimingMethod = Field(
        default="mdt-at-ucc",
        description="Order of MDT, AT and the channel for other frames (UCC); methods 1, 2 and 3 of CoSeMa",
        examples=["mdt-ucc-at"],
    )
    gap_bytes: Annotated[int, Field(ge=int(c.unchanged["LEAST_GAP_BYTES"]), le=1000)] = Field(
        default_factory=lambda: int(c.DEFAULT_GAP_BYTES),
        description="Gap between two telegrams, S-0-1036; more devices with more jitter need more [bytes]",
        examples=[12],
    )
    device_delay_us: TimeUs = Field(
        default_factory=lambda: float(c.DEVICE_DELAY_US), description="Delay of a device, one way [us]", examples=[0.6]
    )
    master_jitter_us: TimeUs = Field(
        default_factory=lambda: float(c.MASTER_JITTER_US),
        description="Jitter with which the master sends; CoSeMa demands an eighth of the period at most [us]",
        examples=[0.1],
    )
    master_jitter_cycles: Count | None = worst_of_cycles("master_jitter_us")
    master_delay_us: TimeUs = Field(
        default_factory=lambda: float(c.MASTER_DELAY_US),
        description="From the start of a cycle in the master to the end of the first header [us]",
        examples=[2.56],
    )
    component_delay_us: TimeUs = Field(
        default_factory=lambda: float(c.COMPONENT_DELAY_US),
        description="Delay of all other components in the ring [us]",
        examples=[1.8],
    )
    at_start_us: TimeUs | None = Field(
        default=None,
        description="Least time from the start of the cycle to the first AT, the largest S-0-1006 of the devices; "
        "without it none is counted [us]",
        examples=[100],
    )
    ring_grade: Literal["measured", "published", "assumed"] | None = Field(
        default=None,
        description="Grade of device_delay_us, gap_bytes, and master_jitter_us without master_jitter_cycles; "
        'unless "measured", the published ranges are their doubt',
        examples=["measured"],
    )
    pipeline_cycles: Annotated[int, Field(ge=1, le=MOST_PIPELINE)] = Field(
        default_factory=lambda: int(c.PIPELINE_CYCLES),
        description="Cycles from feedback to the command computed from it, for a loop on the host",
        examples=[2],
    )


class Sercos3Profile(Profile):
    """A whole profile: one motion network and its cycle."""

    bus: Sercos3Bus = Field(description="The bus")


PROFILE: Final = Sercos3Profile
