"""Progress of long work."""

from collections.abc import Callable
from typing import Final

Progress = Callable[[int, int], None]
"""Function called from time to time with the work done and the total work."""
_PARTS: Final = 1000
"""Steps of progress in a piece of work."""


def ignored(_done: int, _total: int) -> None:
    """Report no progress."""


def part_of(progress: Progress, *, number: int, of: int) -> Progress:
    """Progress of one piece, numbered from 0, of several equal pieces of work."""

    def report(done: int, total: int) -> None:
        progress(number * _PARTS + done * _PARTS // total, of * _PARTS)

    return report
