"""A timeline as SVG, in a page or as a file: bars scale with the width, text keeps its size; light and dark."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.blocks import figure_value
from busplan.forms.numbers import figure_text, sentence_text
from busplan.forms.picture import styled
from busplan.forms.svg import LINE, PHONE, Scale, drawing, inside, markup, paragraph, text_at
from busplan.questions.timeline.events import SHARE, Event, Schedule, totals
from busplan.questions.timeline.lanes import (
    Stretch,
    beyond,
    charged,
    drawn_window,
    event_lanes,
    event_title,
    has_event_lanes,
    kind_of,
    node_lanes,
    only_owner,
    overruns,
    shows_overrun,
    stretches,
    subject,
    time_text,
)
from busplan.questions.timeline.period import (
    BEYOND,
    LEFT,
    NEEDED,
    REST,
    ModelBar,
    model_bars,
    period_end_us,
    period_title,
    rest,
)

_BAR: Final = 18
_GAP: Final = 14
_THIN: Final = 8
_PERIOD_CSS: Final = {NEEDED: "long-gap", LEFT: "fits", BEYOND: "late", REST: "track"}
_GUTTER_PERCENT: Final = 15
_MOST_TALL_LANES: Final = 24
_MOST_BARS: Final = 400
"""Most bars in the lanes of a page; with more events, a bar is a transaction."""
STYLE: Final = """\
.chart.timeline .over{fill:var(--bad);fill-opacity:.16}
.chart.timeline .track{fill:var(--raised)}
.chart.timeline .late, .chart.timeline .bad{fill:var(--bad)}
.chart.timeline .end{stroke:var(--ink);stroke-width:1.5;stroke-dasharray:3 2}
.chart.timeline .window{fill:none;stroke:var(--ink);stroke-width:2}
.chart.timeline .idle{stroke:none}
"""
"""Rules of the drawing."""


def timeline_svg(schedule: Schedule, *, title: str, inline: bool = False) -> str:
    """Draw the period as a strip, the margin of each timing model, the window in lanes, and a legend with totals.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    schedule
        The cycle, narrowed to its window.
    title
        Title: its message in a sentence.
    inline
        If True, leave out style sheet, verdict, subject and legend: the page has them.
    """
    root = drawing(title, css="chart timeline")
    SubElement(root, "desc").text = sentence_text(subject(schedule))
    body = root if inline else inside(root, x_percent=2.5, width_percent=95.0, y=0)
    window = drawn_window(schedule)
    height = 0 if inline else _above(body, schedule, window, title=title) + _GAP
    height = _strip(body, schedule, window, y=height)
    if has_event_lanes(window):
        height = _event_lanes(body, window, y=height + _GAP)
    else:
        height = _node_lanes(body, window, y=height + _GAP, coarse=inline and is_coarse(window))
    if not inline:
        height = _legend(body, schedule, y=height + _GAP) + _GAP
    root.set("height", str(height))
    return markup(root) if inline else styled(markup(root), css=STYLE)


def is_coarse(window: Schedule) -> bool:
    """Whether a page draws a bar for each transaction instead of each event."""
    return len(window.events) > _MOST_BARS


def _above(body: Element, schedule: Schedule, window: Schedule, *, title: str) -> int:
    """Draw the verdict and the subject as text, and return the y below them."""
    height = paragraph(body, title, y=8, css="head" if schedule.figures.fits else "head bad")
    return paragraph(body, sentence_text(charged(window)), y=height, css="small")


def _strip(body: Element, schedule: Schedule, window: Schedule, *, y: int) -> int:
    """Draw the whole period as one bar, transaction by transaction, and one for each timing model."""
    parts, bars, behind = stretches(schedule.cycle_events), model_bars(schedule), rest(schedule)
    y = _strip_legend(body, schedule, parts, bars, y=paragraph(body, period_title(schedule), y=y, css="head")) + 4
    scale = Scale(0.0, period_end_us(schedule, bars))
    if behind is not None:
        scale.rect(body, behind, y=y, height=_BAR, css="track", title=_tip(REST, behind))
    if overruns(schedule):
        _over(body, schedule, scale, y=y - 3, height=_BAR + 6)
    _Bars(body, schedule, scale).draw(schedule.cycle_events, y=y, height=_BAR, coarse=True)
    if window.from_us > 0 or window.to_us < schedule.end_us:
        shown_part = schedule.cycle_events[0]._replace(start_us=window.from_us, end_us=window.to_us)
        scale.rect(body, shown_part, y=y - 2, height=_BAR + 4, css="window", title=_tip("drawn below", shown_part))
    top, y, ends = y + _BAR, y + _BAR + 4, []
    for bar in bars:
        y = _model(body, bar, scale, y=y)
        ends.append(y)
    if behind is not None or overruns(schedule):
        x = f"{scale.percent(schedule.figures.available_us):.5g}%"
        css = "edge" if overruns(schedule) else "end"
        # Not through the words between the bars.
        for from_, to in ((top - _BAR - 3, top + 3), *((end - _THIN - 4, end) for end in ends)):
            SubElement(body, "line", {"x1": x, "x2": x, "y1": str(from_), "y2": str(to), "class": css})
    return scale.marks(body, top=y, bottom=y)


def _model(body: Element, bar: ModelBar, scale: Scale, *, y: int) -> int:
    """Draw what a timing model needs and leaves of the slice, and return the y below it."""
    text_at(body, f"{bar.timing_model}: {bar.words}", x="0", y=y + 14, css="small")
    for part in bar.spans:
        css = _PERIOD_CSS[part.label]
        tip = f"{part.label} by the {bar.timing_model} model, {time_text(part.end_us - part.start_us)} us"
        scale.rect(body, part, y=y + LINE, height=_THIN, css=css, title=tip)
    return y + LINE + _THIN + 2


def _strip_legend(
    body: Element, schedule: Schedule, parts: Iterable[Stretch], bars: Iterable[ModelBar], *, y: int
) -> int:
    """Draw the colours of the strip and of the models, wrapped for a phone, and return the y below them."""
    kinds = (kind_of(schedule.profile, part.kind) for part in parts)
    colours: dict[str, str] = {kind.label: kind.ink for kind in kinds}
    colours |= {part.label: _PERIOD_CSS[part.label] for bar in bars for part in bar.spans}
    x = 0
    for label, css in colours.items():
        width = 26 + 8 * len(label)
        if x + width > PHONE:
            x, y = 0, y + LINE
        SubElement(body, "rect", {"class": css, "x": str(x), "y": str(y + 5), "width": "10", "height": "10"})
        text_at(body, label, x=str(x + 15), y=y + 15, css="small")
        x += width
    return y + LINE


def _over(parent: Element, schedule: Schedule, scale: Scale, *, y: int, height: int) -> None:
    """Shade the time beyond the slice, behind the bars."""
    part = beyond(schedule)
    scale.rect(parent, part, y=y, height=height, css="over", title=_tip("beyond the slice", part))


def _edge(parent: Element, schedule: Schedule, scale: Scale, *, y: int, height: int) -> None:
    """Draw the end of the slice as a line, in front of the bars."""
    x = f"{scale.percent(schedule.figures.available_us):.5g}%"
    SubElement(parent, "line", {"x1": x, "x2": x, "y1": str(y), "y2": str(y + height), "class": "edge"})


def _tip(label: str, event: Event) -> str:
    return f"{label}, {time_text(event.duration_us)} us: {time_text(event.start_us)} to {time_text(event.end_us)} us"


class _Bars(NamedTuple):
    """Draws bars."""

    parent: Element
    schedule: Schedule
    scale: Scale

    def draw(self, events: Sequence[Event], *, y: int, height: int, coarse: bool = False) -> None:
        """Draw events, or their transactions if `coarse`."""
        if not coarse:
            for event in events:
                self._bar(event.kind, event_title(event), event, y=y, height=height)
            return
        for stretch in stretches(events):
            label = kind_of(self.schedule.profile, stretch.kind).label
            owner = label if stretch.event.node is None else f"{stretch.kind} of node {stretch.event.node}"
            self._bar(stretch.kind, owner, stretch.event, y=y, height=height)

    def _bar(self, kind: str, title: str, event: Event, *, y: int, height: int) -> None:
        css = kind_of(self.schedule.profile, kind).ink
        self.scale.rect(self.parent, event, y=y, height=height, css=css, title=_tip(title, event))


def _node_lanes(body: Element, window: Schedule, *, y: int, coarse: bool) -> int:
    """Draw a lane for the bus and one for each node, and return the y below them."""
    lanes = node_lanes(window)
    y = paragraph(body, f"{time_text(window.from_us)} to {time_text(window.to_us)} us, by node", y=y, css="head") + 4
    scale = Scale(window.from_us, window.to_us)
    pitch = _BAR + 4 if len(lanes) <= _MOST_TALL_LANES else _BAR - 3
    area = inside(body, x_percent=_GUTTER_PERCENT, width_percent=100 - _GUTTER_PERCENT, y=0)
    bottom = y + pitch * len(lanes)
    below = scale.marks(area, top=y, bottom=bottom)
    over = shows_overrun(window)
    for number, lane in enumerate(lanes):
        top = y + pitch * number
        text_at(body, lane.label, x="0", y=top + pitch - 5, css="small")
        SubElement(area, "rect", {"class": "track", "width": "100%", "y": str(top), "height": str(pitch - 3)})
    if over:
        _over(area, window, scale, y=y - 2, height=bottom - y + 2)
    for number, lane in enumerate(lanes):
        _Bars(area, window, scale).draw(lane.events, y=y + pitch * number, height=pitch - 3, coarse=coarse)
    if over:
        _edge(area, window, scale, y=y - 2, height=bottom - y + 2)
    return below


def _event_lanes(body: Element, window: Schedule, *, y: int) -> int:
    """Draw a lane for each event, its name above it, and return the y below them."""
    owner = only_owner(window)
    title = f"{time_text(window.from_us)} to {time_text(window.to_us)} us{'' if owner is None else f', {owner}'}"
    y = paragraph(body, title, y=y, css="head")
    scale = Scale(window.from_us, window.to_us)
    pitch = LINE + _BAR
    over = shows_overrun(window)
    bottom = y + pitch * len(window.events)
    below = scale.marks(body, top=bottom - 4, bottom=bottom)
    for number, lane in enumerate(event_lanes(window)):
        top = y + pitch * number
        (event,) = lane.events
        text_at(body, f"{lane.label}, {time_text(event.duration_us)} us", x="0", y=top + LINE - 4, css="small")
        SubElement(body, "rect", {"class": "track", "width": "100%", "y": str(top + LINE), "height": str(_BAR - 4)})
        if over:
            _over(body, window, scale, y=top + LINE, height=_BAR - 4)
        _Bars(body, window, scale).draw((event,), y=top + LINE, height=_BAR - 4)
        if over:
            _edge(body, window, scale, y=top + LINE, height=_BAR - 4)
    return below


def _legend(body: Element, schedule: Schedule, *, y: int) -> int:
    """Draw the meaning of each colour and its total, and return the y below them."""
    text_at(body, "kind", x="20", y=y + 15, css="head")
    text_at(body, "us", x="240", y=y + 15, css="head", anchor="end")
    text_at(body, "share, %", x="310", y=y + 15, css="head", anchor="end")
    for total in totals(schedule):
        y += LINE
        kind = kind_of(schedule.profile, total.kind)
        SubElement(body, "rect", {"class": kind.ink, "y": str(y + 4), "width": "12", "height": "12"})
        text_at(body, kind.label, x="20", y=y + 15)
        text_at(body, time_text(total.total_us), x="240", y=y + 15, anchor="end")
        text_at(body, figure_text(figure_value(SHARE, total.share)), x="310", y=y + 15, anchor="end")
    return y + LINE
