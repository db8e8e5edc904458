"""Model of a profile's TOML file, with units, ranges and defaults. A kind of bus adds its own keys.

Models are strict (no text for a number), frozen and closed (an unknown key is refused). A whole number may stand for a
float.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from busplan.english import has_controls
from busplan.sections.base import MISSING, TRANSACTION_KINDS, Problem, Section, groups_field, refused
from busplan.sections.cycle import (
    BusSection,
    CycleSection,
    GroupSection,
    Limits,
    NodeSection,
    PayloadSection,
    TableExecution,
)
from busplan.sections.machine import (
    CircleSection,
    DeliverySection,
    MechanicsSection,
    ProfileGroup,
    ServoSection,
    ToleranceSection,
)
from busplan.sourced import ChangedConstants, changed_constants

SCHEMA_VERSION: Final = 1

CIRCLE_SECTIONS: Final = ("servo", "mechanics", "delivery", "circle", "tolerance")
"""Sections that only a circle test reads. A profile with any of them asks for the test."""
OF_ALIKE_NODES: Final = ("bus.nodes", "payload", "node")
"""Keys on the nodes, where all are alike."""


def _without_control_characters(allowed: str) -> Callable[[str], str]:
    without = str.maketrans("", "", allowed)

    def check(text: str) -> str:
        if has_controls(text.translate(without)):
            raise refused(Problem("must not hold control characters"))
        return text

    return check


def _whole(value: object) -> object:
    # A literal compares by ==, so true and 1.0 would pass for 1.
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
        default="", description="Description of the network, in words", examples=["Two nodes at 4 ms"]
    )
    bus: BusSection = Field(description="The bus")
    cycle: CycleSection = Field(description="The communication cycle")
    payload: PayloadSection | None = Field(default=None, description="Payload of a cycle, where nodes are alike")
    node: NodeSection | None = Field(default=None, description="One distributed node, where nodes are alike")
    group: Annotated[tuple[GroupSection, ...], groups_field()] = Field(
        default=(), description="Groups of unlike nodes, instead of bus.nodes, [node] and [payload]"
    )
    servo: ServoSection = Field(default_factory=ServoSection, description="Position loop and drive of both axes")
    mechanics: MechanicsSection = Field(
        default_factory=MechanicsSection, description="Mechanics between encoders and table"
    )
    delivery: DeliverySection = Field(
        default_factory=DeliverySection, description="Delays and losses of set-points on their way to the nodes"
    )
    circle: CircleSection = Field(default_factory=CircleSection, description="The circle of the test")
    limits: Limits = Field(default_factory=Limits, description="Requirements of the gate beyond fitting")
    tolerance: ToleranceSection = Field(default_factory=ToleranceSection, description="Tolerances of the circle test")

    _constants: ChangedConstants = PrivateAttr(default_factory=changed_constants)

    @property
    def constants(self) -> ChangedConstants:
        """Changed constants of the profile's figures: those in force when it was validated."""
        return self._constants

    @property
    def asks_for_circle(self) -> bool:
        """Whether the profile has a section of the circle test."""
        return not self.model_fields_set.isdisjoint(CIRCLE_SECTIONS)

    @property
    def node_groups(self) -> tuple[ProfileGroup, ...]:
        """Groups of nodes in the order of the chain: one where all are alike, none without a cycle."""
        if self.group:
            return tuple(ProfileGroup(group.name, group.nodes, group, group) for group in self.group)
        return (ProfileGroup("", self.bus.nodes, self.node, self.payload),) if self.has_cycle else ()

    @property
    def has_cycle(self) -> bool:
        """Whether the network has nodes, and so a cycle."""
        return True

    @classmethod
    def nodes_problems(cls, given: Collection[str]) -> Iterator[Problem]:
        """Problems of the way in which a profile gives its nodes: all alike, or in groups.

        Given are its sections, and "bus.nodes" if it has that key.
        """
        for key in OF_ALIKE_NODES:
            if "group" in given and key in given:
                right = "this profile has groups; set group.NAME.nodes instead"
                why = right if key == "bus.nodes" else "each [[group]] has its own; remove one of the two"
                yield Problem(why, key=key, kind="inconsistent")
            elif "group" not in given and key not in given:
                yield Problem(MISSING, key=key, kind="missing-key")

    def _problems(self) -> Iterator[Problem]:
        present = {name for name in self.model_fields_set if getattr(self, name) not in (None, ())}
        problems = list(self.nodes_problems(present | ({"bus.nodes"} if self.bus.nodes is not None else set())))
        names = [group.name for group in self.group]
        problems += (
            Problem("there is a group of this name", key=f"group.{place}.name", kind="inconsistent")
            for place, name in enumerate(names)
            if name in names[:place]
        )
        yield from problems or self._unknown_executions()

    def _unknown_executions(self) -> Iterator[Problem]:
        for place, nodes in enumerate(self.node_groups):
            if not isinstance(execution := nodes.node.execution, TableExecution):
                continue
            right = f'measure it and add it to {nodes.node_key("execution")}, or use kind = "linear"'
            for key, size, sum_ in _payloads(nodes, place):
                if size and not execution.covers(size):
                    why = f"{sum_}is outside the execution table, {execution.range_bytes}: {right}"
                    yield Problem(why, key=key, kind="execution-unknown")


def _payloads(nodes: ProfileGroup, place: int) -> Iterator[tuple[str, int, str]]:
    """Key of each payload, its size [bytes], and words on the sum where the key holds only a part of it."""
    section = f"group.{place}" if nodes.name else "payload"
    for kind in TRANSACTION_KINDS:
        key, size = nodes.payload.key_of(kind), int(nodes.bytes_of(kind))
        yield f"{section}.{key}", size, (f"makes {size} bytes, which " if key.endswith("_per_axis") else "")


def varied_nodes(profile: Profile) -> ProfileGroup:
    """The nodes whose number varies when axes are counted: all of them, or the group with the most axes."""
    return max(profile.node_groups, key=lambda group: int(group.nodes * group.node.axes))
