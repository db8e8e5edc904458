"""What each small change does to the margin, as bars to the left and to the right of zero."""

from collections.abc import Iterator
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.analysis.capacity.sensitivity import Sensitivity
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line
from busplan.forms.numbers import decimals_of
from busplan.forms.svg import LINE, Scale, drawing, markup, text_at

_BAR: Final = 12
_GAP: Final = 6
_DECIMALS: Final = 3
_NARROWEST: Final = 10
"""Least columns of the bars in characters."""
_TAKES, _ADDS, _ZERO = "-", "+", "|"


class _Bar(NamedTuple):
    """A bar between zero and a change of the margin."""

    change: str
    us: float

    @property
    def start_us(self) -> float:
        return min(self.us, 0.0)

    @property
    def end_us(self) -> float:
        return max(self.us, 0.0)

    @property
    def words(self) -> str:
        return decimals_of(self.us, _DECIMALS, signed=True)


class SensitivityDrawing(Drawing):
    """A bar for each change that can be made, on one scale.

    Parameters
    ----------
    found
        What moves the margin.
    """

    def __init__(self, found: Sensitivity) -> None:
        self._bars = [
            _Bar(one.change, one.margin_change_us) for one in found.effects if one.margin_change_us is not None
        ]
        self._margin_us = found.now.margin_corrected_us
        self._least_us = min((one.start_us for one in self._bars), default=0.0)
        self._most_us = max((one.end_us for one in self._bars), default=0.0)

    @property
    def is_empty(self) -> bool:
        """Whether nothing moves the margin: then there is no bar to see."""
        return self._least_us == self._most_us

    @property
    def shows_the_end(self) -> bool:
        """Whether the scale reaches to where nothing is left of the margin."""
        return self._least_us <= -self._margin_us < 0

    def svg(self) -> str | None:
        """Draw a bar below the name of each change."""
        if self.is_empty:
            return None
        root = drawing("What each small change does to the corrected margin", css="chart sensitivity")
        scale = Scale(self._least_us, self._most_us)
        bottom = len(self._bars) * (LINE + _BAR + _GAP)
        _line(root, scale.percent(0.0), bottom, css="zero")
        if self.shows_the_end:
            _line(root, scale.percent(-self._margin_us), bottom, css="edge")
        for number, one in enumerate(self._bars):
            y = number * (LINE + _BAR + _GAP)
            text_at(root, one.change, x="0", y=y + 15, css="halo")
            text_at(root, f"{one.words} us", x="100%", y=y + 15, css="small halo", anchor="end")
            css = "takes" if one.us < 0 else "hides"
            scale.rect(root, one, y=y + LINE, height=_BAR, css=css, title=f"{one.change}, {one.words} us")
        root.set("height", str(scale.marks(SubElement(root, "g"), top=bottom, bottom=bottom)))
        return markup(root)

    def characters(self, width: int) -> list[Line] | None:
        """Draw a row for each change: its name, its bar and its figure."""
        return None if self.is_empty else [Line(one, "drawn") for one in self._rows(width)]

    def _rows(self, width: int) -> Iterator[str]:
        names = max(len(one.change) for one in self._bars)
        figures = max(len(one.words) for one in self._bars)
        columns = max(_NARROWEST, width - names - figures - 5)
        left, right = _shared(columns, least=self._least_us, most=self._most_us)
        for one in self._bars:
            size = _columns(one.us, self._least_us if one.us < 0 else self._most_us, left if one.us < 0 else right)
            takes, adds = (_TAKES * size, "") if one.us < 0 else ("", _ADDS * size)
            bar = f"{takes.rjust(left)}{_ZERO}{adds.ljust(right)}"
            yield f"{one.change.ljust(names)}  {bar}  {one.words.rjust(figures)}"


def _line(root: Element, percent: float, bottom: int, *, css: str) -> None:
    x = f"{percent:.5g}%"
    SubElement(root, "line", {"x1": x, "x2": x, "y1": "0", "y2": str(bottom), "class": css})


def _shared(columns: int, *, least: float, most: float) -> tuple[int, int]:
    """Share columns between the left and the right of zero; a side with a bar has one at least."""
    left = round(columns * -least / (most - least))
    left = max(left, 1) if least < 0 else 0
    left = min(left, columns - 1) if most > 0 else columns
    return left, columns - left


def _columns(us: float, of_us: float, columns: int) -> int:
    """Columns of a bar: none only for no change at all."""
    return max(1, round(columns * us / of_us)) if us else 0
