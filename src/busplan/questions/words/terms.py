"""Terms of the cycle as bars under each timing model, and the rest of the slice."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.buses import kind_named
from busplan.buses.figure import MARGIN, Figure
from busplan.forms.blocks import Drawing
from busplan.forms.numbers import decimals_of
from busplan.forms.svg import LINE, Scale, drawing, markup, text_at
from busplan.questions.fit.figures import CapacityFigures

_THIN: Final = 12
_THICK: Final = 28
_GAP: Final = 10
_LETTER_PERCENT: Final = 4.5
"""Narrowest bar that has room for its letter on a phone."""
_MAGNIFIED_BELOW: Final = 0.5
"""If the cycle takes less than this share of the slice, it is drawn a second time in full width."""


LEFT: Final = MARGIN._replace(label="left of the slice", ink="idle", letter="L")
"""The rest of the slice; it follows the terms in bars and legend."""


class _Segment(NamedTuple):
    term: Figure
    start_us: float
    end_us: float


class TermsDrawing(Drawing):
    """The terms on the scale of the slice and, if they are small, once more on their own scale.

    Parameters
    ----------
    results
        Figures of one period, one set for each timing model.
    """

    def __init__(self, results: Sequence[CapacityFigures]) -> None:
        self._results = results

    def svg(self) -> str:
        """Draw a bar for each timing model."""
        results = self._results
        root = drawing("Terms of the cycle under each timing model, and what is left of the slice", css="chart terms")
        used_us, slice_us = max(one.required_us for one in results), results[0].available_us
        small = used_us < _MAGNIFIED_BELOW * slice_us
        head = "The slice, us" if used_us <= slice_us else "The cycle and where its slice ends, us"
        y = _bars(root, results, head, y=0, end_us=max(used_us, slice_us), thin=small)
        if small:
            y = _bars(root, results, "The cycle alone, us", y=y + _GAP, end_us=used_us, thin=False)
        root.set("height", str(y))
        return markup(root)


def _bars(root: Element, results: Sequence[CapacityFigures], head: str, *, y: int, end_us: float, thin: bool) -> int:
    """Draw a bar for each model on one scale, and return the y below them."""
    text_at(root, head, x="0", y=y + 15, css="head")
    top = y = y + LINE
    scale, height = Scale(0.0, end_us), _THIN if thin else _THICK
    area = SubElement(root, "g")
    for one in results:
        text_at(root, one.timing_model, x="0", y=y + 14, css="small")
        y += LINE
        for part in _segments(one, _drawn(one, end_us)):
            _segment(root, part, scale, y=y, height=height)
        y += height
    if end_us > results[0].available_us:
        x = f"{scale.percent(results[0].available_us):.5g}%"
        SubElement(root, "line", {"x1": x, "x2": x, "y1": str(top), "y2": str(y), "class": "edge"})
    return scale.marks(area, top=top, bottom=y)


def _drawn(one: CapacityFigures, end_us: float) -> tuple[Figure, ...]:
    """The terms, and the rest of the slice if the scale reaches its end."""
    terms = kind_named(one.kind).figures.terms
    return (*terms, LEFT) if end_us >= one.available_us else terms


def _segments(one: CapacityFigures, terms: Sequence[Figure]) -> Iterator[_Segment]:
    """The terms that take time, one after the other."""
    start_us = 0.0
    for term in terms:
        size_us = getattr(one, term.key)
        if size_us > 0:
            yield _Segment(term, start_us, start_us + size_us)
            start_us += size_us


def _segment(root: Element, part: _Segment, scale: Scale, *, y: int, height: int) -> None:
    """Draw a bar, and its letter if there is room."""
    title = f"{part.term.label}, {decimals_of(part.end_us - part.start_us, 3)} us"
    scale.rect(root, part, y=y, height=height, css=f"bar {part.term.ink}", title=title)
    start, end = scale.percent(part.start_us), scale.percent(part.end_us)
    if end - start >= _LETTER_PERCENT and height == _THICK:
        css = f"letter on-{part.term.ink}"
        text_at(root, part.term.letter, x=f"{(start + end) / 2:.5g}%", y=y + 19, css=css, anchor="middle")
