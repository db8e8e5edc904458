"""A timeline as PNG. Importing this module needs the extra `plot` (matplotlib)."""

from io import BytesIO
from textwrap import wrap
from typing import Any, Final
from warnings import catch_warnings, simplefilter

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from busplan.analysis.timeline.schedule import SHARE, TOTAL, Event, Schedule, Total, totals
from busplan.drawings.timeline.kinds import kind_of
from busplan.drawings.timeline.lanes import (
    Lane,
    beyond,
    charged,
    drawn_window,
    event_lanes,
    has_event_lanes,
    node_lanes,
    overruns,
    shows_overrun,
    stretches,
    time_text,
)
from busplan.drawings.timeline.period import BEYOND, LEFT, NEEDED, REST, model_bars, period_end_us, period_title, rest
from busplan.forms.blocks import figure_value
from busplan.forms.columns import sentence_text
from busplan.forms.inks import INKS
from busplan.forms.numbers import with_unit

_OVER: Final = "#b3261e"
_REST: Final = "#f4f6f8"
_PERIOD_COLOURS: Final = {NEEDED: INKS["long-gap"].light, LEFT: INKS["fits"].light, BEYOND: _OVER, REST: _REST}
_TITLE_CHARACTERS: Final = 110
_LANE_INCHES: Final = 0.28
_MOST_LANE_INCHES: Final = 60.0
"""Largest height of all lanes: very many become thin."""


def timeline_png(plan: Schedule, *, title: str) -> bytes:
    """Draw the period as a strip, the margin of each timing model, the window in lanes, and a legend with totals.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    title
        Title: its message in a sentence.

    Returns
    -------
    bytes
        Content of the file. The same schedule always gives the same bytes.
    """
    window = drawn_window(plan)
    lanes = _lanes(window)
    lane_inches = min(_LANE_INCHES * len(lanes) + 0.6, _MOST_LANE_INCHES)
    buffer = BytesIO()
    # A dollar sign in a name starts no formula.
    with rc_context({"text.parse_math": False}):
        figure = Figure(figsize=(11.0, lane_inches + 3.5), layout="constrained")
        strip, area = figure.subplots(2, 1, height_ratios=(1.3, lane_inches))
        head = "\n".join(wrap(title, _TITLE_CHARACTERS))
        figure.suptitle(head, fontsize=11, color="black" if plan.figures.fits else _OVER)
        _strip(strip, plan, window)
        _draw(area, lanes, window)
        figure.legend(handles=_legend(plan), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        with catch_warnings():
            # Letters that the font lacks become boxes; do not warn about each.
            simplefilter("ignore", UserWarning)
            figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _lanes(window: Schedule) -> tuple[Lane, ...]:
    if not has_event_lanes(window):
        return node_lanes(window)
    return tuple(
        lane._replace(label=f"{lane.label}, {time_text(lane.events[0].duration_us)} us") for lane in event_lanes(window)
    )


def _colour(plan: Schedule, kind: str) -> str:
    return INKS[kind_of(plan.profile, kind).ink].light


def _bar(axes: Any, event: Event, *, lane: float, colour: str, height: float = 0.8) -> None:
    # Without snapping to pixels, bars of a few pixels keep their width.
    span = (event.start_us, event.duration_us)
    axes.broken_barh([span], (lane - height / 2, height), facecolors=colour, linewidth=0, snap=False)


def _strip(axes: Any, plan: Schedule, window: Schedule) -> None:
    """Draw the whole period as one bar, transaction by transaction, and one for each timing model."""
    parts, bars, behind = stretches(plan.cycle_events), model_bars(plan), rest(plan)
    for one in parts:
        _bar(axes, one.event, lane=0.0, colour=_colour(plan, one.kind))
    if window.from_us > 0 or window.to_us < plan.end_us:
        corner, size = (window.from_us, -0.5), (window.to_us - window.from_us, 1.0)
        axes.add_patch(Rectangle(corner, *size, fill=False, linewidth=1.5))
    for number, bar in enumerate(bars, start=1):
        for part in bar.spans:
            span = plan.cycle_events[0]._replace(start_us=part.start_us, end_us=part.end_us)
            _bar(axes, span, lane=number, colour=_PERIOD_COLOURS[part.label])
    if overruns(plan):
        _over(axes, plan)
    elif behind is not None:
        axes.axvline(plan.figures.available_us, color="black", linewidth=1.2, linestyle=(0, (3, 2)))
        _bar(axes, behind, lane=0.0, colour=_REST)
    axes.set_xlim(0.0, period_end_us(plan, bars))
    axes.set_ylim(len(bars) + 0.5, -0.6)
    words = [f"{one.timing_model}: {one.words}" for one in bars]
    axes.set_yticks(range(len(bars) + 1), ["cycle", *words], fontsize=8)
    kinds = dict.fromkeys(one.kind for one in parts)
    handles = [Patch(color=_colour(plan, kind), label=kind_of(plan.profile, kind).label) for kind in kinds]
    shown = dict.fromkeys(part.label for bar in bars for part in bar.spans)
    handles += [Patch(color=_PERIOD_COLOURS[label], label=label) for label in shown]
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=len(handles), fontsize=8, frameon=False
    )
    axes.set_title(period_title(plan), fontsize=9, loc="left")


def _draw(axes: Any, lanes: tuple[Lane, ...], window: Schedule) -> None:
    for number, lane in enumerate(lanes):
        for event in lane.events:
            _bar(axes, event, lane=number, colour=_colour(window, event.kind))
    if shows_overrun(window):
        _over(axes, window)
    axes.set_xlim(window.from_us, window.to_us)
    axes.set_ylim(len(lanes) - 0.5, -0.5)
    axes.set_yticks(range(len(lanes)), [lane.label for lane in lanes], fontsize=8)
    axes.grid(visible=True, axis="x", linewidth=0.4, color="0.85")
    axes.set_axisbelow(True)
    axes.set_xlabel("time in the cycle [us]")
    axes.set_title(sentence_text(charged(window)), fontsize=9, loc="left")


def _over(axes: Any, plan: Schedule) -> None:
    """Mark the end of the slice and the time beyond it."""
    part = beyond(plan)
    axes.axvspan(part.start_us, part.end_us, color=_OVER, alpha=0.16, linewidth=0, zorder=0)
    axes.axvline(part.start_us, color=_OVER, linewidth=1.5)


def _legend(plan: Schedule) -> list[Patch]:
    return [Patch(color=_colour(plan, one.kind), label=_total_label(plan, one)) for one in totals(plan)]


def _total_label(plan: Schedule, one: Total) -> str:
    values = (figure_value(TOTAL, one.total_us), figure_value(SHARE, one.share))
    return ", ".join((kind_of(plan.profile, one.kind).label, *map(with_unit, values)))
