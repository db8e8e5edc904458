"""The picture of a comparison, both scales logarithmic: as SVG for a page or a file, and in characters."""

from collections.abc import Sequence
from itertools import pairwise
from math import log10
from string import ascii_uppercase
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.buses.figure import Ink
from busplan.elementwise import plain
from busplan.forms.lines import BLANK, Line, legend_lines
from busplan.forms.numbers import period, plural
from busplan.forms.picture import DARK, INKS, styled
from busplan.forms.scale import round_numbers
from busplan.forms.svg import LINE, PHONE, anchor, drawing, inside, markup, paragraph, text_at
from busplan.questions.compare.kinds import KindComparison, MachineOnKind
from busplan.questions.fit.network import bus_of, network_of

INKS_OF_LINES: Final[tuple[Ink, ...]] = ("request", "contention", "work", "sync", "acknowledge", "response", "reserve")
"""Colours of the lines; each has a letter, too."""
_LEAST_TOP: Final = 10
_MOST_LABELS: Final = 7


class KindLine(NamedTuple):
    """The line of a kind of bus."""

    letter: str
    ink: Ink
    title: str
    points: tuple[tuple[float, int], ...]
    """Period [us] and axes of each point; one that carries none has no place on the scale."""


class Plane(NamedTuple):
    """Both scales, from 0 to 1."""

    from_us: float
    to_us: float
    top_axes: int

    def x(self, period_us: float) -> float:
        """Place of a period."""
        return log10(period_us / self.from_us) / log10(self.to_us / self.from_us)

    def y(self, axes: int) -> float:
        """Place of a number of axes, 1 or more."""
        return log10(axes) / log10(self.top_axes)


def kind_lines(comparison: KindComparison) -> tuple[KindLine, ...]:
    """A line for each kind that can have the machine; its letter is one of the kind's name."""
    taken: set[str] = set()
    lines = []
    for number, machine in enumerate(comparison.compared):
        letters = f"{machine.profile.bus.kind.upper()}{ascii_uppercase}"
        letter = next((letter for letter in letters if letter in ascii_uppercase and letter not in taken), "#")
        taken.add(letter)
        own, points = " (this profile)" if machine.is_own else "", _points(machine)
        none = "" if points else ": none"
        ink = INKS_OF_LINES[number % len(INKS_OF_LINES)]
        lines.append(KindLine(letter, ink, f"{bus_of(machine.profile).title}{own}{none}", points))
    return tuple(lines)


def _points(machine: MachineOnKind) -> tuple[tuple[float, int], ...]:
    return tuple((point.period_us, point.axes) for point in machine.curve if point.axes)


def plane_of(comparison: KindComparison) -> Plane:
    """The scales that hold every line and the machine itself."""
    periods_us = [point.period_us for machine in comparison.compared for point in machine.curve]
    axes = [point.axes or 1 for machine in comparison.compared for point in machine.curve]
    return Plane(min(periods_us), max(periods_us), max(_LEAST_TOP, own_axes(comparison), *axes))


def own_axes(comparison: KindComparison) -> int:
    """Axes of the machine."""
    return int(plain(network_of(comparison.profile).axes))


def axes_labels(plane: Plane) -> list[int]:
    """Round numbers of axes to label, as few as can be read."""
    return [int(number) for number in round_numbers(1, plane.top_axes, most=_MOST_LABELS)]


def period_labels(comparison: KindComparison) -> list[tuple[float, str]]:
    """Periods of the points with their text, the machine's own among them."""
    return [(us, period(us)) for us in _periods_us(comparison.compared)]


def _periods_us(compared: Sequence[MachineOnKind]) -> list[float]:
    return sorted({point.period_us for machine in compared for point in machine.curve})


_ROWS: Final = 13
_WIDEST: Final = 78
_SEVERAL, _OWN, _OWN_PERIOD = "*", ".", "^"


def compare_lines(comparison: KindComparison, *, width: int) -> list[Line]:
    """Draw a letter where a kind of bus carries so many axes at a period.

    Parameters
    ----------
    comparison
        The comparison.
    width
        Width of the drawing, in columns.
    """
    plane, lines = plane_of(comparison), kind_lines(comparison)
    labels = {_row(plane, label): str(label) for label in axes_labels(plane)}
    gutter = max(map(len, labels.values()))
    columns = min(width, _WIDEST) - gutter - 3
    cells = [[" "] * columns for _ in range(_ROWS)]
    if own_axes(comparison):
        cells[_row(plane, own_axes(comparison))] = [_OWN] * columns
    for line in lines:
        for period_us, axes in line.points:
            place = _column(plane, period_us, columns)
            before = cells[_row(plane, axes)][place]
            cells[_row(plane, axes)][place] = line.letter if before in (" ", _OWN) else _SEVERAL
    drawn = [f"{labels.get(row, ''):>{gutter}} |{''.join(cells[row])}|" for row in reversed(range(_ROWS))]
    own = _column(plane, comparison.profile.cycle.period_us, columns)
    indent = " " * (gutter + 2)
    below = (" " * own + _OWN_PERIOD, _below(comparison, plane, columns))
    legend = [f"{line.letter} {line.title}" for line in lines]
    legend += [f"{_SEVERAL} several"] if any(_SEVERAL in row for row in cells) else []
    legend.append(f"{_OWN} and {_OWN_PERIOD} the axes and the period of this machine")
    return [
        *(Line(row, "drawn") for row in drawn),
        *(Line(f"{indent}{row}".rstrip(), "drawn") for row in below),
        BLANK,
        *legend_lines(legend, width=width),
    ]


