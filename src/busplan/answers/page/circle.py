"""The parts of a chapter that the circle test fills: verdict, drawing, figures, ranked sources."""

from collections.abc import Mapping
from typing import Final

from busplan.analysis.all_answers import AllAnswers
from busplan.analysis.circle.roundness import CircleFigures
from busplan.answers.circle import circle_verdict_lines, signed_um, two_decimals, um
from busplan.answers.page.bus import plain
from busplan.answers.page.content import Chart, Drawing, Part, Row, ShownVerdict, SourceCommand, Table, TableColumn
from busplan.drawings.circle import Magnified, circle_chart, magnified
from busplan.forms.lines import GridRow, count, yes
from busplan.forms.signed_bar import signed_bar

_QUESTION: Final = "Is the circle still round?"
_ROWS: Final = (
    GridRow("mean contour error", "um", "mean_contour_error_mm", um),
    GridRow("largest contour error", "um", "max_contour_error_mm", um),
    GridRow("smallest radial deviation F_min", "um", "radial_deviation_min_mm", um),
    GridRow("largest radial deviation F_max", "um", "radial_deviation_max_mm", um),
    GridRow("circular deviation G", "um", "circular_deviation_mm", um),
    GridRow("radius deviation", "um", "radius_deviation_mm", um),
    GridRow("phase margin", "deg", "phase_margin_deg", two_decimals),
    GridRow("gain margin", "dB", "gain_margin_db", two_decimals),
    GridRow("crossover", "Hz", "crossover_hz", two_decimals),
    GridRow("radius", "mm", "radius_mm", plain),
    GridRow("feed", "mm/min", "feed_mm_per_min", plain),
    GridRow("period", "us", "period_us", plain),
    GridRow("position-loop step", "us", "step_us", plain),
    GridRow("duration", "s", "duration_s", lambda value: f"{value:.3f}"),
    GridRow("set-points", "1", "setpoints", count),
    GridRow("position loop on the", "", "loop", str),
    GridRow("stable", "", "stable", yes),
    GridRow("passed", "", "passed", yes),
)


def circle_verdict(answer: AllAnswers, sources: Mapping[str, SourceCommand]) -> ShownVerdict:
    """Is the circle still round?"""
    result = answer.circle_figures
    if result is None:
        return ShownVerdict(_QUESTION, "NOT RUN", "bad" if answer.no_circle else "plain", _why_not(answer))
    source = sources["circle"]
    lines = tuple(line.text for line in circle_verdict_lines(answer.profile.name, result))
    return ShownVerdict(
        _QUESTION,
        "PASSED" if result.passed else "FAILED",
        "good" if result.passed else "bad",
        (*lines, *_rests_on(result)),
        source.anchor,
        figures=(
            ("mean error", source.figure("/results/0/mean_contour_error_mm", um, "um")),
            ("largest error", source.figure("/results/0/max_contour_error_mm", um, "um")),
            ("deviation G", source.figure("/results/0/circular_deviation_mm", um, "um")),
            ("phase margin", source.figure("/results/0/phase_margin_deg", two_decimals, "deg")),
            ("gain margin", source.figure("/results/0/gain_margin_db", two_decimals, "dB")),
        ),
    )


def _rests_on(result: CircleFigures) -> tuple[str, ...]:
    return () if result.stable is None else (f"The servo values behind these figures are {result.servo_grade}.",)


def _why_not(answer: AllAnswers) -> tuple[str, ...]:
    if answer.no_circle:
        return tuple(f"The circle test cannot be run: {why}." for why in answer.no_circle)
    if answer.profile.asks_for_circle:
        return ("The circle test was left out (--no-circle).",)
    return ("The profile has no section for a circle test, so none was run.",)


def circle_part(answer: AllAnswers, sources: Mapping[str, SourceCommand]) -> Part:
    """The magnified circle and its figures."""
    result, title = answer.circle_figures, "The circle"
    if result is None:
        return Part("circle", title, lines=_why_not(answer))
    source = sources["circle"]
    tolerance_mm = answer.profile.tolerance.max_contour_error_mm
    scale = None if answer.contour is None else magnified(answer.contour, tolerance_mm=tolerance_mm)
    charts: tuple[Chart, ...] = ()
    if answer.contour is not None and scale is not None:
        caption = _caption(scale, result, tolerance_mm=tolerance_mm)
        charts = (Chart("round", caption, circle_chart(answer.contour, scale)),)
    table = Table(
        "Figures of the circle test",
        (TableColumn("", "words"), TableColumn("unit", "words"), TableColumn("value")),
        tuple(Row((row.label, row.unit, source.figure(f"/results/0/{row.key}", row.write, row.unit))) for row in _ROWS),
    )
    return Part(
        "circle", title, () if charts else (_not_drawn(answer, result),), (), charts, (table,), (source.anchor,)
    )


def _not_drawn(answer: AllAnswers, result: CircleFigures) -> str:
    if answer.contour is not None:
        return "Not drawn: there is no contour error to show."
    reason = ", and ".join(failure.text for failure in result.failures)
    return f"Not drawn: {reason}."


def _caption(scale: Magnified, result: CircleFigures, *, tolerance_mm: float | None) -> str:
    """What the drawing shows: the part at constant speed, how far magnified, and where its tolerance is."""
    words = (
        f"Contour error at constant speed, magnified {scale.times(result.radius_mm):,.0f} times; "
        f"{scale.ring_um:g} um from ring to ring, the nominal circle drawn strong"
    )
    if tolerance_mm is None:
        return f"{words}; the profile has no tolerance of the largest contour error."
    limit = f"the tolerance of {tolerance_mm * 1e3:g} um"
    if scale.tolerance_mm is None:
        return f"{words}; {limit} lies outside the drawing."
    return f"{words}; {limit} dashed."


def sources_part(answer: AllAnswers, sources: Mapping[str, SourceCommand]) -> Part | None:
    """What makes the circle less round, ranked; nothing without a simulation."""
    result = answer.circle_figures
    if result is None or result.contributions is None:
        return None
    title, source = "What to attack", sources["circle"]
    if not result.contributions:
        return Part("sources", title, lines=("The profile has no error source that could be removed.",))
    removed = [one.removed_mm for one in result.contributions]
    least, most = min(0.0, *removed), max(0.0, *removed)
    rows = tuple(
        Row(
            (
                one.source.replace("_", " "),
                Drawing(signed_bar(one.removed_mm, least=least, most=most, title=_bar_title(one.removed_mm)))
                if most > least
                else "",
                source.figure(f"/results/0/contributions/{index}/removed_mm", signed_um, "um"),
                source.figure(f"/results/0/contributions/{index}/max_contour_error_mm", um, "um"),
                source.figure(f"/results/0/contributions/{index}/circular_deviation_mm", um, "um"),
            )
        )
        for index, one in enumerate(result.contributions)
    )
    columns = (
        TableColumn("source", "words"),
        TableColumn("", "drawing"),
        TableColumn("takes, um"),
        TableColumn("max", group="without it, um"),
        TableColumn("G", group="without it, um"),
    )
    caption = "Each error source removed in turn; what it takes from the largest contour error, largest first"
    line = "Sources act together: what they take one by one need not add up. A negative one hides another."
    return Part("sources", title, (line,), tables=(Table(caption, columns, rows),), commands=(source.anchor,))


def _bar_title(removed_mm: float) -> str:
    return f"{'takes' if removed_mm >= 0 else 'adds'} {um(abs(removed_mm))} um"
