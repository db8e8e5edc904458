"""`busplan.diff`: the keys that differ between two profiles, and what that does to every figure."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isclose, isfinite
from typing import Any, Final, Literal, TypeGuard

from busplan.buses import figure as register
from busplan.buses.bus import Bus
from busplan.buses.figure import Figure, by_key
from busplan.buses.network import Network
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Report
from busplan.profile.kinds import KeyValue, dotted_keys
from busplan.profile.sources import load_revision
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import Models, ProfileLike, argument, checked_models, finite, load_network
from busplan.questions.fit.certainty import VERDICTS, VerdictWord
from busplan.questions.fit.figures import FitFigures, Judged, capacity_figures
from busplan.questions.fit.needs import missed_limits
from busplan.questions.fit.network import model_names, network_of
from busplan.sections.profile import Profile
from busplan.sourced import constants_changed

Judgement = Literal["better", "worse", "same", "neutral"]

ROUNDING: Final = 1e-9
"""Relative difference that float rounding can cause; figures that differ by less are the same [1]."""


@dataclass(frozen=True)
class KeyDifference:
    """A key whose values differ; None for a profile without the key."""

    key: str
    a: KeyValue | None
    b: KeyValue | None


@dataclass(frozen=True)
class ComparedFigure:
    """A figure of both profiles. A value that does not exist is None."""

    part: str
    """"plan" under the timing models that decide, or the name of a timing model."""
    figure: Figure
    a: Any
    b: Any
    judgement: Judgement
    """Judgement on B against A."""
    difference: float | None
    """B minus A; None unless both are numbers."""
    relative_difference: float | None
    """`difference` as a share of the absolute value of A [1]; None if that is meaningless."""

    def is_regression(self, *, tolerance: float) -> bool:
        """Whether B is worse by more than a share of A; without numbers, whether it is worse at all."""
        if self.judgement != "worse" or self.difference is None:
            return self.judgement == "worse"
        allowed: float = tolerance * abs(self.a) * (1 + ROUNDING)
        return abs(self.difference) > allowed


@dataclass(frozen=True)
class DiffSide(Judged):
    """One of the two profiles."""

    argument: str
    """Argument as given; the name of a `Profile`."""
    profile: Profile
    figures: FitFigures
    """Figures of the timing model that decides."""
    missed_limits: tuple[str, ...]
    """Keys of [limits] that are not kept."""

    @property
    def verdict(self) -> VerdictWord | None:
        """Verdict of the timing model that decides."""
        return self.figures.verdict


@dataclass(frozen=True, slots=True, repr=False)
class DiffAnswer(Answer):
    """Answer of `diff`."""

    a: DiffSide
    b: DiffSide
    """The profiles with their verdicts; B is judged against A."""
    keys: tuple[KeyDifference, ...]
    """Keys whose values differ, defaults applied."""
    figures: tuple[ComparedFigure, ...]
    """Figures of both, with B - A and its `judgement`: "better", "worse", "same" or "neutral"."""

    @property
    def same(self) -> bool:
        """Whether no key differs."""
        return not self.keys

    def judged(self, judgement: Judgement) -> tuple[ComparedFigure, ...]:
        """Figures with one judgement, in order."""
        return tuple(figure for figure in self.figures if figure.judgement == judgement)

    def regressions(self, *, tolerance_percent: float = 0.0) -> tuple[ComparedFigure, ...]:
        """List the figures of B that are worse: those that `--fail-on-regression` fails for.

        Parameters
        ----------
        tolerance_percent
            Margin by which a number may be worse than A's [%].

        Raises
        ------
        BusplanError
            The tolerance is negative or no number.
        """
        allowed = finite(tolerance_percent, name="tolerance_percent")
        if allowed < 0:
            raise ArgumentError(f"tolerance_percent {allowed:g}: must be 0 or more")
        return tuple(figure for figure in self.figures if figure.is_regression(tolerance=allowed / 100))

    def regression_words(self, *, tolerance_percent: float = 0.0) -> str:
        """Sentence that names the `regressions`; empty without any."""
        from busplan.questions.diff.report import regression_words

        return regression_words(self, tolerance_percent=tolerance_percent)

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.diff.report import diff_report

        return diff_report(self)


def diff(
    a: ProfileLike,
    b: ProfileLike,
    *,
    timing_model: Models | None = None,
    arguments: tuple[str, str] | None = None,
) -> DiffAnswer:
    """Tell what changed between two profiles, and what that does to every figure.

    Parameters
    ----------
    a, b
        The profile to compare with, and the one to judge: a `Profile`, a path, a shipped name, or REV:path for a file
        of a git revision, as "HEAD~1:profiles/line.toml".
    timing_model
        Name of a timing model, or several; by default all that can express both profiles. The verdict is always that
        of the model that decides.
    arguments
        Names of A and B in the report; by default as they are given, and the name of a `Profile`.

    Returns
    -------
    DiffAnswer
        Its `figures` have the unit in their key: times are in us, shares 0..1.

    Raises
    ------
    BusplanError
        Not a profile, an unknown timing model, or one of two kinds of bus.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.diff("paper-1ms", "paper-optimal-gap", timing_model="standard")
    >>> [(change.a.value, change.b.value) for change in answer.keys if change.key == "bus.gap_count"]
    [(63, 'optimal')]
    >>> [round(row.difference, 3) for row in answer.figures if row.figure.key == "margin_us"]
    [75.195]
    >>> answer.a.verdict, answer.b.verdict, answer.regressions()
    ('fits', 'fits', ())
    """
    (name_a, network_a), (name_b, network_b) = _given(a), _given(b)
    names = arguments or (name_a, name_b)
    models = model_names(network_a)
    if timing_model is not None:
        models = _models(timing_model, network_a, network_b)
    elif network_a.bus is network_b.bus:
        models = tuple(model for model in models if model in model_names(network_b))
    side_a, side_b = (_side(name, at) for name, at in zip(names, (network_a, network_b), strict=True))
    return DiffAnswer(
        side_a,
        side_b,
        tuple(_keys(side_a.profile, side_b.profile)),
        tuple(_figures((side_a, network_a), (side_b, network_b), models)),
    )


def _given(side: ProfileLike) -> tuple[str, Network]:
    """Name of one side as it was given, and its network."""
    with constants_changed(side.constants if isinstance(side, Profile) else ()):
        if isinstance(side, Profile):
            return side.name, network_of(side)
        if isinstance(side, str):
            return side, network_of(load_revision(argument(side)).profile)
        return os.fspath(side), load_network(side)


def _models(timing_model: Models, a: Network, b: Network) -> tuple[str, ...]:
    if a.bus is not b.bus:
        raise BusplanError(
            f"timing_model {timing_model}: the kinds of bus, {a.bus.kind} and {b.bus.kind}, have no timing "
            "model in common; leave it out"
        )
    checked_models(timing_model, b)  # This refuses a model that cannot express B.
    return checked_models(timing_model, a)


def _side(name: str, network: Network) -> DiffSide:
    with constants_changed(network.profile.constants):
        deciding = capacity_figures(network, model=network.bus.deciding_model)
        missed = tuple(dict.fromkeys(missed.key for missed in missed_limits(network)))
        return DiffSide(name, network.profile, deciding, missed)


def _keys(a: Profile, b: Profile) -> Iterator[KeyDifference]:
    keys_a, keys_b = ({**dotted_keys(side), **_constants(side)} for side in (a, b))
    for key in dict.fromkeys((*keys_a, *keys_b)):
        value_a, value_b = keys_a.get(key), keys_b.get(key)
        if value_a is None or value_b is None or value_a.value != value_b.value:
            yield KeyDifference(key, value_a, value_b)


def _constants(profile: Profile) -> dict[str, KeyValue]:
    return {f"constants.{name}": KeyValue(value, "file") for name, value in profile.constants}


def plan_figures(*buses: Bus) -> tuple[Figure, ...]:
    """Figures of the plan: the verdict of the model that decides, and figures that all models share.

    A longer period or one more node is a choice, neither good nor bad by itself. Bias and uncertainty are not judged
    either, because the corrected margin and the smallest safe period contain them.
    """
    setup = by_key(figure for bus in buses for figure in bus.figures.setup)
    return (
        *(register.TIMING_MODEL, register.VERDICT, register.PERIOD, register.NODES, register.AXES),
        *setup.values(),
        *(register.AVAILABLE, register.TIME_SLICE),
        *(register.MARGIN_CORRECTED, register.UNCERTAINTY, register.BIAS, register.SAFE_NODES, register.SAFE_AXES),
        *(register.SAFE_LIMITED_BY, register.SAFE_MIN_PERIOD),
    )


def cycle_figures(*buses: Bus) -> tuple[Figure, ...]:
    """Figures of the cycle under one timing model.

    A single term is neither good nor bad: only their sum counts.
    """
    of_kind = by_key(figure for bus in buses for figure in bus.figures.compared)
    terms = by_key(figure._replace(better="neither") for bus in buses for figure in bus.figures.terms)
    return (
        *(register.FITS, register.MARGIN, register.UTILISATION, register.REQUIRED),
        *terms.values(),
        *(register.MAX_NODES, register.MAX_AXES, register.LIMITED_BY, register.MIN_PERIOD),
        *of_kind.values(),
        register.BINDING_TERM,
    )


def _figures(
    side_a: tuple[DiffSide, Network], side_b: tuple[DiffSide, Network], models: Sequence[str]
) -> Iterator[ComparedFigure]:
    (a, network_a), (b, network_b) = side_a, side_b
    buses = (network_a.bus, network_b.bus)
    groups = tuple(dict.fromkeys(group.name for side in (a, b) for group in side.profile.group))
    plan = (*plan_figures(*buses), *_of_groups(groups, register.SAFE_NODES))
    yield from _compared("plan", plan, a.figures, b.figures)
    cycle = (*cycle_figures(*buses), *_of_groups(groups, register.MAX_NODES))
    if buses[0] is not buses[1]:
        yield from _compared("deciding", cycle, a.figures, b.figures)
        return
    for model in models:
        yield from _compared(model, cycle, *(_of_model(model, *side) for side in (side_a, side_b)))


def _of_model(model: str, side: DiffSide, network: Network) -> FitFigures:
    if model == side.figures.timing_model:
        return side.figures
    with constants_changed(network.profile.constants):
        return capacity_figures(network, model=model)


def _of_groups(names: Sequence[str], figure: Figure) -> Iterator[Figure]:
    """A figure for each group."""
    for name in names:
        yield figure._replace(key=f"group.{name}.{figure.key}", label=f"{figure.label} of {name}")


def _compared(part: str, measures: Sequence[Figure], of_a: FitFigures, of_b: FitFigures) -> Iterator[ComparedFigure]:
    a, b = of_a.values(), of_b.values()
    for measure in measures:
        value_a, value_b = a.get(measure.key), b.get(measure.key)
        noise = 0.0 if measure.scale is None else ROUNDING * max(side.get(measure.scale) or 0.0 for side in (a, b))
        change = value_b - value_a if _is_number(value_a) and _is_number(value_b) else None
        yield ComparedFigure(
            part=part,
            figure=measure,
            a=value_a,
            b=value_b,
            judgement=_judgement(measure, value_a, value_b, noise=noise),
            difference=change,
            relative_difference=_share(change, value_a, noise=noise) if measure.relative else None,
        )


def _judgement(measure: Figure, a: Any, b: Any, *, noise: float) -> Judgement:
    rank_a, rank_b = _rank(measure, a), _rank(measure, b)
    if rank_a is None or rank_b is None:
        return "same" if a == b else "neutral"
    if isclose(rank_a, rank_b, rel_tol=ROUNDING, abs_tol=noise):
        return "same"
    if measure.better == "neither":
        return "neutral"
    return "better" if (rank_b > rank_a) == (measure.better == "more") else "worse"


def _rank(measure: Figure, value: Any) -> float | None:
    """A figure as a number that ranks it, True above False; None without a rank."""
    if measure.key == register.VERDICT.key and value is not None:
        return -float(VERDICTS.index(value))
    return float(value) if isinstance(value, int | float) else None


def _share(change: float | None, before: Any, *, noise: float) -> float | None:
    """A change as a share of the absolute value before [1]; None if that value is only rounding."""
    if change is None or abs(before) <= noise:
        return None
    share = change / abs(before)
    return share if isfinite(share) else None


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
