"""The cycles of a capture: which frames make a cycle, and which cycle of the plan each one is."""

from math import inf, log
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.ethercat.frames import UnitCycle, cycles_of
from busplan.buses.network import Network
from busplan.recordings.statistics import LEAST_EVENTS, Floats, PeriodicEvents, periodic_events

Ints = npt.NDArray[np.int64]
_JUMP: Final = 1.01
"""Least ratio of two usual distances of frames between which a bound is tried."""
_FARTHEST: Final = log(8)
"""Largest |log(recorded period / planned period)| at which frames are divided into cycles."""
_SAME: Final = 0.1
"""Largest difference of these logarithms at which two periods count as the same."""
_BURST: Final = 1 / 20
"""Share of the planned period: cycles closer than that mean that frames were stamped in bursts."""


class PlannedCycles:
    """The cycles of the hyperperiod (the common multiple of the rates); one cycle if all rates are 1."""

    def __init__(self, network: Network) -> None:
        self.sorts = cycles_of(network)
        """The distinct cycles, the fullest first."""
        self.sort = np.zeros(sum(len(sort.numbers) for sort in self.sorts), dtype=np.int64)
        """Index in `sorts` of each cycle."""
        for index, sort in enumerate(self.sorts):
            self.sort[np.array(sort.numbers) - 1] = index
        self.data_bytes = np.array([float(sort.data_bytes) for sort in self.sorts])[self.sort]
        """Process data of each cycle [bytes]."""
        self._filled = np.concatenate(([0], np.cumsum(self.data_bytes > 0)))
        filled = np.flatnonzero(self.data_bytes)
        apart = np.diff(filled, append=filled[:1] + len(self.sort)) if len(filled) else np.ones(1, dtype=np.int64)
        self.apart = np.ones(len(self.sort), dtype=np.int64)
        """Distance from each cycle with process data to the next, in cycles; 1 for a cycle without."""
        self.apart[filled] = apart[: len(filled)]
        self.least_apart = int(apart.min())
        """Least distance from a cycle with process data to the next, in cycles."""
        self.least_share = float(np.mean(apart == self.least_apart))
        """Share of these distances that are as short."""

    def filled_before(self, number: Ints) -> Ints:
        """Number of cycles with process data before a cycle, from 0; it may be beyond the first hyperperiod."""
        whole, rest = np.divmod(number, len(self.sort))
        return np.asarray(whole * self._filled[-1] + self._filled[rest])

    def phase(self, places: Ints, data_bytes: npt.NDArray[Any], likely: int = 0) -> int:
        """The cycle of the hyperperiod that period 0 of a recording is: the one with the best match of process data.

        Parameters
        ----------
        places, data_bytes
            Periods of n cycles in the recording, from 0, and their process data [bytes].
        likely
            The cycle that is taken where no other is better.
        """
        count = len(self.sort)
        pairs, often = np.unique(np.stack((places % count, data_bytes), axis=1), axis=0, return_counts=True)
        planned = self.data_bytes[(pairs[:, :1].astype(np.int64) + np.arange(count)) % count]
        match = often @ (planned - np.abs(planned - pairs[:, 1:]))
        return likely if match[likely] >= match.max() else int(np.argmax(match))


class SeenCycles(NamedTuple):
    """The n cycles with process data in a recording."""

    frames: Ints
    """Indexes of all their frames in the recording."""
    number: Ints
    """Cycle that each frame belongs to, from 0."""
    first: Ints
    """Indexes of their first frames."""
    periods: PeriodicEvents | None
    """When they begin; None for too few cycles, or for stamps in bursts."""
    in_bursts: bool
    """Whether stamps come in bursts, which have no period."""
    sorts: tuple[UnitCycle, ...]
    """The distinct cycles of the plan, the fullest first."""
    sort: Ints
    """Index in `sorts` of each cycle."""
    gaps: Ints
    """Number of planned cycles with process data that are missing between each cycle and the next."""
    left_out: int
    """Number of frames left out at the ends: the master starting or stopping, and incomplete cycles."""


def seen_cycles(frames: Ints, times_us: Floats, kinds: Ints, data_bytes: Floats, network: Network) -> SeenCycles:
    """Divide frames into cycles, and find the planned cycle of each from its time and process data.

    Parameters
    ----------
    frames
        Indexes of the frames of process data in the recording, in the order of their times, at least one.
    times_us, kinds, data_bytes
        Of each: time sent, number of its datagrams of process data (equal ones have the same), process data [bytes].
    network
        The plan, of plain numbers.
    """
    plan = PlannedCycles(network)
    period_us = network.period_us
    starts, near_us = _starts(times_us, kinds, plan, period_us)
    in_bursts = len(starts) > 1 and float(np.median(np.diff(times_us[starts]))) < _BURST * period_us
    begin, end = 0, len(starts)
    while True:  # until no more cycles have to be left out at the ends
        kept = slice(int(starts[begin]), int(np.append(starts, len(frames))[end]))
        first = starts[begin:end]
        number = np.searchsorted(first, np.arange(kept.start, kept.stop), side="right") - 1
        periods = None if in_bursts else periodic_events(times_us[first], near_us)
        of_plan, gaps = np.zeros(len(first), dtype=np.int64), np.zeros(len(first) - 1, dtype=np.int64)
        if periods is not None:
            in_cycle_bytes = np.bincount(number, weights=data_bytes[kept]).astype(np.float64)
            of_plan, gaps = _numbered(plan, periods.places, in_cycle_bytes)
        sort = plan.sort[of_plan]
        all_cycles = 0, len(first)
        taken = _in_operation(gaps)
        if periods is not None and taken == all_cycles:
            taken = _whole(np.bincount(number), sort)
        if taken == all_cycles:
            left_out = len(frames) - len(number)
            return SeenCycles(frames[kept], number, frames[first], periods, in_bursts, plan.sorts, sort, gaps, left_out)
        begin, end = begin + taken[0], begin + taken[1]


