"""Drawings of the bus: the terms of the cycle as bars, and most axes over the period as staircases."""

from collections.abc import Iterator, Sequence
from itertools import chain
from math import ceil, log10
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.buses import kind_named
from busplan.buses.figure import MARGIN, Figure
from busplan.forms.blocks import Drawing
from busplan.forms.numbers import decimals_of, period, plural
from busplan.forms.scale import round_numbers, round_steps
from busplan.forms.svg import LINE, Scale, anchor, drawing, markup, text_at
from busplan.questions.fit.figures import FitFigures
from busplan.questions.fit.network import network_of
from busplan.questions.fit.node_steps import NodeSteps, telling_periods
from busplan.sections.profile import Profile

_THIN: Final = 12
_THICK: Final = 28
_GAP: Final = 10
_LETTER_PERCENT: Final = 4.5
"""Narrowest bar that has room for its letter on a phone."""
_MAGNIFIED_BELOW: Final = 0.5
"""If the cycle takes less than this share of the slice, it is drawn a second time in full width."""


LEFT: Final = MARGIN._replace(label="left of the slice", ink="idle", letter="L")
"""The rest of the slice; it follows the terms in bars and legend."""


class _Segment(NamedTuple):
    term: Figure
    start_us: float
    end_us: float


class TermsDrawing(Drawing):
    """The terms on the scale of the slice and, if they are small, once more on their own scale.

    Parameters
    ----------
    results
        Figures of one period, one set for each timing model.
    """

    def __init__(self, results: Sequence[FitFigures]) -> None:
        self._results = results

    def svg(self) -> str:
        """Draw a bar for each timing model."""
        results = self._results
        root = drawing("Terms of the cycle under each timing model, and what is left of the slice", css="chart terms")
        used_us, slice_us = max(result.required_us for result in results), results[0].available_us
        small = used_us < _MAGNIFIED_BELOW * slice_us
        head = "The slice, us" if used_us <= slice_us else "The cycle and where its slice ends, us"
        y = _bars(root, results, head, y=0, end_us=max(used_us, slice_us), thin=small)
        if small:
            y = _bars(root, results, "The cycle alone, us", y=y + _GAP, end_us=used_us, thin=False)
        root.set("height", str(y))
        return markup(root)


def _bars(root: Element, results: Sequence[FitFigures], head: str, *, y: int, end_us: float, thin: bool) -> int:
    """Draw a bar for each model on one scale, and return the y below them."""
    text_at(root, head, x="0", y=y + 15, css="head")
    top = y = y + LINE
    scale, height = Scale(0.0, end_us), _THIN if thin else _THICK
    area = SubElement(root, "g")
    for result in results:
        text_at(root, result.timing_model, x="0", y=y + 14, css="small")
        y += LINE
        for part in _segments(result, _drawn(result, end_us)):
            _segment(root, part, scale, y=y, height=height)
        y += height
    if end_us > results[0].available_us:
        x = f"{scale.percent(results[0].available_us):.5g}%"
        SubElement(root, "line", {"x1": x, "x2": x, "y1": str(top), "y2": str(y), "class": "edge"})
    return scale.marks(area, top=top, bottom=y)


def _drawn(figures: FitFigures, end_us: float) -> tuple[Figure, ...]:
    """The terms, and the rest of the slice if the scale reaches its end."""
    terms = kind_named(figures.kind).figures.terms
    return (*terms, LEFT) if end_us >= figures.available_us else terms


def _segments(figures: FitFigures, terms: Sequence[Figure]) -> Iterator[_Segment]:
    """The terms that take time, one after the other."""
    start_us, values = 0.0, figures.values()
    for term in terms:
        size_us = values[term.key]
        if size_us > 0:
            yield _Segment(term, start_us, start_us + size_us)
            start_us += size_us


def _segment(root: Element, part: _Segment, scale: Scale, *, y: int, height: int) -> None:
    """Draw a bar, and its letter if there is room."""
    title = f"{part.term.label}, {decimals_of(part.end_us - part.start_us, 3)} us"
    scale.rect(root, part, y=y, height=height, css=f"bar {part.term.ink}", title=title)
    start, end = scale.percent(part.start_us), scale.percent(part.end_us)
    if end - start >= _LETTER_PERCENT and height == _THICK:
        css = f"letter on-{part.term.ink}"
        text_at(root, part.term.letter, x=f"{(start + end) / 2:.5g}%", y=y + 19, css=css, anchor="middle")


_TOP: Final = 50
_HEIGHT: Final = 230
_BELOW: Final = 44
_MOST_LABELS: Final = 6
"""Most period labels: more do not fit on a phone."""
CURVES: Final = ("first", "second")
"""CSS classes of the curves, in the order of the timing models."""
_WIDE: Final = 1000
"""Width of the curves' viewBox, which is stretched to the width of the drawing."""


class _Plane:
    """Coordinates: periods in percent on a logarithmic scale, axes in px from the top."""

    def __init__(self, from_us: float, to_us: float, most_axes: int) -> None:
        self.from_us, self.to_us = from_us, to_us
        self.axis_step = _step(most_axes)
        self.top_axes = self.axis_step * ceil(most_axes * 1.08 / self.axis_step)

    def x(self, period_us: float) -> float:
        """Position of a period, 0 to 100."""
        share = log10(period_us / self.from_us) / log10(self.to_us / self.from_us)
        return 100 * min(1.0, max(0.0, share))

    def y(self, axes: float) -> float:
        """Position of a number of axes, in px."""
        return _TOP + _HEIGHT * (1 - axes / self.top_axes)


