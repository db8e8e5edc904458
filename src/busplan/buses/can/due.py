"""PDOs of a CAN log beside the SYNCs at which they were due: late, missing and twice."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.recordings.statistics import Floats

_MADE_UP: Final = 10
"""Due cycles within which a PDO that is missing may still come."""
_BLOCK: Final = 50
"""Due cycles over which PDOs of every n-th SYNC keep their place among the SYNCs."""


class DuePdos(NamedTuple):
    """PDOs of an identifier beside the SYNCs at which they were due."""

    cycles: npt.NDArray[np.int64]
    """Number of the SYNC at which each PDO was due."""
    pdos: npt.NDArray[np.int64]
    """Index of each PDO; those before the first SYNC at which one is due are left out."""
    late_us: Floats
    """Time of each PDO after this SYNC [us]."""
    due: int
    """PDOs that were due."""
    missing: npt.NDArray[np.int64]
    """Number of the SYNC of each PDO that never came."""
    twice: npt.NDArray[np.int64]
    """Index of each PDO that came again for one SYNC."""


def due_pdos(sync_us: Floats, times_us: Floats, *, every: int, is_sent: npt.NDArray[np.bool_] | None = None) -> DuePdos:
    """The SYNC at which each PDO was due.

    A PDO comes once for each SYNC that it is due at. Two after one SYNC, where one before had none, are late: they came
    in their order. One that never comes is missing. A lag of whole periods that never changes cannot be seen.

    Times ascend, those of SYNC one a period, and each PDO comes after some SYNC [us]. It is due at every n-th SYNC. For
    a SYNC that was not sent a PDO may come, and need not; by default all were sent.

    Examples
    --------
    The second of five is late, so that it comes with the third; the fifth SYNC is the last, and nobody knows of it:

    >>> found = due_pdos(np.arange(5) * 100.0, np.array([30.0, 210, 230, 330]), every=1)
    >>> found.late_us.tolist(), found.due, found.missing.tolist(), found.twice.tolist()
    ([30.0, 110.0, 30.0, 30.0], 4, [], [])
    """
    sent = np.ones(len(sync_us), dtype=np.bool_) if is_sent is None else is_sent
    due = _due_at(sync_us, times_us, every, sent)
    cycles = np.searchsorted(sync_us[due], times_us, side="right") - 1
    pdos = np.flatnonzero(cycles >= 0)
    times_us, cycles = times_us[pdos], cycles[pdos]
    # After the last SYNC the log may end.
    whole = len(due) - 1
    counts = np.bincount(cycles, minlength=len(due))[:whole]
    first = np.searchsorted(cycles, np.arange(len(due) + 1))
    missing: list[int] = []
    twice: list[int] = []
    for place in np.flatnonzero(counts != 1).tolist():
        if not counts[place]:
            missing += [place] if sent[due[place]] else []
            continue
        for number in range(int(counts[place]) - 1):
            if not missing or place - missing[-1] > _MADE_UP:
                # The log may begin with a PDO of a SYNC before it.
                twice += range(first[place] + number + 1, first[place + 1]) if place else ()
                break
            cycles[first[missing.pop() + 1] : first[place + 1] - 1 - number] -= 1
    late_us, of_due = times_us - sync_us[due[cycles]], int(sent[due[:whole]].sum())
    return DuePdos(due[cycles], pdos, late_us, of_due, due[_places(missing)], pdos[_places(twice)])


def _places(places: list[int]) -> npt.NDArray[np.int64]:
    return np.array(places, dtype=np.int64)


def _due_at(sync_us: Floats, times_us: Floats, every: int, is_sent: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Numbers of the SYNCs at which a PDO of every n-th is due: behind which some neighbours are the least late.

    Nodes count the SYNCs that they get, a host counts periods: of both the one is taken by which more PDOs are due.
    """
    periods = np.arange(len(sync_us))
    if every == 1:
        return periods
    comes = np.bincount(np.searchsorted(sync_us, times_us, side="right"), minlength=len(sync_us) + 1)[1:] > 0
    ways = (_least_late(comes, count % every, every) for count in (periods, is_sent.cumsum()))
    return max(ways, key=lambda due: int(np.count_nonzero(comes[due])))


def _least_late(comes: npt.NDArray[np.bool_], rest: npt.NDArray[np.int64], every: int) -> npt.NDArray[np.int64]:
    """Numbers of the SYNCs whose rest is that of their block behind which PDOs are the fewest SYNCs late in all."""
    blocks = np.array_split(np.arange(len(rest)), max(len(rest) // (_BLOCK * every), 1))
    due = []
    for block in blocks:
        often = np.bincount(rest[block[comes[block]]], minlength=every)
        # For the next rest those of this one are late by all but a round, and all others by one less.
        late = np.cumsum(every * often - often.sum())
        due.append(block[rest[block] == (int(np.argmin(late)) + 1) % every])
    return np.concatenate(due)
