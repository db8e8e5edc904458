"""Sections of the circle test: [servo], [mechanics], [delivery], [circle], [tolerance].

All are optional. Zero in a resolution, a lag or `dac_bits` means ideal. Keys that are parameters of the servo core take
their names, defaults, ranges and descriptions from there.
"""

from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar

from pydantic import AfterValidator, Field, create_model

from busplan.elementwise import Number
from busplan.sections.base import Problem, Section, TransactionKind, refused
from busplan.servo.parameters import (
    MAX_LENGTH_MM,
    MAX_SPEED_MM_S,
    Axis,
    Delivery,
    Interpolation,
    LoopPlace,
    LoopTiming,
    Mechanics,
    parameters,
)


class ProfileGroup(NamedTuple):
    """Alike nodes of a profile: those of a section [[group]], or of [node] and [payload]."""

    name: str
    """Name of the group; empty for the nodes of [node]."""
    nodes: Any
    """Number of nodes [1]."""
    node: Any
    """A node of the group, by its kind's own model: execution time and answer."""
    payload: Any
    """Payloads of a node, by its kind's own model."""

    @property
    def nodes_key(self) -> str:
        """Dotted key of the number of nodes."""
        return f"group.{self.name}.nodes" if self.name else "bus.nodes"

    def node_key(self, key: str) -> str:
        """Dotted key of a node's value in the profile, for a key below the node, as "execution.base_us"."""
        return f"group.{self.name}.{key}" if self.name else f"node.{key}"

    def payload_key(self, kind: TransactionKind) -> str:
        """Dotted key by which a payload is changed first: the payload of each axis, where there is one."""
        key = self.payload.key_of(kind)
        return f"group.{self.name}.{key}" if self.name else f"payload.{key}"

    def bytes_of(self, kind: TransactionKind) -> Number:
        """Payload of a transaction with a node [bytes]."""
        size: Number = self.payload.bytes_of(kind, axes=self.node.axes)
        return size


SERVO_GRADES: Final = ("published", "measured", "calibrated", "assumed")
"""Grades of [servo], the strongest first."""
ServoGrade = Literal["published", "measured", "calibrated", "assumed"]
LengthMm = Annotated[float, Field(ge=0, le=MAX_LENGTH_MM, allow_inf_nan=False)]


def _without(never: tuple[int, str]) -> AfterValidator:
    """Refusal of one value of a range."""
    unwanted, right = never

    def check(value: int) -> int:
        if value == unwanted:
            raise refused(Problem(right))
        return value

    return AfterValidator(check)


def _key(of: type, name: str) -> Any:
    """Key of a parameter of the servo core: its default, range, description and example."""
    (parameter,) = (parameter for parameter in parameters(of) if parameter.name == name)
    known = parameter.known
    return Field(
        default=parameter.default,
        description=known.description,
        examples=[known.example],
        ge=known.least,
        le=known.most,
        allow_inf_nan=False if parameter.type is float else None,
    )


def _keys(of: type) -> dict[str, Any]:
    """Keys of a dataclass of the servo core, in the form from which pydantic makes a model."""
    types = {
        parameter.name: parameter.type
        if parameter.known.never is None
        else Annotated[parameter.type, _without(parameter.known.never)]
        for parameter in parameters(of)
    }
    return {name: (type_, _key(of, name)) for name, type_ in types.items()}


_Model = TypeVar("_Model", bound=Section)


def _with(keys: dict[str, Any]) -> Callable[[type[_Model]], type[_Model]]:
    """Add computed keys to a section."""

    def extended(section: type[_Model]) -> type[_Model]:
        return create_model(
            section.__name__, __base__=section, __doc__=section.__doc__, __module__=section.__module__, **keys
        )

    return extended


@_with(_keys(Axis))
class AxisKeys(Section):
    """Keys that can differ between the axes: controller, drive, encoder."""


# The same keys with the same ranges, none required and none with a default: what is not given is inherited.
@_with(
    {
        name: (field.rebuild_annotation() | None, Field(default=None, description=field.description))
        for name, field in AxisKeys.model_fields.items()
    }
)
class AxisOverride(Section):
    """Values of an axis that differ from [servo]."""


@_with(_keys(Mechanics))
class MechanicsSection(Section):
    """Section [mechanics]: what lies between the encoders and the table."""


@_with(_keys(Delivery))
class DeliverySection(Section):
    """Section [delivery]: how set-points arrive at the nodes."""


_GRADED_TIMING: Final = ("interpolation", "step_us")
"""Keys of the loop's timing that can be measured."""


@_with(
    {
        name: (ServoGrade | None, Field(default=None, description=f"Grade of servo.{name}"))
        for name in (*AxisKeys.model_fields, *_GRADED_TIMING)
    }
)
class ServoGrades(Section):
    """Section [servo.grades]: how single values of [servo] are known."""


