"""Messages of a CAN log beside the plan: their periods, jitter and responses; and the period and jitter of SYNC."""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import Any, Final

from busplan.buses.can.recorded_cycles import SenderNames, finite
from busplan.buses.can.streams import Stream
from busplan.buses.rule import CLOCK_TOLERANCE, RecordedFigure, clocks_us, latest_start
from busplan.recordings.can import CanFrames
from busplan.recordings.can_timing import SentFrames, event_model, mean_period
from busplan.recordings.statistics import LEAST_EVENTS, ahead, expanded, lateness, periodic_events, policed, quantile

_TOO_FEW: Final = f"fewer than {LEAST_EVENTS} frames"


class MessageLog:
    """Messages and SYNC of a log beside the plan."""

    def __init__(self, frames: CanFrames, *, senders: SenderNames, share: float, stamp_error_us: float) -> None:
        self.frames, self.senders, self.share, self.stamp_error_us = frames, senders, share, stamp_error_us
        self.edits: dict[str, Any] = {}

    def sync(self, stream: Stream, sent: SentFrames, spread_us: float | None) -> Iterator[RecordedFigure]:
        """Period of SYNC, equal to that of the plan, and its jitter."""
        periods, planned_us, count = periodic_events(sent.times_us), stream.period_us, len(sent.times_us)
        period = RecordedFigure("SYNC: period", "us", planned_us, None, None, "equal", count, "cycle.period_us")
        if periods is None:
            yield period._replace(recorded=sent.mean.value if count > 1 else None, hidden=_TOO_FEW)
            return
        mean = mean_period(sent.times_us, periods)
        doubt_us = expanded(mean.uncertainty, clocks_us(planned_us), self.stamp_error_us / count)
        yield period._replace(recorded=mean.value, uncertainty=doubt_us, is_mean=True)
        if spread_us is not None:
            late = lateness(periods, self.share)
            doubt_us = expanded(late.uncertainty, stamps_us=self.stamp_error_us)
            quantity = "SYNC: jitter of the arrival"
            key = "bus.sync_jitter_us"
            jitter = RecordedFigure(quantity, "us", spread_us, late.value, doubt_us, "at most", count, key)
            jitter = jitter.located(self.frames.events(late.late_us, sent.frames))
            of_host = f"{key}, " if stream.jitter_us else ""
            yield jitter._replace(note=f"planned: {of_host}the wait for other frames and stuff bits")
            if jitter.verdict == "outside":
                # All of it may be the host's: what other frames add is not known of any one SYNC.
                self.edits |= latest_start(key, ceil(10 * late.value) / 10, events=count, share=self.share)

    def message(
        self, stream: Stream, label: str, recorded: Sequence[SentFrames], spread_us: float | None
    ) -> Iterator[RecordedFigure]:
        """Mean distance of a message, and how much sooner it comes than its period; of the identifier that is worst."""
        key, planned_us = f"message.{stream.name}", stream.period_us
        repeated = [sent for sent in recorded if len(sent.times_us) > 1]
        if not repeated:
            return

        def identifier(sent: SentFrames) -> str:
            return self.senders.name(stream, sent.identifier) if len(recorded) > 1 else ""

        often = min(repeated, key=lambda sent: sent.mean.value)
        count, mean = len(often.times_us), often.mean
        is_enough = count >= LEAST_EVENTS
        notes = [identifier(often), "" if often.periods else "not periodic"]
        if often.periods and often.periods.missing:
            notes.append(f"{often.periods.missing:,} of {often.periods.places[-1] + 1:,} periods without a frame")
        # At worst the first frame was the latest that it may be, and the last one the earliest.
        scatter_us = (planned_us if spread_us is None else spread_us) / (count - 1) / 2
        if mean.uncertainty is not None:
            # A plan with bursts or jitter allows a row of frames that is so much faster.
            allowed_us = (stream.burst - 1) * planned_us + stream.jitter_us
            scatter_us = max(mean.uncertainty, allowed_us / (count - 1) / 2)
        doubt_us = expanded(scatter_us, clocks_us(planned_us), self.stamp_error_us / (count - 1))
        period = RecordedFigure(
            f"{label}: period",
            "us",
            planned_us,
            mean.value,
            doubt_us if is_enough else None,
            "at least" if is_enough else "shown",
            count,
            f"{key}.period_us",
            ", ".join(filter(None, (*notes, "" if is_enough else _TOO_FEW))),
            is_mean=True,
        )
        if is_enough and period.verdict == "outside":
            self.edits[f"{key}.period_us"] = planned_us = round(mean.value, 1)
        yield period
        least_us = planned_us * (1 - float(CLOCK_TOLERANCE))
        ahead_us = [(quantile(ahead(sent.times_us, least_us), self.share), sent) for sent in repeated]
        sooner, sent = max(ahead_us, key=lambda pair: pair[0].value)
        jitter = RecordedFigure(
            f"{label}: sooner than its period",
            "us",
            spread_us,
            sooner.value,
            None if spread_us is None else expanded(sooner.uncertainty or 0.0, stamps_us=self.stamp_error_us),
            "shown" if spread_us is None else "at most",
            len(sent.times_us),
            f"{key}.jitter_us",
            identifier(sent),
        )
        early_us = ahead(sent.times_us, least_us)
        if jitter.verdict == "outside" and spread_us is not None:
            early_us = policed(sent.times_us, least_us, spread_us)
        yield jitter.located(self.frames.events(early_us, sent.frames))
        if jitter.verdict == "outside":
            model = event_model(
                sent.times_us, planned_us, stamp_error_us=self.stamp_error_us, tolerance=float(CLOCK_TOLERANCE)
            )
            self.edits[f"{key}.jitter_us"] = model.jitter_us
            if model.burst > 1:
                self.edits[f"{key}.burst"] = model.burst

    def response(
        self, stream: Stream, label: str, recorded: Sequence[SentFrames], shortest_us: float, worst_us: float
    ) -> Iterator[RecordedFigure]:
        """The latest arrival of a periodic message behind its earliest, which took its shortest frame or longer."""
        sent = [(sent, lateness(sent.periods, self.share)) for sent in recorded if sent.periods]
        if not sent:
            return
        latest, late = max(sent, key=lambda pair: pair[1].value)
        planned_us, count = finite(worst_us), len(latest.times_us)
        note = self.senders.name(stream, latest.identifier) if len(sent) > 1 else ""
        quantity = f"{label}: response"
        figure = RecordedFigure(quantity, "us", planned_us, late.value + shortest_us, None, "shown", count, note=note)
        yield figure.located(self.frames.events(late.late_us, latest.frames))


def spread_us(stream: Stream, shortest_us: float, worst_us: float) -> float | None:
    """Time by which the plan lets a message or SYNC come sooner than its period: R less the shortest frame [us].

    All of a burst may come with its first.
    """
    return finite(max(worst_us - shortest_us, 0.0) + (stream.burst - 1) * stream.period_us)
