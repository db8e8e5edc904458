"""Section [limits]: what a plan must keep free."""

from typing import Annotated

from pydantic import Field

from busplan.sections.base import MAX_COUNT, Section

SpareCount = Annotated[int, Field(ge=0, le=MAX_COUNT)]


class Limits(Section):
    """Section [limits]: what a plan must keep free.

    `reserve` is part of every verdict. The others are for `busplan check`, which does not check what is left out.
    """

    reserve: Annotated[float, Field(ge=0, le=0.99, allow_inf_nan=False)] = Field(
        default=0.0, description="Share of the time slice that must be free for a plan to fit, 0..0.99", examples=[0.15]
    )

    max_utilisation: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = Field(
        default=None, description="Largest share of the time slice that may be used, 0..1", examples=[0.8]
    )
    min_spare_nodes: SpareCount | None = Field(
        default=None, description="Nodes that the bus must be able to carry beyond its own", examples=[1]
    )
    min_spare_axes: SpareCount | None = Field(
        default=None, description="Axes that the bus must be able to carry beyond its own", examples=[4]
    )
