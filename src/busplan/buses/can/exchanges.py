"""Requests and answers of a CAN log without SYNC: cycles, what is missing, and the times of nodes and host."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.can.due import due_pdos
from busplan.buses.can.equations import BASE_BITS, bit_us
from busplan.buses.can.logged import wire_times
from busplan.buses.can.pdos import PdoCycle
from busplan.buses.can.recorded_cycles import SenderNames, finite
from busplan.buses.can.streams import place
from busplan.buses.can.traffic import NAMES
from busplan.buses.network import Group
from busplan.buses.rule import RecordedFigure, clocks_us
from busplan.english import first_of
from busplan.recordings import can_timing
from busplan.recordings.can import CanFrames
from busplan.recordings.statistics import LEAST_EVENTS, Floats, expanded, periodic_events, quantile

Places = npt.NDArray[np.int64]
_SPACE_BITS: Final = 3
"""Bits between two frames (ISO 11898-1), which a stamp at the end of a frame may leave out."""
_MOST: Final = 0.5
"""Share of the times of a node that no other frame may hide, at least, so that they show its execution time [1]."""
_MOST_OF_CYCLE: Final = 0.9
"""Time without a request in a cycle of requests at once, at most, as a share of the period [1]."""
_NOTHING: Final[Places] = np.zeros(0, dtype=np.int64)


class _Node(NamedTuple):
    """A node of the plan that answers requests."""

    name: str
    group: Group
    requests: tuple[int, ...]
    """Identifiers of the frames of its request, in their order."""
    answers: tuple[int, ...]

    @property
    def planned_us(self) -> float:
        """Longest planned time from its request to its queued answer [us]."""
        us: float = max(self.group.read_execution_us, self.group.write_execution_us) + self.group.worst_extra_us
        return us


class _Exchanges(NamedTuple):
    """Requests of a node with their answers, n of them; places are those of frames in the log's order."""

    first: Places
    """First frame of each request."""
    last: Places
    """Last frame of each request."""
    end: Places
    """Last frame of each answer; -1 without one."""
    begin: Places
    """First frame of each of m answers."""
    least_us: Floats
    """Time of each of these that is surely the node's own: without what other frames may have made it wait [us]."""
    is_exact: npt.NDArray[np.bool_]
    """Whether no other frame may have made it wait."""
    due: int
    """Answers that were due."""
    missing: Places
    """Last frame of each request without an answer."""
    twice: Places
    """Last frame of each answer that came again."""


