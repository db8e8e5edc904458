"""The machine beside its plan: what a recording shows to be outside it."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from busplan.buses.recorded import RecordedFigure
from busplan.buses.rule import RuleProblem, told_apart
from busplan.questions.base.inputs import Path
from busplan.sections.profile import Profile

_UNPLANNED: Final = "name"
"""Key of a figure that no key plans: the first one of every profile that has the whole machine."""


class Recording(NamedTuple):
    """A recording of the machine that a profile plans."""

    path: Path
    quantile: float = 1.0
    """Share of the events that worst cases hold for, 0.5..1."""


def outside_plan(profile: Profile, recording: Recording) -> Iterator[RuleProblem]:
    """Figures of a recording that lie outside the plan.

    Raises
    ------
    BusplanError
        It cannot be read, or compared with the profile.
    """
    from busplan.questions.measured import measured

    answer = measured(profile, recording.path, quantile=recording.quantile)
    for figure in answer.outside:
        way_out = "busplan measured --apply writes what was measured" if answer.edits.get(figure.key) else ""
        yield RuleProblem(figure.key or _UNPLANNED, _words(figure), way_out)


def _words(figure: RecordedFigure) -> str:
    planned, seen = figure.planned or 0.0, figure.recorded or 0.0
    unit, factor = {"1": "", "share": " %"}.get(figure.unit, f" {figure.unit}"), 100 if figure.unit == "share" else 1
    if figure.unit in ("1", "bytes"):
        said, allowed = f"{seen:.0f}", f"{planned:.0f}"
    else:
        said, allowed = told_apart(factor * seen, factor * planned)
    doubt = "" if figure.uncertainty is None else f" +/- {factor * figure.uncertainty:.2g}"
    sense = "" if figure.sense == "equal" else f"{figure.sense} "
    note = f" ({figure.note})" if figure.note else ""
    return f"{figure.quantity}: {said}{unit} recorded, {sense}{allowed}{doubt}{unit} planned{note}"
