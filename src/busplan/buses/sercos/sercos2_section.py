"""Keys of [bus] that only SERCOS I and II have."""

from typing import Annotated, Final, Literal

from pydantic import Field

from busplan.buses.sercos.sercos2 import DataRate, c
from busplan.buses.sercos.shared import MOST_PIPELINE
from busplan.sections.base import Count, TimeUs
from busplan.sections.cycle import BusSection
from busplan.sections.profile import Profile


class Sercos2Bus(BusSection):
    """Section [bus]: a SERCOS I or II ring."""

    kind: Literal["sercos2"] = Field(description="Kind of bus", examples=["sercos2"])
    data_rate_mbit_s: DataRate = Field(
        description="Data rate of the ring; 8 and 16 with SERCOS II [Mbit/s]", examples=[16]
    )
    at_gap_us: TimeUs = Field(
        description="Gap between the telegrams of two drives; not published: take it from the master's time slots, "
        "or assume it [us]",
        examples=[5],
    )
    nodes: Count | None = Field(default=None, description="Drives N, master not counted", examples=[8])
    at_start_us: TimeUs | None = Field(
        default=None,
        description="From MST to the first AT, t1min of the slowest drive (S-0-0003); without it 12 at 2 and 4 "
        "Mbit/s, 4 at 8 and 16 [us]",
        examples=[12],
    )
    turnaround_us: TimeUs = Field(
        default_factory=lambda: float(c.TURNAROUND_US),
        description="From the last AT to the MDT, t_ATMT of the slowest drive (S-0-0004) [us]",
        examples=[12],
    )
    recovery_us: TimeUs = Field(
        default=0.0,
        description="From the MDT to the next MST, t_MTSY of the slowest drive (S-0-0088) [us]",
        examples=[20],
    )
    pipeline_cycles: Annotated[int, Field(ge=0, le=MOST_PIPELINE)] = Field(
        default_factory=lambda: int(c.PIPELINE_CYCLES),
        description="Cycles from feedback to the command computed from it, for a loop on the host; 0: the master "
        "computes within turnaround_us",
        examples=[2],
    )


class Sercos2Profile(Profile):
    """A whole profile: one motion network and its cycle."""

    bus: Sercos2Bus = Field(description="The bus")


PROFILE: Final = Sercos2Profile
