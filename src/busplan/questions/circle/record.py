"""What a circle test gives; importing this loads no simulation."""

from typing import TYPE_CHECKING, NamedTuple

from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.questions.circle.contributions import Contribution
    from busplan.questions.circle.failures import Failure
    from busplan.servo.circle import CircleRun


class CircleFigures(NamedTuple):
    """Circle test at one period. Figures of a simulation that did not run are None."""

    period_us: float
    feed_mm_per_min: float
    radius_mm: float
    path: str
    """trapezoid or iso230-4."""
    duration_s: float
    setpoints: int
    steps: int
    step_us: float
    loop: str
    update: str
    """When a node applies a command of a loop on the host."""
    delay_us: float
    """Bus delay inside the loop, the longer one of both axes; 0 for a loop on the node."""
    delay_x_us: float
    delay_y_us: float
    jitter_us: float
    """Jitter of the synchronous packet, either way of its mean: the profile's own and what the bus adds."""
    timing_model: str
    """Timing model that decided whether the bus fits."""
    bus_fits: bool
    """Whether required <= available and no limit is broken."""
    verdict: str
    """fits, not shown to fit, or does not fit: a circle passes only on a bus that is shown to carry it."""
    required_us: float
    available_us: float
    servo_grade: str
    """The weakest grade of the profile's servo values: published, measured, calibrated or assumed."""
    ideal_drive: bool
    """Whether the profile has no [servo], so that an ideal drive was simulated."""
    stable: bool | None
    phase_margin_deg: float | None
    """The smaller one of both axes; None also if no loop gain reaches one."""
    gain_margin_db: float | None
    """The smaller one of both axes; None also if no gain makes a loop unstable."""
    crossover_hz: float | None
    """Of the axis with the smaller phase margin."""
    settled: bool | None
    """Whether the loops had settled before the measured turn; None on a trapezoid. Without it no measure is given."""
    mean_contour_error_mm: float | None
    max_contour_error_mm: float | None
    radial_deviation_min_mm: float | None
    radial_deviation_max_mm: float | None
    circular_deviation_mm: float | None
    """About the least-squares centre of a whole turn; None on a trapezoid."""
    radius_deviation_mm: float | None
    centre_offset_mm: tuple[float, float] | None
    constant_speed_deg: float | None
    """Arc at constant speed from which F, G, radius and centre are taken: 360 on a turn."""
    passed: bool | None
    """None if the profile has no contour tolerance, and nothing else fails: it is not judged."""
    failures: "tuple[Failure, ...]"
    contributions: "tuple[Contribution, ...] | None"
    """Largest first; None if they were not requested and no contour measure failed."""


class CircleTest(NamedTuple):
    """Answer of `circle_test`: the profile, and the figures and simulation of each period."""

    profile: Profile
    results: tuple[CircleFigures, ...]
    runs: "tuple[CircleRun | None, ...]"
    with_contributions: bool = False
    """If True, document and report rank the error sources."""

    @property
    def passed(self) -> bool | None:
        """Whether every period holds every tolerance; None if none fails, and one is not judged."""
        verdicts = [result.passed for result in self.results]
        return False if False in verdicts else None if None in verdicts else True
