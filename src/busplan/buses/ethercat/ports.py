"""What a capture of EtherCAT shows at a port: frames, cycles and their numbers."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import inf, log
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.ethercat.equations import DELAY_UNCERTAINTY_US, DELAY_US, MEASURED_DELAY_UNCERTAINTY_US, cable_us
from busplan.buses.ethercat.frames import UnitCycle, cycles_of
from busplan.buses.network import Network
from busplan.buses.rule import RecordedFigure
from busplan.elementwise import plain
from busplan.english import plural
from busplan.recordings.ethercat import Latch
from busplan.recordings.statistics import LEAST_EVENTS, Floats, PeriodicEvents, expanded, grid
from busplan.sections.machine import ProfileGroup

Places = npt.NDArray[np.int64]
_JUMP: Final = 1.01
"""Least ratio of a pause between cycles to one within a cycle."""
_FARTHEST: Final = log(8)
"""Logarithm of the largest ratio of a recorded period to the planned one that pauses are looked for with."""
_ALIKE: Final = 0.1
"""Difference of logarithms of periods that are taken for the same."""
_BURST: Final = 1 / 20
"""Share of the planned period that is no distance of cycles, but of frames that were stamped in bursts."""


class PlannedCycles:
    """The cycles of the common multiple of the rates; a single one without rates."""

    def __init__(self, network: Network) -> None:
        self.sorts = cycles_of(network)
        """The cycles that differ, the fullest first."""
        self.sort = np.zeros(sum(len(sort.numbers) for sort in self.sorts), dtype=np.int64)
        """Place in `sorts` of each cycle."""
        for place, sort in enumerate(self.sorts):
            self.sort[np.array(sort.numbers) - 1] = place
        self.data_bytes = np.array([float(sort.data_bytes) for sort in self.sorts])[self.sort]
        """Process data of each cycle [bytes]."""
        self._filled = np.concatenate(([0], np.cumsum(self.data_bytes > 0)))
        filled = np.flatnonzero(self.data_bytes)
        apart = np.diff(filled, append=filled[:1] + len(self.sort)) if len(filled) else np.ones(1, dtype=np.int64)
        self.least_apart = int(apart.min())
        """Least distance of two cycles with process data, in cycles."""
        self.least_share = float(np.mean(apart == self.least_apart))
        """Share of such distances that are no longer."""

    def filled_before(self, number: Places) -> Places:
        """How many cycles before one, from 0, have process data; the common multiple repeats itself."""
        whole, rest = np.divmod(number, len(self.sort))
        return np.asarray(whole * self._filled[-1] + self._filled[rest])

    def phase(self, places: Places, data_bytes: npt.NDArray[Any]) -> int:
        """The cycle of the common multiple that the first place is, so that process data match best.

        Parameters
        ----------
        places, data_bytes
            Numbers of n cycles in a recording, and their process data [bytes].
        """
        count = len(self.sort)
        seen, often = np.unique(np.stack((places % count, data_bytes), axis=1), axis=0, return_counts=True)
        planned = self.data_bytes[(seen[:, :1].astype(np.int64) + np.arange(count)) % count]
        return int(np.argmax(often @ (planned - np.abs(planned - seen[:, 1:]))))


class SeenCycles(NamedTuple):
    """Cycles with process data, n of them."""

    frames: Places
    """Places of all their frames in the recording."""
    number: Places
    """Which of the cycles each frame belongs to, from 0."""
    first: Places
    """Places of their first frames."""
    periods: PeriodicEvents | None
    """When they begin; None of too few cycles, or of stamps in bursts."""
    in_bursts: bool
    """Whether stamps come in bursts, which have no period."""
    sorts: tuple[UnitCycle, ...]
    """The cycles of the plan that differ, the fullest first."""
    sort: Places
    """Which of them each one is, from 0."""
    gaps: Places
    """Cycles that should have process data between each and the next."""
    left_out: int
    """Frames of the master's start and end, where more cycles are missing than there are, and of cycles in part."""


