"""Charts as data: cells of a grid, curves, bars in lanes and a circle, with their scales and legends.

A question gives these records; `forms.svg` draws them as SVG and PNG, `forms.terminal` in characters.
"""

from collections.abc import Callable, Iterable, Iterator
from math import log
from string import ascii_letters
from typing import Final, Literal, NamedTuple

from busplan.forms.lines import Tone
from busplan.forms.scale import Tick, round_numbers, ticks

_MOST_ROUND: Final = 7
"""Ticks of a logarithmic scale, at most."""


class Entry(NamedTuple):
    """Meaning of a mark; with words, an entry of the legend."""

    ink: str
    """Colour of the mark: an ink, or another CSS class of `chart.css`."""
    words: str = ""
    mark: str = ""
    """Letter or sign of the mark."""
    shape: Literal["area", "line"] = "area"


class Ruler(NamedTuple):
    """A scale of a chart."""

    label: str
    """Quantity, with its unit."""
    low: float
    high: float
    ticks: tuple[Tick, ...]
    own: float | None = None
    """Tick of this design, which is always shown."""
    is_log: bool = False

    def share(self, value: float) -> float:
        """Place of a value on the scale: 0 at its low end, 1 at its high end [1]."""
        if self.is_log:
            return log(value / self.low) / log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    @property
    def own_tick(self) -> int | None:
        """Index of this design's tick; None without one."""
        return next((number for number, tick in enumerate(self.ticks) if tick.at == self.own), None)


class ChartCell(NamedTuple):
    """A cell of a grid."""

    ink: str
    mark: str = ""
    words: str = ""
    """Tooltip of the cell."""
    tone: Tone = "neutral"
    """Colour of the cell on a terminal."""
    is_inside: bool | None = None
    """Whether the cell is inside the line drawn between True and False; None for a cell without a line."""


class ChartGrid(NamedTuple):
    """Cells of equal size over two scales, the first row at the bottom."""

    across: Ruler
    up: Ruler
    rows: tuple[tuple[ChartCell | None, ...], ...]
    """Cells by row and column; None where there is nothing to show."""
    legend: tuple[Entry, ...]
    own: tuple[float, float] | None = None
    """Place of this design, across and up, on the scales."""


class Curve(NamedTuple):
    """A line through points."""

    entry: Entry
    points: tuple[tuple[float, float | None], ...]
    """Places across and up; the line has a gap where there is no value."""
    words: tuple[str, ...] = ()
    """Tooltips of the points."""
    has_dots: bool = True
    """Whether every point has the curve's mark; False for the last one alone."""
    has_line: bool = True


class Guide(NamedTuple):
    """A line from edge to edge at a value, across or up."""

    entry: Entry
    x: float | None = None
    y: float | None = None


class Shade(NamedTuple):
    """A part of the scale across, shaded from top to bottom."""

    entry: Entry
    low: float
    high: float


class Curves(NamedTuple):
    """Curves over two scales."""

    across: Ruler
    up: Ruler
    curves: tuple[Curve, ...]
    guides: tuple[Guide, ...] = ()
    shades: tuple[Shade, ...] = ()


class Span(NamedTuple):
    """A bar in a lane, from a start to an end on the scale."""

    entry: Entry
    start: float
    end: float
    words: str = ""
    """Tooltip of the bar."""


class Lane(NamedTuple):
    """A row of bars."""

    label: str
    spans: tuple[Span, ...]
    note: str = ""
    """Figure at the end of the row."""
    is_thin: bool = False


class Lanes(NamedTuple):
    """Rows of bars on one scale."""

    across: Ruler
    lanes: tuple[Lane, ...]
    guides: tuple[Guide, ...] = ()
    is_beside: bool = False
    """Whether labels are left of their lanes; False for above."""


