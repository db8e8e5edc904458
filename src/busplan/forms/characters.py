"""Grids and lanes in ASCII characters, for text and Markdown."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from busplan.forms.charts import Cell, Drawing, Grid, Lane, Lanes, Panel, Ruler, Span, legend
from busplan.forms.lines import BLANK, Line, Mark, legend_lines
from busplan.forms.scale import placed

_BRACKETED: Final = 3
"""Columns of a cell with room for brackets."""
_OWN_ROW, _OWN_COLUMN = ">", "^"
_OWN: Final = f"{_OWN_ROW} and {_OWN_COLUMN}"
_NARROWEST: Final = 60
"""Least columns of lanes."""


def drawing_lines(drawing: Drawing, width: int) -> list[Line]:
    """Draw it, `width` columns wide, each mark as a character."""
    lines: list[Line] = []
    for panel in drawing.panels:
        lines += [*([BLANK] if lines else []), *_panel(panel, width)]
    return lines


def _panel(panel: Panel, width: int) -> Iterator[Line]:
    """A chart and its legend; bars that have a lane and a label each need none."""
    match panel.plot:
        case Grid():
            yield from (*_grid(panel.plot, width), BLANK)
        case Lanes():
            yield from _lanes(panel.title, panel.plot, max(width, _NARROWEST))
            if all(len(lane.spans) == 1 for lane in panel.plot.lanes):
                return
    marks = ((_OWN if entry.ink == "frame" else entry.mark, entry) for entry in legend([panel]))
    words = [f"{mark} {entry.words}".lstrip() for mark, entry in marks if entry.shape == "area"]
    yield from legend_lines(words, width=width)


def _grid(grid: Grid, width: int) -> Iterator[Line]:
    """A row of marks for each row of cells, the last on top."""
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


def _tones(row: Sequence[Cell | None], *, start: int, size: int) -> Iterator[Mark]:
    """Colours of runs of cells, on a terminal that has them."""
    for tone, run in groupby("neutral" if cell is None else cell.tone for cell in row):
        end = start + size * len(list(run))
        if tone != "neutral":
            yield Mark(start, end, tone)
        start = end


def _lanes(title: str, lanes: Lanes, width: int) -> Iterator[Line]:
    """A row for each lane; notes stand before the bars where these keep half of the width."""
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
    places = [((tick.at - ruler.low) / column, len(tick.label)) for tick in ruler.ticks]
    for number, start in placed(places, room=columns, gap=1).items():
        below = f"{below:<{int(start)}}{ruler.ticks[number].label}"
    yield Line(f"{ruler.label:<{gutter + 2}}{below.rstrip()}", "drawn")


def _cells(lane: Lane, ruler: Ruler, columns: int) -> str:
    """Fill each column with the mark that takes most of it, or a space."""
    size = (ruler.high - ruler.low) / columns
    shares: list[dict[str, float]] = [{} for _ in range(columns)]
    for span in lane.spans:
        for number, inside in _columns(span, ruler, columns, size=size):
            shares[number][span.entry.mark] = shares[number].get(span.entry.mark, 0.0) + inside
    return "".join(max(share, key=lambda mark: share[mark]) if share else " " for share in shares)


def _columns(span: Span, ruler: Ruler, columns: int, *, size: float) -> Iterator[tuple[int, float]]:
    """Columns that a bar touches, and how much of each it takes."""
    first, last = (min(columns - 1, max(0, int((end - ruler.low) / size))) for end in (span.start, span.end))
    # An overlap that is only float rounding is none.
    least = min(size, span.end - span.start) * 1e-6
    for number in range(first, last + 1):
        start = ruler.low + number * size
        inside = min(span.end, start + size) - max(span.start, start)
        if inside > least:
            yield number, inside
