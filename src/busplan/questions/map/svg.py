"""A map as SVG, in a page or as a file: cells scale with the width, text keeps its size; light and dark."""

from collections.abc import Sequence
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.picture import styled
from busplan.forms.scale import placed_labels
from busplan.forms.svg import LINE, PHONE, drawing, inside, markup, paragraph, text_at
from busplan.questions.map.cells import Cell, NotDrawn
from busplan.questions.map.labels import (
    Looks,
    cell_words,
    legend_of,
    look_of,
    looks_of,
    map_title,
    title_of,
    value_text,
)
from busplan.questions.map.trade_off import TradeOff

_CELL: Final = 20
"""Height of a cell."""
_THIN_CELL: Final = 11
_MOST_TALL: Final = 32
"""Rows up to which cells have their full height, and columns up to which they hold their mark on a phone."""
_LETTER: Final = 7
"""Width of a letter, about."""
_GAP: Final = 12
STYLE: Final = """\
.chart.map .cell{stroke:var(--paper);stroke-width:1}
.chart.map .mark{font-size:12px;font-weight:700;fill:#10151c;stroke:none}
.chart.map .own{fill:none;stroke:var(--ink);stroke-width:3;stroke-dasharray:none}
.chart.map .here{font-weight:700;fill:var(--ink)}
"""
"""Rules of the drawing."""


def map_svg(found: TradeOff, *, title: str, inline: bool = False) -> str:
    """Draw a map with its scales and, as a file of its own, its title and legend.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    found
        The map.
    title
        Title: its message in a sentence.
    inline
        If True, leave out style sheet, title and legend: the page has them.
    """
    root = drawing(title, css="chart map")
    SubElement(root, "desc").text = map_title(found)
    body = root if inline else inside(root, x_percent=2.5, width_percent=95.0, y=0)
    looks = looks_of(found)
    y = 0 if inline else paragraph(body, title, y=8, css="head") + _GAP
    y = _map(body, found, looks, y=y)
    if not inline:
        y = _legend(body, found, looks, y=y + _GAP) + _GAP
    root.set("height", str(y))
    return markup(root) if inline else styled(markup(root), css=STYLE)


def _map(body: Element, found: TradeOff, looks: Looks, *, y: int) -> int:
    """Draw both scales and the cells, and return the y below them."""
    labels = [value_text(found.y, one) for one in found.y.values]
    gutter = min(40.0, 100 * (_LETTER * max(map(len, labels)) + 10) / PHONE)
    text_at(body, title_of(found.y, found.profile), x="0", y=y + 14, css="small")
    y += LINE
    tall = _CELL if len(labels) <= _MOST_TALL else _THIN_CELL
    area = inside(body, x_percent=gutter, width_percent=100 - gutter, y=0)
    bottom = y + tall * len(labels)
    own_row, own_column = found.own_place or (None, None)
    for number, label in enumerate(labels):
        top = bottom - tall * (number + 1)
        if tall == _CELL or number % 2 == 0 or number == own_row:
            css = "small here" if number == own_row else "small"
            text_at(body, label, x=f"{gutter - 1.5:.5g}%", y=top + tall - 4, css=css, anchor="end")
    for number, row in enumerate(found.rows):
        _row(area, found, row, looks, top=bottom - tall * (number + 1), tall=tall)
    if own_row is not None and own_column is not None:
        box = _box(own_column, bottom - tall * (own_row + 1), of=len(found.x.values), tall=tall)
        SubElement(area, "rect", {**box, "class": "own"})
    _across(area, found, own_column, y=bottom + 15, room=PHONE * (1 - gutter / 100))
    text_at(body, title_of(found.x, found.profile), x="100%", y=bottom + 32, css="small", anchor="end")
    return bottom + 2 * LINE


def _box(column: int, top: int, *, of: int, tall: int) -> dict[str, str]:
    return {"x": f"{100 * column / of:.4g}%", "y": str(top), "width": f"{100 / of:.4g}%", "height": str(tall)}


def _row(area: Element, found: TradeOff, row: Sequence[Cell | NotDrawn], looks: Looks, *, top: int, tall: int) -> None:
    """Draw the cells of a row, whose words are tooltips, and their marks where there is room."""
    drawn = {column: one for column, one in enumerate(row) if isinstance(one, Cell)}
    for column, one in drawn.items():
        css = f"cell {look_of(one, looks).ink}"
        rect = SubElement(area, "rect", {**_box(column, top, of=len(row), tall=tall), "class": css})
        SubElement(rect, "title").text = cell_words(found, one)
    if drawn and len(row) <= _MOST_TALL and tall == _CELL:
        # One text with a place for each character: a page may have many maps.
        places = " ".join(f"{100 * (column + 0.5) / len(row):.4g}%" for column in drawn)
        marks = "".join(look_of(one, looks).mark for one in drawn.values())
        text_at(area, marks, x=places, y=top + 14, css="mark", anchor="middle")


def _across(area: Element, found: TradeOff, own: int | None, *, y: int, room: float) -> None:
    """Draw the values of `x`, as many as there is room for on a phone, and always this design's."""
    texts = [value_text(found.x, one) for one in found.x.values]
    pitch = room / len(texts)
    for column in placed_labels(texts, own=own, pitch=pitch, letter=_LETTER):
        x = f"{100 * (column + 0.5) / len(texts):.5g}%"
        text_at(area, texts[column], x=x, y=y, css="small here" if column == own else "small", anchor="middle")


def _legend(body: Element, found: TradeOff, looks: Looks, *, y: int) -> int:
    """Draw the meaning of each colour and mark, and return the y below them."""
    for entry in legend_of(found, looks):
        SubElement(body, "rect", {"class": entry.ink, "y": str(y + 3), "width": "14", "height": "14"})
        text_at(body, entry.letter, x="7", y=y + 14, css="mark", anchor="middle")
        text_at(body, entry.text, x="22", y=y + 15)
        y += LINE
    if found.own is not None:
        SubElement(body, "rect", {"class": "own", "x": "1.5", "y": str(y + 4), "width": "11", "height": "11"})
        text_at(body, "this design", x="22", y=y + 15)
        y += LINE
    if found.not_drawn:
        text_at(body, "blank: cannot exist", x="22", y=y + 15)
        y += LINE
    return y
