"""The circle test as a matplotlib figure, as in ballbar reports. Needs the extra `plot`."""

from io import BytesIO
from textwrap import fill
from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError
from busplan.extras import require_matplotlib
from busplan.forms.numbers import period

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from busplan.analysis.circle.roundness import CircleTest

PLOT_FORMATS: Final = ("png", "svg", "pdf")
_NAME_WIDTH: Final = 60
"""Longest line of a name, in characters: even of wide ones it fits the figure."""
_TITLE_WIDTH: Final = 110


def circle_figure(test: "CircleTest", *, file_format: str, note: str = "") -> bytes:
    """Draw the circle test into a file.

    Parameters
    ----------
    test
        The circle test.
    file_format
        One of `PLOT_FORMATS`.
    note
        What the title says besides the profile's name.

    Returns
    -------
    bytes
        Content of the file. The same test always gives the same bytes.

    Raises
    ------
    BusplanError
        matplotlib is not installed, or no period was simulated.
    """
    require_matplotlib("--plot")
    from matplotlib import rc_context

    buffer = BytesIO()
    # A fixed salt makes the ids of an SVG reproducible.
    with rc_context({"svg.hashsalt": "busplan"}):
        draw_test(test, note=note).savefig(buffer, format=file_format, dpi=120, metadata=metadata(file_format))
    return buffer.getvalue()


def metadata(file_format: str) -> dict[str, None]:
    """Metadata without a date, so that the same test gives the same bytes."""
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(file_format, {})


def draw_test(test: "CircleTest", *, note: str = "") -> "Figure":
    """Draw a row for each simulated period: the magnified circle, the error over time, and error sources if ranked.

    Parameters
    ----------
    test
        The circle test.
    note
        What the title says besides the profile's name.

    Returns
    -------
    Figure
        A figure of matplotlib. All rows have the same scales.

    Raises
    ------
    BusplanError
        No period was simulated.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from busplan.drawings.circle_panels import draw_errors, draw_ranking
    from busplan.drawings.circle_polar import draw_circle
    from busplan.drawings.circle_rows import circle_rows, common_scales

    rows = circle_rows(test)
    if not rows:
        raise BusplanError("--plot: nothing to draw, no period fits the bus")
    scales = common_scales(rows, test.profile.tolerance)
    ranked = any(row.result.contributions for row in rows)
    # A dollar sign in a name starts no formula.
    with rc_context({"text.parse_math": False}):
        figure = Figure(figsize=(15.5 if ranked else 11.0, 4.6 * len(rows) + 1.0), layout="constrained")
        ratios = (1, 1.4, 0.8) if ranked else (1, 1.4)
        panels = figure.subplots(len(rows), len(ratios), squeeze=False, width_ratios=ratios)
        figure.suptitle(_title(test, note))
        for (polar, over_time, *ranking), row in zip(panels, rows, strict=True):
            draw_circle(polar, row, scales)
            draw_errors(over_time, row, scales)
            for axes in ranking:
                draw_ranking(axes, row, rows, scales)
        _legend(figure, columns=5 if ranked else 3)
    return figure


def _title(test: "CircleTest", note: str) -> str:
    """Name, note, grade of the servo values, and the periods that are not drawn."""
    first = test.results[0]
    servo = "ideal drive" if first.ideal_drive else f"servo values: {test.profile.servo.grades_text}"
    missing = [period(one.period_us) for one, run in zip(test.results, test.runs, strict=True) if run is None]
    without = f"not drawn, for the bus does not carry it: {', '.join(missing)}" if missing else ""
    lines = (fill(line, _TITLE_WIDTH) for line in (note, f"circle test, {servo}", without) if line)
    return "\n".join((fill(test.profile.name, _NAME_WIDTH), *lines))


def _legend(figure: "Figure", *, columns: int) -> None:
    """Explain each kind of line once, below all rows."""
    kinds: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            kinds.setdefault(label, handle)
    figure.legend(
        list(kinds.values()), list(kinds), loc="outside lower center", ncols=columns, frameon=False, fontsize=9
    )
