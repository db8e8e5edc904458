"""Text for people, line by line: sentences and tables whose figures are never cut or wrapped.

The layout is ours because a piped report must not pay for loading a renderer; colours are left to who prints.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, NamedTuple

from busplan.buses.figure import Figure
from busplan.printable import printable

Tone = Literal["good", "bad", "warning", "heading", "plain", "table"]
"""How a line is meant; "table" and "heading" lines keep their columns, the others may be wrapped."""


class Line(NamedTuple):
    """One line of a report, or one sentence of it."""

    text: str
    tone: Tone = "plain"


BLANK = Line("")


def plain_text(lines: Iterable[Line]) -> str:
    """Write lines without colours, each with its line end; nothing in them commands a terminal."""
    return "".join(f"{printable(line.text)}\n" for line in lines)


class GridRow(NamedTuple):
    """One row of figures: how it is called, and how its values are written."""

    label: str
    unit: str
    key: str
    write: Callable[[Any], str]
    reference: str = ""
    """Numbers of its equations, or where else it comes from."""


def us(value: float) -> str:
    """Write a time in three decimals, unless it is too small for them.

    Examples
    --------
    >>> us(205.91747), us(0.0), us(0.00012)
    ('205.917', '0.000', '0.00012')
    """
    return f"{value:.3f}" if abs(value) >= 0.001 or value == 0 else f"{value:.3g}"  # noqa: PLR2004


def count(value: float) -> str:
    """Write a number of things."""
    return f"{value:.0f}"


def percent(value: float) -> str:
    """Write a share of one in percent, the sign left to the unit column."""
    return f"{value * 100:.2f}"


def yes(value: object) -> str:
    """Write a truth."""
    return "yes" if value else "no"


def um(value_mm: float) -> str:
    """Write a length in mm as micrometres.

    Examples
    --------
    >>> um(0.0036)
    '3.600'
    """
    return us(value_mm * 1e3)


def writer(figure: Figure) -> Callable[[Any], str]:
    """How the values of a figure are written in a table."""
    match figure.sort:
        case "truth":
            return yes
        case "count":
            return count
        case "word":
            return str
        case "words":
            return ", ".join
        case "number":
            units = {"%": percent, "um": um, "us": us}
            decimals = figure.decimals
            return units.get(figure.column or figure.unit, lambda value: f"{value:.{decimals}f}")


def figure_row(figure: Figure, *, level: int = 0) -> GridRow:
    """The row of a figure.

    Parameters
    ----------
    figure
        One with a label.
    level
        1 for a part of the row above it.
    """
    unit = figure.column or figure.unit
    return GridRow("  " * level + figure.label, unit, figure.key, writer(figure), figure.reference)


def plural(number: int, noun: str) -> str:
    """Write a number of things with their noun.

    Examples
    --------
    >>> plural(1, "node"), plural(2, "node"), plural(8, "axis")
    ('1 node', '2 nodes', '8 axes')
    """
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun.removesuffix('is')}es" if noun.endswith("is") else f"{number} {noun}s"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, left: int) -> list[Line]:
    """Lay out a table.

    Parameters
    ----------
    headings
        One a column; a line end in it makes a second line of headings.
    rows
        Cells, as many as headings.
    left
        How many of the first columns are words, set to the left; the others are figures, set to the right.
    """
    cells = [list(row) for row in rows]
    heads = [heading.split("\n") for heading in headings]
    depth = max(map(len, heads))
    head_rows = list(zip(*([""] * (depth - len(head)) + head for head in heads), strict=True))
    widths = [max(map(len, column)) for column in zip(*head_rows, *cells, strict=True)]

    def lay(row: Sequence[str]) -> str:
        words = (cell.ljust(width) for cell, width in zip(row[:left], widths[:left], strict=True))
        figures = (cell.rjust(width) for cell, width in zip(row[left:], widths[left:], strict=True))
        return "  ".join((*words, *figures)).rstrip()

    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    return [
        *(Line(lay(row), "heading") for row in head_rows),
        Line(rule, "table"),
        *(Line(lay(row), "table") for row in cells),
    ]


def grid(first_heading: str, columns: Sequence[tuple[str, object]], rows: Sequence[GridRow]) -> list[Line]:
    """Lay out figures: rows down, one column of values for each object, units where a row has one."""
    has_units = any(row.unit for row in rows)
    words = [first_heading, "eq", "unit"] if has_units else [first_heading, "eq"]
    return table(
        [*words, *(heading for heading, _ in columns)],
        (
            [
                *(row.label, row.reference, row.unit)[: len(words)],
                *(row.write(getattr(owner, row.key)) for _, owner in columns),
            ]
            for row in rows
        ),
        left=len(words),
    )