def seen_cycles(frames: Places, times_us: Floats, kinds: Places, data_bytes: Floats, network: Network) -> SeenCycles:
    """Tell which frames make a cycle, and number the cycles by their times and their process data.

    Parameters
    ----------
    frames
        Places of the frames of process data in the recording, in the order of their times, at least one.
    times_us, kinds, data_bytes
        When each was sent, what tells its process data apart, and its process data [bytes].
    network
        The plan, of plain numbers.
    """
    plan = PlannedCycles(network)
    period_us = plain(network.period_us)
    starts, near_us = _starts(times_us, kinds, plan, period_us)
    in_bursts = len(starts) > 1 and float(np.median(np.diff(times_us[starts]))) < _BURST * period_us
    begin, end = 0, len(starts)
    while True:
        kept = slice(int(starts[begin]), int(np.append(starts, len(frames))[end]))
        own = starts[begin:end] - starts[begin]
        number = np.searchsorted(own, np.arange(kept.stop - kept.start), side="right") - 1
        periods = None if in_bursts else grid(times_us[starts[begin:end]], near_us)
        of_plan, gaps = np.zeros(len(own), dtype=np.int64), np.zeros(len(own) - 1, dtype=np.int64)
        if periods is not None:
            of_plan, gaps = _numbered(
                plan, periods.places, np.bincount(number, weights=data_bytes[kept]).astype(np.float64)
            )
        first, last = _in_operation(gaps)
        if periods is not None and (first, last) == (0, len(own)):
            first, last = _whole(np.bincount(number), plan.sort[of_plan])
        if first == 0 and last == len(own):
            starts = frames[starts[begin:end]]
            sort = plan.sort[of_plan]
            return SeenCycles(
                frames[kept], number, starts, periods, in_bursts, plan.sorts, sort, gaps, len(frames) - len(number)
            )
        begin, end = begin + first, begin + last


def _starts(times_us: Floats, kinds: Places, plan: PlannedCycles, period_us: float) -> tuple[Places, float]:
    """Frames that begin a cycle, and about the period of the master's task [us].

    A frame begins one where its process data mostly come after a pause when they come behind those before it. How long
    a pause is, is said by the plan: of all jumps between such distances that counts which leaves the period nearest to
    the planned one, and of those that leave the same the one with the fewest frames that contradict it: cycles closer
    to each other than half the period, and frames of a cycle farther apart.
    """
    apart_us = np.diff(times_us)
    _, pair = np.unique(kinds[:-1] * (int(kinds.max()) + 1) + kinds[1:], return_inverse=True)
    each = np.split(apart_us[np.argsort(pair, kind="stable")], np.cumsum(np.bincount(pair))[:-1]) if len(pair) else []
    usual_us = np.array([float(np.median(own)) for own in each])
    ordered_us = np.sort(usual_us)
    within_us = ordered_us[:-1][ordered_us[1:] > _JUMP * ordered_us[:-1]]
    found = []
    for longest_us in (-inf, *within_us):
        begins = np.concatenate(([True], usual_us[pair] > longest_us))
        starts = np.flatnonzero(begins)
        between_us = np.diff(times_us[starts])
        least_us = float(np.quantile(between_us, plan.least_share / 2)) if len(between_us) else 0.0
        for cycles in range(1, plan.least_apart + 1):
            near_us = least_us / cycles
            beside = abs(log(near_us / period_us)) if near_us > 0 else inf
            close, far = between_us < near_us / 2, apart_us[~begins[1:]] > near_us / 2
            found.append((beside, int(np.count_nonzero(close) + np.count_nonzero(far)), starts, near_us))
    least = min(beside for beside, *_ in found)
    if least > _FARTHEST:
        return found[0][2:]
    return min((one for one in found if one[0] <= least + _ALIKE), key=lambda one: one[1])[2:]


def _numbered(plan: PlannedCycles, places: Places, data_bytes: npt.NDArray[Any]) -> tuple[Places, Places]:
    """Cycle of the common multiple of each cycle, and how many with process data are missing behind it."""
    count, apart = len(plan.sort), np.diff(places)
    phase = plan.phase(places, data_bytes)
    of_plan = (places + phase) % count
    # A master that leaves out a cycle may go on with the next one of its own count.
    for part in np.split(np.arange(len(places)), np.flatnonzero(apart > plan.least_apart) + 1):
        if np.any(data_bytes[part] != plan.data_bytes[(places[part] + phase) % count]):
            phase = plan.phase(places[part], data_bytes[part])
        of_plan[part] = (places[part] + phase) % count
    gaps = plan.filled_before(of_plan[:-1] + apart) - plan.filled_before(of_plan[:-1] + 1)
    return of_plan, gaps


