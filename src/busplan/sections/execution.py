"""The execution time of a node: section [node.execution], a line or a table."""

from itertools import pairwise
from math import inf
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from busplan.elementwise import Number, choose, interpolated
from busplan.sections.base import Bytes, Problem, Section, TimeUs, refused
from busplan.sourced import Sourced

UNKNOWN_SHARE: Final = Sourced(
    0.1,
    unit="1",
    grade="assumed",
    source="chosen",
    meaning="standard uncertainty of a time that nobody has measured, as a share of it",
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


class GradedExecution(Section):
    """Keys that both forms of the execution time share."""

    grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description="How the execution time is known; the gate warns of assumed", examples=["measured"]
    )
    uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of the execution time; without it the grade says how large it is [us]",
        examples=[0.5],
    )
    worst_extra_us: TimeUs = Field(
        default=0.0, description="What the slowest execution takes beyond the execution time [us]", examples=[3.1]
    )

    @property
    def covered_bytes(self) -> tuple[float, float]:
        """The smallest and the largest payload whose execution time is known."""
        return 0, inf

    def covers(self, payload_bytes: int) -> bool:
        """Tell whether the execution time of that payload is known."""
        least, most = self.covered_bytes
        return least <= payload_bytes <= most

    def standard_uncertainty_us(self, execution_us: Number) -> Number:
        """Standard uncertainty u(T_exec) of an execution time [us].

        The key `uncertainty_us`, or by grade: of a measured time 0.1 / sqrt(12), of a derived time 1 / sqrt(3), else
        10 % of it.
        """
        if self.uncertainty_us is not None:
            return self.uncertainty_us
        other_us = choose(self.grade == "derived", DERIVED_UNCERTAINTY_US, UNKNOWN_SHARE * execution_us)
        return choose(self.grade == "measured", MEASURED_UNCERTAINTY_US, other_us)


class LinearExecution(GradedExecution):
    """Section [node.execution] of kind "linear": base_us + per_byte_us * payload."""

    kind: Literal["linear"] = Field(description="Form of the execution time", examples=["linear"])
    base_us: TimeUs = Field(description="Execution time of an empty payload [us]", examples=[30])
    per_byte_us: TimeUs = Field(description="What each byte of payload adds [us/byte]", examples=[0.35])

    @property
    def ascends_from_bytes(self) -> int:
        """The payload from which on no larger payload takes less time."""
        return 0

    def execution_us(self, payload_bytes: Number) -> Number:
        """Execution time T_exec of a transaction with that payload [us]."""
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
                f"payloads must ascend, and this follows {before}",
                key=f"payload_bytes.{index}",
                kind="inconsistent",
            )
            for index, (before, after) in enumerate(pairwise(self.payload_bytes), start=1)
            if before >= after
        ]
        if len(self.payload_bytes) != len(self.time_us):
            values = f"has {len(self.time_us)} values and payload_bytes has {len(self.payload_bytes)}"
            problems.append(Problem(f"{values}: the two must be of one length", key="time_us", kind="inconsistent"))
        if problems:
            raise refused(*problems)
        return self

    @property
    def ascends_from_bytes(self) -> int:
        """The payload from which on no larger payload takes less time."""
        falls = [
            self.payload_bytes[at + 1] for at, (before, after) in enumerate(pairwise(self.time_us)) if after < before
        ]
        return falls[-1] if falls else 0

    @property
    def covered_bytes(self) -> tuple[float, float]:
        """The smallest and the largest payload whose execution time is known."""
        return self.payload_bytes[0], self.payload_bytes[-1]

    @property
    def range_bytes(self) -> str:
        """The payloads the table covers, in words."""
        return f"{self.payload_bytes[0]} to {self.payload_bytes[-1]} bytes"

    def execution_us(self, payload_bytes: Number) -> Number:
        """Execution time T_exec of a transaction with that payload [us].

        Raises
        ------
        ValueError
            The payload lies outside the table (see `covers`): nothing is extrapolated. Arrays are not checked.
        """
        if isinstance(payload_bytes, int) and not self.covers(payload_bytes):
            raise ValueError(f"{payload_bytes} bytes is outside the execution table, {self.range_bytes}")
        return interpolated(self.payload_bytes, self.time_us, payload_bytes, words="the table")


Execution = Annotated[LinearExecution | TableExecution, Field(discriminator="kind")]
