"""The circle test for a search: the failures of many variants of one profile."""

from busplan.analysis.circle.roundness import circle_test
from busplan.analysis.circle.setup import loop_delays_us
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.sections.profile import Profile

_PARTS = 1000
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
        self._known: dict[tuple[float, tuple[float, float]], tuple[str, ...]] = {}

    def __call__(self, profile: Profile) -> tuple[str, ...]:
        """Run the circle test and list its failures, or why it cannot be run; empty if it passes.

        Parameters
        ----------
        profile
            A variant that is shown to fit its bus: its failures are those of the circle.
        """
        # The cycle itself matters only where it lies inside a loop on the host.
        key = (profile.cycle.period_us, loop_delays_us(profile))
        if key not in self._known:
            self._known[key] = self._run(profile)
        return self._known[key]

    def _run(self, profile: Profile) -> tuple[str, ...]:
        try:
            result = circle_test(profile, explain=False, progress=self._report).results[0]
        except BusplanError as error:
            return error.problems
        return tuple(failure.text for failure in result.failures)

    def _report(self, done: int, total: int) -> None:
        if self._progress is not None:
            tests = len(self._known)
            self._progress(tests * _PARTS + done * _PARTS // total, max(self._expected, tests + 1) * _PARTS)
