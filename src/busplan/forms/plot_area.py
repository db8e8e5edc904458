"""A plot between two scales: curves and cells stretch with the width, text keeps its size."""

from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.raster import WIDTH
from busplan.forms.scale import Tick, placed_labels, ticks
from busplan.forms.svg import LINE, PHONE, anchor, inside, text_at

MARGIN_PERCENT: Final = 2.5
"""Empty part at each side of a picture."""
_LETTER: Final = 7
"""Width of a letter, about, in px."""
_MOST_GUTTER: Final = 40.0
_ROW: Final = 40
"""Least distance of two labels of numbers, up, in px."""
_NAME: Final = 16
"""Least distance of two names, up, in px."""
_SHORT: Final = 6
"""Longest number, in characters, of which five fit on a phone."""


class Ruler(NamedTuple):
    """Scale along one side: numbers, or names at 0, 1, 2 and so on."""

    label: str
    low: float
    high: float
    names: tuple[str, ...] = ()
    own: int | None = None
    """Name that is always shown, by its place."""
    whole: bool = False
    """Whether only whole numbers have a mark."""

    def share(self, value: float) -> float:
        """Place of a value, from 0 to 1."""
        return (value - self.low) / (self.high - self.low)

    def numbers(self, most: int) -> tuple[Tick, ...]:
        """Marks of numbers."""
        return ticks(self.low, self.high, most=min(most, int(self.high - self.low) + 1) if self.whole else most)


def numbers(label: str, low: float, high: float, *, whole: bool = False) -> Ruler:
    """Make a scale of numbers; a single number gets room at both sides.

    Parameters
    ----------
    label
        What the numbers are, with their unit.
    low, high
        Ends of the scale.
    whole
        Whether only whole numbers have a mark.
    """
    room = 0.0 if high > low else 1.0 if whole else abs(low) / 10 or 1.0
    return Ruler(label, low - room, high + room, whole=whole)


def choices(label: str, names: tuple[str, ...], *, own: int | None = None) -> Ruler:
    """Make a scale of names; `own` is the index of the name that is always shown."""
    return Ruler(label, -0.5, len(names) - 0.5, names, own)


class PlotArea(NamedTuple):
    """A plot of which scales and lines are drawn."""

    area: Element
    """The plot with text and marks: x in percent, y in px of the drawing."""
    paths: Element
    """Its paths, in the coordinates of `point`, clipped to it. In a PNG nothing in it is stretched."""
    across: Ruler
    up: Ruler
    top: int
    height: int
    width: float
    bottom: int
    """The y below the labels, in px."""

    def x(self, value: float) -> str:
        """The x of a value, in percent."""
        return f"{100 * self.across.share(value):.5g}%"

    def y(self, value: float) -> float:
        """The y of a value, in px."""
        return self.top + self.height * (1 - self.up.share(value))

    def point(self, x: float, y: float) -> str:
        """Coordinates of a point of a path."""
        return f"{self.width * self.across.share(x):.1f} {self.height * (1 - self.up.share(y)):.1f}"

    def line(self, *, x: float | None = None, y: float | None = None, css: str) -> None:
        """Draw a line from edge to edge, at a value across or up."""
        if x is not None:
            place = {"x1": self.x(x), "x2": self.x(x), "y1": str(self.top), "y2": str(self.top + self.height)}
        else:
            place = {"x1": "0", "x2": "100%", "y1": f"{self.y(y or 0.0):.1f}", "y2": f"{self.y(y or 0.0):.1f}"}
        SubElement(self.area, "line", {**place, "class": css})

    def place(self, x: float, y: float) -> Element:
        """A place for a mark of fixed size around a point."""
        box = {"x": self.x(x), "y": f"{self.y(y):.1f}", "overflow": "visible"}
        return SubElement(self.area, "svg", box)


def draw_plot_area(body: Element, across: Ruler, up: Ruler, *, y: int, height: int) -> PlotArea:
    """Draw both scales with their labels, and the lines of numbers.

    Parameters
    ----------
    body
        Where it is drawn, `MARGIN_PERCENT` from both edges of the picture.
    across, up
        The scales.
    y
        The y above it, in px.
    height
        Height of the plot, in px.
    """
    text_at(body, up.label, x="0", y=y + 14, css="small")
    top = y + LINE + 8
    marks = up.numbers(height // _ROW) or (Tick(up.low, ""),)
    if up.names:
        every = -(-_NAME * len(up.names) // height)
        marks = tuple(Tick(place, name) for place, name in enumerate(up.names) if place % every == 0)
    gutter = min(_MOST_GUTTER, 100 * (_LETTER * max(len(mark.label) for mark in marks) + 12) / PHONE)
    area = inside(body, x_percent=gutter, width_percent=99 - gutter, y=0)
    width = WIDTH * (1 - 2 * MARGIN_PERCENT / 100) * (99 - gutter) / 100
    stretched = {"y": str(top), "width": "100%", "height": str(height), "preserveAspectRatio": "none"}
    for mark in marks:
        at = f"{top + height * (1 - up.share(mark.at)):.1f}"
        if not up.names:
            SubElement(area, "line", {"x1": "0", "x2": "100%", "y1": at, "y2": at, "class": "rule"})
        text_at(body, mark.label, x=f"{gutter - 2:.5g}%", y=round(float(at)) + 4, css="small", anchor="end")
    paths = SubElement(area, "svg", {**stretched, "viewBox": f"0 0 {width:.1f} {height}"})
    draw_across(area, across, y=top + height, room=PHONE * (99 - gutter) / 100)
    return PlotArea(area, paths, across, up, top, height, width, top + height + 2 * LINE + 4)


def draw_across(area: Element, across: Ruler, *, y: int, room: float) -> None:
    """Draw a scale below a plot, with as many labels as there is room for on a phone.

    Parameters
    ----------
    area
        The plot.
    across
        The scale.
    y
        Its y, in px; labels and title take `2 * LINE` below it.
    room
        Width of the plot on a phone, in px.
    """
    if across.names:
        shown = placed_labels(across.names, own=across.own, pitch=room / len(across.names), letter=_LETTER)
        marks = tuple(Tick(place, across.names[place]) for place in shown)
    else:
        marks = across.numbers(5)
        if max((len(mark.label) for mark in marks), default=0) > _SHORT:
            marks = across.numbers(2)
    for mark in marks:
        share = across.share(mark.at)
        x = f"{100 * share:.5g}%"
        SubElement(area, "line", {"x1": x, "x2": x, "y1": str(y), "y2": str(y + 5), "class": "rule"})
        side = "middle" if across.names else anchor(100 * share, edge=4)
        text_at(area, mark.label, x=x, y=y + 19, css="small", anchor=side)
    text_at(area, across.label, x="100%", y=y + 36, css="small", anchor="end")
