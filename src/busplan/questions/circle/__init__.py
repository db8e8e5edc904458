"""`busplan.circle_test`: is a circle still round at this period? Figures and answer; roundness.py runs the test."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple

from busplan.buses.figure import by_key, read_figures
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.charts import Drawing
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    Periods,
    ProfileLike,
    load_network,
    one_or_several,
    whole_number,
    with_its_constants,
)
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.questions.circle.failures import Failure
    from busplan.questions.circle.shape import Shape
    from busplan.servo.circle import CircleRun

NEGLIGIBLE_MM: Final = 1e-4
"""Contour error below which no error source of the profile matters [mm]; chosen far below that of any machine."""
CIRCLE_FIGURES: Final = read_figures("busplan.questions.circle")["circle"]
CIRCLE_BY_KEY: Final = by_key(CIRCLE_FIGURES)
"""Figures of the circle test by key."""
JITTER: Final = CIRCLE_BY_KEY["jitter_us"]


def telling_measures(profile: Profile) -> tuple[str, ...]:
    """Keys of the measures that tell how round a circle is.

    They are those with a tolerance; without one, G of a whole turn, or the largest contour error of a trapezoid.
    """
    whole = "max_contour_error_mm" if profile.circle.path == "trapezoid" else "circular_deviation_mm"
    return profile.tolerance.judged or (whole,)


class Contribution(NamedTuple):
    """An error source, with figures of the circle without it."""

    source: str
    max_contour_error_mm: float
    """Largest contour error without this source [mm]."""
    removed_mm: float
    """Increase of the largest contour error by this source [mm]; negative if it hides another source."""
    mean_contour_error_mm: float
    """Mean contour error without this source [mm]."""
    circular_deviation_mm: float | None
    """Circular deviation G without this source [mm]; None on a trapezoid."""

    @property
    def words(self) -> str:
        """Name of the source in words."""
        return self.source.replace("_", " ")


class CircleFigures(NamedTuple):
    """Figures of the circle test at one period. Those of a simulation that did not run are None."""

    period_us: float
    feed_mm_per_min: float
    radius_mm: float
    path: str
    """Path of the circle: trapezoid or iso230-4."""
    duration_s: float
    setpoints: int
    steps: int
    step_us: float
    loop: str
    update: str
    """Time at which a node applies a command of a loop on the host."""
    delay_us: float
    """Bus delay inside the loop [us], the longer of both axes; 0 for a loop on the node."""
    delay_x_us: float
    delay_y_us: float
    jitter_us: float
    """Jitter of the synchronous packet [us], +/- about its mean: the profile's own and that of the bus."""
    timing_model: str
    """Timing model that decides whether the bus fits."""
    bus_fits: bool
    """Whether no limit is broken, time among them: required <= available."""
    verdict: str
    """The verdict: fits, not shown to fit, or does not fit. A circle passes only on a bus that is shown to carry it."""
    required_us: float
    available_us: float
    servo_grade: str
    """Weakest grade of the profile's servo values: published, measured, calibrated or assumed."""
    ideal_drive: bool
    """Whether the profile has no [servo], so that an ideal drive was simulated."""
    stable: bool | None
    phase_margin_deg: float | None
    """Smaller phase margin of both axes [deg]; None also if no loop gain reaches one."""
    gain_margin_db: float | None
    """Smaller gain margin of both axes [dB]; None also if no gain makes a loop unstable."""
    crossover_hz: float | None
    """Crossover of the axis with the smaller phase margin [Hz]."""
    settled: bool | None
    """Whether the loops settle before the measured turn; None on a trapezoid. If they do not, every measure is None."""
    mean_contour_error_mm: float | None
    max_contour_error_mm: float | None
    radial_deviation_min_mm: float | None
    radial_deviation_max_mm: float | None
    circular_deviation_mm: float | None
    """Circular deviation G about the least-squares centre of a whole turn [mm]; None on a trapezoid."""
    radius_deviation_mm: float | None
    centre_offset_mm: tuple[float, float] | None
    constant_speed_deg: float | None
    """Arc at constant speed for F, G, radius and centre [deg]; 360 on a turn."""
    sources_matter: bool | None
    """Whether one of the `telling_measures` is 0.1 um or more; None if nothing was measured. If not, no error source of
    the profile matters, and the test says nothing about a machine.
    """
    passed: bool | None
    """Whether the circle passes; None, not judged, if nothing fails and there is no contour tolerance or no error
    source matters.
    """
    failures: "tuple[Failure, ...]"
    contributions: tuple[Contribution, ...] | None
    """Contributions, the largest first; None if they were not requested and no contour measure failed."""

    @property
    def verdict_word(self) -> str:
        """Verdict in a word or two."""
        if self.stable is None:
            return "NOT RUN"
        if self.passed is not None:
            return "PASSED" if self.passed else "FAILED"
        return "NO SOURCE MATTERS" if self.sources_matter is False else "NOT JUDGED"

    @property
    def failed_measure(self) -> str | None:
        """Key of the first contour measure that misses its tolerance; None without one."""
        failed = (failure for failure in self.failures if failure.name in CONTOUR_MEASURES)
        return next((failure.name for failure in failed if failure.value is not None), None)

    @property
    def to_attack(self) -> tuple[Contribution, float] | None:
        """Source to remove first, without which the failed measure is smallest, and the gain [mm].

        None if no contour measure fails, contributions were not requested, or no removal reduces the measure.
        """
        measure = self.failed_measure
        if measure is None or not self.contributions:
            return None
        first = min(self.contributions, key=lambda source: float(getattr(source, measure)))
        removed_mm = float(getattr(self, measure)) - float(getattr(first, measure))
        return (first, removed_mm) if removed_mm > 0 else None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class CircleTestAnswer(Answer):
    """Answer of `circle_test`: `results` and `runs`, one for each period.

    Figures of a simulation that did not run are None, as is the run of a cycle that does not fit the bus. Answers are
    compared by identity, because traces are arrays.
    """

    profile: Profile
    results: tuple[CircleFigures, ...]
    """Figures of each period."""
    runs: "tuple[CircleRun | None, ...]"
    """Simulation of each period."""
    with_contributions: bool = False
    """Whether document and report rank the error sources."""
    shapes: "tuple[Shape | None, ...]" = ()
    """Contour error of each simulation, by angle and over time, condensed for drawings; empty where none is drawn."""

    @property
    def passed(self) -> bool | None:
        """Whether every period holds every tolerance; None if no period fails and some period is not judged."""
        verdicts = [result.passed for result in self.results]
        return False if False in verdicts else None if None in verdicts else True

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.circle.report import circle_report

        return circle_report(self)

    def trace_csv(self, *, every: int = 10) -> Iterator[str]:
        """The simulated steps of each period as CSV: time [us], positions and contour error [mm].

        Parameters
        ----------
        every
            n, to write every n-th step.

        Returns
        -------
        Iterator of str
            The file's text in blocks of many lines.

        Raises
        ------
        BusplanError
            `every` is not a whole number above zero.
        """
        from busplan.forms.csv_rows import csv_blocks
        from busplan.questions.circle.report import TRACE_COLUMNS, trace_records

        return csv_blocks(trace_records(self, every=whole_number(every, name="every")), columns=TRACE_COLUMNS)

    def drawing(self) -> Drawing:
        """Drawing of the magnified circle, its error over time and the ranked error sources.

        Raises
        ------
        BusplanError
            No period fits the bus, so nothing was simulated.
        """
        from busplan.questions.circle.drawing import circle_drawing

        if not any(self.runs):
            raise BusplanError("there is nothing to draw: no period fits the bus")
        return circle_drawing(self)


