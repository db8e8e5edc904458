"""The execution time of a node: section [node.execution], a line or a table."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from busplan.elementwise import Number, interpolated
from busplan.sections.base import Bytes, Problem, Section, TimeUs, refused


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

    def execution_us(self, payload_bytes: Number) -> Number:
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

    def execution_us(self, payload_bytes: Number) -> Number:
        """Execution time T_exec of one transaction with that payload [us].

        Raises
        ------
        ValueError
            The payload lies outside the table (see `covers`): nothing is extrapolated. Arrays are not checked.
        """
        if isinstance(payload_bytes, int) and not self.covers(payload_bytes):
            raise ValueError(f"{payload_bytes} bytes is outside the execution table, {self.range_bytes}")
        return interpolated(self.payload_bytes, self.time_us, payload_bytes, words="the table")


Execution = Annotated[LinearExecution | TableExecution, Field(discriminator="kind")]
