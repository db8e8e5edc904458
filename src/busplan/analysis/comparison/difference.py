"""Two profiles side by side: the keys that differ, and what that does to every figure.

Each figure is that of `capacity`, `latency` or `circle_test`; nothing is computed here but differences.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf, isclose, isfinite, log10
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeGuard

from busplan.analysis.capacity.figures import figures
from busplan.analysis.latency import BOTH_MODELS, latency
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.errors import BusplanError
from busplan.profile.keys import KeyValue, dotted_keys
from busplan.profile.model import Profile

if TYPE_CHECKING:
    from busplan.analysis.circle.roundness import CircleFigures

Part = Literal["plan", "paper", "standard", "circle"]
"""What a figure belongs to: the plan itself, its cycle under one timing model, or its circle."""
Judgement = Literal["better", "worse", "same", "neutral"]
Circle = Callable[[Profile], "CircleFigures"]
"""Runs the circle test of a profile."""

ROUNDING: Final = 1e-9
"""Relative difference that float rounding alone can make; a figure that differs by less is the same."""


class Measure(NamedTuple):
    """One figure, and in which direction it is better."""

    key: str
    better: Literal["more", "less", "neither"] = "neither"
    scale: str | None = None
    """The quantity that its rounding is relative to: what it is a difference of, where it is one."""
    relative: bool = True
    """Whether a share of it means something."""


PLAN: Final = (
    Measure("timing_model"),
    Measure("verdict_fits", "more"),
    Measure("period_us"),
    Measure("nodes"),
    Measure("axes"),
    Measure("hops"),
    Measure("gap_count", relative=False),
    Measure("safe_gap_count", relative=False),
    Measure("gap_count_safe", "more"),
    Measure("available_us"),
    Measure("time_slice_us"),
)
"""The verdict of the model that decides, and what both models share. A longer period or one more node is a choice,
neither good nor bad by itself."""
CYCLE: Final = (
    Measure("fits", "more"),
    Measure("margin_us", "more", scale="available_us"),
    Measure("utilisation", "less"),
    Measure("required_us", "less"),
    Measure("max_nodes", "more"),
    Measure("max_axes", "more"),
    Measure("limited_by"),
    Measure("min_period_us", "less"),
    Measure("read_latency_us", "less"),
    Measure("read_latency_with_gaps_us", "less"),
    Measure("write_latency_us", "less"),
    Measure("write_latency_with_gaps_us", "less"),
    Measure("binding_term"),
)
"""The cycle under one timing model. A truth is better when it is more: true."""
CIRCLE: Final = (
    Measure("passed", "more"),
    Measure("stable", "more"),
    Measure("phase_margin_deg", "more"),
    Measure("gain_margin_db", "more", relative=False),
    Measure("mean_contour_error_mm", "less", scale="radius_mm"),
    Measure("max_contour_error_mm", "less", scale="radius_mm"),
    Measure("circular_deviation_mm", "less", scale="radius_mm"),
    Measure("servo_grade"),
)
"""The circle test, and how the servo values behind it are known."""

_MARGINS: Final = ("phase_margin_deg", "gain_margin_db")


class KeyDifference(NamedTuple):
    """A key whose value is not the same in both profiles; None where one has no such key."""

    key: str
    a: KeyValue | None
    b: KeyValue | None


class Figure(NamedTuple):
    """One figure of both profiles. What could not be computed is None."""

    part: Part
    measure: Measure
    a: Any
    b: Any
    judgement: Judgement
    """What B is against A."""
    difference: float | None
    """B less A; None where they are no numbers."""
    relative_difference: float | None
    """`difference` as a share of A's size, where that means something."""

    def is_regression(self, *, tolerance: float) -> bool:
        """Tell whether B is worse by more than a share of A's size; what is no number has no share."""
        if self.judgement != "worse" or self.difference is None:
            return self.judgement == "worse"
        # A share of a ratio in decibels is a number of decibels, whatever the ratio is.
        share = 20 * log10(1 + tolerance) if self.measure.key.endswith("_db") else tolerance * abs(self.a)
        allowed: float = share * (1 + ROUNDING)
        return abs(self.difference) > allowed


class CircleSide(NamedTuple):
    """The circle test of one profile."""

    figures: "CircleFigures | None"
    """None where the test cannot be run."""
    problems: tuple[str, ...]
    """What the circle does not hold, or why it cannot be run."""

    @property
    def simulated(self) -> bool:
        """Whether there is a circle to speak of: the test can be run, and the bus delivers its set-points."""
        return self.figures is not None and self.figures.stable is not None


class Difference(NamedTuple):
    """Answer of `difference`."""

    a: Profile
    b: Profile
    keys: tuple[KeyDifference, ...]
    figures: tuple[Figure, ...]
    circles: tuple[CircleSide, CircleSide] | None
    """Those of A and B; None where no circle was asked for."""

    def judged(self, judgement: Judgement) -> list[Figure]:
        """The figures of one judgement, in their order."""
        return [figure for figure in self.figures if figure.judgement == judgement]

    def regressions(self, *, tolerance: float = 0.0) -> list[Figure]:
        """The figures that are worse, whatever their part.

        Parameters
        ----------
        tolerance
            By how much a figure may be worse, as a share of A's [1].
        """
        return [figure for figure in self.figures if figure.is_regression(tolerance=tolerance)]