def _row(plane: Plane, axes: int) -> int:
    return round((_ROWS - 1) * plane.y(axes))


def _column(plane: Plane, period_us: float, columns: int) -> int:
    return round((columns - 1) * plane.x(period_us))


def _below(comparison: KindComparison, plane: Plane, columns: int) -> str:
    """Periods below their columns, this machine's first, the others as far as there is room."""
    taken: dict[int, str] = {}
    own_us = comparison.profile.cycle.period_us
    for period_us, text in sorted(period_labels(comparison), key=lambda label: label[0] != own_us):
        start = min(max(0, _column(plane, period_us, columns) - len(text) // 2), columns - len(text))
        if all(start + len(text) < place or start > place + len(label) for place, label in taken.items()):
            taken[start] = text
    line = ""
    for start, text in sorted(taken.items()):
        line = f"{line:<{start}}{text}"
    return line


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


def compare_svg(comparison: KindComparison, *, title: str, inline: bool = False) -> str:
    """Draw the most axes over the period, a line for each kind of bus, with its scales and legend.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    comparison
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
    plane, lines = plane_of(comparison), kind_lines(comparison)
    y = _area(body, comparison, plane, lines, y=y)
    root.set("height", str(_legend(body, lines, y=y) + _GAP))
    return markup(root) if inline else styled(markup(root), css=STYLE)


def _area(body: Element, comparison: KindComparison, plane: Plane, lines: tuple[KindLine, ...], *, y: int) -> int:
    """Draw the scales and the lines, and return the y below them."""
    text_at(body, "axes, logarithmic", x="0", y=y + 14, css="small")
    top, labels = y + 2 * LINE + _RADIUS, axes_labels(plane)
    gutter = 100 * (_LETTER * max(len(str(label)) for label in labels) + 12) / PHONE
    area = inside(body, x_percent=gutter, width_percent=98 - gutter, y=0)
    for axes in labels:
        at = _y(plane, axes, top=top)
        SubElement(area, "line", {"x1": "0", "x2": "100%", "y1": str(at), "y2": str(at), "class": "rule"})
        text_at(body, str(axes), x=f"{gutter - 2:.5g}%", y=at + 4, css="small", anchor="end")
    _own(area, comparison, plane, top=top)
    for line in lines:
        _line(area, line, plane, top=top)
    bottom = top + _HEIGHT
    own_us, room, taken = comparison.profile.cycle.period_us, 0.95 * PHONE * (98 - gutter) / 100, -float(_GAP)
    for period_us, text in period_labels(comparison):
        share, width = plane.x(period_us), _LETTER * len(text)
        side = anchor(100 * share)
        start = share * room - {"start": 0.0, "middle": width / 2, "end": width}[side]
        # As many as have their place on a phone; this machine's own is on its line.
        if start >= taken + _GAP / 2 and period_us != own_us:
            text_at(area, text, x=f"{100 * share:.5g}%", y=bottom + 18, css="small", anchor=side)
            taken = start + width
    text_at(area, "period, logarithmic", x="100%", y=bottom + 36, css="small", anchor="end")
    return bottom + 2 * LINE + _GAP


def _own(area: Element, comparison: KindComparison, plane: Plane, *, top: int) -> None:
    """Draw the period and the axes of the machine as two lines, with a label at the top."""
    at_percent, axes = 100 * plane.x(comparison.profile.cycle.period_us), own_axes(comparison)
    x = f"{at_percent:.5g}%"
    SubElement(area, "line", {"x1": x, "x2": x, "y1": str(top - 4), "y2": str(top + _HEIGHT), "class": "own"})
    if axes:
        y = str(_y(plane, axes, top=top))
        SubElement(area, "line", {"x1": "0", "x2": "100%", "y1": y, "y2": y, "class": "own"})
    words = f"this machine: {period(comparison.profile.cycle.period_us)}, {plural(axes, 'axis')}"
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
