"""Circle tests of the cells of a map that fit."""

from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple, Protocol, TypeVar

from busplan.profile.toml import override
from busplan.progress import Progress
from busplan.questions.circle.roundness import circle_test
from busplan.questions.circle.setup import NOTHING, announce, estimate, setup
from busplan.questions.fit.circle_refusal import refusals
from busplan.questions.map.cells import Cell, MapPoint
from busplan.sections.profile import Profile

_AT_ONCE: Final = 16
"""Circle tests between two reports of the progress."""

Place = tuple[int, int]
"""Row and column of a cell."""
Task = TypeVar("Task")
Result = TypeVar("Result")


class Mapper(Protocol):
    """The built-in `map`, here or in other processes."""

    def __call__(self, function: Callable[[Task], Result], tasks: Iterable[Task], /) -> Iterable[Result]:
        """Return the results in the order of the tasks."""


class _Task(NamedTuple):
    """The circle test of one setting; a process can be handed it."""

    profile: Profile
    changes: dict[str, object]


class _Judgement(NamedTuple):
    passed: bool | None
    failures: tuple[str, ...]


def _judge(task: _Task) -> _Judgement:
    (result,) = circle_test(override(task.profile, task.changes), explain=False).results
    return _Judgement(result.passed, tuple(failure.name for failure in result.failures))


def judged(
    profile: Profile,
    fitting: Mapping[Place, tuple[Cell, MapPoint]],
    *,
    mapper: Mapper,
    progress: Progress | None,
) -> dict[Place, Cell]:
    """Run the circle tests of cells that fit, after saying what many of them cost.

    Parameters
    ----------
    profile
        The network.
    fitting
        Cells and their settings.
    mapper
        How the tests are run.
    progress
        Called now and then with the tests that are done, and all of them.

    Returns
    -------
    dict
        The same cells, with what their circle says.
    """
    cost, runs = NOTHING, dict[Place, _Task]()
    cells = {place: cell for place, (cell, _) in fitting.items()}
    for place, (cell, setting) in fitting.items():
        # A profile that asks for no circle has none to be refused until now.
        refused = tuple(cause.name for cause in refusals(setting.profile))
        if refused:
            cells[place] = cell._replace(state="circle cannot be run", limited_by=refused, circle_refused_by=refused)
        else:
            cost = cost.then(estimate((), [setup(setting.profile)]))
            runs[place] = _Task(profile, dict(setting.changes))
    announce(cost)
    places = list(runs)
    for start in range(0, len(places), _AT_ONCE):
        part = places[start : start + _AT_ONCE]
        for place, found in zip(part, mapper(_judge, [runs[one] for one in part]), strict=True):
            cells[place] = _with_circle(cells[place], found)
        if progress is not None:
            progress(start + len(part), len(places))
    return cells


def _with_circle(cell: Cell, found: _Judgement) -> Cell:
    cell = cell._replace(circle_passed=found.passed)
    if found.passed is False:
        return cell._replace(state="circle fails", limited_by=found.failures)
    return cell if found.passed else cell._replace(state="circle not judged")
