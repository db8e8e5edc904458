"""Offers of a plan: one way to set a network, what the machine could reach, and what would make a plan possible."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from math import inf
from typing import NamedTuple

from busplan.buses.parts import Cost, Value
from busplan.profile.toml import override
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import CapacityFigures, FitFigures, capacity_figures, figures
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.plan.constraints import CIRCLE, Changes, most_asking, with_nodes, with_payload
from busplan.questions.plan.freedoms import (
    PERIOD,
    Freedom,
    freedoms,
    longest_period_us,
    most_nodes,
    period_grid,
    place_of,
)
from busplan.questions.plan.search import MAX_CIRCLES, FindCircleFailures, Search
from busplan.sections.base import MAX_COUNT, MAX_TIME_US
from busplan.sections.profile import Profile


class Option(NamedTuple):
    """One way to set the network, computed with it in place."""

    title: str
    changes: dict[str, Value]
    """Keys that the option changes in the goal, with their new values, the dearest change first."""
    profile: Profile
    """The goal with the changes."""
    deciding: CapacityFigures
    """Capacity under the timing model that decides."""
    others: tuple[FitFigures, ...]
    """Capacity under the other timing models."""
    passes: bool
    """Whether every constraint holds: shown to fit, safe, within [limits], and a circle that passes if it was run."""
    held_by: str | None = None
    """The constraint that it breaks, or that keeps its value from being better; None if there is none."""
    circle_failures: tuple[str, ...] | None = None
    """Failures of the circle; None if it was not run."""
    proven: bool = True
    """Whether no smaller change exists; False if the search was cut short."""
    recommended: bool = False

    @property
    def circle_passed(self) -> bool | None:
        """Whether the circle holds its tolerances; None if it was not run, or holds what always judges and has none."""
        if not self.circle_failures and not self.profile.tolerance.judges_contour:
            return None
        return None if self.circle_failures is None else not self.circle_failures


class Impossible(NamedTuple):
    """Something that has no suitable value."""

    title: str
    reason: str
    proven: bool = True
    """Whether it is proven that no value exists; False if the search was cut short."""


def option(search: Search, title: str, changes: Changes, *, held_by: str | None = None) -> Option:
    """Put changes into the goal of a search and compute its figures.

    Parameters
    ----------
    search
        The search.
    title
        Name of the option.
    changes
        New values by dotted key.
    held_by
        As in `Option`.
    """
    changed = search.profile(changes)
    model, network = bus_of(changed).deciding_model, network_of(changed)
    deciding = capacity_figures(network, model=model)
    is_run = search.runs_circle and deciding.verdict == FITS and not deciding.circle_refused_by
    return Option(
        title=title,
        changes=dict(changes),
        profile=changed,
        deciding=deciding,
        others=tuple(figures(network, model=model_name) for model_name in model_names(changed) if model_name != model),
        passes=search.passes(changes),
        held_by=held_by,
        circle_failures=search.circle_failures(changes) if is_run else None,
        proven=search.proven,
    )


def frontier(goal: Profile, search: Search, levels: Sequence[Freedom]) -> Iterator[Option | Impossible]:
    """Find the shortest period, the largest payload and the most nodes, each with the others as they are.

    Parameters
    ----------
    goal
        The network.
    search
        A search for it.
    levels
        Freedoms, of which those cheaper than a payload are used.
    """
    cheap = [level for level in levels if level.cost < Cost.PAYLOAD]
    yield _shortest_period(goal, search, cheap)
    yield _largest_payload(goal, search, cheap)
    if not goal.group:
        yield _most_nodes(search, cheap)


def _shortest_period(goal: Profile, search: Search, cheap: Sequence[Freedom]) -> Option | Impossible:
    title, grid = "smallest period", period_grid(goal)
    needed_us = search.least_needed_us({}, cheap)
    if needed_us == inf:
        return Impossible(title, search.binding(cheap).why)
    first = place = place_of(grid, needed_us, each_us=1)
    tried = 0
    while grid.number(place) <= MAX_TIME_US:
        changes = search.least(cheap, {PERIOD: grid.number(place)})
        proven = tried < search.max_circles
        if changes is not None:
            held_by = CIRCLE if place > first else most_asking(search.needs(changes), ratio=search.ratio(changes)).key
            return option(search, title, changes, held_by=held_by)._replace(proven=proven)
        tried += 1
        place += 1 if tried < search.max_circles else 2 ** (tried - search.max_circles + 1)
    if not tried:
        return Impossible(title, f"it would be over {longest_period_us(goal) / 1e6:g} s")
    return Impossible(title, search.binding(cheap, {PERIOD: grid.number(first)}).why, proven=False)


def _largest_payload(goal: Profile, search: Search, cheap: Sequence[Freedom]) -> Option | Impossible:
    """For reads and writes alike. Where a larger one may take less time, every size is tried."""
    title, payloads = "largest payload", bus_of(goal).payloads(network_of(goal))
    step = payloads.step_bytes
    largest, tried = payloads.most_bytes // step * step, None
    if with_payload(goal, largest) is None:
        return Impossible(title, "each group has its own" if goal.group else "the payload follows the axes of a node")
    execution = goal.alike_nodes[0].node.execution
    sizes = range(step, largest + 1, step)
    least, most = execution.covered_bytes
    sizes = sizes[bisect_left(sizes, least) : bisect_right(sizes, most)]

    def is_out(size: int) -> bool:
        payload = with_payload(goal, size) or {}
        return not (search.allows(payload) and search.reaches(payload, cheap))

    first = bisect_left(sizes, execution.ascends_from_bytes)
    sizes = sizes[: bisect_left(sizes, True, lo=first, key=is_out) + 1]
    place, failed = len(sizes) - 1, 0
    while place >= 0:
        size = sizes[place]
        payload = with_payload(goal, size) or {}
        if search.allows(payload):
            is_near = search.reaches(payload, cheap)
            changes = search.least(cheap, payload) if is_near else None
            if changes is not None:
                bound = payloads.bound if size == largest else "execution"
                held_by = bound if tried is None else search.binding(cheap, tried).key
                return option(search, title, changes, held_by=held_by)._replace(proven=failed < search.max_circles)
            tried = payload
            failed += is_near  # in time, and refused for something else
        place -= 1 if failed < search.max_circles else 2 ** (failed - search.max_circles + 1)
    if tried is None:
        return Impossible(title, "the execution table holds no whole step of the payload")
    return Impossible(title, f"not even the smallest fits: {search.binding(cheap, tried).why}")


def _most_nodes(search: Search, cheap: Sequence[Freedom]) -> Option | Impossible:
    title = "most nodes"
    nodes = most_nodes(search, {}, cheap, below=MAX_COUNT + 1)
    changes = search.least(cheap, with_nodes(nodes)) if nodes else None
    if changes is None:
        return Impossible(title, search.binding(cheap, with_nodes(max(nodes, 1))).why)
    held_by = search.binding(cheap, with_nodes(nodes + 1)).key if nodes < MAX_COUNT else None
    return option(search, title, changes, held_by=held_by)


_SHARES = 100
"""Steps of a share that is relaxed."""


class Relaxation(NamedTuple):
    """One thing that would be enough, and what to set then."""

    relaxed: str
    """Name of a freedom, a key of [limits], or circle."""
    value: Value | None
    """Value of the key of [limits] that is enough; None for others."""
    changes: dict[str, Value]
    """Changes to make then: keys of the goal with new values."""


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
        Freedoms.
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
    names = {level.name for level in levels}
    for freedom in freedoms(goal):
        if freedom.name not in names:
            more = [level for level in freedoms(goal) if level.name in {*names, freedom.name}]
            search = Search(goal, circle=circle, kept=set(kept) - set(freedom.keys), max_circles=max_circles)
            least = search.least(more)
            if least is not None:
                yield Relaxation(freedom.name, None, dict(least))
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

    # Where not even the weakest is enough, the others need not be tried.
    if not values or not fits(values[-1]):
        return None
    return values[bisect_left(values, x=True, key=fits)]
