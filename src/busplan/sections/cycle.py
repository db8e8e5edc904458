"""Sections on the cycle and its nodes, for every kind of bus: [bus], [cycle], [payload], [node], [[group]].

A kind of bus adds its own keys in a class of its own. The limits of its standard are not checked here: a profile that
breaks them loads, and the analysis says why it does not fit.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import ConfigDict, Field

from busplan.elementwise import Number, choose, interpolated
from busplan.english import plural
from busplan.sections.base import (
    MAX_COUNT,
    MAX_TIME_US,
    MIN_STEP_US,
    TRANSACTION_KINDS,
    Bytes,
    Count,
    Problem,
    Section,
    TimeUs,
    TransactionKind,
)
from busplan.sourced import Sourced

UNKNOWN_SHARE: Final = Sourced(
    0.1,
    unit="1",
    grade="assumed",
    source="chosen",
    meaning="standard uncertainty of an unmeasured time, as a share of it",
)
GUESS_SHARE: Final = Sourced(
    1 / 3**0.5,
    unit="1",
    grade="derived",
    source="between 0 and twice its value, rectangular (JCGM 100, 4.3.7)",
    meaning="standard uncertainty of a time that is assumed, as a share of it",
)
MEASURED_UNCERTAINTY_US: Final = Sourced(
    0.1 / 12**0.5,
    unit="us",
    grade="derived",
    source="one digit of 0.1 us, rectangular (JCGM 100, 4.3.7)",
    meaning="standard uncertainty of a measured execution time",
    symbol="u(T_exec)",
)
DERIVED_UNCERTAINTY_US: Final = Sourced(
    1 / 3**0.5,
    unit="us",
    grade="derived",
    source="1 us either way, rectangular (JCGM 100, 4.3.7)",
    meaning="standard uncertainty of an execution time derived from measured figures",
    symbol="u(T_exec)",
)


def time_uncertainty_us(us: Number, *, is_guess: bool, given_us: Number | None = None) -> Number:
    """Standard uncertainty of a machine's time: as given, else that of a time that nobody has measured [us].

    A guess is between 0 and twice its value; another time is known to 10 %.
    """
    if given_us is not None:
        return given_us
    return choose(is_guess, GUESS_SHARE, UNKNOWN_SHARE) * us


def worst_of_cycles(jitter: str) -> Any:
    """Key beside a jitter, by the name of its key: the number of measured cycles of which it is the worst."""
    return Field(
        default=None,
        description=f"Measured cycles of which {jitter} is the worst: then it is no bound, and a plan is shown "
        "to fit only where limits.missed_cycles accepts a later one",
        examples=[900_000],
    )


class GradedExecution(Section):
    """Keys that both forms of the execution time share."""

    grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description='Grade of the execution time; the gate warns of "assumed"', examples=["measured"]
    )
    uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of the execution time; without it the grade says how large it is [us]",
        examples=[0.5],
    )
    worst_extra_us: TimeUs = Field(default=0.0, description="Extra time of the slowest execution [us]", examples=[3.1])

    @property
    def covered_bytes(self) -> tuple[float, float]:
        """Smallest and largest payload whose execution time is known [bytes]."""
        return 0, inf

    def covers(self, payload_bytes: int) -> bool:
        """Whether the execution time of a payload is known."""
        least, most = self.covered_bytes
        return least <= payload_bytes <= most

    def standard_uncertainty_us(self, execution_us: Number) -> Number:
        """Standard uncertainty u(T_exec) of an execution time [us].

        It is the key `uncertainty_us`, or depends on the grade: 0.1 / sqrt(12) for a measured time, 1 / sqrt(3) for a
        derived one, T_exec / sqrt(3) for an assumed one, and 10 % of T_exec for others.
        """
        if self.uncertainty_us is not None:
            return self.uncertainty_us
        unknown_us = time_uncertainty_us(execution_us, is_guess=self.grade == "assumed")
        other_us = choose(self.grade == "derived", DERIVED_UNCERTAINTY_US, unknown_us)
        return choose(self.grade == "measured", MEASURED_UNCERTAINTY_US, other_us)


class LinearExecution(GradedExecution):
    """Section [node.execution] of kind "linear": base_us + per_byte_us * payload."""

    kind: Literal["linear"] = Field(description="Form of the execution time", examples=["linear"])
    base_us: TimeUs = Field(description="Execution time of an empty payload [us]", examples=[30])
    per_byte_us: TimeUs = Field(description="Execution time per byte of payload [us/byte]", examples=[0.35])

    def execution_us(self, payload_bytes: Number) -> Number:
        """Execution time T_exec of a transaction [us]."""
        return self.base_us + self.per_byte_us * payload_bytes


class TableExecution(GradedExecution):
    """Section [node.execution] of kind "table": measured times, linear between them, nothing beyond them."""

    kind: Literal["table"] = Field(description="Form of the execution time", examples=["table"])
    # Strictness would refuse TOML's arrays for a tuple; their elements stay strict.
    payload_bytes: Annotated[tuple[Bytes, ...], Field(strict=False, min_length=1)] = Field(
        description="Payloads that were measured, ascending [bytes]", examples=[[4, 16]]
    )
    time_us: Annotated[tuple[TimeUs, ...], Field(strict=False, min_length=1)] = Field(
        description="Execution time T_exec at each payload [us]", examples=[[36.7, 36.3]]
    )

    def _problems(self) -> Iterator[Problem]:
        for index, (before, after) in enumerate(pairwise(self.payload_bytes), start=1):
            if before >= after:
                why = f"payloads must ascend, and this follows {before}"
                yield Problem(why, key=f"payload_bytes.{index}", kind="inconsistent")
        if len(self.payload_bytes) != len(self.time_us):
            values = f"has {plural(len(self.time_us), 'value')} and payload_bytes has {len(self.payload_bytes)}"
            yield Problem(f"{values}: the two must be of one length", key="time_us", kind="inconsistent")

    @property
    def covered_bytes(self) -> tuple[float, float]:
        """Smallest and largest payload whose execution time is known [bytes]."""
        return self.payload_bytes[0], self.payload_bytes[-1]

    @property
    def range_bytes(self) -> str:
        """Range of the table's payloads, in words."""
        return f"{self.payload_bytes[0]} to {self.payload_bytes[-1]} bytes"

    def execution_us(self, payload_bytes: Number) -> Number:
        """Execution time T_exec of a transaction [us].

        Nothing is extrapolated: a payload outside the table raises ValueError (see `covers`). Arrays are not checked.
        """
        if isinstance(payload_bytes, int) and not self.covers(payload_bytes):
            raise ValueError(f"{payload_bytes} bytes is outside the execution table, {self.range_bytes}")
        return interpolated(self.payload_bytes, self.time_us, payload_bytes, words="the table")


