"""An answer as lines of text, coloured for a terminal, plain for a pipe or a file."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Final, cast

from busplan.english import printable
from busplan.forms import charts
from busplan.forms.blocks import (
    Block,
    Calculation,
    CalculationStep,
    Card,
    Chapter,
    Chart,
    Command,
    Detail,
    Explorer,
    Gauge,
    Report,
    Sentence,
    ShownValue,
    Snippet,
    Table,
)
from busplan.forms.lines import BLANK, Line, Mark, legend_lines, plain_text, styled_text, wrapped
from busplan.forms.numbers import not_shown, sentence_line, with_unit
from busplan.forms.scale import placed
from busplan.forms.text_table import table_lines

_WIDTH: Final = 80
"""Width of a card and of a drawing without a terminal, and largest width of a card [columns]."""
_CARD_INDENT: Final = "  "
_LABEL: Final = 18
"""Column at which the words of a line begin."""
_GAP: Final = 2
"""Blanks between subject and verdict, at least."""


def _card_lines(card: Card, width: int | None) -> list[Line]:
    """A card as lines, in the width of the terminal if there is one."""
    room = min(width or _WIDTH, _WIDTH)
    lines = [*_head(card, room), *([_bar(card.gauge, room)] if card.gauge else [])]
    for label, words in card.lines:
        line = sentence_line(words)
        before = f"{_CARD_INDENT}{label:<{_LABEL - len(_CARD_INDENT) - 1}} "
        marks = tuple(Mark(mark.start + len(before), mark.end + len(before), mark.tone) for mark in line.marks)
        lines += wrapped(Line(f"{before}{line.text}", line.tone, marks), room if width else None, hang=_LABEL)
    return lines


def _head(card: Card, width: int) -> list[Line]:
    """Subject on the left and verdict on the right, or below each other if they need more than a line."""
    subject, verdict = sentence_line(card.subject).text, printable(card.verdict.text)
    gap = width - len(subject) - len(verdict)
    if gap < _GAP:
        return [
            *wrapped(Line(subject, "title"), width),
            *wrapped(Line(f"{_CARD_INDENT}{verdict}", card.verdict.state), width),
        ]
    start = len(subject) + gap
    marks = (Mark(0, len(subject), "title"), Mark(start, start + len(verdict), card.verdict.state))
    return [Line(f"{subject}{' ' * gap}{verdict}", "neutral", marks)]


def _bar(gauge: Gauge, width: int) -> Line:
    """A bar of the period: # used, ~ in doubt, . free, r to stay free; the cycle may use it up to |."""
    cells = width - len(_CARD_INDENT) - 2
    marks = list[Mark]()
    text = ""
    for part in gauge.parts():
        before = len(text)
        text += part.letter * (round(part.end * cells) - len(text))
        marks.append(Mark(len(_CARD_INDENT) + 1 + before, len(_CARD_INDENT) + 1 + len(text), part.state))
    end = round(gauge.most * cells)
    if end < cells:
        text = f"{text[:end]}|{text[end + 1 :]}"
    return Line(f"{_CARD_INDENT}[{text}]", "drawn", tuple(marks))


_BRACKETED: Final = 3
"""Columns of a cell with room for brackets."""
_OWN_ROW, _OWN_COLUMN = ">", "^"
_OWN: Final = f"{_OWN_ROW} and {_OWN_COLUMN}"
_NARROWEST: Final = 60
"""Columns of lanes, at least."""


def drawing_lines(drawing: charts.Drawing, width: int) -> list[Line]:
    """A drawing in characters, `width` columns wide."""
    lines: list[Line] = []
    for panel in drawing.panels:
        lines += [*([BLANK] if lines else []), *_panel(panel, width)]
    return lines


