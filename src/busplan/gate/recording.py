"""The machine beside its plan: what a recording shows to be outside it, and what it does not show."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from busplan.buses.recorded import RecordedFigure
from busplan.buses.rule import Rule, RuleProblem, told_apart
from busplan.gate.rules import NOT_RECORDED, NOTHING_RECORDED, OUTSIDE_PLAN
from busplan.questions.base.inputs import Path
from busplan.sections.profile import Profile

_UNPLANNED: Final = "name"
"""Key of a figure that no key plans: the first one of every profile that has the whole machine."""


class Recording(NamedTuple):
    """A recording of the machine that a profile plans."""

    path: Path
    quantile: float = 1.0
    """Share of the events that worst cases hold for, 0.5..1."""


def beside_plan(profile: Profile, recording: Recording) -> Iterator[tuple[Rule, RuleProblem]]:
    """What a recording shows outside the plan, what it does not show to be within it, and where it shows nothing.

    Raises
    ------
    BusplanError
        It cannot be read, or compared with the profile.
    """
    from busplan.questions.measured import measured

    answer = measured(profile, recording.path, quantile=recording.quantile)
    for figure in answer.figures:
        way_out = "busplan measured --apply writes what was measured" if answer.edits.get(figure.key) else ""
        if figure.verdict == "outside":
            yield OUTSIDE_PLAN, RuleProblem(figure.key or _UNPLANNED, _words(figure), way_out)
        elif figure.verdict == "not shown" and not answer.shows_nothing:
            yield NOT_RECORDED, RuleProblem(figure.key or _UNPLANNED, f"not shown: {_words(figure)}", way_out)
    for reason in answer.shows_nothing:
        yield NOTHING_RECORDED, RuleProblem(_UNPLANNED, reason, "record it anew")


def _words(figure: RecordedFigure) -> str:
    if figure.hidden or figure.planned is None or figure.recorded is None:
        return f"{figure.quantity}: {figure.hidden}"
    unit = {"1": "", "share": " %"}.get(figure.unit, f" {figure.unit}")
    factor = 100 if figure.unit == "share" else 1
    if figure.unit in ("1", "bytes"):
        recorded, allowed = f"{figure.recorded:.0f}", f"{figure.planned:.0f}"
    else:
        recorded, allowed = told_apart(factor * figure.recorded, factor * figure.planned)
    doubt = "" if figure.uncertainty is None else f" +/- {factor * figure.uncertainty:.2g}"
    sense = "" if figure.sense == "equal" else f"{figure.sense} "
    note = f" ({figure.note})" if figure.note else ""
    return f"{figure.quantity}: {recorded}{doubt}{unit} recorded, {sense}{allowed}{unit} planned{note}"
