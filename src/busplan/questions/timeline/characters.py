"""A timeline to scale, in ASCII characters."""

from collections.abc import Iterable, Iterator
from typing import Final

from busplan.buses.parts import IDLE
from busplan.forms.lines import BLANK, Line, legend_lines
from busplan.forms.scale import ticks
from busplan.questions.fit.network import bus_of
from busplan.questions.timeline.events import Event, Schedule
from busplan.questions.timeline.lanes import (
    Lane,
    beyond,
    drawn_window,
    event_lanes,
    has_event_lanes,
    kind_of,
    node_lanes,
    only_owner,
    overruns,
    shows_overrun,
    stretches,
    time_text,
)
from busplan.questions.timeline.period import (
    BEYOND,
    LEFT,
    NEEDED,
    REST,
    PeriodPart,
    model_bars,
    period_end_us,
    period_title,
    rest,
)

NARROWEST: Final = 60
"""Least columns of a drawing."""
_TICK_COLUMNS: Final = 9
_OVER: Final = "!"
_WINDOW: Final = "^"
_PERIOD_MARKS: Final = {NEEDED: "#", LEFT: ".", BEYOND: _OVER, REST: "-"}


def timeline_lines(schedule: Schedule, *, width: int) -> list[Line]:
    """Draw the whole period as a strip, what each timing model leaves of the slice, and the window in lanes.

    Parameters
    ----------
    schedule
        The cycle, narrowed to its window.
    width
        Width of the drawing, in columns.
    """
    width = max(width, NARROWEST)
    window = drawn_window(schedule)
    lanes = _event_rows(window, width=width) if has_event_lanes(window) else _node_rows(window, width=width)
    return [*_strip(schedule, width=width), BLANK, *lanes]


def _strip(schedule: Schedule, *, width: int) -> Iterator[Line]:
    """The whole period in one row, transaction by transaction, the time beyond its slice, and a row for each model."""
    parts, behind, bars = stretches(schedule.cycle_events), rest(schedule), model_bars(schedule)
    styles = {part.kind: kind_of(schedule.profile, part.kind) for part in parts}
    rows = {"cycle": [(styles[part.kind].mark, part.event) for part in parts]}
    legend = [f"{style.mark} {style.label}" for style in styles.values()]
    if behind is not None:
        rows["cycle"].append((_PERIOD_MARKS[REST], behind))
    for bar in bars:
        rows[bar.timing_model] = [(_PERIOD_MARKS[part.label], _event(schedule, part)) for part in bar.spans]
    shown = {part.label for bar in bars for part in bar.spans}
    if overruns(schedule):
        rows["over"] = [(_OVER, beyond(schedule))]
    legend += [f"{mark} {label}" for label, mark in _PERIOD_MARKS.items() if label in shown]
    if not schedule.is_whole:
        rows["window"] = [(_WINDOW, _event(schedule, PeriodPart("", schedule.from_us, schedule.to_us)))]
        legend.append(f"{_WINDOW} shown below")
    gutter = max(map(len, rows))
    scale = _Bar(0.0, period_end_us(schedule, bars), width - gutter - 3)
    yield Line(f"{period_title(schedule)}, {scale.per_column}", "heading")
    for label, row in rows.items():
        yield Line(f"{label:<{gutter}} |{scale.cells(row)}|", "fails" if label == "over" else "drawn")
    yield scale.scale(gutter + 2)
    yield from legend_lines(legend, width=width)


def _event(schedule: Schedule, part: PeriodPart) -> Event:
    return schedule.cycle_events[0]._replace(start_us=part.start_us, end_us=part.end_us)


def _node_rows(window: Schedule, *, width: int) -> Iterator[Line]:
    """A row for each node; a column shows the kind that takes most of its time."""
    lanes = node_lanes(window)
    gutter = max(len(lane.label) for lane in lanes)
    bar = _Bar(window.from_us, window.to_us, width - gutter - 3)
    yield Line(f"{time_text(window.from_us)} to {time_text(window.to_us)} us by node, {bar.per_column}", "heading")
    for lane in lanes:
        yield Line(f"{lane.label:<{gutter}} |{bar.cells(_marked(window, lane))}|", "drawn")
    if shows_overrun(window):
        yield Line(f"{'over':<{gutter}} |{bar.cells([(_OVER, beyond(window))])}|", "fails")
    yield bar.scale(gutter + 2)
    shown = {event.kind for event in window.events}
    kinds = (*bus_of(window.profile).event_kinds, IDLE)
    legend = [f"{kind.mark} {kind.label}" for kind in kinds if kind.key in shown]
    yield from legend_lines(legend, width=width)


def _marked(window: Schedule, lane: Lane) -> list[tuple[str, Event]]:
    return [(kind_of(window.profile, event.kind).mark, event) for event in lane.events]


def _event_rows(window: Schedule, *, width: int) -> Iterator[Line]:
    """A row for each event, with its duration."""
    lanes, owner = event_lanes(window), only_owner(window)
    figures = [time_text(event.duration_us) for event in window.events]
    gutter, digits = max(len(lane.label) for lane in lanes), max(map(len, figures))
    bar = _Bar(window.from_us, window.to_us, max(10, width - gutter - digits - 5))
    whose = "Events" if owner is None else f"The {owner}"
    yield Line(f"{whose}, {time_text(window.from_us)} to {time_text(window.to_us)} us, {bar.per_column}", "heading")
    for lane, figure in zip(lanes, figures, strict=True):
        yield Line(f"{lane.label:<{gutter}}  {figure:>{digits}} |{bar.cells(_marked(window, lane))}|", "drawn")
    yield bar.scale(gutter + digits + 4)


class _Bar:
    """A time scale in columns.

    Parameters
    ----------
    from_us, to_us
        Start and end [us].
    columns
        Number of columns.
    """

    def __init__(self, from_us: float, to_us: float, columns: int) -> None:
        self._from_us, self._to_us, self._columns = from_us, to_us, columns
        self._column_us = (to_us - from_us) / columns

    @property
    def per_column(self) -> str:
        """The scale in words."""
        return f"{self._column_us:.3g} us a column"

    def _column(self, time_us: float) -> int:
        return min(self._columns - 1, max(0, int((time_us - self._from_us) / self._column_us)))

    def cells(self, parts: Iterable[tuple[str, Event]]) -> str:
        """Fill each column with the mark that takes most of its time, or a space."""
        shares: list[dict[str, float]] = [{} for _ in range(self._columns)]
        for mark, event in parts:
            # Ignore overlaps that are only float rounding.
            least_us = min(self._column_us, event.duration_us) * 1e-6
            for column in range(self._column(event.start_us), self._column(event.end_us) + 1):
                start_us = self._from_us + column * self._column_us
                inside_us = min(event.end_us, start_us + self._column_us) - max(event.start_us, start_us)
                if inside_us > least_us:
                    shares[column][mark] = shares[column].get(mark, 0.0) + inside_us
        return "".join(max(share, key=lambda mark: share[mark]) if share else " " for share in shares)

    def scale(self, indent: int) -> Line:
        """Labels of round times below their columns."""
        text = " " * self._columns
        for tick in ticks(self._from_us, self._to_us, most=max(2, self._columns // _TICK_COLUMNS)):
            at = self._column(tick.at)
            if text[max(0, at - 1) :].strip():
                continue
            text = f"{text[:at]}{tick.label}{text[at + len(tick.label) :]}"
        return Line(f"{'us':<{indent}}{text.rstrip()}", "drawn")