def _in_operation(gaps: Places) -> tuple[int, int]:
    """The first cycle and the one behind the last, without the master's start and end.

    They lie before the first and behind the last ten cycles in a row, where more cycles are missing than there are.
    """
    in_a_row = np.convolve(np.append(gaps, 1) == 0, np.ones(LEAST_EVENTS - 1), "full")[LEAST_EVENTS - 2 :]
    rows = np.flatnonzero(in_a_row == LEAST_EVENTS - 1)
    if not len(rows):
        return 0, len(gaps) + 1
    first, last = int(rows[0]), int(rows[-1]) + LEAST_EVENTS
    before, behind = int(gaps[:first].sum()), int(gaps[last - 1 :].sum())
    return first if before > first else 0, last if behind > len(gaps) + 1 - last else len(gaps) + 1


def _whole(frames: Places, sort: Places) -> tuple[int, int]:
    """The first cycle and the one behind the last, without those that the capture begins or ends within.

    Parameters
    ----------
    frames, sort
        Frames of n cycles, and which cycles of the plan they are.
    """
    has_less = [frames[end] < np.median(frames[sort == sort[end]]) for end in (0, -1)]
    return int(has_less[0]), len(frames) - int(has_less[1])


_WRAP_NS: Final = 1 << 32
_OPEN_OF_LINE: Final = 2
"""Ports of a device within a line."""
_INCLUDED: Final = "one way, with the cable to it, by port times"


class _NoLineError(Exception):
    """Port times are not those of a line; its text says why."""


class LineDelays(NamedTuple):
    """Delay of each device of a line and of the cable to it, by the port times that a master reads at its start."""

    hops_us: tuple[float, ...]
    """One way, of the second device and all behind it [us]."""
    latches: int
    """Number of broadcast writes that they are the mean of [1]."""
    remarks: tuple[str, ...]
    """What the port times do not say, and why."""

    def figures(self, network: Network) -> Iterator[RecordedFigure]:
        """Each delay beside the planned one, and the mean of those that the plan has alike.

        The plan says a mean, so this alone is judged; nothing is planned where it has another number of devices.
        """
        first = 1
        if not self._is_planned(network):
            yield from (self._figure(number, number, None) for number in range(2, len(self.hops_us) + 2))
            return
        for alike in _alike(network):
            own = range(max(first, 2), first + int(plain(alike.nodes)))
            first = own.stop
            if len(own) > 1:
                yield from (self._figure(number, number, alike)._replace(sense="shown") for number in own)
            if own:
                yield self._figure(own[0], own[-1], alike)

    def _figure(self, first: int, last: int, alike: ProfileGroup | None) -> RecordedFigure:
        """Mean delay of some devices."""
        own_us = self.hops_us[first - 2 : last - 1]
        name = f"delay of device {first}" if first == last else f"mean delay of devices {first} to {last}"
        shown = RecordedFigure(
            name, "us", None, sum(own_us) / len(own_us), None, "shown", self.latches, note=_INCLUDED, is_mean=True
        )
        if alike is None:
            return shown
        delay_us, doubt_us = _planned(alike)
        step_us = MEASURED_DELAY_UNCERTAINTY_US / len(own_us) ** 0.5
        if alike.node.delay_us is not None:
            doubt_us = step_us
        return shown._replace(
            planned=delay_us + _cable_us(alike),
            uncertainty=expanded(doubt_us, step_us),
            sense="at most",
            key=alike.node_key("delay_us"),
        )

    def _is_planned(self, network: Network) -> bool:
        return sum(int(plain(alike.nodes)) for alike in _alike(network)) == len(self.hops_us) + 1

    def edits(self, network: Network) -> Mapping[str, float]:
        """Mean delay one way of the devices of each group, cable taken off [us], by its key."""
        edits: dict[str, float] = {}
        first = 0
        if not self._is_planned(network):
            return edits
        for alike in _alike(network):
            last = first + int(plain(alike.nodes))
            own_us = self.hops_us[max(first - 1, 0) : last - 1]
            mean_us = sum(own_us) / len(own_us) - _cable_us(alike) if own_us else 0.0
            if mean_us > 0:
                edits[alike.node_key("delay_us")] = round(mean_us, 6)
            first = last
        return edits

    def more_us(self, network: Network) -> float:
        """What the devices take there and back beyond the plan, by what `edits` say [us]."""
        edits = self.edits(network)
        return sum(
            2 * plain(alike.nodes) * (edits[key] - _planned(alike)[0])
            for alike in _alike(network)
            if (key := alike.node_key("delay_us")) in edits
        )


