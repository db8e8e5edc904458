"""Drawings of the bus: the terms of the cycle as bars, and most axes over the period as staircases."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.buses import kind_named
from busplan.buses.figure import MARGIN
from busplan.forms.charts import (
    Curve,
    Curves,
    Drawing,
    Entry,
    Guide,
    Lane,
    Lanes,
    Panel,
    Span,
    letters,
    logarithmic,
    numbers,
)
from busplan.forms.numbers import decimals_of, period, plural
from busplan.questions.fit.figures import CapacityFigures
from busplan.questions.fit.network import network_of
from busplan.questions.fit.node_steps import NodeSteps, telling_periods
from busplan.sections.profile import Profile

_MAGNIFIED_BELOW: Final = 0.5
"""If the cycle takes less than this share of the slice, it is drawn a second time in full width."""
LEFT: Final = MARGIN._replace(label="left of the slice", ink="idle", letter="L")
"""The rest of the slice; it follows the terms in bars and legend."""


def terms_drawing(results: Sequence[CapacityFigures]) -> Drawing:
    """Draw the terms on the scale of the slice and, if they are small, once more on their own scale.

    Parameters
    ----------
    results
        Figures of one period, one set for each timing model.
    """
    used_us, slice_us = max(result.required_us for result in results), results[0].available_us
    head = "The slice, us" if used_us <= slice_us else "The cycle and where its slice ends, us"
    panels = [_terms(results, head, max(used_us, slice_us))]
    if used_us < _MAGNIFIED_BELOW * slice_us:
        panels.append(_terms(results, "The cycle alone, us", used_us))
    title = "Terms of the cycle under each timing model, and what is left of the slice"
    return Drawing(title, tuple(panels))


def _terms(results: Sequence[CapacityFigures], head: str, end_us: float) -> Panel:
    slice_us = results[0].available_us
    guides = (Guide(Entry("edge", "end of the slice", shape="line"), x=slice_us),) if end_us > slice_us else ()
    lanes = (Lane(result.timing_model, tuple(_spans(result, end_us))) for result in results)
    return Panel(Lanes(numbers("us", 0.0, end_us), tuple(lanes), guides), head)


def _spans(figures: CapacityFigures, end_us: float) -> Iterator[Span]:
    """The terms that take time, one after the other, and the rest of the slice if the scale reaches its end."""
    terms, start_us = kind_named(figures.kind).figures.terms, 0.0
    for term in (*terms, LEFT) if end_us >= figures.available_us else terms:
        size_us = getattr(figures, term.key)
        if size_us > 0:
            words = f"{term.label}, {decimals_of(size_us, 3)} us"
            yield Span(Entry(term.ink, term.label, term.letter), start_us, start_us + size_us, words)
            start_us += size_us


def axes_drawing(profile: Profile, steps: Sequence[NodeSteps]) -> Drawing:
    """Draw the most axes over a range of periods around the profile's own, a staircase for each timing model.

    Parameters
    ----------
    profile
        The network.
    steps
        The steps under each timing model.
    """
    own_us, own_axes = profile.cycle.period_us, int(network_of(profile).axes)
    from_us, to_us = telling_periods(profile, steps)
    most = max(own_axes, *(model.max_axes(to_us) for model in steps))
    own = Entry("own", f"this profile: {period(own_us)}, {plural(own_axes, 'axis')}", shape="line")
    marks = letters(model.timing_model for model in steps)
    curves = (
        Curve(Entry(ink, model.timing_model, mark, "line"), tuple(_staircase(model, from_us, to_us)), has_dots=False)
        for ink, model, mark in zip(("first", "second"), steps, marks, strict=False)
    )
    plot = Curves(
        logarithmic("communication period, logarithmic", from_us, to_us, period),
        numbers("axes", 0, most, whole=True, room=0.06),
        tuple(curves),
        (Guide(own, x=own_us), Guide(own, y=own_axes)),
    )
    return Drawing("Most axes over the communication period, under each timing model", (Panel(plot),))


def _staircase(steps: NodeSteps, low_us: float, high_us: float) -> Iterator[tuple[float, float]]:
    axes = steps.max_axes(low_us)
    yield low_us, axes
    for from_us in steps.from_us:
        if low_us < from_us <= high_us:
            yield from_us, axes
            axes += steps.axes_per_node
            yield from_us, axes
    yield high_us, axes