class RequestLog:
    """Requests and answers of a log beside the plan."""

    def __init__(
        self,
        cycle: PdoCycle,
        frames: CanFrames,
        stretch: can_timing.ClockStretch,
        by_identifier: Mapping[tuple[int, bool], can_timing.SentFrames],
        *,
        senders: SenderNames,
        share: float,
        stamp_error_us: float,
    ) -> None:
        self.cycle, self.traffic, self.network = cycle, cycle.traffic, cycle.network
        self.frames, self.taken, self.senders = frames, stretch.taken, senders
        self.share, self.times_us = share, stretch.times_us
        bit = bit_us(self.traffic.bit_rate_kbit_s)
        self.error_us = stamp_error_us + _SPACE_BITS * bit
        """Largest error of a time from the end of one frame to the start of another [us]."""
        rates = {"bit_rate_kbit_s": self.traffic.bit_rate_kbit_s}
        rates["data_bit_rate_kbit_s"] = self.traffic.data_bit_rate_kbit_s
        self.wire_us, worst_us, none_us, _ = wire_times(frames, stretch.taken, **rates)
        # The stuff bits of CAN FD are not known.
        unknown_us = (worst_us - none_us)[frames.is_fd[stretch.taken]] / 2
        self.error_us += float(unknown_us.max(initial=0.0))
        self.starts_us = self.times_us - self.wire_us
        identifiers, is_extended = frames.identifiers[stretch.taken], frames.extended[stretch.taken]
        self.order = np.where(is_extended, place(identifiers, 29), place(identifiers, BASE_BITS))
        self._position = np.zeros(len(frames.times_us), dtype=np.int64)
        self._position[stretch.taken] = np.arange(len(stretch.taken))
        self._by_identifier = by_identifier
        self.nodes = [node for group in self.network.groups for node in self._nodes(group)]
        self.found = [self._exchanges(node) for node in self.nodes]
        self.edits: dict[str, Any] = {}

    def _nodes(self, group: Group) -> Iterator[_Node]:
        sent = [stream for stream in self.senders.sent if stream.group == group.name and not stream.is_message]
        both = [[stream for stream in sent if stream.name == NAMES[kind]] for kind in ("write", "read")]
        for number in range(int(both[0][0].identifiers)):
            requests, answers = (tuple(int(stream.first) + number for stream in way) for way in both)
            yield _Node(self.senders.node(both[0][0], number), group, requests, answers)

    def _located(self, figure: RecordedFigure, places: Places, values: Floats | None = None) -> RecordedFigure:
        """The figure with the moments of frames, by their values, or of frames that are counted."""
        counted = np.ones(len(places)) if values is None else values
        return figure.located(self.frames.events(counted, self.taken[places]))

    def _places(self, identifier: int) -> Places:
        sent = self._by_identifier.get((identifier, self.traffic.identifier_bits > BASE_BITS))
        return _NOTHING if sent is None else self._position[sent.frames]

    def _exchanges(self, node: _Node) -> _Exchanges:
        """Requests of a node with their answers: two behind one request, where one before had none, are late."""
        last = self._places(node.requests[-1])
        firsts, begins, ends = (self._places(way) for way in (node.requests[0], node.answers[0], node.answers[-1]))
        at = np.searchsorted(firsts, last, side="right") - 1
        first = np.where(at >= 0, firsts[np.maximum(at, 0)], last) if len(firsts) else last
        answered = due_pdos(self.times_us[last], self.times_us[ends], every=1)
        end = np.full(len(last), -1)
        requests, chosen = np.unique(answered.cycles, return_index=True)
        end[requests] = ends[answered.pdos[chosen]]
        begun = due_pdos(self.times_us[last], self.times_us[begins], every=1)
        requests, chosen = np.unique(begun.cycles, return_index=True)
        begin = begins[begun.pdos[chosen]]
        ready_us, is_exact = self._ready_us(begin, last[requests])
        least_us = np.maximum(ready_us - self.times_us[last[requests]], 0.0)
        missing, twice = last[answered.missing], ends[answered.twice]
        return _Exchanges(first, last, end, begin, least_us, is_exact, answered.due, missing, twice)

    def _ready_us(self, frames: Places, floors: Places) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """Instant at which each frame was not yet queued, or just queued, no sooner than that of its floor [us].

        Where the bus was idle before a frame, it was queued when it started. Where not, it was not queued when the
        frame before it won the arbitration, if that has a lower priority; of higher ones nothing is known, and the one
        before decides. The flags say where the bus was idle, so that the instant is exact.
        """
        ready_us, at = self.starts_us[frames], frames.copy()
        active = np.arange(len(frames))
        is_exact = np.ones(len(frames), dtype=np.bool_)
        while len(active):
            before, now = at[active] - 1, at[active]
            is_idle = self.starts_us[now] - self.times_us[np.maximum(before, 0)] > self.error_us
            is_floor = before <= floors[active]
            is_lower = self.order[np.maximum(before, 0)] > self.order[frames[active]]
            goes_on = ~is_idle & ~is_floor
            ready_us[active] = np.where(goes_on, self.starts_us[np.maximum(before, 0)], self.starts_us[now])
            is_exact[active[goes_on]] = False
            at[active] = before
            active = active[goes_on & ~is_lower]
        return np.maximum(ready_us, self.times_us[floors]), is_exact

    def figures(self, missed: Callable[..., RecordedFigure]) -> Iterator[RecordedFigure]:
        """Figures beside the plan; `missed` makes that of a number that counts against `limits.missed_cycles`."""
        if sum(len(found.last) for found in self.found) < LEAST_EVENTS:
            yield missed("answers missing", None, 0, hidden=f"fewer than {LEAST_EVENTS} requests")
            return
        requests = self._requests()
        yield from self._cycles(requests, missed)
        due = sum(found.due for found in self.found)
        for name in ("missing", "twice"):
            yield self._counted(f"answers {name}", [getattr(found, name) for found in self.found], due, missed)
        yield from self._node_times()
        yield from self._host(requests)

    def _counted(
        self, quantity: str, places: Sequence[Places], due: int, missed: Callable[..., RecordedFigure]
    ) -> RecordedFigure:
        """A number of frames that are missing or come twice, of each node."""
        notes = [f"{len(each):,} of {node.name}" for node, each in zip(self.nodes, places, strict=True) if len(each)]
        every = np.concatenate(places)
        return self._located(missed(quantity, len(every), due, note=first_of(notes, can_timing.LISTED)), every)

    def _requests(self) -> "_Requests":
        """All requests in the order of the log, cut into cycles."""
        counts = [len(found.last) for found in self.found]
        node = np.repeat(np.arange(len(self.found)), counts)
        first, last, end = (
            np.concatenate([getattr(found, name) for found in self.found]) for name in ("first", "last", "end")
        )
        order = np.argsort(last, kind="stable")
        node, first, last, end = node[order], first[order], last[order], end[order]
        apart_us, ahead = np.diff(self.times_us[last]), np.diff(node)
        period_us = self.traffic.period_us
        if self.traffic.access == "burst":
            terms = self.cycle.by_term
            pause_us = (period_us - terms["cycle_host_us"] - terms["cycle_command_us"]) / 2
            begins = ((ahead <= 0) & (apart_us > pause_us)) | (apart_us > _MOST_OF_CYCLE * period_us)
            begins[_repeats(node, self.times_us[last], begins, least_us=period_us / 2)] = True
        else:
            begins = (ahead < 0) | ((ahead == 0) & (apart_us > period_us / 2))
        return _Requests(node, first, last, end, np.concatenate(([0], np.cumsum(begins))))

    def _cycles(self, requests: "_Requests", missed: Callable[..., RecordedFigure]) -> Iterator[RecordedFigure]:
        """Period of the cycles, requests that are missing, the time of a cycle, and its wire."""
        _, opening = np.unique(requests.cycle, return_index=True)
        # A log begins and ends anywhere.
        usual = int(np.bincount(requests.node[opening]).argmax())
        begun = int(requests.node[0] != usual)
        opening = opening[begun:]
        starts_us = self.starts_us[requests.first[opening]]
        planned_us, count = self.traffic.period_us, len(opening)
        period = RecordedFigure("cycle: period", "us", planned_us, None, None, "equal", count, "cycle.period_us")
        periods = periodic_events(starts_us)
        if periods is None:
            yield period._replace(hidden=f"fewer than {LEAST_EVENTS} cycles")
            return
        mean = can_timing.mean_period(starts_us, periods)
        doubt_us = expanded(mean.uncertainty, clocks_us(planned_us), self.error_us / count)
        yield period._replace(recorded=mean.value, uncertainty=doubt_us, is_mean=True)
        skipped = np.flatnonzero(np.diff(periods.places) > 1) + 1
        figure = missed("cycles without requests", periods.missing, int(periods.places[-1]) + 1)
        yield self._located(figure, requests.first[opening[skipped]])
        cycles = np.arange(periods.places[-1] + 1)
        grid_us, is_sent = np.interp(cycles, periods.places, starts_us), np.isin(cycles, periods.places)
        opened = np.zeros(len(cycles), dtype=np.int64)
        opened[periods.places] = requests.first[opening]
        due, missing, twice = 0, list[Places](), list[Places]()
        for found in self.found:
            sent = due_pdos(grid_us, self.times_us[found.last], every=1, is_sent=is_sent)
            due += sent.due
            missing.append(opened[sent.missing])
            twice.append(found.last[sent.twice])
        yield self._counted("requests missing", missing, due, missed)
        yield self._counted("requests twice", twice, due, missed)
        yield from self._lengths(requests, opening, begun)

    def _lengths(self, requests: "_Requests", opening: Places, begun: int) -> Iterator[RecordedFigure]:
        """Time of whole cycles from the first request to the last answer, and the share of their own frames in it."""
        is_in = (requests.end >= 0) & (requests.cycle >= begun) & (requests.cycle < requests.cycle[-1])
        if not is_in.any():
            return
        cycle = requests.cycle[is_in] - begun
        ends, own_us = np.full(len(opening), -1), np.zeros(len(opening))
        np.maximum.at(ends, cycle, requests.end[is_in])
        for places in (requests.last[is_in], requests.end[is_in]):
            np.add.at(own_us, cycle, self.wire_us[places])
        is_whole = ends >= 0
        lasts_us = (self.times_us[ends] - self.starts_us[requests.first[opening]])[is_whole]
        worst = quantile(lasts_us, self.share)
        waits_us = [doubt.us for doubt in self.cycle.doubts()]
        # The time before the first request and behind the last answer is not on the wire.
        bus = self.network.profile.bus
        planned_us = self.cycle.required_us - self.network.nonperiodic_us - bus.host_us - self._adapter_us
        figure = RecordedFigure(
            "last answer after the first request",
            "us",
            finite(planned_us),
            worst.value,
            expanded(*waits_us, worst.uncertainty or 0.0, stamps_us=self.error_us),
            "at most",
            int(is_whole.sum()),
            "cycle.period_us",
        )
        yield self._located(figure, ends[is_whole], lasts_us)
        if all(len(node.requests) == len(node.answers) == 1 for node in self.nodes):
            share = float(np.median(own_us[is_whole] / lasts_us))
            terms = self.cycle.by_term
            wire_us = terms["cycle_command_us"] + terms["cycle_feedback_us"]
            yield RecordedFigure(
                "wire of that time",
                "share",
                wire_us / planned_us if np.isfinite(planned_us) else None,
                share,
                None,
                "shown",
                int(is_whole.sum()),
                note="requests and answers; median",
            )

    @property
    def _adapter_us(self) -> float:
        """Time of the host's adapter both ways [us]."""
        bus = self.network.profile.bus
        us: float = bus.write_us + bus.read_us
        return us

    def _node_times(self) -> Iterator[RecordedFigure]:
        """Time from request to answer: of the node that is furthest beyond its plan, and of each."""
        figures = []
        for node, found in zip(self.nodes, self.found, strict=True):
            if not len(found.least_us):
                continue
            worst = quantile(found.least_us, self.share)
            doubt_us = expanded(worst.uncertainty or 0.0, stamps_us=self.error_us)
            key, count = node.group.key("execution.worst_extra_us"), len(found.least_us)
            quantity, note = f"{node.name}: request to answer", _median(found.least_us, found.is_exact)
            figure = RecordedFigure(quantity, "us", node.planned_us, worst.value, doubt_us, "at most", count, key, note)
            figures.append(self._located(figure, found.begin, found.least_us))
        if not figures:
            return
        furthest = max(figures, key=lambda figure: figure.residual or 0.0)
        label = furthest.quantity.partition(":")[0]
        yield furthest._replace(quantity="request to answer", note=f"{label}; without waits for other frames")
        yield from figures if len(figures) > 1 else ()
        for group in self.network.groups:
            self._edit_execution(group)

    def _edit_execution(self, group: Group) -> None:
        """New execution time of a group: the median where no other frame was in the way, and the slowest beyond it."""
        found = [one for node, one in zip(self.nodes, self.found, strict=True) if node.group is group]
        least_us, is_exact = (
            np.concatenate([getattr(one, name) for one in found]) for name in ("least_us", "is_exact")
        )
        if np.count_nonzero(is_exact) < max(LEAST_EVENTS, _MOST * len(is_exact)):
            return
        median_us = round(float(np.median(least_us[is_exact])), 1)
        worst_us = quantile(least_us, self.share).value
        values: dict[str, Any] = {
            "kind": "linear",
            "base_us": median_us,
            "per_byte_us": 0.0,
            "grade": "measured",
            "uncertainty_us": round(self.error_us / 2, 2),
            "worst_extra_us": max(ceil(10 * (worst_us - median_us)) / 10, 0.0),
        }
        if group.node.execution.kind == "table":
            values |= {"payload_bytes": None, "time_us": None}
        for member in group.members:
            self.edits |= {f"{member.node_key('execution')}.{key}": value for key, value in values.items()}

    def _host(self, requests: "_Requests") -> Iterator[RecordedFigure]:
        """The host's time to its next request: behind the answer before, of requests at once behind the one before.

        Of these the host has queued all frames of one before the next, whatever the order in which they go.
        """
        order = np.arange(len(requests.node))
        if self.traffic.access == "burst":
            order = np.lexsort((requests.node, requests.cycle))
        node, cycle, first = requests.node[order], requests.cycle[order], requests.first[order]
        floors = (first if self.traffic.access == "burst" else requests.end)[:-1]
        is_next = (cycle[1:] == cycle[:-1]) & (node[1:] == node[:-1] + 1) & (floors >= 0) & (floors < first[1:])
        floors, first = floors[is_next], first[1:][is_next]
        quantity = "next request of the host"
        if not len(first):
            return
        ready_us, is_exact = self._ready_us(first, floors)
        gaps_us = np.maximum(ready_us - self.times_us[floors], 0.0)
        worst = quantile(gaps_us, self.share)
        doubt_us = expanded(worst.uncertainty or 0.0, stamps_us=self.error_us) or 0.0
        behind = "request" if self.traffic.access == "burst" else "answer"
        # Requests at once wait for no answer to come through the adapter.
        adapter_us = 0.0 if self.traffic.access == "burst" else self._adapter_us
        planned_us = self.network.profile.bus.host_us + adapter_us
        note = f"behind the {behind} before, without waits for other frames; {_median(gaps_us, is_exact)}"
        figure = RecordedFigure(
            quantity, "us", planned_us, worst.value, doubt_us, "at most", len(first), "bus.host_us", note
        )
        yield self._located(figure, first, gaps_us)
        if self.traffic.access == "polled" and len(first) >= LEAST_EVENTS:
            self.edits |= {
                "bus.host_us": max(ceil(10 * (worst.value - adapter_us)) / 10, 0.0),
                "bus.host_grade": "measured",
                "bus.host_uncertainty_us": round(doubt_us / 2, 2),
            }