class Dial(NamedTuple):
    """A band around a circle between two radii, in equal sectors counter-clockwise from the x axis.

    Radii are multiples of the nominal radius.
    """

    entry: Entry
    inner: tuple[float | None, ...]
    """Inner radius of each sector; None in a sector without points."""
    outer: tuple[float | None, ...]
    rings: tuple[tuple[float, Entry], ...]
    words: tuple[str, ...]
    """Lines of text in the middle."""
    is_clockwise: bool


class Panel(NamedTuple):
    """One chart of a drawing."""

    plot: ChartGrid | Curves | Lanes | Dial | None
    title: str = ""
    words: str = ""
    tone: Tone = "neutral"
    """Verdict of the chart, as a colour."""


class Drawing(NamedTuple):
    """Charts one below the other, with one legend."""

    title: str
    """Message of the drawing, for screen readers and at the top of a file."""
    panels: tuple[Panel, ...]
    words: tuple[str, ...] = ()
    """Text below the title of a file."""
    description: str = ""
    """Description for screen readers."""
    has_characters: bool = False
    """Whether text and Markdown show the drawing in characters; then its panels are grids or lanes."""

    @property
    def is_round(self) -> bool:
        """Whether all charts are circles, which need no wide place."""
        return all(isinstance(panel.plot, Dial) for panel in self.panels)


def legend(panels: Iterable[Panel]) -> list[Entry]:
    """Entries with words in some charts, each once, in the order of the drawing."""
    entries = (entry for panel in panels for entry in _entries(panel.plot))
    return list(dict.fromkeys(entry for entry in entries if entry.words))


def _entries(plot: ChartGrid | Curves | Lanes | Dial | None) -> Iterator[Entry]:
    match plot:
        case ChartGrid():
            yield from plot.legend
        case Curves():
            yield from (curve.entry for curve in plot.curves)
            yield from (guide.entry for guide in plot.guides)
            yield from (shade.entry for shade in plot.shades)
        case Lanes():
            yield from (span.entry for lane in plot.lanes for span in lane.spans)
            yield from (guide.entry for guide in plot.guides)
        case Dial():
            yield from (plot.entry, *(entry for _, entry in plot.rings))


def numbers(label: str, low: float, high: float, *, most: int = 6, whole: bool = False, room: float = 0.0) -> Ruler:
    """A scale of numbers, with room at both sides of a single one.

    `most` is the largest number of ticks; `whole` puts them at whole numbers only. `room` is the empty part beyond an
    end that is not zero, as a share of the scale.
    """
    size = high - low or (1.0 if whole else abs(low) / 10 or 1.0)
    below, above = (size, size) if high == low else (room * size * bool(low), room * size * bool(high))
    low, high = low - below, high + above
    most = min(most, int(high - low) + 1) if whole else most
    return Ruler(label, low, high, ticks(low, high, most=most))


def logarithmic(
    label: str,
    low: float,
    high: float,
    write: Callable[[float], str],
    *,
    at: Iterable[float] | None = None,
    own: float | None = None,
) -> Ruler:
    """A logarithmic scale from `low` to `high`, both above 0.

    Ticks are at some numbers, by default round ones, with the label that `write` makes; `own` is the place of this
    design.
    """
    marks = round_numbers(low, high, most=_MOST_ROUND) if at is None else at
    return Ruler(label, low, high, tuple(Tick(value, write(value)) for value in marks), own, is_log=True)


def choices(label: str, names: Iterable[str], *, own: float | None = None) -> Ruler:
    """A scale of names at 0, 1, 2 and so on; `own` is the place of this design."""
    marks = tuple(Tick(place, name) for place, name in enumerate(names))
    return Ruler(label, -0.5, len(marks) - 0.5, marks, own)


def letters(names: Iterable[str]) -> list[str]:
    """Letters for names, all different: from the name, or the next of the alphabet where all of its own are taken."""
    taken: list[str] = []
    for name in names:
        free = (letter for letter in name + ascii_letters if letter in ascii_letters and letter not in taken)
        taken.append(next(free, "#"))
    return taken
