"""A comparison in ASCII characters: a letter for each point of a kind of bus."""

from typing import Final

from busplan.forms.legend import legend_lines
from busplan.forms.lines import BLANK, Line
from busplan.questions.compare.kinds import KindComparison
from busplan.questions.compare.plane import Plane, axes_labels, kind_lines, own_axes, period_labels, plane_of

_ROWS: Final = 13
_WIDEST: Final = 78
_SEVERAL, _OWN, _OWN_PERIOD = "*", ".", "^"


def compare_lines(found: KindComparison, *, width: int) -> list[Line]:
    """Draw a letter where a kind of bus carries so many axes at a period.

    Parameters
    ----------
    found
        The comparison.
    width
        Width of the drawing, in columns.
    """
    plane, lines = plane_of(found), kind_lines(found)
    labels = {_row(plane, one): str(one) for one in axes_labels(plane)}
    gutter = max(map(len, labels.values()))
    columns = min(width, _WIDEST) - gutter - 3
    cells = [[" "] * columns for _ in range(_ROWS)]
    if own_axes(found):
        cells[_row(plane, own_axes(found))] = [_OWN] * columns
    for line in lines:
        for period_us, axes in line.points:
            place = _column(plane, period_us, columns)
            before = cells[_row(plane, axes)][place]
            cells[_row(plane, axes)][place] = line.letter if before in (" ", _OWN) else _SEVERAL
    drawn = [f"{labels.get(row, ''):>{gutter}} |{''.join(cells[row])}|" for row in reversed(range(_ROWS))]
    own = _column(plane, found.profile.cycle.period_us, columns)
    indent = " " * (gutter + 2)
    below = (" " * own + _OWN_PERIOD, _below(found, plane, columns))
    legend = [f"{line.letter} {line.title}" for line in lines]
    legend += [f"{_SEVERAL} several"] if any(_SEVERAL in row for row in cells) else []
    legend.append(f"{_OWN} and {_OWN_PERIOD} the axes and the period of this machine")
    return [
        *(Line(one, "drawn") for one in drawn),
        *(Line(f"{indent}{one}".rstrip(), "drawn") for one in below),
        BLANK,
        *legend_lines(legend, width=width),
    ]


def _row(plane: Plane, axes: int) -> int:
    return round((_ROWS - 1) * plane.y(axes))


def _column(plane: Plane, period_us: float, columns: int) -> int:
    return round((columns - 1) * plane.x(period_us))


def _below(found: KindComparison, plane: Plane, columns: int) -> str:
    """Periods below their columns, this machine's first, the others as far as there is room."""
    taken: dict[int, str] = {}
    own_us = found.profile.cycle.period_us
    for period_us, text in sorted(period_labels(found), key=lambda one: one[0] != own_us):
        start = min(max(0, _column(plane, period_us, columns) - len(text) // 2), columns - len(text))
        if all(start + len(text) < other or start > other + len(one) for other, one in taken.items()):
            taken[start] = text
    line = ""
    for start, text in sorted(taken.items()):
        line = f"{line:<{start}}{text}"
    return line
