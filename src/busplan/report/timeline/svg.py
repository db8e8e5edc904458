"""A timeline as one SVG, for a page or alone: bars stretch with the width, words keep their size, light and dark."""

from collections.abc import Iterable
from textwrap import wrap
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.analysis.schedule import Event, Schedule, totals
from busplan.report.lines import us
from busplan.report.timeline.kinds import KINDS, STRIP, event_title
from busplan.report.timeline.lanes import (
    Stretch,
    beyond,
    drawn_window,
    event_lanes,
    has_event_lanes,
    headline,
    node_lanes,
    only_owner,
    overruns,
    stretches,
    strip_title,
    subject,
    ticks,
)
from busplan.report.timeline.svg_style import stylesheet

_NAMESPACE: Final = "http://www.w3.org/2000/svg"
_LINE_CHARACTERS: Final = 44
"""Characters of a line of words: what a phone shows at this size."""
_LINE: Final = 20
_BAR: Final = 18
_GAP: Final = 14
_PHONE: Final = 335
"""Width that a phone shows, margins left away."""
_TICKS: Final = 5
_SHORT: Final = 6
"""Characters of a figure that so many marks leave room for on a phone."""
_GUTTER_PERCENT: Final = 15
_MOST_TALL_LANES: Final = 24


def timeline_svg(plan: Schedule) -> str:
    """Draw the slice in one strip, the window in lanes, and the legend with what each kind takes.

    It has no width of its own: it fills what it is put into, from 320 px on.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    """
    root = Element("svg", {"xmlns": _NAMESPACE, "class": "busplan-timeline", "width": "100%", "role": "img"})
    SubElement(root, "title").text = headline(plan)
    SubElement(root, "desc").text = subject(plan)
    SubElement(root, "style").text = stylesheet()
    SubElement(root, "rect", {"class": "paper", "width": "100%", "height": "100%"})
    body = _inside(root, x_percent=2.5, width_percent=95.0, y=0)
    window = drawn_window(plan)
    height = _words(body, headline(plan), y=8, css="head" if plan.figures.fits else "head bad")
    height = _words(body, f"{subject(window)}, every node at the hops of the farthest", y=height, css="small")
    height = _strip(body, plan, window, y=height + _GAP)
    height = (_event_lanes if has_event_lanes(window) else _node_lanes)(body, window, y=height + _GAP)
    height = _legend(body, plan, y=height + _GAP)
    root.set("height", str(height + _GAP))
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _inside(parent: Element, *, x_percent: float, width_percent: float, y: int) -> Element:
    """A part of the picture with its own width; what stands at its edge may reach over it."""
    box = {"x": f"{x_percent:g}%", "width": f"{width_percent:g}%", "y": str(y), "overflow": "visible"}
    return SubElement(parent, "svg", box)


def _text(parent: Element, text: str, *, x: str, y: int, css: str = "", anchor: str = "start") -> None:
    words = SubElement(parent, "text", {"x": x, "y": str(y), "class": css, "text-anchor": anchor})
    words.text = text


