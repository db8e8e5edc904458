"""Parameters of the simulation and their ranges: axis, timing of the loop, delivery of set-points, mechanics.

Zero means ideal: no lag, no offset, no play, no quantisation. Profiles take names, defaults, ranges and descriptions
from these fields. This module does not need numpy, so that profiles can be validated without it.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any, Literal, NamedTuple, TypeVar, get_args

from busplan.errors import BusplanError

LoopPlace = Literal["node", "host"]
Interpolation = Literal["linear", "hold"]
OnLoss = Literal["hold", "extrapolate"]

LARGEST = 1e9
"""A larger gain, length or time is a typing error; products of allowed values do not overflow."""
SHORTEST_STEP_US = 1e-3
MAX_LENGTH_MM = 1e6
MAX_SPEED_MM_S = 1e6
LONGEST_DELAY_PERIODS = 16
"""Most periods from a sample to its command; a loop with more needs a different controller."""
FINEST_ENCODER_MM = 1e-9
"""A picometre: a float of 53 bits cannot count finer steps over metres of travel."""

_MIN_SPEED_MM_S = 1e-6
_MAX_PPM = 1e5
_ROUNDING_PERIODS = 1e-9
"""Tolerance in periods, so that rounding does not add a period to a delay."""
_MULTIPLE_TOLERANCE = 1e-9
"""Periods such as 1000 / 3 us are not exact floats; a relative 1e-9 is a microsecond in a quarter of an hour."""
_ROUNDING = 1e-12
_NANOSECONDS = 3
"""Decimals of a time in us."""
_MOST_STEPS_MORE = 100
"""Further numbers of steps in a period that are tried for a round step. Chosen."""
_KNOWN = "known"
_Value = TypeVar("_Value")


class Refused(NamedTuple):
    """One value that cannot be simulated."""

    name: str
    """Name of the parameter for the user."""
    value: object
    """Value as the message shows it."""
    right: str
    """Value or range that would be right."""
    beside: tuple[str, ...] = ()
    """Other parameters that it is refused for, which may be the ones that a user gave."""

    @property
    def message(self) -> str:
        """Message with name, value and what would be right."""
        return f"{self.name} = {self.value}: {self.right}"


class ParameterError(BusplanError):
    """Parameters that cannot be simulated."""

    def __init__(self, *refused: Refused) -> None:
        super().__init__(*(problem.message for problem in refused))
        self.refused = refused

    def __reduce__(self) -> tuple[Callable[..., "ParameterError"], tuple[Refused, ...]]:
        """Pickle with all arguments; by default, an exception is pickled with its message only."""
        return ParameterError, self.refused


def refuse(*refused: Refused) -> None:
    """Raise a single `ParameterError` for all refused values; without any, do nothing.

    Examples
    --------
    >>> refuse()
    >>> refuse(Refused("radius_mm", 0, "must be above 0"))
    Traceback (most recent call last):
    ...
    busplan.servo.parameters.ParameterError: radius_mm = 0: must be above 0
    """
    if refused:
        raise ParameterError(*refused)


class Known(NamedTuple):
    """Metadata of a parameter."""

    description: str
    """Description that ends in the unit in brackets."""
    example: object
    least: float | None
    """Smallest value; None for a word, whose type lists the allowed ones."""
    most: float | None
    never: tuple[int, str] | None
    """A value between `least` and `most` that is not allowed, and what would be right."""


class Parameter(NamedTuple):
    """One parameter of a dataclass."""

    name: str
    type: object
    default: object
    known: Known


def parameter(
    default: _Value,
    description: str,
    *,
    example: object,
    least: float | None = None,
    most: float | None = None,
    never: tuple[int, str] | None = None,
) -> _Value:
    """Declare a parameter: a field of a dataclass with its default and metadata."""
    known = Known(description, example, least, most, never)
    return field(default=default, metadata={_KNOWN: known})


def parameters(of: Any) -> Iterator[Parameter]:
    """Yield every parameter of a dataclass, in the order of its fields."""
    for key in fields(of):
        if _KNOWN in key.metadata:
            yield Parameter(key.name, key.type, key.default, key.metadata[_KNOWN])


def out_of_range(values: Any) -> Iterator[Refused]:
    """Yield every parameter of a dataclass whose value is not allowed.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Encoder:
    ...     lines: int = parameter(1000, "Lines of the disc [1]", example=500, least=1, most=100_000)
    >>> [problem.message for problem in out_of_range(Encoder(lines=0))]
    ['lines = 0: must be between 1 and 100000']
    """
    for name, type_, _, known in parameters(values):
        value = getattr(values, name)
        if known.least is None or known.most is None:
            yield from not_one_of(*get_args(type_), **{name: value})
        elif not known.least <= value <= known.most:
            yield Refused(name, value, f"must be between {known.least:g} and {known.most:g}")
        elif known.never is not None and value == known.never[0]:
            yield Refused(name, value, known.never[1])


def not_positive(**values: float) -> Iterator[Refused]:
    """Yield every value that is not above zero.

    Examples
    --------
    >>> [problem.message for problem in not_positive(radius_mm=0)]
    ['radius_mm = 0: must be above 0 and at most 1e+09']
    """
    for name, value in values.items():
        if not 0 < value <= LARGEST:
            yield Refused(name, value, f"must be above 0 and at most {LARGEST:g}")


def negative(**values: float) -> Iterator[Refused]:
    """Yield every value below zero; see `not_positive`.

    Examples
    --------
    >>> [problem.message for problem in negative(drive_lag_us=-1, backlash_mm=0)]
    ['drive_lag_us = -1: must be between 0 and 1e+09']
    """
    for name, value in values.items():
        if not 0 <= value <= LARGEST:
            yield Refused(name, value, f"must be between 0 and {LARGEST:g}")


def not_one_of(*allowed: str, **values: str) -> Iterator[Refused]:
    """Yield every word that is not among the allowed ones.

    Examples
    --------
    >>> [problem.message for problem in not_one_of("ccw", "cw", direction="left")]
    ["direction = 'left': must be one of 'ccw', 'cw'"]
    """
    for name, value in values.items():
        if value not in allowed:
            yield Refused(name, repr(value), f"must be one of {', '.join(map(repr, allowed))}")


def no_multiple(*, period_us: float, step_us: float) -> Iterator[Refused]:
    """Yield the step if the period is not a multiple of it.

    Examples
    --------
    >>> [problem.message for problem in no_multiple(period_us=1000, step_us=300)]
    ['step_us = 300: the period of 1000 us is no multiple of it; 250 us would fit']
    >>> [problem.message for problem in no_multiple(period_us=1000, step_us=2000)]
    ['step_us = 2000: longer than the period of 1000 us; the period is the longest step that fits']
    """
    if is_multiple(period_us, step_us):
        return
    if step_us > period_us:
        right = f"longer than the period of {period_us:g} us; the period is the longest step that fits"
    else:
        fits_us = dividing_step_us(period_us, most_us=step_us)
        right = f"the period of {period_us:g} us is no multiple of it; {fits_us:.15g} us would fit"
    yield Refused("step_us", step_us, right, ("period_us",))


def is_multiple(period_us: Any, step_us: Any) -> Any:
    """Whether a period is a whole number of steps, of one at least; of numbers or of arrays.

    Examples
    --------
    >>> is_multiple(1000.0, 250.0), is_multiple(1000.0, 300.0), is_multiple(1000.0, 2000.0)
    (True, False, False)
    """
    steps = period_us / step_us
    nearest = (steps + 0.5) // 1
    return (nearest > 0) & (abs(steps - nearest) <= _MULTIPLE_TOLERANCE * steps)


def dividing_step_us(period_us: float, *, most_us: float) -> float:
    """Longest step up to a given step that divides a period, in whole nanoseconds where such a step is near [us].

    Examples
    --------
    >>> [dividing_step_us(period_us, most_us=100.0) for period_us in (1000.0, 250.0, 50.0, 1000 / 3)]
    [100.0, 62.5, 50.0, 83.33333333333333]
    """
    fewest = math.ceil(period_us / most_us * (1 - _MULTIPLE_TOLERANCE))
    for steps in range(fewest, min(2 * fewest, fewest + _MOST_STEPS_MORE) + 1):
        step_us = round(period_us / steps, _NANOSECONDS)
        if math.isclose(step_us * steps, period_us, rel_tol=_ROUNDING):
            return step_us
    return period_us / fewest


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis: its position controller, its drive, its encoder.

    Examples
    --------
    >>> Axis(position_gain_per_s=143.0, max_velocity_mm_s=400.0).drive_lag_us
    0.0
    >>> Axis(position_gain_per_s=float("inf"))
    Traceback (most recent call last):
    ...
    busplan.servo.parameters.ParameterError: position_gain_per_s = inf: must be between 0 and 1e+09
    """

    position_gain_per_s: float = parameter(100.0, "Proportional gain kp [1/s]", example=143, least=0, most=LARGEST)
    integral_gain_per_s2: float = parameter(0.0, "Integral gain ki [1/s^2]", example=0, least=0, most=LARGEST)
    derivative_gain: float = parameter(0.0, "Derivative gain kd [1]", example=0, least=0, most=LARGEST)
    velocity_feedforward: float = parameter(
        1.0, "Share of the target velocity that is commanded directly [1]", example=1, least=-LARGEST, most=LARGEST
    )
    acceleration_feedforward_s: float = parameter(
        0.0, "Velocity commanded per target acceleration [s]", example=0, least=-LARGEST, most=LARGEST
    )
    drive_lag_us: float = parameter(
        0.0, "Time constant of the velocity-controlled drive, 0 ideal [us]", example=7500, least=0, most=LARGEST
    )
    drive_offset_mm_s: float = parameter(
        0.0,
        "Velocity at which the drive creeps when told to stand [mm/s]",
        example=0.56,
        least=-MAX_SPEED_MM_S,
        most=MAX_SPEED_MM_S,
    )
    max_velocity_mm_s: float = parameter(
        1000.0,
        "Largest velocity command, full scale of the DAC [mm/s]",
        example=400,
        least=_MIN_SPEED_MM_S,
        most=MAX_SPEED_MM_S,
    )
    dac_bits: int = parameter(
        0,
        "Resolution of the velocity command, 0 ideal, else 2 to 32 [bits]",
        example=16,
        least=0,
        most=32,
        never=(1, "expected 0 (ideal), or 2 to 32: one bit is a sign and no level"),
    )
    """2^bits levels over twice `max_velocity_mm_s`."""
    encoder_resolution_mm: float = parameter(
        0.0, "Length of one encoder count, 0 ideal [mm]", example=0.001, least=0, most=MAX_LENGTH_MM
    )
    reversal_mm_s: float = parameter(
        0.0,
        "Velocity disturbance of friction when the axis reverses [mm/s]",
        example=1.6,
        least=0,
        most=MAX_SPEED_MM_S,
    )
    """Disturbance in motion; a reversal changes it by twice as much."""
    reversal_recovery_us: float = parameter(
        10_000.0, "Time constant with which that disturbance dies away [us]", example=10000, least=0, most=LARGEST
    )
    reversal_smoothing_mm_s: float = parameter(
        0.5,
        "Velocity over which the sign of friction turns [mm/s]",
        example=0.5,
        least=_MIN_SPEED_MM_S,
        most=MAX_SPEED_MM_S,
    )
    delay_us: float = 0.0
    """Time Td from a sample until its command takes effect; used only by a loop on the host [us]."""

    def __post_init__(self) -> None:
        """Refuse invalid values, all in a single error."""
        refuse(*out_of_range(self), *self._too_fine(), *negative(delay_us=self.delay_us))

    @property
    def level_mm_s(self) -> float:
        """Step of the DAC, 0 for an ideal DAC [mm/s]."""
        return 2 * self.max_velocity_mm_s / 2**self.dac_bits if self.dac_bits else 0.0

    @property
    def highest_command_mm_s(self) -> float:
        """Largest velocity that can be commanded forwards [mm/s].

        DACs use two's complement, which has one level more below zero than above.
        """
        return self.max_velocity_mm_s - self.level_mm_s

    def _too_fine(self) -> Iterator[Refused]:
        if 0 < self.encoder_resolution_mm < FINEST_ENCODER_MM:
            right = f"must be 0 (ideal) or {FINEST_ENCODER_MM:g} mm or more"
            yield Refused("encoder_resolution_mm", self.encoder_resolution_mm, right)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """Timing of the position loop.

    Examples
    --------
    >>> LoopTiming(period_us=4000, step_us=100).steps_per_period
    40
    """

    period_us: float
    """Communication period T_s, with a set-point each [us]."""
    loop: LoopPlace = parameter(
        "node",
        "Place where the position loop is closed: on the node each step, or on the host each period",
        example="node",
    )
    interpolation: Interpolation = parameter(
        "linear",
        "Interpolation between set-points: move on the line between the last two, or hold",
        example="linear",
    )
    """Not used by a loop on the host."""
    step_us: float = parameter(
        100.0,
        "Period of the node's position loop, and step of the simulation [us]",
        example=100,
        least=SHORTEST_STEP_US,
        most=LARGEST,
    )

    def __post_init__(self) -> None:
        """Refuse invalid values, all in a single error."""
        refuse(*not_positive(period_us=self.period_us), *out_of_range(self))
        refuse(*no_multiple(period_us=self.period_us, step_us=self.step_us))

    @property
    def steps_per_period(self) -> int:
        """Whole number of simulation steps in a period [1]."""
        return round(self.period_us / self.step_us)

    @property
    def control_period_us(self) -> float:
        """Time between runs of the position loop [us]."""
        return self.step_us if self.loop == "node" else self.period_us

    def delay_parts(self, delay_us: float) -> tuple[int, float]:
        """Periods that a command waits in a loop on the host [1], and the rest of its delay, up to one period [us].

        Examples
        --------
        >>> timing = LoopTiming(period_us=1000, step_us=100, loop="host")
        >>> [timing.delay_parts(delay_us) for delay_us in (0, 400, 1000, 2100)]
        [(0, 0), (0, 400), (0, 1000), (2, 100)]
        """
        waiting = max(math.ceil(delay_us / self.period_us - _ROUNDING_PERIODS) - 1, 0)
        return waiting, min(delay_us - waiting * self.period_us, self.period_us)


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """Delivery of set-points to the nodes.

    Examples
    --------
    >>> Delivery(jitter_us=2.0).loss_probability
    0.0
    """

    jitter_us: float = parameter(
        0.0,
        "The synchronous packet comes within plus or minus this time [us]",
        example=2,
        least=0,
        most=LARGEST,
    )
    """Uniform, drawn anew in every cycle, and common to all axes."""
    skew_us: float = parameter(
        0.0,
        "The y node takes its set-points over this much after x [us]",
        example=0.1,
        least=-LARGEST,
        most=LARGEST,
    )
    loss_probability: float = parameter(
        0.0, "Share of the set-points that never arrive, 0..1", example=0.001, least=0, most=1
    )
    """Drawn for each cycle and node separately."""
    on_loss: OnLoss = parameter("hold", "Reaction of a node to a lost set-point", example="hold")
    """Hold the last set-point, or extrapolate the last two."""
    seed: int = parameter(0, "Seed of all that is random", example=1, least=0, most=2**63 - 1)

    def __post_init__(self) -> None:
        """Refuse invalid values, all in a single error."""
        refuse(*out_of_range(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanics:
    """Errors between encoders and table.

    Examples
    --------
    >>> Mechanics(backlash_mm=0.002).squareness_um_per_m
    0.0
    """

    backlash_mm: float = parameter(0.0, "Play between motor and table [mm]", example=0.002, least=0, most=MAX_LENGTH_MM)
    """Total gap, on each axis."""
    scale_x_ppm: float = parameter(0.0, "Scale error of the x axis [um/m]", example=10, least=-_MAX_PPM, most=_MAX_PPM)
    """Positive if the axis moves too far."""
    scale_y_ppm: float = parameter(0.0, "Scale error of the y axis [um/m]", example=-10, least=-_MAX_PPM, most=_MAX_PPM)
    squareness_um_per_m: float = parameter(
        0.0, "Displacement in x for each metre of y [um/m]", example=20, least=-_MAX_PPM, most=_MAX_PPM
    )
    """Inclination of the y axis towards x."""

    def __post_init__(self) -> None:
        """Refuse invalid values, all in a single error."""
        refuse(*out_of_range(self))
