"""Figures, cells and sentences as plain text."""

from collections.abc import Iterator, Sequence
from math import floor, isfinite, isnan, log10
from typing import Final

from busplan.buses.figure import unit_of
from busplan.english import listed, nouns, printable
from busplan.forms.blocks import (
    Bar,
    Block,
    Card,
    Cell,
    Chapter,
    Detail,
    Explorer,
    Part,
    Report,
    Sentence,
    ShownValue,
    Swatch,
    Table,
    Words,
)
from busplan.forms.lines import Line, Mark

MISSING: Final = "-"
_DIGITS: Final = 12
"""Digits of a number, at most; further ones are float rounding."""
_FACTORS: Final = {("", "%"): 100.0, ("mm", "um"): 1e3, ("us", "ms"): 1e-3, ("us", "s"): 1e-6, ("us", "us/byte"): 1.0}
"""Factors from the unit of a key to the written unit. The key `per_byte_us` is in us/byte."""
_MILLISECOND_US: Final = 1e3
_SECOND_US: Final = 1e6
SILENT_UNITS: Final = frozenset(("", "1", "nodes", "axes"))
"""Units that a sentence does not repeat after a figure, because a noun names them."""
ROUNDING_UM: Final = 1e-6
"""Length below which figures are float rounding: a picometre [um]."""


def figure_text(value: ShownValue) -> str:
    """A figure without its unit.

    Examples
    --------
    >>> figure_text(ShownValue(0.0036, "max_contour_error_mm", "um", 3))
    '3.600'
    >>> [figure_text(ShownValue(value)) for value in (None, True, 16.0, ("time", "nodes"))]
    ['-', 'yes', '16', 'time, nodes']
    >>> figure_text(ShownValue([2.38808777, 4000.0], digits=4)), figure_text(ShownValue(-4e-16, decimals=3, fixed=True))
    ('2.388, 4000', '0.000')
    >>> figure_text(ShownValue(1234567)), figure_text(ShownValue(1234567, grouped=True))
    ('1234567', '1,234,567')
    >>> figure_text(ShownValue(0x181, hexadecimal=True))
    '0x181'
    """
    match value.value:
        case None:
            return MISSING
        case bool():
            return "yes" if value.value else "no"
        case int() if value.hexadecimal:
            return f"{value.value:#x}"
        case int() | float():
            return _number(value)
        case list() | tuple():
            return ", ".join(figure_text(value._replace(value=element)) for element in value.value) or MISSING
    return str(value.value)


def with_unit(value: ShownValue) -> str:
    """A figure with its unit, as in a sentence.

    Examples
    --------
    >>> with_unit(ShownValue(3.9691, "margin_us", "us", 3)), with_unit(ShownValue(0.5, "utilisation", "%", 1))
    ('3.969 us', '50.0%')
    """
    return f"{figure_text(value)}{unit_text(value)}"


def unit_text(value: ShownValue) -> str:
    """Unit after a figure in a sentence, with its space."""
    if value.unit in SILENT_UNITS or figure_text(value) == MISSING:
        return ""
    return "%" if value.unit == "%" else f" {value.unit}"


def decimals_of(number: float, decimals: int, *, signed: bool = False) -> str:
    """A number with fixed decimals, below 0 to tens and hundreds; one too small has three digits.

    Examples
    --------
    >>> decimals_of(205.91747, 3), decimals_of(0.0, 3), decimals_of(0.00012, 3), decimals_of(2.5, 1, signed=True)
    ('205.917', '0.000', '0.00012', '+2.5')
    >>> decimals_of(6764.2, -1)
    '6760'
    """
    sign = "+" if signed and number > 0 else ""
    if decimals < 0:
        return f"{sign}{round(number, decimals):.0f}"
    if number == 0 or abs(number) >= 10.0**-decimals:
        return f"{sign}{number:.{decimals}f}"
    return f"{sign}{number:.3g}"


_UNKNOWN_DIGITS: Final = 3
"""Significant digits of a number whose uncertainty is unknown."""
_MOST_DECIMALS: Final = 6
"""Decimals of a time in us, at most; below a picosecond there is only float rounding."""
_TWO_DIGITS: Final = 100.0
"""Uncertainty from which it has two digits; a smaller one has one, or all before the decimal point."""


def known_decimals(number: float, uncertainty: float | None) -> int:
    """Decimals of a number that its uncertainty allows, below 0 for tens and hundreds.

    A number without uncertainty gets three digits.

    Examples
    --------
    >>> known_decimals(6764.2, 424.0), known_decimals(461.4, 56.8), known_decimals(73.31, 0.42)
    (-1, 0, 1)
    """
    if uncertainty and isfinite(uncertainty):
        place = floor(log10(uncertainty))
        return min(1 - place if uncertainty >= _TWO_DIGITS else max(0, -place), _MOST_DECIMALS)
    decimals = _UNKNOWN_DIGITS - 1 - floor(log10(abs(number))) if number else 0
    return min(max(0, decimals), _MOST_DECIMALS)


def known_text(number: float, uncertainty: float | None) -> str:
    """A number with as many digits as its uncertainty allows, never as a power of ten.

    Examples
    --------
    >>> known_text(6764.2, 424.0), known_text(370.4, 370.4), known_text(0.0123456, None)
    ('6760', '370', '0.0123')
    """
    decimals = known_decimals(number, uncertainty)
    return f"{round(number, decimals):.{max(0, decimals)}f}"