class ServoSection(AxisKeys):
    """Section [servo]: position loop and drive of both axes; [servo.x] and [servo.y] override keys for one."""

    loop: LoopPlace = _key(LoopTiming, "loop")
    update: Literal["next_sync", "on_arrival"] = Field(
        default="next_sync",
        description="Time at which a node applies a host loop's command: with the next synchronous packet (the "
        "paper, III-C), so that one period lies inside the loop, or when it arrives",
        examples=["next_sync"],
    )
    interpolation: Interpolation = _key(LoopTiming, "interpolation")
    step_us: float = _key(LoopTiming, "step_us")
    grade: ServoGrade = Field(
        default="assumed",
        description="Grade of these values; reports show it with every figure that depends on them",
        examples=["measured"],
    )
    grades: ServoGrades = Field(
        default_factory=ServoGrades, description="Grades of single values, where they differ from servo.grade"
    )
    x: AxisOverride = Field(
        default_factory=AxisOverride, description="Values for the x axis, in place of those for both"
    )
    y: AxisOverride = Field(
        default_factory=AxisOverride, description="Values for the y axis, in place of those for both"
    )

    def axis_keys(self, axis: Literal["x", "y"]) -> dict[str, Any]:
        """Keys of an axis by name. Its own override those of both axes."""
        override: AxisOverride = getattr(self, axis)
        return self.model_dump(include=set(AxisKeys.model_fields)) | override.model_dump(exclude_none=True)

    def grade_of(self, key: str) -> ServoGrade:
        """Grade of the value of a key, by its name in [servo], [servo.x] and [servo.y]."""
        grade: ServoGrade | None = getattr(self.grades, key, None)
        return grade or self.grade

    @property
    def grades_given(self) -> tuple[ServoGrade, ...]:
        """Grades of the values that the profile gives or grades, the weakest first; servo.grade if there are none."""
        given = self.model_fields_set | self.x.model_fields_set | self.y.model_fields_set
        # A default may be graded, unless it means none.
        given |= {key for key in self.grades.model_fields_set if getattr(self, key)}
        grades = [self.grade_of(key) for key in given & set(ServoGrades.model_fields)] or [self.grade]
        return tuple(sorted(grades, key=SERVO_GRADES.index, reverse=True))

    @property
    def grades_text(self) -> str:
        """Grades of the values in words, the weakest first."""
        counts = Counter(self.grades_given)
        return ", ".join(f"{number} {grade}" if len(counts) > 1 else grade for grade, number in counts.items())


class CircleSection(Section):
    """Section [circle]: the circle of the test."""

    path: Literal["trapezoid", "iso230-4"] = Field(
        default="trapezoid",
        description="trapezoid: one circle with both ramps on it (the paper); iso230-4: a lead-in until the loops have "
        "settled, then one whole turn that is measured. Only iso230-4 has a circular deviation G",
        examples=["iso230-4"],
    )
    radius_mm: Annotated[float, Field(ge=1e-3, le=MAX_LENGTH_MM, allow_inf_nan=False)] = Field(
        default=100.0, description="Radius [mm]", examples=[320]
    )
    feed_mm_per_min: Annotated[float, Field(ge=1e-3, le=60 * MAX_SPEED_MM_S, allow_inf_nan=False)] = Field(
        default=1000.0, description="Speed along the circle [mm/min]", examples=[2500]
    )
    direction: Literal["ccw", "cw"] = Field(
        default="ccw", description="Sense of rotation, counter-clockwise or clockwise", examples=["ccw"]
    )
    ramp_periods: Annotated[int, Field(ge=0, le=1_000_000)] = Field(
        default=100, description="Periods to speed up in, and to slow down in", examples=[100]
    )


CONTOUR_MEASURES: Final = ("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm")
"""Measures of roundness with a tolerance, in the order of the checks."""


class ToleranceSection(Section):
    """Section [tolerance]: what the circle test must hold. A contour tolerance that is left out is not checked."""

    mean_contour_error_mm: LengthMm | None = Field(
        default=None,
        description="Largest mean contour error of the turn, or of the whole trapezoid [mm]",
        examples=[0.005],
    )
    max_contour_error_mm: LengthMm | None = Field(
        default=None, description="Largest contour error of the turn, or of the whole trapezoid [mm]", examples=[0.025]
    )
    circular_deviation_mm: LengthMm | None = Field(
        default=None,
        description='Largest circular deviation G, which needs circle.path = "iso230-4" [mm]',
        examples=[0.03],
    )
    min_phase_margin_deg: Annotated[float, Field(ge=0, le=180, allow_inf_nan=False)] = Field(
        default=30.0, description="Smallest phase margin of the position loop [deg]", examples=[30]
    )
    min_gain_margin_db: Annotated[float, Field(ge=0, le=200, allow_inf_nan=False)] = Field(
        default=6.0, description="Smallest gain margin of the position loop [dB]", examples=[6]
    )

    @property
    def judged(self) -> tuple[str, ...]:
        """Measures of roundness that the profile gives a tolerance."""
        return tuple(name for name in CONTOUR_MEASURES if getattr(self, name) is not None)

    @property
    def judges_contour(self) -> bool:
        """Whether a tolerance limits the roundness of the circle."""
        return bool(self.judged)
