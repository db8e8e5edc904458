"""Bars left and right of zero: each below its name, or one in a table cell."""

from collections.abc import Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.svg import LINE, Scale, drawing, markup, text_at

_BAR: Final = 12
ROW: Final = LINE + _BAR + 6
"""Height of a bar with its name, in px."""


class SignedBar(NamedTuple):
    """A bar between zero and a value."""

    label: str
    value: float
    words: str
    """The value as it is written, without its unit."""
    unit: str
    css: str

    @property
    def start_us(self) -> float:
        """Its left end, in its unit."""
        return min(self.value, 0.0)

    @property
    def end_us(self) -> float:
        """Its right end, in its unit."""
        return max(self.value, 0.0)


def draw_bars(parent: Element, bars: Sequence[SignedBar], scale: Scale, *, y: int) -> None:
    """Draw bars with their names and values, each in a row of `ROW` px.

    Parameters
    ----------
    parent
        Where they are drawn.
    bars
        The bars.
    scale
        Their scale.
    y
        The y above them, in px.
    """
    for number, bar in enumerate(bars):
        top = y + number * ROW
        text_at(parent, bar.label, x="0", y=top + 15, css="halo")
        text_at(parent, f"{bar.words} {bar.unit}", x="100%", y=top + 15, css="small halo", anchor="end")
        title = f"{bar.label}, {bar.words} {bar.unit}"
        scale.rect(parent, bar, y=top + LINE, height=_BAR, css=bar.css, title=title)


def draw_zero(parent: Element, scale: Scale, *, top: int, bottom: int, at: float = 0.0, css: str = "zero") -> None:
    """Draw a line through all bars, at zero or at another value."""
    x = f"{scale.percent(at):.5g}%"
    SubElement(parent, "line", {"x1": x, "x2": x, "y1": str(top), "y2": str(bottom), "class": css})


_HEIGHT = 16


def signed_bar(value: float, *, least: float, most: float, title: str) -> str:
    """Draw one value as a bar on a scale.

    Parameters
    ----------
    value
        Value of the bar.
    least, most
        Ends of the scale, least <= 0 <= most.
    title
        Title for screen readers.
    """
    root = drawing(title, css="chart bars")
    root.set("height", str(_HEIGHT))
    zero, end = (100 * (mark - least) / (most - least) for mark in (0.0, value))
    box = {"x": f"{min(zero, end):.5g}%", "width": f"{abs(end - zero):.5g}%", "y": "2", "height": str(_HEIGHT - 4)}
    SubElement(root, "rect", {**box, "class": "takes" if value >= 0 else "hides"})
    x = f"{zero:.5g}%"
    SubElement(root, "line", {"x1": x, "x2": x, "y1": "0", "y2": str(_HEIGHT), "class": "zero"})
    return markup(root)
