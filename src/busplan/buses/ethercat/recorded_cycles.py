"""Cycles of a capture: the frames of each cycle, the cycle of the plan that each one is, and frames that return."""

from math import inf, log
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.ethercat.frames import UnitCycle, cycles_of
from busplan.buses.network import Network
from busplan.recordings.ethercat import EthercatFrames
from busplan.recordings.statistics import LEAST_EVENTS, Floats, PeriodicEvents, periodic_events

Ints = npt.NDArray[np.int64]
_JUMP: Final = 1.01
"""Smallest ratio of two usual frame distances between which a bound is tried."""
_FARTHEST: Final = log(8)
"""Largest |log(recorded period / planned period)| at which frames are divided into cycles."""
_SAME: Final = 0.1
"""Largest difference of these logarithms at which two periods count as equal."""
_BURST: Final = 1 / 20
"""Share of the planned period below which the distance of cycles shows that frames were stamped in bursts."""


class PlannedCycles:
    """Cycles of the hyperperiod (the common multiple of the rates); one cycle if all rates are 1."""

    def __init__(self, network: Network) -> None:
        self.sorts = cycles_of(network)
        """Distinct cycles, the fullest first."""
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
        """Distance from each cycle with process data to the next one, in cycles; 1 for a cycle without."""
        self.apart[filled] = apart[: len(filled)]
        self.least_apart = int(apart.min())
        """Smallest such distance, in cycles."""
        self.least_share = float(np.mean(apart == self.least_apart))
        """Share of the distances that equal the smallest."""

    def filled_before(self, number: Ints) -> Ints:
        """Number of cycles with process data before cycle `number`, from 0, in this or a later hyperperiod."""
        whole, rest = np.divmod(number, len(self.sort))
        return np.asarray(whole * self._filled[-1] + self._filled[rest])

    def phase(self, places: Ints, data_bytes: npt.NDArray[Any], likely: int = 0) -> int:
        """Cycle of the hyperperiod in which the recording begins: the one whose process data match best.

        `places` are the periods of n cycles in the recording, from 0, and `data_bytes` their process data [bytes].
        `likely` is taken where no other cycle matches better.
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
    """Cycle of each frame, from 0."""
    first: Ints
    """Index of the first frame of each cycle."""
    periods: PeriodicEvents | None
    """Start times of the cycles; None for too few cycles, or for stamps in bursts."""
    in_bursts: bool
    """Whether stamps come in bursts, which have no period."""
    sorts: tuple[UnitCycle, ...]
    """Distinct cycles of the plan, the fullest first."""
    sort: Ints
    """Index in `sorts` of each cycle."""
    gaps: Ints
    """Number of planned cycles with process data that are missing between each cycle and the next."""
    left_out: int
    """Number of frames left out at the ends, where the master starts or stops or a cycle is incomplete."""


def seen_cycles(frames: Ints, times_us: Floats, kinds: Ints, data_bytes: Floats, network: Network) -> SeenCycles:
    """Cycles that the frames make up, and the planned cycle of each, from its time and process data.

    `frames` are the indexes of the frames of process data in the recording, at least one, in the order of their times.
    Of each frame, `times_us` has the time sent, `kinds` a number for its datagrams of process data (the same for equal
    ones), and `data_bytes` the process data [bytes]. The network has plain numbers.
    """
    plan = PlannedCycles(network)
    period_us = network.period_us
    starts, near_us = _starts(times_us, kinds, plan, period_us)
    in_bursts = len(starts) > 1 and float(np.median(np.diff(times_us[starts]))) < _BURST * period_us
    begin, end = 0, len(starts)
    while True:  # Until no more cycles have to be left out at the ends.
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
    """Cycle of the hyperperiod of each recorded cycle, and number of cycles with process data missing after it.

    The whole recording shows its place in the hyperperiod. A master that skips a period may not skip a number in its
    own count: where a cycle comes that the plan does not expect next, and its data differ, the place is sought again.
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
    """First cycle and end of the last, without those while the master starts or stops.

    These lie before the first ten or after the last ten cycles in a row, if more cycles are missing there than present.
    """
    in_a_row = np.convolve(np.append(gaps, 1) == 0, np.ones(LEAST_EVENTS - 1), "full")[LEAST_EVENTS - 2 :]
    rows = np.flatnonzero(in_a_row == LEAST_EVENTS - 1)
    if not len(rows):
        return 0, len(gaps) + 1
    first, last = int(rows[0]), int(rows[-1]) + LEAST_EVENTS
    before, after = int(gaps[:first].sum()), int(gaps[last - 1 :].sum())
    return first if before > first else 0, last if after > len(gaps) + 1 - last else len(gaps) + 1


def _whole(frames: Ints, sort: Ints) -> tuple[int, int]:
    """First cycle and end of the last, without cycles that the capture has only in part.

    `frames` counts the frames of n cycles, and `sort` tells which cycles of the plan they are.
    """
    has_less = [frames[end] < np.median(frames[sort == sort[end]]) for end in (0, -1)]
    return int(has_less[0]), len(frames) - int(has_less[1])


class Trips(NamedTuple):
    """Frames paired with their return, as indexes into the recording."""

    sent: Ints
    returned: Ints
    """Returned frame of each pair."""
    lost: Ints
    """Frames that did not return."""
    unsent: int
    """Number of returned frames that were not seen when sent."""


def trips(frames: EthercatFrames) -> Trips:
    """Sent frames paired with returned ones.

    Frames keep their order on the ring, so frames with equal datagrams and indexes return in the order in which they
    were sent. If some were sent in a row and fewer returned before the next was sent, the earliest are lost.
    """
    order = np.argsort(frames.key, kind="stable")
    key, returned = frames.key[order], frames.returned[order]
    changes = np.flatnonzero((np.diff(key) != 0) | (np.diff(returned.view(np.int8)) != 0)) + 1
    first = np.concatenate(([0], changes))
    length = np.diff(np.concatenate((first, [len(order)])))
    answered = ~returned[first[:-1]] & returned[first[1:]] & (key[first[:-1]] == key[first[1:]])
    run = np.flatnonzero(answered)
    sent, back = length[run], length[run + 1]
    pairs = np.minimum(sent, back)
    within = np.arange(pairs.sum()) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    sent_at = order[np.repeat(first[run] + sent - pairs, pairs) + within]
    back_at = order[np.repeat(first[run + 1], pairs) + within]
    is_paired = np.zeros(len(order), dtype=np.bool_)
    is_paired[sent_at] = is_paired[back_at] = True
    lost = np.flatnonzero(~is_paired & ~frames.returned)
    # Frames sent after the last return may still be on their way.
    lost = lost[lost < (back_at.max() if len(back_at) else 0)]
    unsent = int(np.count_nonzero(~is_paired & frames.returned))
    kept = frames.times_ns[back_at] >= frames.times_ns[sent_at]
    return Trips(sent_at[kept], back_at[kept], lost, unsent)
