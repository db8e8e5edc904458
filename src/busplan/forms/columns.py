"""Cells and sentences as plain text."""

from busplan.forms.blocks import Bar, Cell, Part, Sentence, ShownValue, Swatch, Words
from busplan.forms.lines import Line, Mark
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
    return "".join(map(part_text, sentence.parts))


def part_text(part: Part) -> str:
    """Write a piece of a sentence as plain text, a figure with its unit."""
    return with_unit(part) if isinstance(part, ShownValue) else cell_text(part)


def sentence_line(sentence: Sentence) -> Line:
    """Write a sentence as one line: its words of a state are marked, or all of it where no word has one."""
    text, marks = "", list[Mark]()
    for part in sentence.parts:
        start, text = len(text), text + printable(part_text(part))
        if isinstance(part, ShownValue | Words) and part.state != "neutral":
            marks.append(Mark(start, len(text), part.state))
    return Line(text, "neutral" if marks else sentence.state, tuple(marks))
