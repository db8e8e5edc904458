"""Circle tests of the variants of a profile, and of a comparison; only running one loads the simulation."""

from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError
from busplan.progress import Progress, part_of
from busplan.questions.fit.circle_refusal import path_steps
from busplan.questions.fit.loop_delays import jitter_us, loop_delays_us, skew_us
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.questions.circle.figures import CircleFigures


MOST_STEPS: Final = 10_000_000
"""Most steps of a circle that a gate runs: seconds, and a few hundred megabytes."""
_PARTS: Final = 1000
"""Progress steps of one test."""


class CircleCheck:
    """Runs circle tests of variants of one profile that differ only in bus, cycle and payload, each simulation once.

    Parameters
    ----------
    progress
        Called with the parts of tests done and those expected.
    expected
        Number of tests expected [1].
    """

    def __init__(self, *, progress: Progress | None = None, expected: int = 1) -> None:
        self._progress = progress
        self._expected = expected
        self._known: dict[tuple[float, ...], tuple[str, ...]] = {}
        self._always: tuple[str, ...] = ()
        """Failures that no period mends."""

    def __call__(self, profile: Profile) -> tuple[str, ...]:
        """Run the circle test and list its failures, or why it cannot be run; empty if it passes.

        Parameters
        ----------
        profile
            A variant that is shown to fit its bus: its failures are those of the circle.
        """
        key = rests_on(profile)
        if key not in self._known:
            self._known[key] = self._always or self._run(profile)
        return self._known[key]

    def _run(self, profile: Profile) -> tuple[str, ...]:
        from busplan.questions.circle.failures import STABILITY
        from busplan.questions.circle.roundness import circle_test

        try:
            result = circle_test(profile, explain=False, progress=self._report).results[0]
        except BusplanError as error:
            return error.problems
        texts = tuple(failure.text for failure in result.failures)
        # A loop on the node knows neither the period nor the bus.
        if profile.servo.loop == "node" and any(failure.name in STABILITY for failure in result.failures):
            self._always = texts
        return texts

    def _report(self, done: int, total: int) -> None:
        if self._progress is not None:
            tests = len(self._known)
            self._progress(tests * _PARTS + done * _PARTS // total, max(self._expected, tests + 1) * _PARTS)


def rests_on(profile: Profile) -> tuple[float, ...]:
    """Inputs of a circle from bus and cycle: the period, its steps, delays in a loop on the host, skew and jitter."""
    own = profile.cycle.period_us, profile.servo.step_us
    return *own, *loop_delays_us(profile), skew_us(profile), jitter_us(profile)


def failures_within(profile: Profile, *, most_steps: int) -> tuple[str, ...] | None:
    """Limits that the circle of a profile breaks, or why it cannot be run; None where it is too long to be run.

    Parameters
    ----------
    profile
        A profile that is shown to fit its bus.
    most_steps
        Most simulated steps of each axis.
    """
    try:
        steps = path_steps(profile)
    except BusplanError as error:
        return error.problems
    return None if steps > most_steps else CircleCheck()(profile)


ComputeCircleFigures = Callable[["Profile"], "CircleFigures"]
"""Runs the circle test of a profile."""


def circle_tests(progress: Progress | None = None, *, of: int = 2) -> ComputeCircleFigures:
    """Make the function that runs the circle test of each of some profiles, with one progress for all.

    Parameters
    ----------
    progress
        Called from time to time with the work done and the total work.
    of
        How many profiles [1].
    """
    number = count()

    def run(profile: "Profile") -> "CircleFigures":
        from busplan.questions.circle.roundness import circle_test

        part = None if progress is None else part_of(progress, number=next(number), of=of)
        return circle_test(profile, explain=False, progress=part).results[0]

    return run
