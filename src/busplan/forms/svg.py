"""What every SVG of ours is made of: it fills the width it is given, in percent, and its words keep their size."""

from typing import Final, Protocol
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.forms.scale import ticks

LINE: Final = 20
"""Height of a line of words."""
_NAMESPACE: Final = "http://www.w3.org/2000/svg"
_TICKS: Final = 5
_SHORT: Final = 6
"""Characters of a figure that so many marks leave room for on a phone."""


class Span(Protocol):
    """What has a start and an end."""

    @property
    def start_us(self) -> float:
        """When it begins [us]."""

    @property
    def end_us(self) -> float:
        """When it ends [us]."""


def drawing(title: str, *, css: str) -> Element:
    """Begin a picture as wide as its place; who draws it sets its height.

    Parameters
    ----------
    title
        What it shows, for who cannot see it.
    css
        Its class: no style reaches beyond it.
    """
    root = Element("svg", {"xmlns": _NAMESPACE, "class": css, "width": "100%", "role": "img"})
    SubElement(root, "title").text = title
    return root


def inside(parent: Element, *, x_percent: float, width_percent: float, y: int) -> Element:
    """A part of the picture with its own width; what stands at its edge may reach over it."""
    box = {"x": f"{x_percent:g}%", "width": f"{width_percent:g}%", "y": str(y), "overflow": "visible"}
    return SubElement(parent, "svg", box)


def text_at(parent: Element, text: str, *, x: str, y: int, css: str = "", anchor: str = "start") -> None:
    """Words at a place."""
    SubElement(parent, "text", {"x": x, "y": str(y), "class": css, "text-anchor": anchor}).text = text


def markup(root: Element) -> str:
    """Write the picture; what it says is text, whatever it holds."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


class Scale:
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

    def rect(self, parent: Element, span: Span, *, y: int, height: int, css: str, title: str) -> None:
        """Draw a time as a bar; what it is comes up where a pointer rests on it."""
        start, end = self.percent(span.start_us), self.percent(span.end_us)
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
            text_at(parent, tick.label, x=x, y=bottom + 17, css="small", anchor=anchor)
        return bottom + LINE