def _repeats(nodes: Places, times_us: Floats, begins: npt.NDArray[np.bool_], *, least_us: float) -> Places:
    """Requests but the first that come again in a cycle, some of which begin where known, after some time or more.

    A cycle begins there, too; a node that gets its request again sooner gets it twice.
    """
    seen_us, repeats = {int(nodes[0]): float(times_us[0])}, list[int]()
    rows = zip(nodes[1:].tolist(), times_us[1:].tolist(), begins.tolist(), strict=True)
    for number, (node, us, begin) in enumerate(rows):
        is_again = not begin and us - seen_us.get(node, us) > least_us
        if is_again:
            repeats.append(number)
        if begin or is_again:
            seen_us.clear()
        seen_us.setdefault(node, us)
    return np.array(repeats, dtype=np.int64)


def _median(us: Floats, is_exact: npt.NDArray[np.bool_]) -> str:
    """Words on the median of times, most of which no other frame may hide."""
    return f"median {np.median(us[is_exact]):.1f} us" if is_exact.mean() >= _MOST else "other frames may hide it"


class _Requests(NamedTuple):
    """All requests of a log, n of them in its order."""

    node: Places
    first: Places
    last: Places
    end: Places
    """Last frame of the answer; -1 without one."""
    cycle: Places
    """Number of the cycle, from 0; one that has no request has none."""