def _words(parent: Element, text: str, *, y: int, css: str) -> int:
    """Words in lines that a phone shows; the height below them."""
    # Letters of some scripts are twice as wide.
    for line in wrap(text, _LINE_CHARACTERS if text.isascii() else _LINE_CHARACTERS // 2):
        y += _LINE
        _text(parent, line, x="0", y=y - 5, css=css)
    return y


class _Scale:
    """From times to shares of a width.

    Parameters
    ----------
    from_us, to_us
        What the width spans [us].
    """

    def __init__(self, from_us: float, to_us: float) -> None:
        self._from_us, self._to_us = from_us, to_us

    def percent(self, time_us: float) -> float:
        """Where a time lies, 0 to 100."""
        return min(100.0, max(0.0, 100 * (time_us - self._from_us) / (self._to_us - self._from_us)))

    def rect(self, parent: Element, event: Event, *, y: int, height: int, css: str, title: str) -> None:
        """Draw a time as a bar; what it is comes up where a pointer rests on it."""
        start, end = self.percent(event.start_us), self.percent(event.end_us)
        box = {"x": f"{start:.5g}%", "width": f"{end - start:.5g}%", "y": str(y), "height": str(height), "class": css}
        SubElement(SubElement(parent, "rect", box), "title").text = title

    def marks(self, parent: Element, *, top: int, bottom: int) -> int:
        """Draw round times as lines with their figures below; the height below them."""
        marks = ticks(self._from_us, self._to_us, most=_TICKS)
        if max((len(tick.label) for tick in marks), default=0) > _SHORT:
            marks = ticks(self._from_us, self._to_us, most=_TICKS // 2)
        for tick in marks:
            at = self.percent(tick.at_us)
            x = f"{at:.5g}%"
            SubElement(parent, "line", {"x1": x, "x2": x, "y1": str(top), "y2": str(bottom + 4), "class": "rule"})
            anchor = "start" if at < 4 else "end" if at > 96 else "middle"  # noqa: PLR2004 - percent: the edges
            _text(parent, tick.label, x=x, y=bottom + 17, css="small", anchor=anchor)
        return bottom + _LINE


def _strip(body: Element, plan: Schedule, window: Schedule, *, y: int) -> int:
    """The whole slice in one bar, transaction by transaction, with the window that is drawn below."""
    parts = stretches(plan.cycle_events)
    y = _strip_legend(body, parts, y=_words(body, strip_title(plan), y=y, css="head")) + 4
    scale = _Scale(0.0, plan.end_us)
    if overruns(plan):
        _over(body, plan, scale, y=y - 3, height=_BAR + 6)
    for one in parts:
        owner = STRIP[one.kind].label if one.event.node is None else f"{one.kind} of node {one.event.node}"
        scale.rect(body, one.event, y=y, height=_BAR, css=one.kind, title=_tip(owner, one.event))
    if overruns(plan):
        _edge(body, plan, scale, y=y - 3, height=_BAR + 6)
    if window.from_us > 0 or window.to_us < plan.end_us:
        shown_part = plan.cycle_events[0]._replace(start_us=window.from_us, end_us=window.to_us)
        scale.rect(body, shown_part, y=y - 2, height=_BAR + 4, css="window", title=_tip("drawn below", shown_part))
    return scale.marks(body, top=y + _BAR, bottom=y + _BAR)


def _strip_legend(body: Element, parts: Iterable[Stretch], *, y: int) -> int:
    """The colours of the strip, as many in a line as a phone shows; the height below them."""
    x = 0
    for kind in dict.fromkeys(one.kind for one in parts):
        label = STRIP[kind].label
        width = 30 + 7 * len(label)
        if x + width > _PHONE:
            x, y = 0, y + _LINE
        SubElement(body, "rect", {"class": kind, "x": str(x), "y": str(y + 5), "width": "10", "height": "10"})
        _text(body, label, x=str(x + 15), y=y + 15, css="small")
        x += width
    return y + _LINE


def _over(parent: Element, plan: Schedule, scale: _Scale, *, y: int, height: int) -> None:
    """Shade what lies beyond the slice, behind the bars."""
    part = beyond(plan)
    scale.rect(parent, part, y=y, height=height, css="over", title=_tip("beyond the slice", part))


def _edge(parent: Element, plan: Schedule, scale: _Scale, *, y: int, height: int) -> None:
    """Draw the line where the slice ends, before the bars."""
    x = f"{scale.percent(plan.figures.available_us):.5g}%"
    SubElement(parent, "line", {"x1": x, "x2": x, "y1": str(y), "y2": str(y + height), "class": "edge"})


def _tip(label: str, event: Event) -> str:
    return f"{label}, {us(event.duration_us)} us: {us(event.start_us)} to {us(event.end_us)} us"


def _bars(parent: Element, events: Iterable[Event], scale: _Scale, *, y: int, height: int) -> None:
    for event in events:
        scale.rect(parent, event, y=y, height=height, css=event.kind, title=_tip(event_title(event), event))


def _node_lanes(body: Element, window: Schedule, *, y: int) -> int:
    """A lane for the bus and one for each node."""
    lanes = node_lanes(window)
    y = _words(body, f"{us(window.from_us)} to {us(window.to_us)} us, by node", y=y, css="head") + 4
    scale = _Scale(window.from_us, window.to_us)
    pitch = _BAR + 4 if len(lanes) <= _MOST_TALL_LANES else _BAR - 3
    area = _inside(body, x_percent=_GUTTER_PERCENT, width_percent=100 - _GUTTER_PERCENT, y=0)
    bottom = y + pitch * len(lanes)
    below = scale.marks(area, top=y, bottom=bottom)
    over = overruns(window) and window.to_us > window.figures.available_us
    for number, lane in enumerate(lanes):
        top = y + pitch * number
        _text(body, lane.label, x="0", y=top + pitch - 5, css="small")
        SubElement(area, "rect", {"class": "track", "width": "100%", "y": str(top), "height": str(pitch - 3)})
    if over:
        _over(area, window, scale, y=y - 2, height=bottom - y + 2)
    for number, lane in enumerate(lanes):
        _bars(area, lane.events, scale, y=y + pitch * number, height=pitch - 3)
    if over:
        _edge(area, window, scale, y=y - 2, height=bottom - y + 2)
    return below


def _event_lanes(body: Element, window: Schedule, *, y: int) -> int:
    """A lane for each event, its name above it."""
    owner = only_owner(window)
    title = f"{us(window.from_us)} to {us(window.to_us)} us{'' if owner is None else f', {owner}'}"
    y = _words(body, title, y=y, css="head")
    scale = _Scale(window.from_us, window.to_us)
    pitch = _LINE + _BAR
    over = overruns(window) and window.to_us > window.figures.available_us
    bottom = y + pitch * len(window.events)
    below = scale.marks(body, top=bottom - 4, bottom=bottom)
    for number, lane in enumerate(event_lanes(window)):
        top = y + pitch * number
        (event,) = lane.events
        _text(body, f"{lane.label}, {us(event.duration_us)} us", x="0", y=top + _LINE - 4, css="small")
        SubElement(body, "rect", {"class": "track", "width": "100%", "y": str(top + _LINE), "height": str(_BAR - 4)})
        if over:
            _over(body, window, scale, y=top + _LINE, height=_BAR - 4)
        _bars(body, (event,), scale, y=top + _LINE, height=_BAR - 4)
        if over:
            _edge(body, window, scale, y=top + _LINE, height=_BAR - 4)
    return below


def _legend(body: Element, plan: Schedule, *, y: int) -> int:
    """What each colour means, and what of the window it takes."""
    _text(body, "kind", x="20", y=y + 15, css="head")
    _text(body, "us", x="240", y=y + 15, css="head", anchor="end")
    _text(body, "share, %", x="310", y=y + 15, css="head", anchor="end")
    for one in totals(plan):
        y += _LINE
        SubElement(body, "rect", {"class": one.kind, "y": str(y + 4), "width": "12", "height": "12"})
        _text(body, KINDS[one.kind].label, x="20", y=y + 15)
        _text(body, us(one.total_us), x="240", y=y + 15, anchor="end")
        _text(body, f"{one.share * 100:.2f}", x="310", y=y + 15, anchor="end")
    return y + _LINE
