"""The whole period with its slice, and what each timing model leaves of the slice: what all drawings of it share."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from busplan.buses.figure import MARGIN, REQUIRED
from busplan.elementwise import plain
from busplan.forms.blocks import figure_value
from busplan.forms.numbers import with_unit
from busplan.questions.fit.figures import margin_us
from busplan.questions.fit.network import model_names
from busplan.questions.timeline.events import Event, Schedule, drawn_cycle
from busplan.questions.timeline.lanes import overruns, time_text

REST: Final = "rest of the period"
NEEDED: Final = "needed"
LEFT: Final = "margin"
BEYOND: Final = "beyond the slice"


class PeriodPart(NamedTuple):
    """A part of the period."""

    label: str
    start_us: float
    end_us: float


class ModelBar(NamedTuple):
    """Time of the slice that a timing model needs for the cycle that is drawn."""

    timing_model: str
    required_us: float
    available_us: float
    period_us: float

    @property
    def margin_us(self) -> float:
        """Time that it leaves of the slice [us]."""
        return plain(margin_us(self.required_us, available_us=self.available_us))

    @property
    def words(self) -> str:
        """Time needed and margin, as "207.117 us needed, margin 1792.883 us"."""
        needed = with_unit(figure_value(REQUIRED, self.required_us))
        if self.margin_us < 0:
            return f"{needed} needed, {with_unit(figure_value(MARGIN, -self.margin_us))} short"
        return f"{needed} needed, margin {with_unit(figure_value(MARGIN, self.margin_us))}"

    @property
    def spans(self) -> Iterator[PeriodPart]:
        """The time needed, what is left of the slice or goes beyond it, and the rest of the period."""
        needed_us, slice_us = self.required_us, self.available_us
        yield PeriodPart(NEEDED, 0.0, min(needed_us, slice_us))
        used_us = max(needed_us, slice_us)
        if used_us > min(needed_us, slice_us):
            yield PeriodPart(LEFT if slice_us > needed_us else BEYOND, min(needed_us, slice_us), used_us)
        if self.period_us > used_us:
            yield PeriodPart(REST, used_us, self.period_us)


def model_bars(schedule: Schedule) -> tuple[ModelBar, ...]:
    """Time of the slice that each timing model needs which can express the profile.

    Parameters
    ----------
    schedule
        The cycle, under one of them.
    """
    figures, bars = schedule.figures, []
    for model in model_names(schedule.network):
        cycle = drawn_cycle(schedule.network, model=model, number=schedule.number)
        bars.append(ModelBar(model, plain(cycle.required_us), figures.available_us, figures.period_us))
    return tuple(bars)


def period_end_us(schedule: Schedule, bars: tuple[ModelBar, ...]) -> float:
    """End of the period, or of a cycle that takes longer [us]."""
    return max(schedule.figures.period_us, schedule.end_us, *(bar.required_us for bar in bars))


def rest(schedule: Schedule) -> Event | None:
    """The part of the period after slice and cycle; None if there is none."""
    if schedule.end_us >= schedule.figures.period_us:
        return None
    return schedule.cycle_events[-1]._replace(start_us=schedule.end_us, end_us=schedule.figures.period_us)


def period_title(schedule: Schedule) -> str:
    """Title of the strip above the lanes."""
    figures = schedule.figures
    period, slice_ = time_text(figures.period_us), time_text(figures.available_us)
    if overruns(schedule):
        cycle = time_text(schedule.end_us)
        return f"The period of {period} us: its cycle of {cycle} us is beyond its slice of {slice_} us"
    return f"The period of {period} us and its slice of {slice_} us"