def period_value(period_us: float) -> ShownValue:
    """A communication period in s, ms or us, by its size.

    Examples
    --------
    >>> [with_unit(period_value(period_us)) for period_us in (4000.0, 250.0, 1234.5, 2e6)]
    ['4 ms', '250 us', '1.2345 ms', '2 s']
    """
    unit = "s" if period_us >= _SECOND_US else "ms" if period_us >= _MILLISECOND_US else "us"
    return ShownValue(period_us, "period_us", unit)


def period(period_us: float) -> str:
    """A communication period in s, ms or us, by its size, as text."""
    return with_unit(period_value(period_us))


def factor_of(value: ShownValue) -> float:
    """Factor from the unit of the key to the written unit. A key without a unit is in the written one.

    An unknown pair raises KeyError.
    """
    unit = unit_of(value.key)
    if unit == value.unit or not value.unit or (not unit and value.unit != "%"):
        return 1.0
    return _FACTORS[unit, value.unit]


def _number(value: ShownValue) -> str:
    factor = factor_of(value)
    number = value.value if factor == 1.0 else value.value * factor
    if isnan(number):
        return MISSING
    if value.unit == "um" and abs(number) < ROUNDING_UM:
        number = 0.0
    if value.decimals is not None:
        # Adding 0.0 turns -0.0 into 0.0.
        number = round(number, value.decimals) + 0.0 if value.fixed else number
        return decimals_of(number, value.decimals, signed=value.signed)
    sign, comma = "+" if value.signed and number > 0 else "", "," if value.grouped else ""
    return f"{number:{sign}{comma}.{value.digits or _DIGITS}g}"


def cell_text(cell: Cell) -> str:
    """A cell as plain text."""
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
    """A sentence as plain text."""
    return "".join(map(part_text, sentence.parts))


def part_text(part: Part) -> str:
    """A piece of a sentence as plain text, a figure with its unit."""
    return with_unit(part) if isinstance(part, ShownValue) else cell_text(part)


def sentence_line(sentence: Sentence) -> Line:
    """A sentence as a line. Words with a state are marked; without any, the line has the state of the sentence."""
    text, marks = "", list[Mark]()
    for part in sentence.parts:
        start, text = len(text), text + printable(part_text(part))
        if isinstance(part, ShownValue | Words) and part.state != "neutral":
            marks.append(Mark(start, len(text), part.state))
    return Line(text, "neutral" if marks else sentence.state, tuple(marks))


def shown_blocks(report: Report) -> Sequence[Block]:
    """Content of an answer for a page or a comment, without details unless it is whole."""
    blocks = report.blocks
    if report.is_whole:
        return list(_with_details(blocks))
    return [*_without_details(blocks, report.whole_by), *not_shown(report)]


def not_shown(report: Report) -> tuple[Sentence, ...]:
    """Last line of an answer that is not whole: the blocks left out, and the way to see them."""
    words = [] if report.is_whole else list(dict.fromkeys(_adds(report.blocks)))
    return (Sentence((f"Not shown: {listed(words, 'and')}. {report.whole_by}".rstrip(),)),) if words else ()


def _adds(blocks: Sequence[Block]) -> Iterator[str]:
    for block in blocks:
        if isinstance(block, Detail) and block.adds:
            yield block.adds
        elif isinstance(block, Chapter | Explorer):
            yield from _adds(block.blocks)


def _with_details(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Detail):
            yield from _with_details(block.blocks)
        elif isinstance(block, Card):
            yield block.whole
        elif isinstance(block, Chapter | Explorer):
            yield block._replace(blocks=tuple(_with_details(block.blocks)))
        else:
            yield block


def _without_details(blocks: Sequence[Block], whole_by: str) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Detail):
            yield from _without_details(block.instead, whole_by)
        elif isinstance(block, Chapter | Explorer):
            yield block._replace(blocks=tuple(_without_details(block.blocks, whole_by)))
        elif isinstance(block, Table):
            numbers = [number for number, column in enumerate(block.columns) if not column.is_detail]
            rows = tuple(
                row._replace(cells=tuple(row.cells[number] for number in numbers))
                for row in block.rows
                if not row.is_detail
            )
            heads = sum(number < block.heads for number in numbers)
            yield block._replace(columns=tuple(block.columns[number] for number in numbers), rows=rows, heads=heads)
            left_out = left_out_sentence(len(block.rows) - len(rows), whole_by=whole_by)
            yield from [Sentence((left_out,))] if left_out else []
        else:
            yield block


def left_out_sentence(rows: int, columns: Sequence[str] = (), *, whole_by: str) -> str:
    """Sentence on what a table leaves out, with the way to see it; empty for nothing.

    Examples
    --------
    >>> left_out_sentence(2, ["eq", "paper"], whole_by="--all shows all.")
    'Not shown: 2 rows; columns eq, paper. --all shows all.'
    """
    names = list(dict.fromkeys(columns))
    parts = [f"{rows} {nouns(rows, 'row')}"] if rows else []
    parts += [f"{nouns(len(names), 'column')} {', '.join(names)}"] if names else []
    return f"Not shown: {'; '.join(parts)}. {whole_by}".rstrip() if parts else ""
