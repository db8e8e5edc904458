"""An answer as Markdown, for a repository page or a comment; text from profiles is escaped."""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Final

from busplan.english import printable
from busplan.forms.blocks import (
    Block,
    Calculation,
    Card,
    Cell,
    Chapter,
    Chart,
    Code,
    Command,
    Explorer,
    Part,
    Report,
    SectionLink,
    Sentence,
    ShownValue,
    Snippet,
    Swatch,
    Table,
    Words,
)
from busplan.forms.lines import plain_text
from busplan.forms.numbers import cell_text, part_text, shown_blocks, with_unit
from busplan.forms.terminal import drawing_lines

_INSIDE: Final = re.compile(r"[\\`*_\[\]<>~&@:$]|(?<=www)\.")
"""Markup inside a line, and characters that turn words into a link, a mention or a formula."""
_AT_START: Final = re.compile(r"^(\d*)([-+#=.)])(?=\s|$|[-=#])")
"""Markup at the start of a line: a list, a heading or a rule."""

BAR: Final = r"\|"
"""Escaped bar in a cell. Code needs it, too, because Markdown splits a table into cells first."""


def escaped(text: str) -> str:
    r"""Text with Markdown escaped.

    Examples
    --------
    >>> escaped("a *b*")
    'a \\*b\\*'
    """
    return _AT_START.sub(r"\1\\\2", _INSIDE.sub(r"\\\g<0>", printable(" ".join(text.split()))))


def code(text: str) -> str:
    """Inline code of a text; line ends become spaces, and control characters are escaped.

    Examples
    --------
    >>> code("bus.nodes"), code("a ` b")
    ('`bus.nodes`', '`` a ` b ``')
    """
    line = printable(" ".join(text.split()))
    longest = max(map(len, re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    # A backtick at an edge would join the fence.
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}" if line else "` `"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, left: int | Sequence[bool]) -> list[str]:
    r"""Lines of a table; headings and cells are Markdown, and bars in cells are escaped here.

    `left` tells left-aligned columns: one flag each, or their number from the first. Others are right-aligned.

    Examples
    --------
    >>> table(["name", "us"], [["`a | b`", "1"]], left=1)[-1]
    '| `a \\| b` | 1 |'
    """
    words = [number < left for number in range(len(headings))] if isinstance(left, int) else left
    rule = [":---" if is_words else "---:" for is_words in words]
    return [f"| {' | '.join(cell.replace('|', BAR) for cell in row)} |" for row in (headings, rule, *rows)]


_TEXT_WIDTH: Final = 80
"""Width of a drawing in characters [columns]."""
_COMMENT_LEVEL: Final = 3
"""Title level of an answer inside a page, such as a comment on a change."""


def text(report: Report) -> str:
    """Markdown of an answer."""
    blocks = shown_blocks(report)
    level = 1 if report.is_page else _COMMENT_LEVEL
    lines = (f"{'#' * level} {_sentence(report.title)}", *_blocks(blocks, level=level + 1))
    return "\n".join(lines) + "\n"


def _blocks(blocks: Sequence[Block], *, level: int) -> Iterator[str]:
    """Lines of blocks, each after a blank line; neighbouring commands are one listing."""
    for are_commands, run in groupby(blocks, key=lambda block: isinstance(block, Command)):
        if are_commands:
            yield from ("", "```sh", *(command.line for command in run if isinstance(command, Command)), "```")
            continue
        for block in run:
            lines = list(_lines(block, level=level))
            yield from ("", *lines) if lines else ()


def _lines(block: Block, *, level: int) -> Iterator[str]:
    match block:
        case Sentence():
            words = _sentence(block)
            yield f"**{words}**" if block.state in ("passes", "fails") else words
        case Table():
            yield from _caption(block.caption)
            yield from _table(block)
        case Chart():
            yield from _chart(block)
        case Snippet():
            yield from ("```toml", *block.lines, "```")
        case Calculation():
            yield from _steps(block)
        case Card():
            yield from (f"{_sentence(block.subject)}: **{escaped(block.verdict.text)}**", "")
            rows = ([escaped(label), _cell(words)] for label, words in block.lines)
            yield from table([" ", " "], rows, left=2)
        case Chapter():
            yield from (f'<a id="{block.key}"></a>', "") if block.key else ()
            yield f"{'#' * level} {_sentence(block.title)}"
            yield from _blocks(block.blocks, level=level + 1)
        case Explorer():
            yield from _blocks(block.blocks, level=level)
        case Command():
            yield code(block.line)


def _chart(chart: Chart) -> Iterator[str]:
    """A drawing in characters, or else its content in words."""
    if chart.drawing.has_characters:
        drawn = plain_text(drawing_lines(chart.drawing, _TEXT_WIDTH)).splitlines()
        yield from (*_caption(chart.caption), "```text", *drawn, "```")
    else:
        yield f"{_sentence(chart.caption).removesuffix('.')}."


def _caption(caption: Sentence | None) -> tuple[str, ...]:
    return (f"{_sentence(caption).removesuffix('.')}:", "") if caption else ()


def _sentence(sentence: Sentence) -> str:
    # Text and figures are escaped together, because markup may span both; code is escaped by itself.
    pieces: list[str] = []
    for is_code, run in groupby(sentence.parts, key=lambda part: isinstance(part, Code)):
        if is_code:
            pieces += map(_part, run)
        else:
            words = "".join(map(part_text, run))
            before, after = (" " if words[at : at + 1].isspace() else "" for at in (0, len(words) - 1))
            pieces.append(f"{before}{escaped(words)}{after}")
    return "".join(pieces).strip()


def _part(part: Part) -> str:
    match part:
        case Code():
            return code(part.text)
    return escaped(part_text(part))


def _table(block: Table) -> list[str]:
    # Columns of drawings are left out, since another column has the figure.
    shown = [number for number, column in enumerate(block.columns) if column.kind != "drawing"]
    columns = [block.columns[number] for number in shown]
    headings = [
        escaped(", ".join(filter(None, (" ".join(filter(None, (column.group, column.heading))), column.unit)))) or " "
        for column in columns
    ]
    rows = ([_in_row(_cell(row.cells[number]), highlighted=row.highlighted) for number in shown] for row in block.rows)
    return table(headings, rows, left=[column.kind == "words" for column in columns])


def _in_row(words: str, *, highlighted: bool) -> str:
    return f"**{words}**" if highlighted and words and not words.startswith("**") else words


def _cell(cell: Cell) -> str:
    match cell:
        case ShownValue() | Words() | Sentence():
            words = _sentence(cell) if isinstance(cell, Sentence) else escaped(cell_text(cell))
            return f"**{words}**" if cell.state == "fails" and words else words
        case SectionLink():
            origin = "" if cell.origin == cell.text else f" {code(cell.origin)}"
            return f"[{code(cell.text)}](#{cell.key}){origin}"
        case Command() | Code():
            return code(cell_text(cell))
        case Swatch():
            # The mark stands for a colour, which Markdown does not have.
            return escaped(cell.text)
    return escaped(cell_text(cell))


def _steps(steps: Calculation) -> list[str]:
    rows = (
        [
            str(number),
            escaped(step.reference),
            code(f"{step.symbol} = {step.formula}" if step.formula else step.symbol),
            code(step.numbers) if step.numbers else "",
            escaped(with_unit(step.result) if isinstance(step.result, ShownValue) else step.result.text),
        ]
        for number, step in enumerate(steps.steps, start=1)
    )
    return table(["step", "eq", "formula", "numbers", "result"], rows, left=4)
