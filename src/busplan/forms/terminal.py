"""An answer as lines of text: coloured for a terminal, plain for a pipe or a file."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from busplan.forms.blocks import (
    Block,
    Calculation,
    CalculationStep,
    Chapter,
    Chart,
    Command,
    Facts,
    Part,
    Question,
    Report,
    Sentence,
    ShownValue,
    Snippet,
    Table,
)
from busplan.forms.columns import cell_text, sentence_text, table_lines
from busplan.forms.lines import BLANK, Line, plain_text, styled_text
from busplan.forms.numbers import with_unit

WIDTH: Final = 80
"""Width of a drawing if there is no terminal, in columns."""


def text(report: Report, *, width: int = WIDTH, styled: bool = False) -> str:
    """Write an answer as lines of text.

    Parameters
    ----------
    report
        The answer.
    width
        Width of drawings, in columns.
    styled
        If True, write the colours of a terminal.
    """
    blocks = [Chapter(report.title, tuple(report.blocks()))] if report.is_page else report.blocks()
    lines = block_lines(blocks, width=width)
    return styled_text(lines) if styled else plain_text(lines)


def block_lines(blocks: Iterable[Block], *, width: int = WIDTH) -> Iterator[Line]:
    """Write blocks as lines, with blank lines around everything but sentences.

    Parameters
    ----------
    blocks
        The blocks.
    width
        Width of drawings, in columns.
    """
    before: Block | None = None
    for block in blocks:
        lines = _lines(block, width)
        if not lines:
            continue
        if before is not None and not _belong(before, block):
            yield BLANK
        yield from lines
        before = block


def _belong(one: Block, other: Block) -> bool:
    """Whether no blank line separates two blocks."""
    return any(isinstance(one, kind) and isinstance(other, kind) for kind in (Sentence | Facts, Command))


def _lines(block: Block, width: int) -> Sequence[Line]:
    match block:
        case Sentence():
            return [Line(sentence_text(block), block.state)]
        case Facts():
            facts = ", ".join(f"{name} {_part(value)}" for name, value in block.items)
            return [Line(f"{facts}.")] if facts else []
        case Table():
            return [*_caption(block.caption), *table_lines(block)]
        case Chart():
            drawn = block.drawing.characters(width)
            return [*_caption(block.caption), *drawn] if drawn else []
        case Command():
            return [Line(f"$ {block.line}", "drawn")]
        case Snippet():
            return [Line(line, "drawn") for line in block.lines]
        case Calculation():
            return [line for number, step in enumerate(block.steps, start=1) for line in _step(number, step)]
        case Question():
            head = Line(f"{block.question} {block.answer.text}", block.answer.state)
            return [head, *block_lines((*block.sentences, block.facts), width=width)]
        case Chapter():
            return [Line(sentence_text(block.title), "title"), *block_lines(block.blocks, width=width)]


def _caption(caption: Sentence | None) -> list[Line]:
    return [Line(sentence_text(caption), "title")] if caption else []


def _part(part: Part) -> str:
    return with_unit(part) if isinstance(part, ShownValue) else cell_text(part)


def _step(number: int, step: CalculationStep) -> Iterator[Line]:
    """A line in symbols, one in numbers and one with the result; empty ones are left out."""
    head = f"{number:>3}  {step.reference:<13}  {step.symbol} "
    result = with_unit(step.result) if isinstance(step.result, ShownValue) else step.result.text
    distinct = (text for text in (step.formula, step.numbers, result) if text)
    if number > 1:
        yield BLANK
    for at, line in enumerate(distinct):
        yield Line(f"{head if at == 0 else ' ' * len(head)}= {line}", "drawn")