def line_delays(latches: tuple[Latch, ...], unlatched: int) -> LineDelays:
    """The delays that port times say of a line.

    A frame passes a device, all behind it, and the device again: half the difference of its two port times less that
    of the next device is the delay one way. The difference falls from device to device, which gives their order.

    Parameters
    ----------
    latches
        The broadcast writes, each with the port times behind it.
    unlatched
        Reads of port times without such a write before them.

    References
    ----------
    ETG.1000.4, distributed clocks; the formula of the open masters SOEM and IgH.
    """
    remarks = []
    if unlatched:
        remarks.append(
            f"Port times were read {plural(unlatched, 'time')} without the broadcast write to 0x0900 that stamps "
            "them: not used; begin the recording before the master starts."
        )
    hops = []
    reasons: dict[str, None] = {}
    for latch in latches:
        try:
            hops.append([(span - behind) / 2000 for span, behind in pairwise(_spans_ns(latch))])
        except _NoLineError as error:
            reasons[str(error)] = None
    remarks += [f"No delays of devices by port times: {reason}." for reason in reasons]
    # The machine may have been changed between: only lines as long as the last one are alike.
    hops = [hop for hop in hops if len(hop) == len(hops[-1])]
    means_us = tuple(sum(own) / len(own) for own in zip(*hops, strict=True))
    if means_us:
        remarks.append("The delay of device 1 and its cable is not in port times, for the master's port has none.")
    return LineDelays(means_us, len(hops), tuple(remarks))


def _spans_ns(latch: Latch) -> list[int]:
    """From the first to the last port time of each device of a line, in their order.

    Raises
    ------
    _NoLineError
        The times say no line.
    """
    seen = len(latch.ports_ns)
    if seen != latch.devices:
        raise _NoLineError(f"the write passed {plural(latch.devices, 'device')}, and those of {seen:,} were read")
    if seen == 1:
        raise _NoLineError("there is 1 device")
    spans = sorted(map(_span_ns, latch.ports_ns.values()), reverse=True)
    ends = spans.count(0)
    if ends != 1:
        raise _NoLineError(f"{ends} devices have a time of port 0 alone, where a line has 1, at its end")
    if len(set(spans)) < len(spans):
        raise _NoLineError("devices are as far from the end as others: they are on no line")
    return spans


def _span_ns(times_ns: Mapping[int, int]) -> int:
    # A port without a link has no time.
    linked = {port: time for port, time in times_ns.items() if time}
    if 0 not in linked:
        raise _NoLineError("a device has no time of its port 0")
    if len(linked) > _OPEN_OF_LINE:
        raise _NoLineError(f"a device has times of {len(linked)} ports: it is a branch, which the times do not place")
    span = (linked[max(linked)] - linked[0]) % _WRAP_NS
    if span >= _WRAP_NS // 2:
        raise _NoLineError("a frame enters a device by another port than 0")
    return span


def _alike(network: Network) -> list[ProfileGroup]:
    return list(network.profile.node_groups)


def _planned(alike: ProfileGroup) -> tuple[float, float]:
    """Delay of a device one way as planned, and its standard uncertainty [us]."""
    node = alike.node
    if node.delay_us is None:
        return float(DELAY_US[node.port]), float(DELAY_UNCERTAINTY_US[node.port])
    return plain(node.delay_us), float(MEASURED_DELAY_UNCERTAINTY_US)


def _cable_us(alike: ProfileGroup) -> float:
    """Cable to a device one way [us]."""
    return plain(cable_us(alike.node.cable_m)) / 2
