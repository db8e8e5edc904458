"""The profile: what a TOML file may say, with units, ranges and defaults.

Models are strict (no text for a number), frozen and closed (an unknown key is refused). A whole number may stand
for a float.
"""

from collections.abc import Callable
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from busplan.printable import commands
from busplan.profile.bus import Cycle, Ieee1394Bus, Node, Payload, TableExecution
from busplan.profile.gate import Limits
from busplan.profile.machine import Circle, Delivery, Mechanics, Servo, Tolerance
from busplan.profile.sections import Problem, Section, refused

SCHEMA_VERSION: Final = 1

_CIRCLE_SECTIONS: Final = {"servo", "circle", "tolerance", "delivery", "mechanics"}


def _without_control_characters(allowed: str) -> Callable[[str], str]:
    def check(text: str) -> str:
        if any(commands(one) and one not in allowed for one in text):
            raise refused(Problem("must not hold control characters"))
        return text

    return check


def _whole(value: object) -> object:
    # A literal compares: true and 1.0 would pass for 1.
    if type(value) is not int:
        raise refused(Problem(f"expected {SCHEMA_VERSION}"))
    return value


class Profile(Section):
    """A whole profile: one motion network and its cycle."""

    schema_version: Annotated[Literal[1], BeforeValidator(_whole)] = Field(
        description="Version of this file's schema", examples=[SCHEMA_VERSION]
    )
    name: Annotated[
        str, Field(min_length=1, max_length=100, pattern=r"\S"), AfterValidator(_without_control_characters(""))
    ] = Field(description="Name in reports", examples=["my-machine"])
    description: Annotated[str, Field(max_length=2000), AfterValidator(_without_control_characters("\n\t"))] = Field(
        default="", description="What the profile stands for, in words", examples=["Two nodes at 4 ms"]
    )
    bus: Ieee1394Bus = Field(description="The bus")
    cycle: Cycle = Field(description="The communication cycle")
    payload: Payload = Field(description="What travels in a cycle")
    node: Node = Field(description="One distributed node")
    servo: Servo = Field(default_factory=Servo, description="Position loop and drive of both axes")
    mechanics: Mechanics = Field(default_factory=Mechanics, description="What lies between encoders and table")
    delivery: Delivery = Field(default_factory=Delivery, description="How set-points arrive at the nodes")
    circle: Circle = Field(default_factory=Circle, description="The circle of the test")
    limits: Limits = Field(default_factory=Limits, description="What the gate asks for beyond fitting")
    tolerance: Tolerance = Field(default_factory=Tolerance, description="What the circle test must hold")

    @property
    def asks_for_circle(self) -> bool:
        """Whether the profile says anything that a circle test is for."""
        return bool(_CIRCLE_SECTIONS & self.model_fields_set)

    @model_validator(mode="after")
    def _execution_is_known(self) -> Self:
        execution = self.node.execution
        if isinstance(execution, TableExecution):
            unknown = [
                Problem(
                    f"is outside the execution table, {execution.range_bytes}: measure it and add it to "
                    'node.execution, or use kind = "linear"',
                    key=f"payload.{key}",
                    kind="execution-unknown",
                )
                for key, size in (
                    ("read_bytes", self.payload.read_bytes),
                    ("write_bytes", self.payload.write_bytes),
                )
                if not execution.covers(size)
            ]
            if unknown:
                raise refused(*unknown)
        return self
