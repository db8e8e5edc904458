"""What can be set: one axis, the timing of its loop, the delivery of set-points, the mechanics.

Zero means ideal: no lag, no offset, no play, an encoder and a DAC as fine as the arithmetic. No numpy here, so
that a profile can be checked without loading it.
"""

from dataclasses import dataclass
from typing import Literal

from busplan.servo.checks import negative, no_multiple, not_finite, not_one_of, not_positive, refuse

LoopPlace = Literal["node", "host"]
Interpolation = Literal["linear", "hold"]
OnLoss = Literal["hold", "extrapolate"]

MAX_DAC_BITS = 32
FINEST_ENCODER_MM = 1e-9
"""A picometre: finer counts than these would not fit into the 53 bits of a float over metres of travel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis: its position controller, its drive, its encoder.

    Parameters
    ----------
    position_gain_per_s
        Proportional gain kp [1/s].
    max_velocity_mm_s
        Largest velocity command, full scale of the DAC [mm/s].
    integral_gain_per_s2
        Integral gain ki [1/s^2].
    derivative_gain
        Derivative gain kd [1].
    velocity_feedforward
        Share of the target velocity that is commanded directly [1].
    acceleration_feedforward_s
        Velocity commanded per target acceleration [s].
    drive_lag_us
        Time constant tau of the velocity-controlled drive [us].
    drive_offset_mm_s
        Velocity at which the drive creeps when it is told to stand [mm/s].
    dac_bits
        Resolution of the velocity command, 2^bits levels over twice `max_velocity_mm_s` [bits].
    encoder_resolution_mm
        Length of one encoder count [mm].
    reversal_mm_s
        Velocity disturbance of Coulomb friction in motion; a reversal swings it by twice as much [mm/s].
    reversal_recovery_us
        Time constant with which the drive recovers from that disturbance [us].
    reversal_smoothing_mm_s
        Velocity over which the sign of the friction turns smoothly [mm/s].

    Raises
    ------
    BusplanError
        A value is not finite, of the wrong sign, or out of range.

    Examples
    --------
    >>> Axis(position_gain_per_s=143.0, max_velocity_mm_s=400.0).drive_lag_us
    0.0
    >>> Axis(position_gain_per_s=float("inf"), max_velocity_mm_s=400.0)
    Traceback (most recent call last):
    ...
    busplan.errors.BusplanError: position_gain_per_s = inf: must be between 0 and 1e+09
    """

    position_gain_per_s: float
    max_velocity_mm_s: float
    integral_gain_per_s2: float = 0.0
    derivative_gain: float = 0.0
    velocity_feedforward: float = 0.0
    acceleration_feedforward_s: float = 0.0
    drive_lag_us: float = 0.0
    drive_offset_mm_s: float = 0.0
    dac_bits: int = 0
    encoder_resolution_mm: float = 0.0
    reversal_mm_s: float = 0.0
    reversal_recovery_us: float = 0.0
    reversal_smoothing_mm_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated, all of it in one message."""
        refuse(
            *negative(
                position_gain_per_s=self.position_gain_per_s,
                integral_gain_per_s2=self.integral_gain_per_s2,
                derivative_gain=self.derivative_gain,
                drive_lag_us=self.drive_lag_us,
                encoder_resolution_mm=self.encoder_resolution_mm,
                reversal_mm_s=self.reversal_mm_s,
                reversal_recovery_us=self.reversal_recovery_us,
                reversal_smoothing_mm_s=self.reversal_smoothing_mm_s,
            ),
            *not_positive(max_velocity_mm_s=self.max_velocity_mm_s),
            *not_finite(
                velocity_feedforward=self.velocity_feedforward,
                acceleration_feedforward_s=self.acceleration_feedforward_s,
                drive_offset_mm_s=self.drive_offset_mm_s,
            ),
            *self._out_of_range(),
        )

    @property
    def level_mm_s(self) -> float:
        """Step from one level of the DAC to the next; 0 for an ideal one [mm/s]."""
        return 2 * self.max_velocity_mm_s / 2**self.dac_bits if self.dac_bits else 0.0

    @property
    def highest_command_mm_s(self) -> float:
        """Largest velocity that can be commanded forwards [mm/s].

        Two's complement, as DACs have it: one level more below zero than above.
        """
        return self.max_velocity_mm_s - self.level_mm_s

    def _out_of_range(self) -> list[str]:
        problems = []
        if self.dac_bits != 0 and not 2 <= self.dac_bits <= MAX_DAC_BITS:  # noqa: PLR2004 - sign and one bit
            problems.append(f"dac_bits = {self.dac_bits}: must be 0 (ideal) or between 2 and {MAX_DAC_BITS}")
        if 0 < self.encoder_resolution_mm < FINEST_ENCODER_MM:
            problems.append(
                f"encoder_resolution_mm = {self.encoder_resolution_mm}: "
                f"must be 0 (ideal) or {FINEST_ENCODER_MM:g} mm or more"
            )
        if self.reversal_mm_s > 0 and self.reversal_smoothing_mm_s == 0:
            problems.append(
                "reversal_smoothing_mm_s = 0: must be above 0 when reversal_mm_s is, or an axis at rest chatters"
            )
        return problems


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """Where the position loop is closed, and how often.

    Parameters
    ----------
    period_us
        Communication period T_s: one set-point a period [us].
    step_us
        Step of the simulation, and the period of the position loop when it runs on the node [us].
    loop
        "node": the loop runs each step on the node. "host": it runs each period on the host, across the bus.
    interpolation
        What a node does between set-points: "linear" moves on the line between the last two, "hold" stands.
        Without meaning when the loop runs on the host.
    delay_us
        Time Td from the sample to the moment its command takes effect, 0 to one period; used by the loop on
        the host only, where it lies inside the loop [us].

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
    step_us: float = 100.0
    loop: LoopPlace = "node"
    interpolation: Interpolation = "linear"
    delay_us: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated, all of it in one message."""
        problems = [
            *not_positive(period_us=self.period_us, step_us=self.step_us),
            *not_one_of("node", "host", loop=self.loop),
            *not_one_of("linear", "hold", interpolation=self.interpolation),
        ]
        refuse(*problems)
        refuse(*no_multiple(period_us=self.period_us, step_us=self.step_us), *self._late())

    def _late(self) -> list[str]:
        if 0 <= self.delay_us <= self.period_us:
            return []
        return [f"delay_us = {self.delay_us}: must be between 0 and the period of {self.period_us:g} us"]

    @property
    def steps_per_period(self) -> int:
        """Whole number of simulation steps in one period [1]."""
        return round(self.period_us / self.step_us)

    @property
    def control_period_us(self) -> float:
        """Time from one run of the position loop to the next [us]."""
        return self.step_us if self.loop == "node" else self.period_us


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """How set-points arrive at the nodes.

    Parameters
    ----------
    jitter_us
        The synchronous packet of a cycle arrives uniformly within plus or minus this time, all axes alike [us].
    skew_us
        The y node takes its set-points over this much later than the x node, in every cycle [us].
    loss_probability
        Share of the packets with a set-point that never arrive, drawn for each cycle and node on its own [1].
    on_loss
        What a node does without its set-point: "hold" the last one, or "extrapolate" the last two.
    seed
        Seed of all that is random here.

    Raises
    ------
    BusplanError
        A value is not finite, of the wrong sign, or out of range.

    Examples
    --------
    >>> Delivery(jitter_us=2.0).loss_probability
    0.0
    """

    jitter_us: float = 0.0
    skew_us: float = 0.0
    loss_probability: float = 0.0
    on_loss: OnLoss = "hold"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated, all of it in one message."""
        problems = [
            *negative(jitter_us=self.jitter_us),
            *not_finite(skew_us=self.skew_us),
            *not_one_of("hold", "extrapolate", on_loss=self.on_loss),
        ]
        if not 0 <= self.loss_probability <= 1:
            problems.append(f"loss_probability = {self.loss_probability}: must be between 0 and 1")
        if self.seed < 0:
            problems.append(f"seed = {self.seed}: must be 0 or more")
        refuse(*problems)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanics:
    """What lies between the encoders and the table.

    Parameters
    ----------
    backlash_mm
        Play between motor and table, the whole gap, on each axis [mm].
    scale_x_ppm, scale_y_ppm
        How much too long the axis moves [um/m].
    squareness_um_per_m
        How far the y axis leans towards x: displacement in x for each metre of y [um/m].

    Raises
    ------
    BusplanError
        A value is not finite, or the backlash is negative.

    Examples
    --------
    >>> Mechanics(backlash_mm=0.002).squareness_um_per_m
    0.0
    """

    backlash_mm: float = 0.0
    scale_x_ppm: float = 0.0
    scale_y_ppm: float = 0.0
    squareness_um_per_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated, all of it in one message."""
        refuse(
            *negative(backlash_mm=self.backlash_mm),
            *not_finite(
                scale_x_ppm=self.scale_x_ppm,
                scale_y_ppm=self.scale_y_ppm,
                squareness_um_per_m=self.squareness_um_per_m,
            ),
        )
