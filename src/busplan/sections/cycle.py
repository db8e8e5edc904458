"""Sections that every kind of bus shares, on the cycle and its nodes: [bus], [cycle], [payload], [node], [[group]].

A kind of bus adds its own keys in a class of its own. The limits of its standard are not checked here: a profile that
breaks them loads, and the analysis says why it does not fit.
"""

from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from busplan.elementwise import Number
from busplan.sections.base import (
    MAX_COUNT,
    MAX_TIME_US,
    MIN_STEP_US,
    Count,
    Extended,
    Problem,
    Section,
    TimeUs,
    refused,
)
from busplan.sections.execution import Execution
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

SliceRatio = Annotated[
    float,
    Field(
        ge=1e-6,
        le=1,
        allow_inf_nan=False,
        description="Share alpha of the period that is for communication, 0..1",
        examples=[0.5],
    ),
]


class BusSection(Extended):
    """Section [bus]. Every kind of bus has `nodes` and `timing_model`, where they belong among its own keys."""

    kind: str = Field(description="Kind of bus", examples=["ieee1394"])

    if TYPE_CHECKING:
        nodes: int | None
        timing_model: str


class CycleSection(Extended):
    """Section [cycle]: the communication period and what of it is for communication."""

    period_us: Annotated[float, Field(ge=MIN_STEP_US, le=MAX_TIME_US, allow_inf_nan=False)] = Field(
        description="Communication period T_s [us]", examples=[4000]
    )
    slice_ratio: SliceRatio = 1.0
    nonperiodic_us: TimeUs = Field(
        default=0.0, description="Time kept for non-periodic data in each cycle T_npd [us]", examples=[0]
    )


class PayloadSection(Extended):
    """Section [payload]: what is read from and written to each node in a cycle, fixed and for each of its axes."""

    read_bytes: Count | None = Field(
        default=None, description="Payload of the read transaction, or its fixed part [bytes]", examples=[12]
    )
    write_bytes: Count | None = Field(
        default=None, description="Payload of the write transaction, or its fixed part [bytes]", examples=[12]
    )
    read_bytes_per_axis: Count | None = Field(
        default=None, description="What each axis of a node adds to the read payload [bytes]", examples=[8]
    )
    write_bytes_per_axis: Count | None = Field(
        default=None, description="What each axis of a node adds to the write payload [bytes]", examples=[8]
    )

    @model_validator(mode="after")
    def _is_given(self) -> Self:
        missing = [
            Problem(
                f"missing key; expected {kind}_bytes, {kind}_bytes_per_axis or both",
                key=f"{kind}_bytes",
                kind="missing-key",
            )
            for kind in TRANSACTION_KINDS
            if self._parts(kind) == (None, None)
        ]
        if missing:
            raise refused(*missing)
        return self

    def _parts(self, kind: TransactionKind) -> tuple[Number | None, Number | None]:
        return getattr(self, f"{kind}_bytes"), getattr(self, f"{kind}_bytes_per_axis")

    def bytes_of(self, kind: TransactionKind, *, axes: Number) -> Number:
        """Payload of a transaction with a node [bytes].

        Parameters
        ----------
        kind
            "read" or "write".
        axes
            Axes of the node; of any sort [1].
        """
        fixed, per_axis = self._parts(kind)
        if per_axis is None:
            return 0 if fixed is None else fixed
        share = per_axis * axes
        return share if fixed is None else fixed + share

    def key_of(self, kind: TransactionKind) -> str:
        """The key that a payload is changed by first: what each axis adds, where it adds something."""
        return f"{kind}_bytes" if self._parts(kind)[1] is None else f"{kind}_bytes_per_axis"

    @property
    def follows_axes(self) -> bool:
        """Whether more axes mean more bytes."""
        return any(self._parts(kind)[1] is not None for kind in TRANSACTION_KINDS)


class NodeSection(Section):
    """Section [node]: a distributed node."""

    axes: Count = Field(description="Axes that one node controls", examples=[4])
    execution: Execution = Field(description="Execution time T_exec in the node, measured")


GroupName = Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
GroupAxes = Annotated[
    int,
    Field(ge=0, le=MAX_COUNT, description="Axes that one node of the group controls; 0 for inputs and outputs"),
]


class GroupSection(NodeSection, PayloadSection):
    """One of the sections [[group]]: nodes that are alike, in the order of the chain.

    They stand instead of `bus.nodes`, [node] and [payload]. A kind of bus extends its own node and payload by this
    section, and says `axes` again.
    """

    name: GroupName = Field(description="Name of the group; its keys are group.NAME.key", examples=["drives"])
    nodes: Count = Field(description="Nodes of the group", examples=[2])
    axes: GroupAxes = Field(examples=[4])

    @model_validator(mode="after")
    def _has_payloads(self) -> Self:
        empty = [
            Problem(
                f"makes a payload of 0 bytes, for the group has no axes; give {kind}_bytes",
                key=self.key_of(kind),
                kind="inconsistent",
            )
            for kind in TRANSACTION_KINDS
            if not self.bytes_of(kind, axes=self.axes)
        ]
        if empty:
            raise refused(*empty)
        return self


SpareCount = Annotated[int, Field(ge=0, le=MAX_COUNT)]


class Limits(Section):
    """Section [limits]: what must stay free.

    `reserve` is part of every verdict. The others are for `busplan check`, which does not check what is left out.
    """

    reserve: Annotated[float, Field(ge=0, le=0.99, allow_inf_nan=False)] = Field(
        default=0.0,
        description="Share of the time slice that must be free for a cycle to be shown to fit, 0..0.99",
        examples=[0.15],
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
    missed_cycles: SpareCount = Field(
        default=0,
        description="Most cycles of a recording without a frame or SYNC, most PDOs missing or twice, and most error "
        "frames",
        examples=[0],
    )
