"""The circle tests of a comparison; importing this loads no simulation."""

from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING

from busplan.progress import Progress, part_of

if TYPE_CHECKING:
    from busplan.questions.circle.record import CircleFigures
    from busplan.sections.profile import Profile

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
