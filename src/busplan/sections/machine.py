"""The sections that the circle test needs: [servo], [mechanics], [delivery], [circle], [tolerance].

All are optional. Zero in a resolution, a lag or `dac_bits` means ideal.
"""

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, create_model

from busplan.sections.base import MAX_TIME_US, MIN_STEP_US, Problem, Section, TimeUs, refused

_MAX_LENGTH_MM: Final = 1e6
_MAX_SPEED_MM_S: Final = 1e6
_MAX_GAIN: Final = 1e9

PositiveTimeUs = Annotated[float, Field(ge=MIN_STEP_US, le=MAX_TIME_US, allow_inf_nan=False)]
LengthMm = Annotated[float, Field(ge=0, le=_MAX_LENGTH_MM, allow_inf_nan=False)]
SpeedMmS = Annotated[float, Field(ge=0, le=_MAX_SPEED_MM_S, allow_inf_nan=False)]
PositiveSpeedMmS = Annotated[float, Field(ge=1e-6, le=_MAX_SPEED_MM_S, allow_inf_nan=False)]
SignedSpeedMmS = Annotated[float, Field(ge=-_MAX_SPEED_MM_S, le=_MAX_SPEED_MM_S, allow_inf_nan=False)]
Gain = Annotated[float, Field(ge=0, le=_MAX_GAIN, allow_inf_nan=False)]
SignedGain = Annotated[float, Field(ge=-_MAX_GAIN, le=_MAX_GAIN, allow_inf_nan=False)]
PartsPerMillion = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


def _no_single_bit(bits: int) -> int:
    if bits == 1:
        raise refused(Problem("expected 0 (ideal), or 2 to 32: one bit is a sign and no level"))
    return bits


class AxisKeys(Section):
    """What can differ from one axis to the other: its controller, its drive, its encoder."""

    position_gain_per_s: Gain = Field(default=100.0, description="Proportional gain kp [1/s]", examples=[143])
    integral_gain_per_s2: Gain = Field(default=0.0, description="Integral gain ki [1/s^2]", examples=[0])
    derivative_gain: Gain = Field(default=0.0, description="Derivative gain kd [1]", examples=[0])
    velocity_feedforward: SignedGain = Field(
        default=1.0, description="Share of the target velocity that is commanded directly [1]", examples=[1]
    )
    acceleration_feedforward_s: SignedGain = Field(
        default=0.0, description="Velocity commanded per target acceleration [s]", examples=[0]
    )
    drive_lag_us: TimeUs = Field(
        default=0.0, description="Time constant of the velocity-controlled drive, 0 ideal [us]", examples=[7500]
    )
    drive_offset_mm_s: SignedSpeedMmS = Field(
        default=0.0, description="Velocity at which the drive creeps when told to stand [mm/s]", examples=[0.56]
    )
    max_velocity_mm_s: PositiveSpeedMmS = Field(
        default=1000.0, description="Largest velocity command, full scale of the DAC [mm/s]", examples=[400]
    )
    dac_bits: Annotated[int, Field(ge=0, le=32), AfterValidator(_no_single_bit)] = Field(
        default=0, description="Resolution of the velocity command, 0 ideal, else 2 to 32 [bits]", examples=[16]
    )
    encoder_resolution_mm: LengthMm = Field(
        default=0.0, description="Length of one encoder count, 0 ideal [mm]", examples=[0.001]
    )
    reversal_mm_s: SpeedMmS = Field(
        default=0.0, description="Velocity disturbance of friction when the axis reverses [mm/s]", examples=[1.6]
    )
    reversal_recovery_us: TimeUs = Field(
        default=10_000.0, description="Time constant with which that disturbance dies away [us]", examples=[10000]
    )
    reversal_smoothing_mm_s: PositiveSpeedMmS = Field(
        default=0.5, description="Velocity over which the sign of friction turns [mm/s]", examples=[0.5]
    )


if TYPE_CHECKING:

    class AxisOverride(Section):
        """Any of `AxisKeys`, each optional."""

else:
    # The same keys with the same ranges, none required and none with a default: what is not said is inherited.
    AxisOverride = create_model(
        "AxisOverride",
        __base__=Section,
        __doc__="What one axis has otherwise than [servo] says.",
        **{
            name: (field.rebuild_annotation() | None, Field(default=None, description=field.description))
            for name, field in AxisKeys.model_fields.items()
        },
    )


