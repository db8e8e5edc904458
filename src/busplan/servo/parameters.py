"""Parameters of the simulation: axis, timing of the loop, delivery of set-points, mechanics.

Zero means ideal: no lag, no offset, no play, no quantisation. Profiles take names, defaults, ranges and descriptions
from these fields. This module does not need numpy, so that profiles can be validated without it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from busplan.servo.checks import (
    LARGEST,
    SHORTEST_STEP_US,
    Refused,
    negative,
    no_multiple,
    not_positive,
    out_of_range,
    parameter,
    refuse,
)

LoopPlace = Literal["node", "host"]
Interpolation = Literal["linear", "hold"]
OnLoss = Literal["hold", "extrapolate"]

MAX_LENGTH_MM = 1e6
MAX_SPEED_MM_S = 1e6
_MIN_SPEED_MM_S = 1e-6
_MAX_PPM = 1e5
_ROUNDING_PERIODS = 1e-9
"""Tolerance in periods, so that rounding does not add a period to a delay."""
LONGEST_DELAY_PERIODS = 16
"""Most periods from a sample to its command; a loop with more needs a different controller."""
FINEST_ENCODER_MM = 1e-9
"""A picometre: a float of 53 bits cannot count finer steps over metres of travel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis: its position controller, its drive, its encoder.

    Parameters
    ----------
    delay_us
        Time Td from a sample until its command takes effect; used only by a loop on the host [us].

    Raises
    ------
    BusplanError
        A value is out of range.

    Examples
    --------
    >>> Axis(position_gain_per_s=143.0, max_velocity_mm_s=400.0).drive_lag_us
    0.0
    >>> Axis(position_gain_per_s=float("inf"))
    Traceback (most recent call last):
    ...
    busplan.servo.checks.ParameterError: position_gain_per_s = inf: must be between 0 and 1e+09
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

    Parameters
    ----------
    period_us
        Communication period T_s, with a set-point each [us].

    Raises
    ------
    BusplanError
        A time is out of range, the step is longer than the period or does not divide it.

    Examples
    --------
    >>> LoopTiming(period_us=4000, step_us=100).steps_per_period
    40
    """

    period_us: float
    loop: LoopPlace = parameter(
        "node",
        "Where the position loop is closed: on the node each step, or on the host each period",
        example="node",
    )
    interpolation: Interpolation = parameter(
        "linear",
        "What a node does between set-points: move on the line between the last two, or hold",
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

        Parameters
        ----------
        delay_us
            Time from a sample until its command takes effect [us].

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

    Raises
    ------
    BusplanError
        A value is out of range.

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
    on_loss: OnLoss = parameter("hold", "What a node does without its set-point", example="hold")
    """Hold the last set-point, or extrapolate the last two."""
    seed: int = parameter(0, "Seed of all that is random", example=1, least=0, most=2**63 - 1)

    def __post_init__(self) -> None:
        """Refuse invalid values, all in a single error."""
        refuse(*out_of_range(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanics:
    """Errors between encoders and table.

    Raises
    ------
    BusplanError
        A value is out of range.

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
