"""A comparison as SVG, in a page or as a file: lines stretch with the width, text keeps its size; light and dark."""

from itertools import pairwise
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.inks import DARK, INKS
from busplan.forms.numbers import period, plural
from busplan.forms.picture import styled
from busplan.forms.svg import LINE, PHONE, anchor, drawing, inside, markup, paragraph, text_at
from busplan.questions.compare.kinds import KindComparison
from busplan.questions.compare.plane import (
    INKS_OF_LINES,
    KindLine,
    Plane,
    axes_labels,
    kind_lines,
    own_axes,
    period_labels,
    plane_of,
)

_HEIGHT: Final = 240
_LETTER: Final = 7
"""Width of a letter, about."""
_GAP: Final = 12
_RADIUS: Final = 7
_STROKES, _DARK_STROKES = (
    "".join(f".chart.kinds .line-{ink}{{stroke:{INKS[ink][side]}}}\n" for ink in INKS_OF_LINES) for side in (0, 1)
)
STYLE: Final = f"""\
.chart.kinds .line{{fill:none;stroke-width:2}}
.chart.kinds .dot{{stroke:var(--paper);stroke-width:1.5}}
.chart.kinds .mark{{font-size:10px;font-weight:700;fill:var(--paper);stroke:none}}
{_STROKES}{DARK}{{{_DARK_STROKES}}}
"""
"""Rules of the drawing."""


def compare_svg(found: KindComparison, *, title: str, inline: bool = False) -> str:
    """Draw the most axes over the period, a line for each kind of bus, with its scales and legend.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    found
        The comparison.
    title
        Title: its message in a sentence.
    inline
        If True, leave out style sheet and title: the page has them.
    """
    root = drawing(title, css="chart kinds")
    SubElement(root, "desc").text = "Most axes that are shown to fit over the period, both logarithmic"
    body = inside(root, x_percent=2.5, width_percent=95.0, y=0)
    y = _GAP if inline else paragraph(body, title, y=8, css="head") + _GAP
    plane, lines = plane_of(found), kind_lines(found)
    y = _area(body, found, plane, lines, y=y)
    root.set("height", str(_legend(body, lines, y=y) + _GAP))
    return markup(root) if inline else styled(markup(root), css=STYLE)


def _area(body: Element, found: KindComparison, plane: Plane, lines: tuple[KindLine, ...], *, y: int) -> int:
    """Draw the scales and the lines, and return the y below them."""
    text_at(body, "axes, logarithmic", x="0", y=y + 14, css="small")
    top, labels = y + LINE + _RADIUS, axes_labels(plane)
    gutter = 100 * (_LETTER * max(len(str(one)) for one in labels) + 12) / PHONE
    area = inside(body, x_percent=gutter, width_percent=98 - gutter, y=0)
    for axes in labels:
        at = _y(plane, axes, top=top)
        SubElement(area, "line", {"x1": "0", "x2": "100%", "y1": str(at), "y2": str(at), "class": "rule"})
        text_at(body, str(axes), x=f"{gutter - 2:.5g}%", y=at + 4, css="small", anchor="end")
    _own(area, found, plane, top=top)
    for line in lines:
        _line(area, line, plane, top=top)
    bottom = top + _HEIGHT
    shown = period_labels(found)
    own_us, every = found.profile.cycle.period_us, 1 + (len(shown) - 1) // 6
    for number, (period_us, text) in enumerate(shown):
        # Every label has its place on a phone; this machine's own is on its line.
        if number % every == 0 and period_us != own_us:
            at_percent = 100 * plane.x(period_us)
            text_at(area, text, x=f"{at_percent:.5g}%", y=bottom + 18, css="small", anchor=anchor(at_percent))
    text_at(area, "period, logarithmic", x="100%", y=bottom + 36, css="small", anchor="end")
    return bottom + 2 * LINE + _GAP


def _own(area: Element, found: KindComparison, plane: Plane, *, top: int) -> None:
    """Draw the period and the axes of the machine as two lines, with a label at the top."""
    at_percent, axes = 100 * plane.x(found.profile.cycle.period_us), own_axes(found)
    x = f"{at_percent:.5g}%"
    SubElement(area, "line", {"x1": x, "x2": x, "y1": str(top - 4), "y2": str(top + _HEIGHT), "class": "own"})
    if axes:
        y = str(_y(plane, axes, top=top))
        SubElement(area, "line", {"x1": "0", "x2": "100%", "y1": y, "y2": y, "class": "own"})
    words = f"this machine: {period(found.profile.cycle.period_us)}, {plural(axes, 'axis')}"
    text_at(area, words, x=x, y=top - _RADIUS - 2, css="small", anchor=anchor(at_percent, edge=40))


def _line(area: Element, line: KindLine, plane: Plane, *, top: int) -> None:
    """Draw a line, and on each of its points a dot with its letter; a point's words are a tooltip."""
    places = [(f"{100 * plane.x(us):.5g}%", _y(plane, axes, top=top)) for us, axes in line.points]
    for (x, y), (next_x, next_y) in pairwise(places):
        box = {"x1": x, "x2": next_x, "y1": str(y), "y2": str(next_y), "class": f"line line-{line.ink}"}
        SubElement(area, "line", box)
    for (x, y), (us, axes) in zip(places, line.points, strict=True):
        dot = SubElement(area, "circle", {"cx": x, "cy": str(y), "r": str(_RADIUS), "class": f"dot {line.ink}"})
        SubElement(dot, "title").text = f"{line.title}: {plural(axes, 'axis')} at {period(us)}"
        text_at(area, line.letter, x=x, y=y + 4, css="mark", anchor="middle")


def _legend(body: Element, lines: tuple[KindLine, ...], *, y: int) -> int:
    """Draw each letter with its kind, and return the y below them."""
    for line in lines:
        SubElement(body, "circle", {"cx": "8", "cy": str(y + 10), "r": str(_RADIUS), "class": f"dot {line.ink}"})
        text_at(body, line.letter, x="8", y=y + 14, css="mark", anchor="middle")
        text_at(body, line.title, x="22", y=y + 15)
        y += LINE
    return y


def _y(plane: Plane, axes: int, *, top: int) -> int:
    return round(top + _HEIGHT * (1 - plane.y(axes)))
