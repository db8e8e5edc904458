"""An answer as lines of text: coloured for a terminal, plain for a pipe or a file."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, cast

from busplan.forms.blocks import (
    ALL_SHOWS,
    Block,
    Calculation,
    CalculationStep,
    Card,
    Chapter,
    Chart,
    Command,
    Detail,
    Facts,
    Question,
    Report,
    Sentence,
    ShownValue,
    Snippet,
    Table,
)
from busplan.forms.cards import card_lines
from busplan.forms.characters import drawing_lines
from busplan.forms.lines import BLANK, Line, plain_text, styled_text, wrapped
from busplan.forms.numbers import part_text, sentence_line, with_unit
from busplan.forms.text_tables import table_lines

WIDTH: Final = 80
"""Width of a drawing if there is no terminal, in columns."""


def text(report: Report, *, width: int | None = None, height: int | None = None, styled: bool = False) -> str:
    """Write an answer as lines of text.

    Parameters
    ----------
    report
        The answer.
    width
        Width of the terminal, in columns; None without one: then no line is wrapped and no table narrowed.
    height
        Lines of the terminal; where all of an answer does not fit, it may be its cards alone.
    styled
        If True, write the colours of a terminal.
    """
    blocks = [*report.blocks]
    last = max((number for number, block in enumerate(blocks) if isinstance(block, Card)), default=None)
    if last is not None and width is not None:
        card = cast("Card", blocks[last])
        names = ("next", *("" for _ in report.next_commands))
        commands = zip(names, (Sentence((command.line,)) for command in report.next_commands), strict=False)
        blocks[last] = card._replace(lines=(*card.lines, *commands))
    shown = [Chapter(report.title, tuple(blocks))] if report.is_page else blocks
    lines = [*block_lines(shown, width=width, is_whole=report.is_whole, whole_by=report.whole_by)]
    # The shell's prompt takes a line.
    folds = report.is_card_enough and not report.is_whole
    if folds and height is not None and last is not None and len(lines) >= height:
        lines = [*block_lines(blocks[: last + 1], width=width), Line("--all shows the figures behind it.")]
    return styled_text(lines) if styled else plain_text(lines)


def block_lines(
    blocks: Iterable[Block], *, width: int | None = None, is_whole: bool = False, whole_by: str = ALL_SHOWS
) -> Iterator[Line]:
    """Write blocks as lines, with blank lines around everything but sentences.

    Parameters
    ----------
    blocks
        The blocks.
    width
        Width of the terminal, in columns; None without one.
    is_whole
        If True, tables leave nothing out.
    whole_by
        Says how the reader sees what a table leaves out.
    """
    before: Block | None = None
    for block in blocks:
        lines = _lines(block, width, is_whole=is_whole, whole_by=whole_by)
        if not lines:
            continue
        if before is not None and not _belong(before, block):
            yield BLANK
        yield from lines
        before = block


def _belong(block: Block, following: Block) -> bool:
    """Whether no blank line separates two blocks."""
    return any(isinstance(block, kind) and isinstance(following, kind) for kind in (Sentence | Facts, Command))


def _lines(block: Block, width: int | None, *, is_whole: bool, whole_by: str) -> Sequence[Line]:
    match block:
        case Sentence():
            return wrapped(sentence_line(block), width)
        case Facts():
            facts = ", ".join(f"{name} {part_text(value)}" for name, value in block.items)
            return wrapped(Line(f"{facts}."), width) if facts else []
        case Table():
            lines = table_lines(block, width=width, is_whole=is_whole, whole_by=whole_by)
            return [*_caption(block.caption, width), *lines]
        case Chart():
            if not block.drawing.has_characters:
                return []
            drawn = drawing_lines(block.drawing, width or WIDTH)
            return [*_caption(block.caption, width), *(piece for line in drawn for piece in _drawn_lines(line, width))]
        case Command():
            return [Line(f"$ {block.line}", "drawn")]
        case Snippet():
            return [Line(line, "drawn") for line in block.lines]
        case Calculation():
            return [line for number, step in enumerate(block.steps, start=1) for line in _step(number, step, width)]
        case Question():
            head = Line(f"{block.question} {block.answer.text}", block.answer.state)
            inside: tuple[Block, ...] = (*block.sentences, block.facts)
            return [*wrapped(head, width), *block_lines(inside, width=width)]
        case Card():
            return card_lines(block, width)
        case Detail():
            return [*block_lines(block.blocks, width=width, is_whole=True)] if is_whole else []
        case Chapter():
            title = wrapped(sentence_line(block.title)._replace(tone="title"), width)
            return [*title, *block_lines(block.blocks, width=width, is_whole=is_whole, whole_by=whole_by)]


def _drawn_lines(line: Line, width: int | None) -> list[Line]:
    """A line of a drawing: words are wrapped, a label that reaches beyond the width is moved to the left."""
    if line.tone != "drawn":
        return wrapped(line, width)
    beyond = 0 if width is None else len(line.text) - width
    before, gap, label = line.text.rpartition(" " * (beyond + 1)) if beyond > 0 else ("", "", "")
    return [line._replace(text=f"{before} {label}") if gap else line]


def _caption(caption: Sentence | None, width: int | None) -> list[Line]:
    return wrapped(sentence_line(caption)._replace(tone="title"), width) if caption else []


_INDENT: Final = " " * 5
"""Before what is below the number of a step."""


def _step(number: int, step: CalculationStep, width: int | None) -> Iterator[Line]:
    """A line in symbols, one in numbers and one with the result; empty ones are left out."""
    head = f"{number:>3}  {step.reference:<13}  {step.symbol} "
    result = with_unit(step.result) if isinstance(step.result, ShownValue) else step.result.text
    distinct = (text for text in (step.formula, step.numbers, result) if text)
    if number > 1:
        yield BLANK
    if width is not None and len(head) > width // 2:
        yield from wrapped(Line(head.rstrip(), "drawn"), width, hang=len(_INDENT))
        head = _INDENT
    for at, line in enumerate(distinct):
        before = f"{head if at == 0 else ' ' * len(head)}= "
        yield from wrapped(Line(f"{before}{line}", "drawn"), width, hang=len(before))
