"""A comparison as PNG. Importing this module needs the extra `plot` (matplotlib)."""

from io import BytesIO
from textwrap import wrap
from typing import Any, Final
from warnings import catch_warnings, simplefilter

from matplotlib import rc_context
from matplotlib.figure import Figure

from busplan.analysis.comparison.kinds import KindComparison
from busplan.drawings.compare.plane import KindLine, axes_labels, kind_lines, own_axes, period_labels, plane_of
from busplan.forms.inks import INKS

_TITLE_CHARACTERS: Final = 100


def compare_png(found: KindComparison, *, title: str) -> bytes:
    """Draw the most axes over the period, with scales, title and legend.

    Parameters
    ----------
    found
        The comparison.
    title
        Title: its message in a sentence.

    Returns
    -------
    bytes
        Content of the file. The same comparison always gives the same bytes.
    """
    buffer = BytesIO()
    # A dollar sign in a name starts no formula.
    with rc_context({"text.parse_math": False}):
        figure = Figure(figsize=(9.0, 5.4), layout="constrained")
        figure.suptitle("\n".join(wrap(title, _TITLE_CHARACTERS)), fontsize=11)
        axes: Any = figure.subplots()
        _scales(axes, found)
        for line in kind_lines(found):
            _line(axes, line)
        # Behind the lines, which have 2.
        own = {"color": "black", "linewidth": 1.0, "linestyle": ":", "zorder": 1.5}
        axes.axvline(found.profile.cycle.period_us, label="this machine", **own)
        if own_axes(found):
            axes.axhline(own_axes(found), **own)
        figure.legend(loc="outside lower center", ncols=3, fontsize=9, frameon=False)
        with catch_warnings():
            # Letters that the font lacks become boxes; do not warn about each.
            simplefilter("ignore", UserWarning)
            figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _line(axes: Any, line: KindLine) -> None:
    colour, periods_us = INKS[line.ink].light, [us for us, _ in line.points]
    counts = [each for _, each in line.points]
    label = f"{line.letter}  {line.title}"
    axes.plot(periods_us, counts, color=colour, marker="o", markersize=12, linewidth=2.0, label=label)
    for period_us, count in line.points:
        letter = {"ha": "center", "va": "center", "color": "white", "fontsize": 8, "fontweight": "bold"}
        axes.text(period_us, count, line.letter, **letter)


def _scales(axes: Any, found: KindComparison) -> None:
    plane = plane_of(found)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(plane.from_us / 1.1, plane.to_us * 1.1)
    axes.set_ylim(0.9, plane.top_axes * 1.2)
    labels = period_labels(found)
    axes.set_xticks([us for us, _ in labels], [text for _, text in labels], fontsize=9)
    axes.set_yticks(axes_labels(plane), [str(one) for one in axes_labels(plane)], fontsize=9)
    axes.minorticks_off()
    axes.set_xlabel("period")
    axes.set_ylabel("most axes that are shown to fit")
    axes.grid(visible=True, linewidth=0.4, color="0.85")
    axes.set_axisbelow(True)
