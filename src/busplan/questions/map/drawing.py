"""The picture of a map: names and marks, as SVG for a page or a file, and in characters."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from string import ascii_lowercase
from types import MappingProxyType
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.buses.figure import Ink
from busplan.buses.parts import Value
from busplan.forms.blocks import ShownValue, Swatch
from busplan.forms.blocks import State as Tone
from busplan.forms.lines import BLANK, Line, Mark, legend_lines
from busplan.forms.numbers import period_value, with_unit
from busplan.forms.picture import styled
from busplan.forms.scale import placed_labels
from busplan.forms.svg import LINE, PHONE, drawing, inside, markup, paragraph, text_at
from busplan.questions.fit.certainty import TIME
from busplan.questions.fit.network import PERIOD, varied_nodes
from busplan.questions.map.direction import AXES, Direction
from busplan.questions.map.trade_off import Cell, NotDrawn, Region, State, TradeOff
from busplan.sections.profile import Profile

_DIGITS: Final = 6


class Look(NamedTuple):
    """How a state is drawn."""

    mark: str
    """Its character; a limit of the bus that is broken has a letter of its own."""
    ink: Ink
    tone: Tone
    """Its colour on a terminal."""


LOOKS: Final[Mapping[State, Look]] = MappingProxyType(
    {
        "fits": Look("#", "fits", "passes"),
        "circle fails": Look("%", "uneven", "fails"),
        "circle not judged": Look("+", "unjudged", "warns"),
        "circle cannot be run": Look("/", "refused", "fails"),
        "not shown to fit": Look("?", "unsure", "warns"),
        "unsafe": Look("!", "unsafe", "fails"),
        "does not fit": Look(".", "short", "neutral"),
    }
)
_BARRED: Final = Look("x", "barred", "neutral")
"""Of what does not fit in any time; its letter is that of the limit."""

Looks = Mapping[tuple[State, tuple[str, ...]], Look]
"""The look of each region, by its state and limits."""


def looks_of(trade_off: TradeOff) -> Looks:
    """Give each region of a map its look: that of its state, with a letter for each limit that no time helps.

    Parameters
    ----------
    trade_off
        The map.
    """
    looks: dict[tuple[State, tuple[str, ...]], Look] = {}
    taken: set[str] = set()
    for region in trade_off.regions:
        looks[region.state, region.limited_by] = LOOKS[region.state]
        if region.state == "does not fit" and region.limited_by != (TIME,):
            letters = (letter for letter in "".join(region.limited_by) + ascii_lowercase if letter in ascii_lowercase)
            mark = next((letter for letter in letters if letter not in taken), _BARRED.mark)
            taken.add(mark)
            looks[region.state, region.limited_by] = _BARRED._replace(mark=mark)
    return looks


def look_of(cell: Cell, looks: Looks) -> Look:
    """Look of a cell."""
    return looks[cell.state, cell.limited_by]


def legend_of(trade_off: TradeOff, looks: Looks) -> list[Swatch]:
    """Explain each mark of a map once; a letter names its limit.

    Parameters
    ----------
    trade_off
        The map.
    looks
        From `looks_of`.
    """
    entries: dict[str, Swatch] = {}
    for (state, limits), look in looks.items():
        limit = f": {' and '.join(limits)}" if look.ink == _BARRED.ink else ""
        entries.setdefault(look.mark, Swatch(look.ink, look.mark, f"{state_words(state, trade_off)}{limit}"))
    return list(entries.values())


def state_words(state: State, trade_off: TradeOff) -> str:
    """Name of a state on a map."""
    if state == "unsafe":
        return f"unsafe {trade_off.network.bus.safety.setting}"
    return f"{state}, and the circle passes" if state == "fits" and trade_off.with_circle else state


def limit_words(region: Region | Cell, trade_off: TradeOff) -> str:
    """Limits that keep a region from fitting; empty where it fits."""
    words = " and ".join(region.limited_by)
    if region.limited_by != (TIME,):
        return words
    return f"{words}, largest term {trade_off.network.bus.figures.term_label(region.binding_term)}"


def title_of(direction: Direction, profile: Profile) -> str:
    """Name of a direction."""
    if direction.key == AXES:
        return f"axes ({varied_nodes(profile).nodes_key})"
    return "period" if direction.key == PERIOD else direction.key


def value_text(direction: Direction, value: Value) -> str:
    """Write a value of a direction in few characters: a period with its unit, any other in the unit of its key."""
    if isinstance(value, str | bool):
        return str(value).lower() if isinstance(value, bool) else value
    shown = period_value(value) if direction.key == PERIOD else ShownValue(value)
    return with_unit(shown._replace(digits=_DIGITS))


def setting_words(trade_off: TradeOff, cell: Cell) -> str:
    """Write the setting of a cell, as "8 axes, period 4 ms"."""
    return ", ".join(
        _along(direction, value, trade_off.profile)
        for direction, value in ((trade_off.x, cell.x), (trade_off.y, cell.y))
    )


def _along(direction: Direction, value: Value, profile: Profile) -> str:
    text = value_text(direction, value)
    return f"{text} axes" if direction.key == AXES else f"{title_of(direction, profile)} {text}"


def map_title(trade_off: TradeOff) -> str:
    """Quantities on the y and x axis: "period against axes"."""
    return f"{title_of(trade_off.y, trade_off.profile)} against {title_of(trade_off.x, trade_off.profile)}"


def cell_words(trade_off: TradeOff, cell: Cell) -> str:
    """Say the setting of a cell, its state and its limit."""
    limit = limit_words(cell, trade_off)
    return f"{setting_words(trade_off, cell)}: {state_words(cell.state, trade_off)}{limit and f', {limit}'}"


_BRACKETED: Final = 3
"""Columns of a cell with room for brackets."""
_EDGE: Final = " |"
_OWN_ROW: Final = "> "
_OWN_COLUMN: Final = "^"


def map_lines(trade_off: TradeOff, *, width: int) -> list[Line]:
    """Draw a map: a row of characters for each value of `y`, the last on top.

    Parameters
    ----------
    trade_off
        The map.
    width
        Width of the drawing, in columns; a map of many narrow cells may need up to 80.
    """
    labels = [value_text(trade_off.y, value) for value in trade_off.y.values]
    gutter = len(_OWN_ROW) + max(map(len, labels))
    room = width - gutter - len(_EDGE) - 1
    widest = max(_BRACKETED, *(len(value_text(trade_off.x, value)) + 1 for value in trade_off.x.values))
    cell_width = max(1, min(widest, room // len(trade_off.x.values)))
    own_row, own_column = trade_off.own_place or (None, None)
    looks = looks_of(trade_off)
    lines = []
    for number, (label, row) in enumerate(zip(labels, trade_off.rows, strict=True)):
        head = f"{_OWN_ROW if number == own_row else '':<{len(_OWN_ROW)}}{label:>{gutter - len(_OWN_ROW)}}{_EDGE}"
        cells = _cells(row, looks, own=own_column if number == own_row else None, cell_width=cell_width)
        tones = _tones(row, start=len(head), cell_width=cell_width)
        lines.append(Line(f"{head}{cells}|", "drawn", tuple(tones)))
    indent = " " * (gutter + len(_EDGE))
    return [
        *reversed(lines),
        *(Line(f"{indent}{row}".rstrip(), "drawn") for row in _below(trade_off, own_column, cell_width=cell_width)),
        BLANK,
        *legend_lines(_legend_words(trade_off, looks, is_bracketed=cell_width >= _BRACKETED), width=width),
    ]


def _cells(row: Sequence[Cell | NotDrawn], looks: Looks, *, own: int | None, cell_width: int) -> str:
    """Looks of a row; this design stands in brackets where there is room."""
    texts = [f"{look_of(cell, looks).mark if isinstance(cell, Cell) else '':^{cell_width}}" for cell in row]
    if own is not None and cell_width >= _BRACKETED:
        texts[own] = f"{f'[{texts[own].strip()}]':^{cell_width}}"
    return "".join(texts)


def _tones(row: Sequence[Cell | NotDrawn], *, start: int, cell_width: int) -> Iterator[Mark]:
    """Colours of runs of cells, on a terminal that has them."""
    for tone, run in groupby(row, key=lambda cell: LOOKS[cell.state].tone if isinstance(cell, Cell) else "neutral"):
        end = start + cell_width * len(list(run))
        if tone != "neutral":
            yield Mark(start, end, tone)
        start = end


def _below(trade_off: TradeOff, own: int | None, *, cell_width: int) -> Iterator[str]:
    """A pointer to the column of this design, and values of `x` below their columns as far as there is room."""
    if own is not None:
        yield " " * ((cell_width - 1) // 2 + own * cell_width) + _OWN_COLUMN
    texts = [value_text(trade_off.x, value) for value in trade_off.x.values]
    line = ""
    for column, start in placed_labels(texts, own=own, pitch=cell_width, letter=1).items():
        line = f"{line:<{int(start)}}{texts[column]}"
    yield line


def _legend_words(trade_off: TradeOff, looks: Looks, *, is_bracketed: bool) -> list[str]:
    entries = [f"{entry.letter} {entry.text}" for entry in legend_of(trade_off, looks)]
    if trade_off.own is not None:
        entries.append("[ ] or > and ^ this design" if is_bracketed else "> and ^ this design")
    return [*entries, "blank cannot exist"] if trade_off.not_drawn else entries


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


def map_svg(trade_off: TradeOff, *, title: str, inline: bool = False) -> str:
    """Draw a map with its scales and, as a file of its own, its title and legend.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    trade_off
        The map.
    title
        Title: its message in a sentence.
    inline
        If True, leave out style sheet, title and legend: the page has them.
    """
    root = drawing(title, css="chart map")
    SubElement(root, "desc").text = map_title(trade_off)
    body = root if inline else inside(root, x_percent=2.5, width_percent=95.0, y=0)
    looks = looks_of(trade_off)
    y = 0 if inline else paragraph(body, title, y=8, css="head") + _GAP
    y = _map(body, trade_off, looks, y=y)
    if not inline:
        y = _legend(body, trade_off, looks, y=y + _GAP) + _GAP
    root.set("height", str(y))
    return markup(root) if inline else styled(markup(root), css=STYLE)


def _map(body: Element, trade_off: TradeOff, looks: Looks, *, y: int) -> int:
    """Draw both scales and the cells, and return the y below them."""
    labels = [value_text(trade_off.y, value) for value in trade_off.y.values]
    gutter = min(40.0, 100 * (_LETTER * max(map(len, labels)) + 10) / PHONE)
    text_at(body, title_of(trade_off.y, trade_off.profile), x="0", y=y + 14, css="small")
    y += LINE
    tall = _CELL if len(labels) <= _MOST_TALL else _THIN_CELL
    area = inside(body, x_percent=gutter, width_percent=100 - gutter, y=0)
    bottom = y + tall * len(labels)
    own_row, own_column = trade_off.own_place or (None, None)
    for number, label in enumerate(labels):
        top = bottom - tall * (number + 1)
        if tall == _CELL or number % 2 == 0 or number == own_row:
            css = "small here" if number == own_row else "small"
            text_at(body, label, x=f"{gutter - 1.5:.5g}%", y=top + tall - 4, css=css, anchor="end")
    for number, row in enumerate(trade_off.rows):
        _row(area, trade_off, row, looks, top=bottom - tall * (number + 1), tall=tall)
    if own_row is not None and own_column is not None:
        box = _box(own_column, bottom - tall * (own_row + 1), of=len(trade_off.x.values), tall=tall)
        SubElement(area, "rect", {**box, "class": "own"})
    _across(area, trade_off, own_column, y=bottom + 15, room=PHONE * (1 - gutter / 100))
    text_at(body, title_of(trade_off.x, trade_off.profile), x="100%", y=bottom + 32, css="small", anchor="end")
    return bottom + 2 * LINE


def _box(column: int, top: int, *, of: int, tall: int) -> dict[str, str]:
    return {"x": f"{100 * column / of:.4g}%", "y": str(top), "width": f"{100 / of:.4g}%", "height": str(tall)}


def _row(
    area: Element, trade_off: TradeOff, row: Sequence[Cell | NotDrawn], looks: Looks, *, top: int, tall: int
) -> None:
    """Draw the cells of a row, whose words are tooltips, and their marks where there is room."""
    drawn = {column: cell for column, cell in enumerate(row) if isinstance(cell, Cell)}
    for column, cell in drawn.items():
        css = f"cell {look_of(cell, looks).ink}"
        rect = SubElement(area, "rect", {**_box(column, top, of=len(row), tall=tall), "class": css})
        SubElement(rect, "title").text = cell_words(trade_off, cell)
    if drawn and len(row) <= _MOST_TALL and tall == _CELL:
        # One text with a place for each character: a page may have many maps.
        places = " ".join(f"{100 * (column + 0.5) / len(row):.4g}%" for column in drawn)
        marks = "".join(look_of(cell, looks).mark for cell in drawn.values())
        text_at(area, marks, x=places, y=top + 14, css="mark", anchor="middle")


def _across(area: Element, trade_off: TradeOff, own: int | None, *, y: int, room: float) -> None:
    """Draw the values of `x`, as many as there is room for on a phone, and always this design's."""
    texts = [value_text(trade_off.x, value) for value in trade_off.x.values]
    pitch = room / len(texts)
    for column in placed_labels(texts, own=own, pitch=pitch, letter=_LETTER):
        x = f"{100 * (column + 0.5) / len(texts):.5g}%"
        text_at(area, texts[column], x=x, y=y, css="small here" if column == own else "small", anchor="middle")


def _legend(body: Element, trade_off: TradeOff, looks: Looks, *, y: int) -> int:
    """Draw the meaning of each colour and mark, and return the y below them."""
    for entry in legend_of(trade_off, looks):
        SubElement(body, "rect", {"class": entry.ink, "y": str(y + 3), "width": "14", "height": "14"})
        text_at(body, entry.letter, x="7", y=y + 14, css="mark", anchor="middle")
        y = paragraph(body, entry.text, x=22, y=y)
    if trade_off.own is not None:
        SubElement(body, "rect", {"class": "own", "x": "1.5", "y": str(y + 4), "width": "11", "height": "11"})
        text_at(body, "this design", x="22", y=y + 15)
        y += LINE
    if trade_off.not_drawn:
        text_at(body, "blank: cannot exist", x="22", y=y + 15)
        y += LINE
    return y