def difference(
    a: Profile,
    b: Profile,
    *,
    timing_models: Sequence[TimingModelName] = BOTH_MODELS,
    circle: Circle | None = None,
) -> Difference:
    """Compare two profiles.

    Parameters
    ----------
    a, b
        The profiles; B is judged against A.
    timing_models
        Which timing models, in this order.
    circle
        The circle test, run when either profile asks for a circle; without it none is.

    Returns
    -------
    Difference
        Keys in the order of the schema; figures of the plan, of each timing model and of the circle.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> found = difference(load("paper-1ms").profile, load("paper-optimal-gap").profile, timing_models=["standard"])
    >>> [one.key for one in found.keys if one.key.startswith("bus.")]
    ['bus.gap_count', 'bus.timing_model']
    >>> found.judged("worse")
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
        one, other = of_a.get(key), of_b.get(key)
        if one is None or other is None or one.value != other.value:
            yield KeyDifference(key, one, other)


def _circle_side(profile: Profile, circle: Circle) -> CircleSide:
    try:
        result = circle(profile)
    except BusplanError as error:
        return CircleSide(None, error.problems)
    return CircleSide(result, tuple(failure.text for failure in result.failures))


def _figures(
    a: Profile,
    b: Profile,
    timing_models: Sequence[TimingModelName],
    circles: tuple[CircleSide, CircleSide] | None,
) -> Iterator[Figure]:
    yield from _compared("plan", PLAN, _plan(a), _plan(b))
    for model in timing_models:
        yield from _compared(model, CYCLE, _cycle(a, model), _cycle(b, model))
    if circles is not None:
        circle_a, circle_b = ({} if side.figures is None else side.figures._asdict() for side in circles)
        yield from _compared("circle", CIRCLE, circle_a, circle_b)


def _plan(profile: Profile) -> dict[str, Any]:
    """Figures under the model that decides, whichever are asked for: no choice of models hides its verdict."""
    deciding = figures(profile, model=profile.bus.timing_model)
    return deciding._asdict() | {"verdict_fits": deciding.fits}


def _cycle(profile: Profile, model: TimingModelName) -> dict[str, Any]:
    """Figures of one cycle by name: those of `capacity`, and the latencies with their gaps."""
    gaps = {
        f"{one.transaction}_latency_with_gaps_us": one.phases.latency_with_gaps_us
        for one in latency(profile, timing_models=[model]).transactions
    }
    return figures(profile, model=model)._asdict() | gaps


def _compared(part: Part, measures: Sequence[Measure], a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Figure]:
    for measure in measures:
        of_a, of_b = a.get(measure.key), b.get(measure.key)
        noise = 0.0 if measure.scale is None else ROUNDING * max(side.get(measure.scale, 0.0) for side in (a, b))
        change = of_b - of_a if _is_number(of_a) and _is_number(of_b) else None
        yield Figure(
            part=part,
            measure=measure,
            a=of_a,
            b=of_b,
            judgement=_judgement(measure, a, b, noise=noise),
            difference=change,
            relative_difference=_share(change, of_a, noise=noise) if measure.relative else None,
        )


def _judgement(measure: Measure, a: Mapping[str, Any], b: Mapping[str, Any], *, noise: float) -> Judgement:
    of_a, of_b = a.get(measure.key), b.get(measure.key)
    rank_a, rank_b = _rank(measure, a), _rank(measure, b)
    if rank_a is None or rank_b is None:
        return "same" if of_a == of_b else "neutral"
    if isclose(rank_a, rank_b, rel_tol=ROUNDING, abs_tol=noise):
        # A circle that cannot be run is as good as one that fails, and not the same.
        return "same" if (of_a is None) == (of_b is None) else "neutral"
    if measure.better == "neither":
        return "neutral"
    return "better" if (rank_b > rank_a) == (measure.better == "more") else "worse"


def _rank(measure: Measure, values: Mapping[str, Any]) -> float | None:
    """A figure as a number that orders; None where it has no order."""
    value = values.get(measure.key)
    if measure.key == "passed":
        return float(value is True)
    stable = values.get("stable")
    if value is None and measure.key in _MARGINS and stable is not None:
        # A stable loop without a margin never comes to its limit; an unstable one is beyond it.
        return inf if stable else -inf
    return float(value) if isinstance(value, int | float) else None


def _share(change: float | None, of: Any, *, noise: float) -> float | None:
    """A change as a share of a figure's size; None where that is nothing but rounding."""
    if change is None or abs(of) <= noise:
        return None
    share = change / abs(of)
    return share if isfinite(share) else None


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
