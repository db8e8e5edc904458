"""What each small change does to the margin, as bars to the left and to the right of zero."""

from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import SubElement

from busplan.forms.bars import ROW, SignedBar, draw_bars, draw_zero
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line
from busplan.forms.numbers import decimals_of
from busplan.forms.svg import Scale, drawing, markup
from busplan.questions.capacity.sensitivity import Sensitivity

_DECIMALS: Final = 3
_NARROWEST: Final = 10
"""Least columns of the bars in characters."""
_TAKES, _ADDS, _ZERO = "-", "+", "|"


class SensitivityDrawing(Drawing):
    """A bar for each change that can be made, on one scale.

    Parameters
    ----------
    found
        What moves the margin.
    """

    def __init__(self, found: Sensitivity) -> None:
        self._bars = [
            _bar(one.change, one.margin_change_us) for one in found.effects if one.margin_change_us is not None
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
        bottom = len(self._bars) * ROW
        draw_zero(root, scale, top=0, bottom=bottom)
        if self.shows_the_end:
            draw_zero(root, scale, top=0, bottom=bottom, at=-self._margin_us, css="edge")
        draw_bars(root, self._bars, scale, y=0)
        root.set("height", str(scale.marks(SubElement(root, "g"), top=bottom, bottom=bottom)))
        return markup(root)

    def characters(self, width: int) -> list[Line] | None:
        """Draw a row for each change: its name, its bar and its figure."""
        return None if self.is_empty else [Line(one, "drawn") for one in self._rows(width)]

    def _rows(self, width: int) -> Iterator[str]:
        names = max(len(one.label) for one in self._bars)
        figures = max(len(one.words) for one in self._bars)
        columns = max(_NARROWEST, width - names - figures - 5)
        left, right = _shared(columns, least=self._least_us, most=self._most_us)
        for one in self._bars:
            size = _columns(
                one.value, self._least_us if one.value < 0 else self._most_us, left if one.value < 0 else right
            )
            takes, adds = (_TAKES * size, "") if one.value < 0 else ("", _ADDS * size)
            bar = f"{takes.rjust(left)}{_ZERO}{adds.ljust(right)}"
            yield f"{one.label.ljust(names)}  {bar}  {one.words.rjust(figures)}"


def _bar(change: str, us: float) -> SignedBar:
    return SignedBar(change, us, decimals_of(us, _DECIMALS, signed=True), "us", "takes" if us < 0 else "hides")


def _shared(columns: int, *, least: float, most: float) -> tuple[int, int]:
    """Share columns between the left and the right of zero; a side with a bar has one at least."""
    left = round(columns * -least / (most - least))
    left = max(left, 1) if least < 0 else 0
    left = min(left, columns - 1) if most > 0 else columns
    return left, columns - left


def _columns(us: float, of_us: float, columns: int) -> int:
    """Columns of a bar: none only for no change at all."""
    return max(1, round(columns * us / of_us)) if us else 0
