"""The picture of a comparison: most axes over the period, a curve for each kind of bus, both scales logarithmic."""

from typing import Final

from busplan.buses.figure import Ink
from busplan.elementwise import plain
from busplan.english import plural
from busplan.forms.charts import Curve, Curves, Drawing, Entry, Guide, Panel, letters, logarithmic
from busplan.forms.numbers import period
from busplan.questions.compare.kinds import KindComparison, MachineOnKind
from busplan.questions.fit.network import bus_of, network_of

_INKS: Final[tuple[Ink, ...]] = ("request", "contention", "work", "sync", "acknowledge", "response", "reserve")
"""Colours of the curves; each has a letter, too."""
_LEAST_TOP: Final = 10
CAPTION: Final = "Most axes that are shown to fit over the period, both logarithmic"


def compare_drawing(comparison: KindComparison, *, title: str) -> Drawing:
    """Draw the curves of a comparison in which some kind of bus can have the machine.

    Parameters
    ----------
    comparison
        The comparison.
    title
        Its message in a sentence.
    """
    compared, own_us = comparison.compared, comparison.profile.cycle.period_us
    own_axes = int(plain(network_of(comparison.profile).axes))
    points = [point for machine in compared for point in machine.curve]
    periods_us, top = sorted({point.period_us for point in points}), max(point.axes or 1 for point in points)
    own = Entry("own", f"this machine: {period(own_us)}, {plural(own_axes, 'axis')}", shape="line")
    marks = letters(machine.profile.bus.kind.upper() for machine in compared)
    plot = Curves(
        logarithmic("period, logarithmic", periods_us[0], periods_us[-1], period, at=periods_us, own=own_us),
        logarithmic("axes, logarithmic", 1, max(_LEAST_TOP, own_axes, top), lambda axes: f"{axes:.0f}"),
        tuple(
            _curve(machine, mark, _INKS[number % len(_INKS)])
            for number, (machine, mark) in enumerate(zip(compared, marks, strict=True))
        ),
        (Guide(own, x=own_us), *([Guide(own, y=own_axes)] if own_axes else [])),
    )
    return Drawing(title, (Panel(plot),), description=CAPTION)


def _curve(machine: MachineOnKind, mark: str, ink: Ink) -> Curve:
    """A point for each period that carries an axis: none has no place on the scale."""
    points = [(point.period_us, point.axes) for point in machine.curve if point.axes]
    own, none, title = (
        " (this profile)" if machine.is_own else "",
        "" if points else ": none",
        bus_of(machine.profile).title,
    )
    return Curve(
        Entry(ink, f"{title}{own}{none}", mark, "line"),
        tuple(points),
        tuple(f"{title}: {plural(axes, 'axis')} at {period(us)}" for us, axes in points),
    )