def _panel(panel: charts.Panel, width: int) -> Iterator[Line]:
    """A chart and its legend. Bars with a lane and a label each need none."""
    match panel.plot:
        case charts.ChartGrid():
            yield from (*_grid(panel.plot, width), BLANK)
        case charts.Lanes():
            yield from _lanes(panel.title, panel.plot, max(width, _NARROWEST))
            if all(len(lane.spans) == 1 for lane in panel.plot.lanes):
                return
    marks = ((_OWN if entry.ink == "frame" else entry.mark, entry) for entry in charts.legend([panel]))
    words = [f"{mark} {entry.words}".lstrip() for mark, entry in marks if entry.shape == "area"]
    yield from legend_lines(words, width=width)


def _grid(grid: charts.ChartGrid, width: int) -> Iterator[Line]:
    """Marks of a grid, one line for each row of cells, the last row on top."""
    names, labels = ([tick.label for tick in ruler.ticks] for ruler in (grid.across, grid.up))
    gutter = 2 + max(map(len, labels))
    size = max(1, min(max(_BRACKETED, *(len(name) + 1 for name in names)), (width - gutter - 3) // len(names)))
    own_column, own_row = (None, None) if grid.own is None else map(int, grid.own)
    for number, (label, row) in reversed(list(enumerate(zip(labels, grid.rows, strict=True)))):
        head = f"{_OWN_ROW if number == own_row else '':<2}{label:>{gutter - 2}} |"
        texts = [f"{'' if cell is None else cell.mark:^{size}}" for cell in row]
        if number == own_row and own_column is not None and size >= _BRACKETED:
            texts[own_column] = f"{f'[{texts[own_column].strip()}]':^{size}}"
        yield Line(f"{head}{''.join(texts)}|", "drawn", tuple(_tones(row, start=len(head), size=size)))
    indent = " " * (gutter + 2)
    if own_column is not None:
        yield Line(f"{indent}{' ' * ((size - 1) // 2 + own_column * size)}{_OWN_COLUMN}", "drawn")
    places = [((number + 0.5) * size, len(name)) for number, name in enumerate(names)]
    below = ""
    for number, start in placed(places, room=size * len(names), gap=1, own=own_column).items():
        below = f"{below:<{int(start)}}{names[number]}"
    yield Line(f"{indent}{below}".rstrip(), "drawn")


def _tones(row: Sequence[charts.ChartCell | None], *, start: int, size: int) -> Iterator[Mark]:
    """Colours of runs of equal cells, for a terminal."""
    for tone, run in groupby("neutral" if cell is None else cell.tone for cell in row):
        end = start + size * len(list(run))
        if tone != "neutral":
            yield Mark(start, end, tone)
        start = end


def _lanes(title: str, lanes: charts.Lanes, width: int) -> Iterator[Line]:
    """Lines of lanes; notes are before the bars if these keep half of the width."""
    labels = max(len(lane.label) for lane in lanes.lanes)
    notes = max(len(lane.note) for lane in lanes.lanes)
    gutter = labels + 2 + notes if notes and labels + notes + 5 <= width / 2 else labels
    columns, ruler = width - gutter - 3, lanes.across
    column = (ruler.high - ruler.low) / columns
    yield Line(f"{title}, {column:.3g} {ruler.label} a column", "heading")
    for lane in lanes.lanes:
        note = f"  {lane.note:>{notes}}" if gutter > labels else ""
        yield Line(f"{lane.label:<{labels}}{note} |{_cells(lane, ruler, columns)}|", "drawn")
    below = ""
    places = [(columns * ruler.share(tick.at), len(tick.label)) for tick in ruler.ticks]
    for number, start in placed(places, room=columns, gap=1).items():
        below = f"{below:<{int(start)}}{ruler.ticks[number].label}"
    yield Line(f"{ruler.label:<{gutter + 2}}{below.rstrip()}", "drawn")


def _cells(lane: charts.Lane, ruler: charts.Ruler, columns: int) -> str:
    """Characters of a lane. Each column has the mark that takes most of it, or a space."""
    size = (ruler.high - ruler.low) / columns
    parts: list[dict[str, float]] = [{} for _ in range(columns)]
    for span in lane.spans:
        first, last = (min(columns - 1, max(0, int((end - ruler.low) / size))) for end in (span.start, span.end))
        # An overlap of float rounding alone is none.
        least = min(size, span.end - span.start) * 1e-6
        for number in range(first, last + 1):
            start = ruler.low + number * size
            inside = min(span.end, start + size) - max(span.start, start)
            if inside > least:
                parts[number][span.entry.mark] = parts[number].get(span.entry.mark, 0.0) + inside
    return "".join(max(part, key=lambda mark: part[mark]) if part else " " for part in parts)


def text(report: Report, *, width: int | None = None, styled: bool = False) -> str:
    """An answer as lines of text, `styled` in the colours of a terminal.

    `width` is that of the terminal [columns]; for None, no line is wrapped and no table narrowed.
    """
    blocks = [*report.blocks]
    last = max((number for number, block in enumerate(blocks) if isinstance(block, Card)), default=None)
    if last is not None and width is not None:
        card = cast("Card", blocks[last])
        names = ("next", *("" for _ in report.next_commands))
        commands = zip(names, (Sentence((command.line,)) for command in report.next_commands), strict=False)
        blocks[last] = card._replace(lines=(*card.lines, *commands))
    blocks += not_shown(report)
    shown = [Chapter(report.title, tuple(blocks))] if report.is_page else blocks
    lines = [*block_lines(shown, width=width, is_whole=report.is_whole, whole_by=report.whole_by)]
    return styled_text(lines) if styled else plain_text(lines)


def block_lines(
    blocks: Iterable[Block], *, width: int | None = None, is_whole: bool = False, whole_by: str = ""
) -> Iterator[Line]:
    """Blocks as lines, with blank lines around everything but sentences.

    `width` is that of the terminal [columns], None without one. Tables leave nothing out of a whole answer; `whole_by`
    is the advice on seeing what they leave out of others.
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
    return any(isinstance(block, kind) and isinstance(following, kind) for kind in (Sentence, Command))


def _lines(block: Block, width: int | None, *, is_whole: bool, whole_by: str) -> Sequence[Line]:
    match block:
        case Sentence():
            return wrapped(sentence_line(block), width)
        case Table():
            lines = table_lines(block, width=width, is_whole=is_whole, whole_by=whole_by)
            return [*_caption(block.caption, width), *lines]
        case Chart():
            if not block.drawing.has_characters:
                return []
            drawn = drawing_lines(block.drawing, width or _WIDTH)
            return [*_caption(block.caption, width), *(piece for line in drawn for piece in _drawn_lines(line, width))]
        case Command():
            return [Line(f"$ {block.line}", "drawn")]
        case Snippet():
            return [Line(line, "drawn") for line in block.lines]
        case Calculation():
            return [line for number, step in enumerate(block.steps, start=1) for line in _step(number, step, width)]
        case Card():
            return _card_lines(block.whole if is_whole else block, width)
        case Detail():
            blocks = block.blocks if is_whole else block.instead
            return [*block_lines(blocks, width=width, is_whole=is_whole, whole_by=whole_by)]
        case Chapter() | Explorer():
            title = _caption(block.title if isinstance(block, Chapter) else None, width)
            return [*title, *block_lines(block.blocks, width=width, is_whole=is_whole, whole_by=whole_by)]


def _drawn_lines(line: Line, width: int | None) -> list[Line]:
    """Lines of a line in a drawing: words are wrapped, and a label beyond the width moves to the left."""
    if line.tone != "drawn":
        return wrapped(line, width)
    beyond = 0 if width is None else len(line.text) - width
    before, gap, label = line.text.rpartition(" " * (beyond + 1)) if beyond > 0 else ("", "", "")
    return [line._replace(text=f"{before} {label}") if gap else line]


def _caption(caption: Sentence | None, width: int | None) -> list[Line]:
    return wrapped(sentence_line(caption)._replace(tone="title"), width) if caption else []


_INDENT: Final = " " * 5
"""Indent of the lines below the number of a step."""


def _step(number: int, step: CalculationStep, width: int | None) -> Iterator[Line]:
    """Lines of a step in symbols, in numbers and with the result; empty ones are left out."""
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
