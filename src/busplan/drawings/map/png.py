"""A map as PNG. Importing this module needs the extra `plot` (matplotlib)."""

from io import BytesIO
from textwrap import wrap
from typing import Any, Final
from warnings import catch_warnings, simplefilter

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from busplan.analysis.map.cells import Cell
from busplan.analysis.map.trade_off import TradeOff
from busplan.drawings.map.labels import Looks, legend_of, look_of, looks_of, title_of, value_text
from busplan.forms.inks import INKS

_TITLE_CHARACTERS: Final = 100
_MOST_MARKED: Final = 32
"""Columns or rows up to which cells hold their mark and every value has its label."""


def map_png(found: TradeOff, *, title: str) -> bytes:
    """Draw a map with its scales, title and legend.

    Parameters
    ----------
    found
        The map.
    title
        Title: its message in a sentence.

    Returns
    -------
    bytes
        Content of the file. The same map always gives the same bytes.
    """
    looks = looks_of(found)
    buffer = BytesIO()
    # A dollar sign in a name starts no formula.
    with rc_context({"text.parse_math": False}):
        figure = Figure(figsize=(10.0, 2.6 + 0.24 * len(found.rows)), layout="constrained")
        figure.suptitle("\n".join(wrap(title, _TITLE_CHARACTERS)), fontsize=11)
        axes = figure.subplots()
        _cells(axes, found, looks)
        _scales(axes, found)
        figure.legend(handles=_legend(found, looks), loc="outside lower center", ncols=3, fontsize=9, frameon=False)
        with catch_warnings():
            # Letters that the font lacks become boxes; do not warn about each.
            simplefilter("ignore", UserWarning)
            figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _cells(axes: Any, found: TradeOff, looks: Looks) -> None:
    is_marked = max(len(found.rows), len(found.x.values)) <= _MOST_MARKED
    for number, row in enumerate(found.rows):
        for column, one in enumerate(row):
            if isinstance(one, Cell):
                look = look_of(one, looks)
                colour = INKS[look.ink].light
                corner = column - 0.5, number - 0.5
                axes.add_patch(Rectangle(corner, 1, 1, facecolor=colour, edgecolor="white", linewidth=0.8))
                if is_marked:
                    axes.text(column, number, look.mark, ha="center", va="center", fontsize=9, fontweight="bold")
    if found.own_place is not None:
        row_, column_ = found.own_place
        axes.add_patch(Rectangle((column_ - 0.5, row_ - 0.5), 1, 1, fill=False, edgecolor="black", linewidth=2.5))


def _scales(axes: Any, found: TradeOff) -> None:
    for direction, limits, ticks, label in (
        (found.x, axes.set_xlim, axes.set_xticks, axes.set_xlabel),
        (found.y, axes.set_ylim, axes.set_yticks, axes.set_ylabel),
    ):
        size = len(direction.values)
        places = range(0, size, 1 + (size - 1) // _MOST_MARKED)
        limits(-0.5, size - 0.5)
        ticks(places, [value_text(direction, direction.values[one]) for one in places], fontsize=9)
        label(title_of(direction, found.profile))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _legend(found: TradeOff, looks: Looks) -> list[Patch]:
    entries = [
        Patch(facecolor=INKS[entry.ink].light, label=f"{entry.letter}  {entry.text}")
        for entry in legend_of(found, looks)
    ]
    if found.own is not None:
        entries.append(Patch(facecolor="none", edgecolor="black", linewidth=2, label="this design"))
    if found.not_drawn:
        entries.append(Patch(facecolor="none", label="blank: cannot exist"))
    return entries
