"""Tables in character columns; figures are never cut or wrapped."""

from collections.abc import Iterator, Sequence
from itertools import zip_longest

from busplan.forms.blocks import Bar, Cell, Sentence, ShownValue, Swatch, Table, TableColumn, TableRow, Words
from busplan.forms.lines import Line, Mark, Tone
from busplan.forms.numbers import figure_text, with_unit
from busplan.printable import printable


def cell_text(cell: Cell) -> str:
    """Write a cell as plain text."""
    match cell:
        case str():
            return cell
        case ShownValue():
            return figure_text(cell)
        case Swatch():
            return f"{cell.letter} {cell.text}"
        case Bar():
            return ""
        case Sentence():
            return sentence_text(cell)
        case _:
            return cell[0]


def sentence_text(sentence: Sentence) -> str:
    """Write a sentence as plain text."""
    return "".join(with_unit(part) if isinstance(part, ShownValue) else cell_text(part) for part in sentence.parts)


def table_lines(table: Table) -> list[Line]:
    """Lay out a table: words left, figures right, a rule below the headings.

    Parameters
    ----------
    table
        The table. Columns of drawings are left out: the figure is in another column.
    """
    shown = [number for number, column in enumerate(table.columns) if column.kind != "drawing"]
    columns = [table.columns[number] for number in shown]
    rows = [[_one_line(row.cells[number]) for number in shown] for row in table.rows]
    for row, own in zip(table.rows, rows, strict=True):
        own[0] = "  " * row.level + own[0]
    heads = _heads(columns)
    widths = [max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
    left = [column.kind == "words" for column in columns]
    return [
        *(Line(_laid(head, widths, left), "heading") for head in heads),
        Line("-" * (sum(widths) + 2 * (len(widths) - 1)), "drawn"),
        *(
            Line(_laid(cells, widths, left), "drawn", tuple(_marks(row, shown, cells, widths, left)))
            for row, cells in zip(table.rows, rows, strict=True)
        ),
    ]


def _one_line(cell: Cell) -> str:
    return printable(" ".join(cell_text(cell).split()))


def _heads(columns: Sequence[TableColumn]) -> list[tuple[str, ...]]:
    """Heading lines from the top: group, heading and unit, aligned at the bottom."""
    stacks = [[*filter(None, (column.unit, column.heading, column.group))] for column in columns]
    return [tuple(line) for line in zip_longest(*stacks, fillvalue="")][::-1]


def _laid(cells: Sequence[str], widths: Sequence[int], left: Sequence[bool]) -> str:
    return "  ".join(
        cell.ljust(width) if words else cell.rjust(width)
        for cell, width, words in zip(cells, widths, left, strict=True)
    ).rstrip()


def _marks(
    row: TableRow, shown: Sequence[int], cells: Sequence[str], widths: Sequence[int], left: Sequence[bool]
) -> Iterator[Mark]:
    """Marks of the cells that have a state; a highlighted row is one more mark."""
    start = 0
    for number, cell, width, words in zip(shown, cells, widths, left, strict=True):
        tone = _tone(row.cells[number])
        if tone != "neutral":
            begin = start if words else start + width - len(cell)
            yield Mark(begin, begin + len(cell), tone)
        start += width + 2
    if row.highlighted:
        yield Mark(0, start, "heading")


def _tone(cell: Cell) -> Tone:
    return cell.state if isinstance(cell, ShownValue | Words | Sentence) else "neutral"
