"""Progress of long work."""

from collections.abc import Callable
from typing import Final

Progress = Callable[[int, int], None]
"""Called from time to time with the work done and the total work."""
_PARTS: Final = 1000
"""Progress steps of a piece of work."""


def ignored(_done: int, _total: int) -> None:
    """Report no progress."""


def part_of(progress: Progress, *, number: int, of: int) -> Progress:
    """Progress of a piece of work, of several that are equal.

    Parameters
    ----------
    progress
        Progress of all pieces.
    number
        Number of the piece, from 0.
    of
        Number of pieces.
    """

    def report(done: int, total: int) -> None:
        progress(number * _PARTS + done * _PARTS // total, of * _PARTS)

    return report
