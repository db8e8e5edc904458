"""Compare two profiles: the keys that differ, and the change of every figure.

The figures are those of `capacity`, `latency` and `circle_test`; only differences are computed here.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import inf, isclose, isfinite, log10
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeAlias, TypeGuard

from busplan.buses import figure as known
from busplan.buses.bus import Bus
from busplan.buses.figure import Figure, by_key
from busplan.errors import BusplanError
from busplan.profile.keys import KeyValue, dotted_keys
from busplan.questions.circle.check import ComputeCircleFigures
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.fit.certainty import FITS, VERDICTS
from busplan.questions.fit.figures import CapacityFigures, figures
from busplan.questions.fit.network import bus_of, model_names
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.questions.circle.figures import CircleFigures

Judgement = Literal["better", "worse", "same", "neutral"]

ROUNDING: Final = 1e-9
"""Relative difference that float rounding can cause; figures that differ by less are the same."""

SHOWN_TO_FIT: Final = Figure(
    "shown_to_fit",
    "shown",
    known.VERDICT.reference,
    "whether the cycle is shown to fit",
    "shown to fit",
    sort="truth",
    better="more",
)
_CIRCLE: Final = tuple(
    CIRCLE_BY_KEY[key]
    for key in (
        "passed",
        "stable",
        "phase_margin_deg",
        "gain_margin_db",
        "mean_contour_error_mm",
        "max_contour_error_mm",
        "circular_deviation_mm",
        "servo_grade",
    )
)
"""Compared figures of the circle test, with the grade of the servo values."""


def plan_figures(*buses: Bus) -> tuple[Figure, ...]:
    """Figures of the plan: the verdict of the model that decides, and what all models share.

    A longer period or one more node is a choice, neither good nor bad by itself. Nor are the bias and the uncertainty:
    the corrected margin and the period with enough time have them.
    """
    setup = by_key(figure for bus in buses for figure in bus.figures.setup)
    return (
        *(known.TIMING_MODEL, known.VERDICT, SHOWN_TO_FIT, known.PERIOD, known.NODES, known.AXES),
        *setup.values(),
        *(known.AVAILABLE, known.TIME_SLICE),
        *(known.MARGIN_CORRECTED, known.UNCERTAINTY, known.BIAS, known.SAFE_NODES, known.SAFE_AXES),
        *(known.SAFE_LIMITED_BY, known.SAFE_MIN_PERIOD),
    )


def cycle_figures(*buses: Bus) -> tuple[Figure, ...]:
    """Figures of the cycle under one timing model.

    A single term is neither good nor bad: only their sum counts.
    """
    own = by_key(figure for bus in buses for figure in bus.figures.compared)
    terms = by_key(figure._replace(better="neither") for bus in buses for figure in bus.figures.terms)
    return (
        *(known.FITS, known.MARGIN, known.UTILISATION, known.REQUIRED),
        *terms.values(),
        *(known.MAX_NODES, known.MAX_AXES, known.LIMITED_BY, known.MIN_PERIOD),
        *own.values(),
        known.BINDING_TERM,
    )


_MARGINS: Final = ("phase_margin_deg", "gain_margin_db")

_Figures: TypeAlias = Mapping[str, Any]
"""Figures of an answer by key."""


class KeyDifference(NamedTuple):
    """A key whose values differ; None for a profile without the key."""

    key: str
    a: KeyValue | None
    b: KeyValue | None


class ComparedFigure(NamedTuple):
    """One figure of both profiles. A value that cannot be computed is None."""

    part: str
    """"plan", "circle", or the name of a timing model for its cycle."""
    figure: Figure
    a: Any
    b: Any
    judgement: Judgement
    """B compared with A."""
    difference: float | None
    """B minus A; None unless both are numbers."""
    relative_difference: float | None
    """`difference` as a share of the absolute value of A; None if that is meaningless."""

    def is_regression(self, *, tolerance: float) -> bool:
        """Whether B is worse by more than a share of A; without numbers, whether it is worse at all."""
        if self.judgement != "worse" or self.difference is None:
            return self.judgement == "worse"
        # A share of a ratio is a fixed number of decibels.
        share = 20 * log10(1 + tolerance) if self.figure.key.endswith("_db") else tolerance * abs(self.a)
        allowed: float = share * (1 + ROUNDING)
        return abs(self.difference) > allowed


class CircleSide(NamedTuple):
    """The circle test of one profile."""

    figures: "CircleFigures | None"
    """None if the test cannot be run."""
    problems: tuple[str, ...]
    """Failures of the circle, or why the test cannot be run."""

    @property
    def simulated(self) -> bool:
        """Whether the circle was simulated: the test can be run, and the cycle fits the bus."""
        return self.figures is not None and self.figures.stable is not None


class Difference(NamedTuple):
    """Answer of `difference`."""

    a: Profile
    b: Profile
    keys: tuple[KeyDifference, ...]
    figures: tuple[ComparedFigure, ...]
    circles: tuple[CircleSide, CircleSide] | None
    """Circle tests of A and B; None if none was requested."""

    def judged(self, judgement: Judgement) -> list[ComparedFigure]:
        """The figures with one judgement, in order."""
        return [figure for figure in self.figures if figure.judgement == judgement]

    def regressions(self, *, tolerance: float = 0.0) -> list[ComparedFigure]:
        """The figures that are worse, of all parts.

        Parameters
        ----------
        tolerance
            How much worse a figure may be, as a share of A [1].
        """
        return [figure for figure in self.figures if figure.is_regression(tolerance=tolerance)]


def difference(
    a: Profile,
    b: Profile,
    *,
    timing_models: Sequence[str] | None = None,
    circle: ComputeCircleFigures | None = None,
) -> Difference:
    """Compare two profiles.

    Parameters
    ----------
    a, b
        The profiles; B is judged against A.
    timing_models
        Timing models, in this order; by default all that can express both profiles. If the kinds differ, the models
        that decide are compared.
    circle
        Function that runs the circle test; it is called if either profile asks for a circle. None for no circle tests.

    Returns
    -------
    Difference
        Keys in the order of the schema; figures of the plan, of each timing model and of the circle.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> changed = difference(load("paper-1ms").profile, load("paper-optimal-gap").profile, timing_models=["standard"])
    >>> "bus.timing_model" in [change.key for change in changed.keys]
    True
    >>> changed.judged("worse")
    []
    """
    keys = tuple(_keys(a, b))
    circles = None
    if circle is not None and (a.asks_for_circle or b.asks_for_circle):
        of_a = _circle_side(a, circle)
        circles = of_a, _circle_side(b, circle) if keys else of_a
    return Difference(a, b, keys, tuple(_figures(a, b, timing_models, circles)), circles)


def _keys(a: Profile, b: Profile) -> Iterator[KeyDifference]:
    of_a, of_b = dotted_keys(a), dotted_keys(b)
    for key in dict.fromkeys((*of_a, *of_b)):
        value_a, value_b = of_a.get(key), of_b.get(key)
        if value_a is None or value_b is None or value_a.value != value_b.value:
            yield KeyDifference(key, value_a, value_b)


def _circle_side(profile: Profile, circle: ComputeCircleFigures) -> CircleSide:
    try:
        result = circle(profile)
    except BusplanError as error:
        return CircleSide(None, error.problems)
    return CircleSide(result, tuple(failure.text for failure in result.failures))


def _figures(
    a: Profile,
    b: Profile,
    timing_models: Sequence[str] | None,
    circles: tuple[CircleSide, CircleSide] | None,
) -> Iterator[ComparedFigure]:
    buses = (bus_of(a), bus_of(b))
    groups = tuple(dict.fromkeys(group.name for group in (*a.group, *b.group)))
    plan = (*plan_figures(*buses), *_of_groups(groups, known.SAFE_NODES))
    yield from _compared("plan", plan, _plan(a), _plan(b))
    deciding = (("deciding", buses[0].deciding_model, buses[1].deciding_model),)
    common = tuple(model for model in model_names(a) if model in model_names(b))
    models = common if timing_models is None else timing_models
    pairs = tuple((model, model, model) for model in models) if buses[0] is buses[1] else deciding
    for part, of_a, of_b in pairs:
        cycle = (*cycle_figures(*buses), *_of_groups(groups, known.MAX_NODES))
        yield from _compared(part, cycle, _cycle(a, of_a), _cycle(b, of_b))
    if circles is not None:
        circle_a, circle_b = ({} if side.figures is None else side.figures._asdict() for side in circles)
        yield from _compared("circle", _CIRCLE, circle_a, circle_b)


def _of_groups(names: Sequence[str], figure: Figure) -> Iterator[Figure]:
    """A figure that each group has for itself."""
    for name in names:
        yield figure._replace(key=f"group.{name}.{figure.key}", label=f"{figure.label} of {name}")


def _counts(figures: CapacityFigures, figure: Figure) -> _Figures:
    return {f"group.{group.name}.{figure.key}": getattr(group, figure.key) for group in figures.groups}


def _plan(profile: Profile) -> _Figures:
    """Figures under the model that decides, whichever are asked for: no choice of models hides its verdict."""
    deciding = figures(profile, model=bus_of(profile).deciding_model)
    own = {SHOWN_TO_FIT.key: deciding.verdict == FITS}
    return {**deciding.by_key(), **own, **_counts(deciding, known.SAFE_NODES)}


def _cycle(profile: Profile, model: str) -> _Figures:
    """Figures of one cycle by key: those of `capacity`, and others that the bus compares."""
    cycle = figures(profile, model=model)
    return {**cycle.by_key(), **cycle.own, **_counts(cycle, known.MAX_NODES)}


def _compared(part: str, measures: Sequence[Figure], a: _Figures, b: _Figures) -> Iterator[ComparedFigure]:
    for measure in measures:
        of_a, of_b = a.get(measure.key), b.get(measure.key)
        noise = 0.0 if measure.scale is None else ROUNDING * max(side.get(measure.scale) or 0.0 for side in (a, b))
        change = of_b - of_a if _is_number(of_a) and _is_number(of_b) else None
        yield ComparedFigure(
            part=part,
            figure=measure,
            a=of_a,
            b=of_b,
            judgement=_judgement(measure, a, b, noise=noise),
            difference=change,
            relative_difference=_share(change, of_a, noise=noise) if measure.relative else None,
        )


def _judgement(measure: Figure, a: _Figures, b: _Figures, *, noise: float) -> Judgement:
    of_a, of_b = a.get(measure.key), b.get(measure.key)
    rank_a, rank_b = _rank(measure, a), _rank(measure, b)
    if rank_a is None or rank_b is None:
        return "same" if of_a == of_b else "neutral"
    if isclose(rank_a, rank_b, rel_tol=ROUNDING, abs_tol=noise):
        # A circle that cannot be run ranks like one that fails, but is not the same.
        return "same" if (of_a is None) == (of_b is None) else "neutral"
    if measure.better == "neither":
        return "neutral"
    return "better" if (rank_b > rank_a) == (measure.better == "more") else "worse"


def _rank(measure: Figure, values: _Figures) -> float | None:
    """A figure as a number that ranks it; None if it has no rank. True ranks above False."""
    value = values.get(measure.key)
    if measure.key == "passed":
        # A circle that is not judged has no rank; one that cannot be run ranks like one that fails.
        return None if value is None and values.get("stable") else float(value is True)
    if measure.key == known.VERDICT.key:
        return None if value is None else -float(VERDICTS.index(value))
    stable = values.get("stable")
    if value is None and measure.key in _MARGINS and stable is not None:
        # A stable loop without a margin cannot become unstable; an unstable loop is beyond its limit.
        return inf if stable else -inf
    return float(value) if isinstance(value, int | float) else None


def _share(change: float | None, of: Any, *, noise: float) -> float | None:
    """A change as a share of the absolute value of a figure; None if that value is only rounding."""
    if change is None or abs(of) <= noise:
        return None
    share = change / abs(of)
    return share if isfinite(share) else None


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
