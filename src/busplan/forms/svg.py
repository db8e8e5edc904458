"""Parts of every SVG: widths are in percent, so that it fills its container and text keeps its size."""

from textwrap import wrap
from typing import Final, Protocol
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.forms.scale import ticks

LINE: Final = 20
"""Height of a line of text."""
PHONE: Final = 335
"""Width of a phone without margins, in px."""
_LINE_CHARACTERS: Final = 42
"""Characters in a line of text: fits on a phone."""
_NAMESPACE: Final = "http://www.w3.org/2000/svg"
_TICKS: Final = 5
_SHORT: Final = 6
"""Longest label, in characters, for which `_TICKS` marks fit on a phone."""


class Span(Protocol):
    """Something with a start and an end."""

    @property
    def start_us(self) -> float:
        """When it begins [us]."""

    @property
    def end_us(self) -> float:
        """When it ends [us]."""


def drawing(title: str, *, css: str) -> Element:
    """Begin a drawing as wide as its container; the caller sets its height.

    Parameters
    ----------
    title
        Title for screen readers.
    css
        CSS class that scopes its styles.
    """
    root = Element("svg", {"xmlns": _NAMESPACE, "class": css, "width": "100%", "role": "img"})
    SubElement(root, "title").text = title
    return root


def inside(parent: Element, *, x_percent: float, width_percent: float, y: int) -> Element:
    """A nested drawing with its own width; content at its edge may overflow."""
    box = {"x": f"{x_percent:g}%", "width": f"{width_percent:g}%", "y": str(y), "overflow": "visible"}
    return SubElement(parent, "svg", box)


def text_at(parent: Element, text: str, *, x: str, y: int, css: str = "", anchor: str = "start") -> None:
    """Draw text at a place."""
    SubElement(parent, "text", {"x": x, "y": str(y), "class": css, "text-anchor": anchor}).text = text


def anchor(percent: float, *, edge: int = 5) -> str:
    """How a text stands at its place: within `edge` percent of a side it keeps inside the drawing.

    Examples
    --------
    >>> anchor(3.0), anchor(50.0), anchor(96.0)
    ('start', 'middle', 'end')
    """
    return "start" if percent < edge else "end" if percent > 100 - edge else "middle"


def paragraph(parent: Element, text: str, *, x: int = 0, y: int, css: str = "") -> int:
    """Draw text wrapped for a phone, and return the y below it."""
    characters = _LINE_CHARACTERS * (PHONE - x) // PHONE
    # Letters of other scripts may be twice as wide.
    for line in wrap(text, characters if text.isascii() else characters // 2):
        y += LINE
        text_at(parent, line, x=f"{x}", y=y - 5, css=css)
    return y


def markup(root: Element) -> str:
    """Write a drawing as SVG; text is escaped."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


class Scale:
    """Map times to percent of a width.

    Parameters
    ----------
    from_us, to_us
        Times at the left and the right edge [us].
    """

    def __init__(self, from_us: float, to_us: float) -> None:
        self._from_us, self._to_us = from_us, to_us

    def percent(self, time_us: float) -> float:
        """Position of a time, 0 to 100, clipped to the edges."""
        return min(100.0, max(0.0, 100 * (time_us - self._from_us) / (self._to_us - self._from_us)))

    def rect(self, parent: Element, span: Span, *, y: int, height: int, css: str, title: str) -> None:
        """Draw a time span as a bar; its title is a tooltip."""
        start, end = self.percent(span.start_us), self.percent(span.end_us)
        box = {"x": f"{start:.5g}%", "width": f"{end - start:.5g}%", "y": str(y), "height": str(height), "class": css}
        SubElement(SubElement(parent, "rect", box), "title").text = title

    def marks(self, parent: Element, *, top: int, bottom: int) -> int:
        """Draw tick marks as lines with labels below, and return the y below them."""
        marks = ticks(self._from_us, self._to_us, most=_TICKS)
        if max((len(tick.label) for tick in marks), default=0) > _SHORT:
            marks = ticks(self._from_us, self._to_us, most=_TICKS // 2)
        for tick in marks:
            at = self.percent(tick.at)
            x = f"{at:.5g}%"
            SubElement(parent, "line", {"x1": x, "x2": x, "y1": str(top), "y2": str(bottom + 4), "class": "rule"})
            text_at(parent, tick.label, x=x, y=bottom + 17, css="small", anchor=anchor(at, edge=4))
        return bottom + LINE
