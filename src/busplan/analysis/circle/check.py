"""The circle test for a search: the failures of many variants of one profile. Only a test loads the simulation."""

from typing import Final

from busplan.analysis.circle.delays import jitter_us, loop_delays_us, skew_us
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.sections.profile import Profile

MOST_STEPS: Final = 10_000_000
"""Most steps of a circle that is run where nobody asked for it: seconds, and a few hundred megabytes."""
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
    most_steps
        Most simulated steps of each axis; None for any number. A longer circle is not run, and fails unless it is no
        longer than that of `own`.
    own
        Profile that the variants are of.
    is_taken
        Whether its circle, at its own period and with its own delays, is taken to pass.
    """

    def __init__(
        self,
        *,
        progress: Progress | None = None,
        expected: int = 1,
        most_steps: int | None = None,
        own: Profile | None = None,
        is_taken: bool = False,
    ) -> None:
        self._progress = progress
        self._expected = expected
        self._most_steps = most_steps
        self._known: dict[tuple[float, tuple[float, float], float, float], tuple[str, ...]] = {}
        self._always: tuple[str, ...] = ()
        """Failures that no period mends."""
        self._own = own
        if own is not None and is_taken:
            self._known[_key(own)] = ()

    def __call__(self, profile: Profile) -> tuple[str, ...]:
        """Run the circle test and list its failures, or why it cannot be run; empty if it passes.

        Parameters
        ----------
        profile
            A variant that is shown to fit its bus: its failures are those of the circle.
        """
        key = _key(profile)
        if key not in self._known:
            self._known[key] = self._always or self._run(profile)
        return self._known[key]

    def _run(self, profile: Profile) -> tuple[str, ...]:
        from busplan.analysis.circle.failures import STABILITY
        from busplan.analysis.circle.roundness import circle_test
        from busplan.analysis.circle.setup import path_steps

        try:
            steps = path_steps(profile)
            if self._most_steps is not None and steps > self._most_steps:
                own_steps = 0 if self._own is None else path_steps(self._own)
                return () if steps <= own_steps else (f"a circle of {steps:,} steps is too long to be run here",)
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


def _key(profile: Profile) -> tuple[float, tuple[float, float], float, float]:
    """What a circle rests on: the cycle itself matters only inside a loop on the host, or without a common clock."""
    return profile.cycle.period_us, loop_delays_us(profile), skew_us(profile), jitter_us(profile)
