"""The section that only the gate reads: [limits], what a plan must keep free."""

from typing import Annotated

from pydantic import Field

from busplan.sections.base import MAX_COUNT, Section

SpareCount = Annotated[int, Field(ge=0, le=MAX_COUNT)]


class Limits(Section):
    """Section [limits]: what `busplan check` asks of a plan beyond fitting. What is left out is not checked."""

    max_utilisation: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = Field(
        default=None, description="Largest share of the time slice that may be used, 0..1", examples=[0.8]
    )
    min_spare_nodes: SpareCount | None = Field(
        default=None, description="Nodes that the bus must be able to carry beyond its own", examples=[1]
    )
    min_spare_axes: SpareCount | None = Field(
        default=None, description="Axes that the bus must be able to carry beyond its own", examples=[4]
    )
