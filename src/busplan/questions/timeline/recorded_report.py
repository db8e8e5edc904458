"""Report of `timeline` for a recording: two lanes on one scale, the shares of both, and the largest difference."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from busplan.buses.waterfall import Awaited, WaterfallEvent
from busplan.forms import blocks, charts
from busplan.forms.numbers import sentence_text
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.timeline.recorded import RecordedTimelineAnswer

_DECIMALS: Final = 1
_MOST_BARS: Final = 400
"""Most events with a bar each; of more, those of one sort in a row share one."""
_WORDS: Final[dict[Awaited, str]] = {
    "wire": "wire",
    "nodes": "nodes",
    "adapter": "adapter",
    "host": "host",
    "others": "other frames",
    "unknown": "not attributed",
}
_ENTRIES: Final[dict[Awaited, charts.Entry]] = {
    "wire": charts.Entry("out", "wire", "#"),
    "nodes": charts.Entry("work", "nodes", "n"),
    "adapter": charts.Entry("acknowledge", "adapter", "a"),
    "host": charts.Entry("gap", "host", "h"),
    "others": charts.Entry("contention", "other frames", "o"),
    "unknown": charts.Entry("idle", "not attributed", "?"),
}
_COLUMNS: Final = (
    blocks.TableColumn("waits for", kind="words"),
    blocks.TableColumn("recorded", "us"),
    blocks.TableColumn("share", "%"),
    blocks.TableColumn("U", "us", rank=1),
    blocks.TableColumn("planned", "us"),
    blocks.TableColumn("share", "%"),
    blocks.TableColumn("difference", "us"),
)
_EVENT_COLUMNS: Final = (
    blocks.TableColumn("waits for", kind="words"),
    blocks.TableColumn("frame", kind="words", wraps=True),
    blocks.TableColumn("number"),
    blocks.TableColumn("start", "us"),
    blocks.TableColumn("time", "us"),
    blocks.TableColumn("beyond the plan", "us"),
)


def recorded_report(answer: RecordedTimelineAnswer) -> blocks.Report:
    """Report of `timeline` for a recording."""
    summary = _summary(answer)
    return blocks.Report(
        blocks.Sentence(("Timeline of ", blocks.Code(answer.profile.name), " beside ", blocks.Code(answer.source))),
        (
            summary,
            *([blocks.Sentence((f"Shows no machine: {answer.synthetic}.",), "warns")] if answer.synthetic else []),
            _chart(answer, sentence_text(summary)),
            _table(answer),
            _difference(answer),
            blocks.Detail((_events_table(answer),), "each frame and each wait"),
            *(blocks.Sentence((remark,)) for remark in answer.remarks),
        ),
        _document(answer),
        with_profile(answer.profile.name, [{"source": answer.source, **row} for row in _rows(answer)]),
    )


def _us(value: float, key: str, *, signed: bool = False) -> blocks.ShownValue:
    return blocks.ShownValue(value, key, "us", _DECIMALS, signed=signed, fixed=True)


def _percent(value: float, key: str) -> blocks.ShownValue:
    return blocks.ShownValue(value, key, "%", 0, fixed=True)


def _word(answer: RecordedTimelineAnswer, awaited: Awaited) -> str:
    has_adapter = any(event.waits_for == "adapter" for event in answer.planned_events)
    return "host and adapter" if awaited == "host" and has_adapter else _WORDS[awaited]


def _summary(answer: RecordedTimelineAnswer) -> blocks.Sentence:
    which = {"worst": ", the longest", "median": ", the median one", None: ""}[answer.chosen]
    template = (
        f"{{}} beside {{}}: cycle {answer.cycle:,}{which} of {answer.cycles:,} whole ones, from frame "
        f"{answer.frame:,}, begun at {answer.start_s:.6f} s, takes {{}}, and {{}} in the plan."
    )
    return blocks.sentence(
        template,
        blocks.Code(answer.profile.name),
        blocks.Code(answer.source),
        _us(answer.recorded_us, "recorded_us"),
        _us(answer.planned_us, "planned_us"),
    )


def _chart(answer: RecordedTimelineAnswer, title: str) -> blocks.Chart:
    lanes = [
        charts.Lane(name, tuple(_spans(answer, events)), sentence_text(blocks.Sentence((_us(us, "end_us"),))))
        for name, us, events in (
            ("recorded", answer.recorded_us, answer.events),
            ("planned", answer.planned_us, answer.planned_events),
        )
    ]
    across = charts.numbers("us", 0.0, max(answer.recorded_us, answer.planned_us))
    words = blocks.Sentence((f"Cycle {answer.cycle:,} as recorded and as planned, from its first frame to its last",))
    text = sentence_text(words)
    panel = charts.Panel(charts.Lanes(across, tuple(lanes)), "Recorded and planned")
    return blocks.Chart(charts.Drawing(title, (panel,), (), text, has_characters=True), words)


def _spans(answer: RecordedTimelineAnswer, events: Sequence[WaterfallEvent]) -> Iterator[charts.Span]:
    if len(events) > _MOST_BARS:
        for awaited, row in groupby(events, key=lambda event: event.waits_for):
            first, *rest = row
            yield charts.Span(_ENTRIES[awaited], first.start_us, rest[-1].end_us if rest else first.end_us)
        return
    for event in events:
        entry = _ENTRIES[event.waits_for]
        wait = f"{_word(answer, event.waits_for)}: "
        frame = f", frame {event.frame:,}" if event.frame else ""
        tip = f"{wait}{event.label}{frame}, {event.duration_us:.1f} us: {event.start_us:.1f} to {event.end_us:.1f} us"
        yield charts.Span(entry, event.start_us, event.end_us, tip)


def _table(answer: RecordedTimelineAnswer) -> blocks.Table:
    rows = [
        blocks.TableRow(
            (
                _word(answer, share.waits_for),
                _us(share.recorded_us, "recorded_us"),
                _percent(share.recorded_share, "recorded_share"),
                _us(share.uncertainty_us, "uncertainty_us"),
                _us(share.planned_us, "planned_us"),
                _percent(share.planned_share, "planned_share"),
                _us(share.difference_us, "difference_us", signed=True),
            )
        )
        for share in answer.shares
    ]
    rows.append(
        blocks.TableRow(
            (
                "cycle",
                _us(answer.recorded_us, "recorded_us"),
                "",
                "",
                _us(answer.planned_us, "planned_us"),
                "",
                _us(answer.difference_us, "difference_us", signed=True),
            ),
            highlighted=True,
        )
    )
    return blocks.Table(_COLUMNS, tuple(rows), blocks.Sentence(("Where the time of the cycle goes",)))


def _events_table(answer: RecordedTimelineAnswer) -> blocks.Table:
    rows = (
        blocks.TableRow(
            (
                _word(answer, event.waits_for),
                event.label,
                blocks.ShownValue(event.frame, "frame"),
                _us(event.start_us, "start_us"),
                _us(event.duration_us, "duration_us"),
                _us(event.late_us, "late_us"),
            )
        )
        for event in answer.events
    )
    return blocks.Table(_EVENT_COLUMNS, tuple(rows), blocks.Sentence(("The recorded cycle, frame by frame",)))


def _difference(answer: RecordedTimelineAnswer) -> blocks.Sentence:
    found = answer.difference
    head = f"The largest difference: {_word(answer, found.waits_for)}, {{}} recorded, {{}} planned"
    values = _us(found.recorded_us, "recorded_us"), _us(found.planned_us, "planned_us")
    if not found.is_longer:
        return blocks.sentence(f"Nothing takes longer than planned. {head}.", *values, state="passes")
    cause = ""
    if found.cause:
        verb = "takes" if found.waits_for in ("wire", "others") else "is waited for"
        beyond = "of the wire" if found.waits_for == "others" else "longer than planned"
        cause = f": {found.cause}, frame {found.frame:,} at {found.at_s:.6f} s, {verb} {found.late_us:.1f} us {beyond}"
    return blocks.sentence(f"{head}{cause}.", *values, state="warns")


def _rows(answer: RecordedTimelineAnswer) -> Iterator[blocks.Record]:
    for lane, events in (("recorded", answer.events), ("planned", answer.planned_events)):
        for event in events:
            row = fields(event, "waits_for", "label", "node", "frame", "start_us", "end_us", "duration_us", "late_us")
            yield {"lane": lane, **row, "node": event.node or None}


def _document(answer: RecordedTimelineAnswer) -> blocks.JsonDocument:
    difference = answer.difference._asdict()
    return document(
        "timeline",
        profile=answer.profile.name,
        **fields(answer, "source", "chosen", "cycles", "cycle", "start_s", "frame", "recorded_us", "planned_us"),
        difference_us=answer.difference_us,
        synthetic=answer.synthetic or None,
        shares=[{**share._asdict(), "difference_us": share.difference_us} for share in answer.shares],
        difference={**difference, "cause": difference["cause"] or None, "node": difference["node"] or None},
        remarks=list(answer.remarks),
        events=list(_rows(answer)),
    )