@with_its_constants
def circle_test(
    profile: ProfileLike,
    *,
    period_us: Periods | None = None,
    contributions: bool = False,
    progress: Progress | None = None,
) -> CircleTestAnswer:
    """Tell whether the circle is still round: simulate both axes at the communication period.

    Parameters
    ----------
    profile
        The network, its servo and its circle: a `Profile`, a path or a shipped name.
    period_us
        Communication period T_s [us], or n of them; by default the profile's own.
    contributions
        If True, remove each error source in turn, and rank them.
    progress
        Function called from time to time with the steps simulated and the steps known to be needed.

    Returns
    -------
    CircleTestAnswer
        Its `results` and `runs` have n entries. Errors are in mm, margins in deg and dB.

    Raises
    ------
    BusplanError
        Not a profile, a feed that the drive cannot reach, or a circle too short for its ramps.

    References
    ----------
    ISO 230-4 for the measures; the paper's section IV-B for the test.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.circle_test("paper-4ms")
    >>> answer.passed, round(answer.results[0].max_contour_error_mm, 6)
    (True, 0.018967)
    >>> answer.runs[0].trace(every=10).contour_error_mm.shape
    (48656,)
    """
    from busplan.questions.circle.roundness import run_circles
    from busplan.questions.circle.shape import Shape

    test = run_circles(
        load_network(profile),
        periods_us=None if period_us is None else one_or_several(period_us, name="period_us"),
        with_contributions=contributions,
        progress=progress,
    )
    return replace(test, shapes=tuple(None if run is None else Shape.of(run) for run in test.runs))