class AxesDrawing(Drawing):
    """The most axes over a range of periods around the profile's own.

    Parameters
    ----------
    profile
        The network.
    steps
        The steps under each timing model.
    """

    def __init__(self, profile: Profile, steps: Sequence[NodeSteps]) -> None:
        self._profile, self._steps = profile, steps

    def svg(self) -> str:
        """Draw a staircase for each timing model, and the profile's own point."""
        profile, steps = self._profile, self._steps
        root = drawing("Most axes over the communication period, under each timing model", css="chart axes")
        root.set("height", str(_TOP + _HEIGHT + _BELOW))
        own_us, own_axes = profile.cycle.period_us, int(network_of(profile).axes)
        from_us, to_us = telling_periods(profile, steps)
        plane = _Plane(from_us, to_us, max(own_axes, *(step.max_axes(to_us) for step in steps)))
        _grid(root, plane)
        stretched = {"y": str(_TOP), "width": "100%", "height": str(_HEIGHT), "preserveAspectRatio": "none"}
        area = SubElement(root, "svg", {**stretched, "viewBox": f"0 0 {_WIDE} {_HEIGHT}", "overflow": "visible"})
        for css, model_steps in zip(CURVES, steps, strict=False):
            SubElement(area, "path", {"class": f"curve {css}", "d": _path(model_steps, plane)})
        _figures(root, plane)
        _legend(root, steps)
        _own(root, plane, own_us, own_axes)
        for css, model_steps in zip(CURVES, steps, strict=False):
            draw_mark(root, css, x=f"{plane.x(own_us):.5g}%", y=plane.y(model_steps.max_axes(own_us)))
        return markup(root)


def _step(most: int) -> int:
    """Round step that divides a number of axes into at most five parts."""
    smallest = max(1.0, most / 5)
    return next(int(step.size) for step in round_steps(smallest) if step.size >= smallest)


def _grid(root: Element, plane: _Plane) -> None:
    """Draw lines at round numbers of axes, and labels of round periods."""
    for axes in range(0, plane.top_axes + 1, plane.axis_step):
        y = str(round(plane.y(axes)))
        SubElement(root, "line", {"x1": "0", "x2": "100%", "y1": y, "y2": y, "class": "rule"})
    bottom = _TOP + _HEIGHT
    for period_us in round_numbers(plane.from_us, plane.to_us, most=_MOST_LABELS):
        at = plane.x(period_us)
        x = f"{at:.5g}%"
        SubElement(root, "line", {"x1": x, "x2": x, "y1": str(bottom), "y2": str(bottom + 5), "class": "rule"})
        text_at(root, period(period_us), x=x, y=bottom + 19, css="small", anchor=anchor(at))
    text_at(root, "communication period, logarithmic", x="100%", y=bottom + 38, css="small", anchor="end")


def _figures(root: Element, plane: _Plane) -> None:
    """Draw round numbers of axes on their lines, the highest with its unit."""
    for axes in range(0, plane.top_axes + 1, plane.axis_step):
        text = plural(axes, "axis") if axes == plane.top_axes else str(axes)
        text_at(root, text, x="0", y=round(plane.y(axes)) - 4, css="small halo")


def _legend(root: Element, steps: Sequence[NodeSteps]) -> None:
    """Draw a piece of each curve with its name."""
    for number, (css, model_steps) in enumerate(zip(CURVES, steps, strict=False)):
        place = SubElement(root, "svg", {"x": str(110 * number), "overflow": "visible"})
        SubElement(place, "line", {"x1": "2", "x2": "42", "y1": "9", "y2": "9", "class": f"curve {css}"})
        draw_mark(place, css, x="22", y=9)
        text_at(place, model_steps.timing_model, x="50", y=14)


def _path(steps: NodeSteps, plane: _Plane) -> str:
    """Path of the staircase from the left edge to the right one."""
    commands = chain(_commands(steps, plane), [f"H{_WIDE}"])
    return "".join(commands)


def _commands(steps: NodeSteps, plane: _Plane) -> Iterator[str]:
    axes = steps.max_axes(plane.from_us)
    yield f"M0 {plane.y(axes) - _TOP:.1f}"
    for from_us in steps.from_us:
        if plane.from_us < from_us <= plane.to_us:
            axes += steps.axes_per_node
            yield f"H{plane.x(from_us) / 100 * _WIDE:.1f}V{plane.y(axes) - _TOP:.1f}"


def _own(root: Element, plane: _Plane, own_us: float, own_axes: int) -> None:
    """Draw the profile's period as a line, and its axes as a point on it."""
    at = plane.x(own_us)
    x, y = f"{at:.5g}%", round(plane.y(own_axes))
    line = {"x1": x, "x2": x, "y1": str(_TOP - 4), "y2": str(_TOP + _HEIGHT), "class": "own"}
    SubElement(root, "line", line)
    text_at(root, f"this profile, {period(own_us)}", x=x, y=38, css="head", anchor=anchor(at, edge=30))
    SubElement(root, "circle", {"cx": x, "cy": str(y), "r": "5", "class": "point"})
    side, shift = ("end", "-9") if at > 70 else ("start", "9")  # noqa: PLR2004 - percent
    box = SubElement(root, "svg", {"x": x, "overflow": "visible"})
    text_at(box, plural(own_axes, "axis"), x=shift, y=y + 4, css="small halo", anchor=side)


def draw_mark(root: Element, css: str, *, x: str, y: float) -> None:
    """Draw a point of a curve: a square on the first, a diamond on the second; `x` with its unit, `y` in px."""
    place = SubElement(root, "svg", {"x": x, "y": f"{y:.1f}", "overflow": "visible"})
    turn = {} if css == CURVES[0] else {"transform": "rotate(45)"}
    SubElement(place, "rect", {"x": "-4.5", "y": "-4.5", "width": "9", "height": "9", "class": f"mark {css}", **turn})
