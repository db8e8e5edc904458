"""What would make a plan possible: another freedom, a limit of the profile that asks for less, no circle."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from busplan.buses.parts import Value
from busplan.profile.toml import override
from busplan.questions.plan.constraints import CIRCLE
from busplan.questions.plan.freedoms import Freedom, freedoms
from busplan.questions.plan.search import MAX_CIRCLES, FindCircleFailures, Search
from busplan.sections.profile import Profile

_SHARES = 100
"""Steps of a share that is relaxed."""


class Relaxation(NamedTuple):
    """One thing that would be enough, and what to set then."""

    relaxed: str
    """Name of a freedom, a key of [limits], or circle."""
    value: Value | None
    """Value of the key of [limits] that is enough; None for others."""
    changes: dict[str, Value]
    """What to set then; keys of the goal with new values."""


def relaxations(
    goal: Profile,
    levels: Sequence[Freedom],
    *,
    kept: Sequence[str],
    circle: FindCircleFailures | None,
    max_circles: int = MAX_CIRCLES,
) -> Iterator[Relaxation]:
    """Find what alone would make a plan possible, with what to set then.

    Parameters
    ----------
    goal
        The profile with the wanted values, for which there is no plan.
    levels
        What may be changed.
    kept
        Keys that were asked for: each is relaxed by itself.
    circle
        Function that runs the circle test; None for none.
    max_circles
        As for `Search` [1].

    Yields
    ------
    Relaxation
        Freedoms in the order of their cost, then keys of [limits], then the circle.
    """
    names = {one.name for one in levels}
    for one in freedoms(goal):
        if one.name not in names:
            more = [each for each in freedoms(goal) if each.name in {*names, one.name}]
            search = Search(goal, circle=circle, kept=set(kept) - set(one.keys), max_circles=max_circles)
            found = search.least(more)
            if found is not None:
                yield Relaxation(one.name, None, dict(found))
    for key, values in _weaker_limits(goal):
        relaxed = _least_relaxed(goal, key, values, levels, kept=kept)
        if relaxed is not None:
            weaker = override(goal, {key: relaxed})
            changes = Search(weaker, circle=circle, kept=kept, max_circles=max_circles).least(levels)
            if changes is not None:
                yield Relaxation(key, relaxed, dict(changes))
    if circle is not None and goal.asks_for_circle:
        without = Search(goal, kept=kept).least(levels)
        if without is not None:
            yield Relaxation(CIRCLE, None, dict(without))


def _weaker_limits(goal: Profile) -> Iterator[tuple[str, Sequence[Value]]]:
    """Values of each key of [limits] that ask for less, the nearest first."""
    limits = goal.limits
    if limits.reserve:
        yield "limits.reserve", [n / _SHARES for n in range(_SHARES - 1, -1, -1) if n / _SHARES < limits.reserve]
    if limits.max_utilisation is not None:
        most = limits.max_utilisation
        yield "limits.max_utilisation", [n / _SHARES for n in range(1, _SHARES + 1) if n / _SHARES > most]
    for key in ("min_spare_nodes", "min_spare_axes"):
        least = getattr(limits, key)
        if least is not None:
            yield f"limits.{key}", range(least - 1, -1, -1)


def _least_relaxed(
    goal: Profile, key: str, values: Sequence[Value], levels: Sequence[Freedom], *, kept: Sequence[str]
) -> Value | None:
    """The nearest value with which the bus fits; a weaker one is never harder to hold."""

    def fits(value: Value) -> bool:
        return Search(override(goal, {key: value}), kept=kept).least(levels) is not None

    place = bisect_left(values, x=True, key=fits)
    return values[place] if place < len(values) else None
