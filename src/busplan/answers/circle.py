"""`busplan circle-test` for people."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from busplan.analysis.circle.contour_profile import ContourProfile
from busplan.analysis.circle.roundness import CircleFigures, CircleTest, failed_measure, to_attack
from busplan.answers.verdict_sentences import period
from busplan.forms.lines import BLANK, Line, table, us

PLOT_SECTORS: Final = 72
"""Columns of the plot in the terminal: one for every 5 degrees."""
_PLOT_ROWS: Final = 9
_SHOWN: Final = 1e-9
"""Largest error, in mm, that still counts as none in a plot."""
_SHOWN_UM: Final = 1e-6
"""Smallest error, in um, that is shown as one: a picometre is rounding."""
_ONE_DIGIT_UM: Final = 0.05
"""From here on one digit after the point shows something."""


_MEASURES: Final = {
    "mean_contour_error_mm": "mean contour error",
    "max_contour_error_mm": "largest contour error",
    "circular_deviation_mm": "circular deviation G",
}


def circle_lines(
    test: CircleTest, profiles: Sequence[ContourProfile | None], *, with_contributions: bool
) -> list[Line]:
    """Verdict of each period, one row of figures a period, the ranked sources and a plot of the error."""
    lines: list[Line] = []
    for result in test.results:
        lines.extend(circle_verdict_lines(test.profile.name, result))
    if any(result.stable is not None for result in test.results):
        # Said wherever a contour figure is shown: what it rests on.
        lines.append(Line(f"The servo values behind these figures are {test.results[0].servo_grade}."))
    lines.extend((BLANK, *_figures(test.results)))
    for result, profile in zip(test.results, profiles, strict=True):
        title = f"{period(result.period_us)}, {result.feed_mm_per_min:g} mm/min"
        if with_contributions and result.contributions:
            lines.extend((BLANK, *_contributions(title, result)))
        if profile is not None:
            lines.extend((BLANK, *_plot(title, profile)))
    return lines


def circle_verdict_lines(name: str, result: CircleFigures) -> Iterator[Line]:
    """Say whether the circle holds, what it does not hold, and what to attack first."""
    subject = f"{name} at {period(result.period_us)} and {result.feed_mm_per_min:g} mm/min"
    if result.passed:
        yield Line(f"{subject}: the circle holds every tolerance.", "good")
        return
    reasons = ", and ".join(failure.text for failure in result.failures)
    yield Line(f"{subject}: FAILED, {reasons}.", "bad")
    measure, attack = failed_measure(result), to_attack(result)
    if measure is not None and attack is not None:
        source, removed_mm = attack
        yield Line(
            f"Attack {source.source} first: without it the {_MEASURES[measure]} is "
            f"{um(getattr(source, measure))} um, {um(removed_mm)} um less."
        )
    elif measure is not None and result.contributions is not None:
        yield Line(f"No single error source of the profile explains the {_MEASURES[measure]}.")


def um(value_mm: float | None) -> str:
    """Write a length in micrometres; a dash for what does not exist."""
    return "-" if value_mm is None else us(_rounded_um(value_mm))


def _rounded_um(value_mm: float) -> float:
    """Micrometres, and 0 without a sign for what is less than arithmetic can tell."""
    value_um = value_mm * 1e3
    return value_um if abs(value_um) >= _SHOWN_UM else 0.0


def signed_um(value_mm: float) -> str:
    """Write a length in micrometres with its sign."""
    text = f"{value_mm * 1e3:+.3f}"
    return "0.000" if float(text) == 0.0 else text


def two_decimals(value: float | None) -> str:
    """Write a margin; a dash for what does not exist."""
    return "-" if value is None else f"{value:.2f}"


_COLUMNS: Final[tuple[tuple[str, Callable[[CircleFigures], str]], ...]] = (
    ("period", lambda one: period(one.period_us)),
    ("feed\nmm/min", lambda one: f"{one.feed_mm_per_min:g}"),
    ("duration\ns", lambda one: f"{one.duration_s:.3f}"),
    ("set-\npoints", lambda one: str(one.setpoints)),
    ("mean\num", lambda one: um(one.mean_contour_error_mm)),
    ("max\num", lambda one: um(one.max_contour_error_mm)),
    ("F_min\num", lambda one: um(one.radial_deviation_min_mm)),
    ("F_max\num", lambda one: um(one.radial_deviation_max_mm)),
    ("G\num", lambda one: um(one.circular_deviation_mm)),
    ("phase\ndeg", lambda one: two_decimals(one.phase_margin_deg)),
    ("gain\ndB", lambda one: two_decimals(one.gain_margin_db)),
    ("passed", lambda one: "yes" if one.passed else "no"),
)


def _figures(results: Sequence[CircleFigures]) -> list[Line]:
    return table(
        [heading for heading, _ in _COLUMNS],
        ([write(result) for _, write in _COLUMNS] for result in results),
        left=1,
    )


def _contributions(title: str, result: CircleFigures) -> list[Line]:
    return [
        Line(f"Error sources at {title}, each removed in turn", "heading"),
        *table(
            ["source", "max without it, um", "takes, um"],
            (
                [one.source, um(one.max_contour_error_mm), signed_um(one.removed_mm)]
                for one in result.contributions or ()
            ),
            left=1,
        ),
    ]


def _plot(title: str, profile: ContourProfile) -> list[Line]:
    """Contour error over the angle, in characters that every terminal has."""
    lows = [value for value in profile.low_mm if value is not None]
    highs = [value for value in profile.high_mm if value is not None]
    bottom, top = min((*lows, 0.0)), max((*highs, 0.0))
    if top - bottom < _SHOWN:
        return [Line(f"Contour error at {title}: none.", "heading")]
    height = (top - bottom) / _PLOT_ROWS
    lines = [Line(f"Contour error over the angle at {title}, um", "heading")]
    for number in range(_PLOT_ROWS):
        upper = top - number * height
        lower = upper - height
        label = {0: top, _PLOT_ROWS - 1: bottom}.get(number)
        zero = lower <= 0.0 < upper or (upper == 0.0 == top and number == 0)
        cells = "".join(
            _cell(low, high, lower=lower, upper=upper, zero=zero)
            for low, high in zip(profile.low_mm, profile.high_mm, strict=True)
        )
        text = _label(label) if label is not None else "0" if zero else ""
        lines.append(Line(f"{text:>9} |{cells}".rstrip(), "table"))
    axis = "".join(f"{angle:<{PLOT_SECTORS // 4}}" for angle in (0, 90, 180, 270)).rstrip()
    lines.append(Line(f"{'deg':>9}  {axis}", "table"))
    return lines


def _label(value_mm: float) -> str:
    """An end of the scale, with as many digits as tell it from 0."""
    value_um = _rounded_um(value_mm)
    if value_um == 0.0:
        return "0"
    return f"{value_um:+.1f}" if abs(value_um) >= _ONE_DIGIT_UM else f"{value_um:+.1g}"


def _cell(low: float | None, high: float | None, *, lower: float, upper: float, zero: bool) -> str:
    if low is not None and high is not None and low <= upper and high >= lower:
        return "#"
    return "-" if zero else " "