Execution = Annotated[LinearExecution | TableExecution, Field(discriminator="kind")]


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


class BusSection(Section):
    """Section [bus]. Every kind of bus has `nodes`, where it belongs among its own keys."""

    kind: str = Field(description="Kind of bus", examples=["ieee1394"])

    if TYPE_CHECKING:
        nodes: int | None


class CycleSection(Section):
    """Section [cycle]: the communication period and what of it is for communication."""

    period_us: Annotated[float, Field(ge=MIN_STEP_US, le=MAX_TIME_US, allow_inf_nan=False)] = Field(
        description="Communication period T_s [us]", examples=[4000]
    )
    slice_ratio: SliceRatio = 1.0
    nonperiodic_us: TimeUs = Field(
        default=0.0, description="Time kept for non-periodic data in each cycle T_npd [us]", examples=[0]
    )


_NO_DATA: Final = (
    "makes 0 bytes, and so does what is read: nodes without data have no part in the cycle; give read_bytes, "
    "write_bytes or both"
)


class PayloadSection(Section):
    """Section [payload]: what is read from and written to each node in a cycle, fixed and for each of its axes.

    In a direction of 0 bytes nothing is sent: no transaction, request, PDO or data.
    """

    read_bytes: Bytes | None = Field(
        default=None,
        description="Payload of the read transaction, or its fixed part; 0 where nodes are only written [bytes]",
        examples=[12],
    )
    write_bytes: Bytes | None = Field(
        default=None,
        description="Payload of the write transaction, or its fixed part; 0 where nodes are only read [bytes]",
        examples=[12],
    )
    read_bytes_per_axis: Bytes | None = Field(default=None, description="Read payload per axis [bytes]", examples=[8])
    write_bytes_per_axis: Bytes | None = Field(default=None, description="Write payload per axis [bytes]", examples=[8])

    may_be_empty: ClassVar[bool] = False
    """Whether nodes may have no data in either direction."""

    def _problems(self) -> Iterator[Problem]:
        for kind in TRANSACTION_KINDS:
            if self._parts(kind) == (None, None):
                why = f"missing key; expected {kind}_bytes, {kind}_bytes_per_axis or both"
                yield Problem(why, key=f"{kind}_bytes", kind="missing-key")
        given = [self._parts(kind) for kind in TRANSACTION_KINDS]
        if not self.may_be_empty and (None, None) not in given and not any(map(any, given)):
            yield Problem(_NO_DATA, key=self.key_of("write"), kind="inconsistent")

    def _parts(self, kind: TransactionKind) -> tuple[Number | None, Number | None]:
        return getattr(self, f"{kind}_bytes"), getattr(self, f"{kind}_bytes_per_axis")

    def bytes_of(self, kind: TransactionKind, *, axes: Number) -> Number:
        """Payload of a transaction with a node of some axes [bytes]."""
        fixed, per_axis = self._parts(kind)
        if per_axis is None:
            return 0 if fixed is None else fixed
        share = per_axis * axes
        return share if fixed is None else fixed + share

    def key_of(self, kind: TransactionKind) -> str:
        """Key by which a payload is changed first: the payload of each axis, where there is one."""
        return f"{kind}_bytes" if self._parts(kind)[1] is None else f"{kind}_bytes_per_axis"

    @property
    def follows_axes(self) -> bool:
        """Whether more axes need more bytes."""
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

    model_config = ConfigDict(title="Group")

    name: GroupName = Field(description="Name of the group; its keys are group.NAME.key", examples=["drives"])
    nodes: Count = Field(description="Nodes of the group", examples=[2])
    axes: GroupAxes = Field(examples=[4])

    def _problems(self) -> Iterator[Problem]:
        for kind in TRANSACTION_KINDS:
            if any(self._parts(kind)) and not (self.may_be_empty or self.bytes_of(kind, axes=self.axes)):
                why = f"makes a payload of 0 bytes: the group has no axes; give {kind}_bytes"
                yield Problem(why, key=self.key_of(kind), kind="inconsistent")
        if not (self.may_be_empty or any(self.bytes_of(kind, axes=self.axes) for kind in TRANSACTION_KINDS)):
            yield Problem(_NO_DATA, key=self.key_of("write"), kind="inconsistent")


SpareCount = Annotated[int, Field(ge=0, le=MAX_COUNT)]


class Limits(Section):
    """Section [limits]: what must stay free.

    `reserve` is part of every verdict. The others are for `busplan check`, which does not check what is left out.
    """

    reserve: Annotated[float, Field(ge=0, le=0.99, allow_inf_nan=False)] = Field(
        default=0.0,
        description="Share of the time slice that must be free for a cycle to be shown to fit",
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
        "frames; from 1 on the plan, too, accepts one start of a cycle later than the worst of those measured, in as "
        "many cycles",
        examples=[0],
    )