class Servo(AxisKeys):
    """Section [servo]: position loop and drive of both axes; [servo.x] and [servo.y] override keys for one."""

    loop: Literal["node", "host"] = Field(
        default="node",
        description="Where the position loop is closed: on the node each step, or on the host each period",
        examples=["node"],
    )
    interpolation: Literal["linear", "hold"] = Field(
        default="linear",
        description="What a node does between set-points: move on the line between the last two, or hold",
        examples=["linear"],
    )
    step_us: PositiveTimeUs = Field(
        default=100.0, description="Period of the node's position loop, and step of the simulation [us]", examples=[100]
    )
    grade: Literal["measured", "calibrated", "assumed"] = Field(
        default="assumed",
        description="How these values are known; reports say so beside every figure that rests on them",
        examples=["measured"],
    )
    x: AxisOverride = Field(default_factory=AxisOverride, description="What the x axis has otherwise")
    y: AxisOverride = Field(default_factory=AxisOverride, description="What the y axis has otherwise")

    def axis_keys(self, axis: Literal["x", "y"]) -> dict[str, Any]:
        """Keys of one axis by name, its own before those of both."""
        own: AxisOverride = getattr(self, axis)
        return self.model_dump(include=set(AxisKeys.model_fields)) | own.model_dump(exclude_none=True)


class Mechanics(Section):
    """Section [mechanics]: what lies between the encoders and the table."""

    backlash_mm: LengthMm = Field(default=0.0, description="Play between motor and table [mm]", examples=[0.002])
    scale_x_ppm: PartsPerMillion = Field(default=0.0, description="Scale error of the x axis [um/m]", examples=[10])
    scale_y_ppm: PartsPerMillion = Field(default=0.0, description="Scale error of the y axis [um/m]", examples=[-10])
    squareness_um_per_m: PartsPerMillion = Field(
        default=0.0, description="Displacement in x for each metre of y [um/m]", examples=[20]
    )


class Delivery(Section):
    """Section [delivery]: how set-points arrive at the nodes."""

    jitter_us: TimeUs = Field(
        default=0.0, description="The synchronous packet comes within plus or minus this time [us]", examples=[2]
    )
    skew_us: Annotated[float, Field(ge=-MAX_TIME_US, le=MAX_TIME_US, allow_inf_nan=False)] = Field(
        default=0.0, description="The y node takes its set-points over this much after x [us]", examples=[0.1]
    )
    loss_probability: Share = Field(
        default=0.0, description="Share of the set-points that never arrive, 0..1", examples=[0.001]
    )
    on_loss: Literal["hold", "extrapolate"] = Field(
        default="hold", description="What a node does without its set-point", examples=["hold"]
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=0, description="Seed of all that is random", examples=[1]
    )


class Circle(Section):
    """Section [circle]: the circle of the test."""

    radius_mm: Annotated[float, Field(ge=1e-3, le=_MAX_LENGTH_MM, allow_inf_nan=False)] = Field(
        default=100.0, description="Radius [mm]", examples=[320]
    )
    feed_mm_per_min: Annotated[float, Field(ge=1e-3, le=60 * _MAX_SPEED_MM_S, allow_inf_nan=False)] = Field(
        default=1000.0, description="Speed along the circle [mm/min]", examples=[2500]
    )
    direction: Literal["ccw", "cw"] = Field(
        default="ccw", description="Sense of rotation, counter-clockwise or clockwise", examples=["ccw"]
    )
    ramp_periods: Annotated[int, Field(ge=0, le=1_000_000)] = Field(
        default=100, description="Periods to speed up in, and to slow down in", examples=[100]
    )


class Tolerance(Section):
    """Section [tolerance]: what the circle test must hold. A contour tolerance that is left out is not checked."""

    mean_contour_error_mm: LengthMm | None = Field(
        default=None, description="Largest mean contour error of the whole move [mm]", examples=[0.005]
    )
    max_contour_error_mm: LengthMm | None = Field(
        default=None, description="Largest contour error of the whole move [mm]", examples=[0.025]
    )
    circular_deviation_mm: LengthMm | None = Field(
        default=None, description="Largest circular deviation G [mm]", examples=[0.03]
    )
    min_phase_margin_deg: Annotated[float, Field(ge=0, le=180, allow_inf_nan=False)] = Field(
        default=30.0, description="Smallest phase margin of the position loop [deg]", examples=[30]
    )
    min_gain_margin_db: Annotated[float, Field(ge=0, le=200, allow_inf_nan=False)] = Field(
        default=6.0, description="Smallest gain margin of the position loop [dB]", examples=[6]
    )