def _starts(times_us: Floats, kinds: Ints, plan: PlannedCycles, period_us: float) -> tuple[Ints, float]:
    """Indexes of the frames that begin a cycle, and the approximate period of the master's task [us].

    Two consecutive kinds of frame have a usual distance, the median. If it exceeds a bound, the second begins a cycle.
    A bound is tried at each jump of the sorted distances. The best has the period nearest to the planned one; of equal
    periods, the fewest contradictions: cycles closer than half a period, or frames of one cycle farther apart.
    """
    apart_us = np.diff(times_us)
    _, pair = np.unique(kinds[:-1] * (int(kinds.max()) + 1) + kinds[1:], return_inverse=True)
    by_pair = np.split(apart_us[np.argsort(pair, kind="stable")], np.cumsum(np.bincount(pair))[:-1])
    usual_us = np.array([float(np.median(distances)) for distances in by_pair if len(distances)])
    ordered_us = np.sort(usual_us)
    within_us = ordered_us[:-1][ordered_us[1:] > _JUMP * ordered_us[:-1]]
    tried = []
    for longest_us in (-inf, *within_us):
        begins = np.concatenate(([True], usual_us[pair] > longest_us))
        starts = np.flatnonzero(begins)
        between_us = np.diff(times_us[starts])
        least_us = float(np.quantile(between_us, plan.least_share / 2)) if len(between_us) else 0.0
        for cycles in range(1, plan.least_apart + 1):
            near_us = least_us / cycles
            off = abs(log(near_us / period_us)) if near_us > 0 else inf
            close, far = between_us < near_us / 2, apart_us[~begins[1:]] > near_us / 2
            tried.append((off, int(np.count_nonzero(close) + np.count_nonzero(far)), starts, near_us))
    least = min(off for off, *_ in tried)
    if least > _FARTHEST:
        return tried[0][2:]
    return min((bound for bound in tried if bound[0] <= least + _SAME), key=lambda bound: bound[1])[2:]


def _numbered(plan: PlannedCycles, places: Ints, data_bytes: npt.NDArray[Any]) -> tuple[Ints, Ints]:
    """Cycle of the hyperperiod for each recorded one, and the number of those missing after it, with process data.

    The whole recording shows its place in the hyperperiod. A master that skips a period may not skip a number of its
    own count: where another cycle comes than the next one planned, and data differ, the place is looked for again.
    """
    count, apart = len(plan.sort), np.diff(places)
    some = max(2 * int(np.count_nonzero(plan.data_bytes)), LEAST_EVENTS)
    of_plan, looked_at = (places + plan.phase(places, data_bytes)) % count, -1
    while True:
        turns = np.append(0, 1 + np.flatnonzero(apart != plan.apart[of_plan[:-1]]))
        differs = np.logical_or.reduceat(data_bytes != plan.data_bytes[of_plan], turns)
        for turn in turns[differs & (turns > looked_at)].tolist():
            phase, part = (of_plan[turn] - places[turn]) % count, slice(turn, turn + some)
            found = plan.phase(places[part], data_bytes[part], int(phase))
            if found != phase:
                of_plan[turn:], looked_at = (places[turn:] + found) % count, turn
                break
        else:
            break
    gaps = plan.filled_before(of_plan[:-1] + apart) - plan.filled_before(of_plan[:-1] + 1)
    return of_plan, gaps


def _in_operation(gaps: Ints) -> tuple[int, int]:
    """The first cycle and the end of the last, without those while the master starts or stops.

    Those lie before the first ten or after the last ten cycles in a row, if more cycles are missing there than present.
    """
    in_a_row = np.convolve(np.append(gaps, 1) == 0, np.ones(LEAST_EVENTS - 1), "full")[LEAST_EVENTS - 2 :]
    rows = np.flatnonzero(in_a_row == LEAST_EVENTS - 1)
    if not len(rows):
        return 0, len(gaps) + 1
    first, last = int(rows[0]), int(rows[-1]) + LEAST_EVENTS
    before, after = int(gaps[:first].sum()), int(gaps[last - 1 :].sum())
    return first if before > first else 0, last if after > len(gaps) + 1 - last else len(gaps) + 1


def _whole(frames: Ints, sort: Ints) -> tuple[int, int]:
    """The first cycle and the end of the last, without cycles that the capture has only in part.

    Parameters
    ----------
    frames, sort
        Frames of n cycles, and which cycles of the plan they are.
    """
    has_less = [frames[end] < np.median(frames[sort == sort[end]]) for end in (0, -1)]
    return int(has_less[0]), len(frames) - int(has_less[1])
