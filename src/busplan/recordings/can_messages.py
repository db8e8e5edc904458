"""The messages of a CAN log: frames of each identifier, and whether they come periodically."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.recordings.can import CanFrames
from busplan.recordings.statistics import Floats, PeriodicEvents, grid
from busplan.recordings.words import counted

_STEP_BACK_US: Final = -1000.0
"""Stamps of neighbours are so far out of order only where a clock was set [us]."""
_PERIODIC: Final = 0.15
"""Largest standard deviation of a periodic message, as a share of its period."""
_MISSING: Final = 0.1
"""Most periods of a periodic message without a frame, as a share of its frames."""
_SHOWN: Final = 6
"""Most identifiers that a sentence lists."""


class SentFrames(NamedTuple):
    """Frames of an identifier."""

    identifier: int
    extended: bool
    """Whether the identifier has 29 bits."""
    times_us: Floats
    most_bytes: int
    is_fd: bool
    """Whether any of them is of CAN FD."""
    grid: PeriodicEvents | None
    """Its periods, where it comes periodically."""

    @property
    def mean_us(self) -> float:
        """Mean distance of its frames [us]."""
        return float(self.times_us[-1] - self.times_us[0]) / (len(self.times_us) - 1)


class ClockStretch(NamedTuple):
    """The longest part of a log in which its clock was not set back."""

    taken: npt.NDArray[np.int64]
    """Places of its frames in the log, by their stamps."""
    times_us: Floats
    """Their stamps, ascending [us]."""
    steps_back: int
    """How often the clock was set back in the whole log."""


def longest_stretch(frames: CanFrames) -> ClockStretch:
    """Find the longest part without a clock that was set back; queues may put neighbours out of order."""
    steps_back = np.flatnonzero(np.diff(frames.times_us) < _STEP_BACK_US) + 1
    ends = np.concatenate(([0], steps_back, [len(frames.times_us)]))
    longest = int(np.argmax(np.diff(ends)))
    taken = np.arange(ends[longest], ends[longest + 1])
    taken = taken[np.argsort(frames.times_us[taken], kind="stable")]
    return ClockStretch(taken, frames.times_us[taken], len(steps_back))


def sent_messages(frames: CanFrames, stretch: ClockStretch) -> Mapping[tuple[int, bool], SentFrames]:
    """Frames of each identifier, by the identifier and whether it has 29 bits, ascending."""
    key = frames.identifiers[stretch.taken] * 2 + frames.extended[stretch.taken]
    order = np.argsort(key, kind="stable")
    messages = {}
    for places in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        identifier, extended = divmod(int(key[places[0]]), 2)
        times_us, taken = stretch.times_us[places], stretch.taken[places]
        periods = grid(times_us)
        if periods is not None and not _is_periodic(periods):
            periods = None
        messages[identifier, bool(extended)] = SentFrames(
            identifier,
            bool(extended),
            times_us,
            int(frames.sizes[taken].max()),
            bool(frames.is_fd[taken].any()),
            periods,
        )
    return messages


def _is_periodic(periods: PeriodicEvents) -> bool:
    late_us = float(np.std(periods.late_us))
    return late_us <= _PERIODIC * periods.period_us and periods.missing <= _MISSING * len(periods.late_us)


def faults(frames: CanFrames, stretch: ClockStretch) -> Iterator[str]:
    """Sentences on a log that is damaged, and on its clock."""
    if frames.broken:
        yield f"The log is cut or damaged behind frame {len(frames.times_us):,}, read up to there: {frames.broken}."
    if stretch.steps_back:
        yield f"Its clock was set back {counted(stretch.steps_back, 'time')}: the longest stretch between is taken."


def listed(names: list[str]) -> str:
    """Names of a sentence, no more than six.

    Examples
    --------
    >>> listed(list("abcdefgh"))
    'a, b, c, d, e, f and 2 more'
    """
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
