"""What a network could reach with all that is cheap free: the shortest period, the largest payload, the most nodes."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from math import inf

from busplan.buses.parts import Cost
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import CIRCLE, most_asking
from busplan.questions.plan.freedoms import PERIOD, Freedom, longest_period_us, most_nodes, period_grid, place_of
from busplan.questions.plan.machine import with_nodes, with_payload
from busplan.questions.plan.option import Impossible, Option, option
from busplan.questions.plan.search import Search
from busplan.sections.base import MAX_COUNT, MAX_TIME_US
from busplan.sections.profile import Profile


def frontier(goal: Profile, search: Search, levels: Sequence[Freedom]) -> Iterator[Option | Impossible]:
    """Find the shortest period, the largest payload and the most nodes, each with the others as they are.

    Parameters
    ----------
    goal
        The network.
    search
        A search for it.
    levels
        What may be changed, of which what is cheaper than a payload is.
    """
    cheap = [one for one in levels if one.cost < Cost.PAYLOAD]
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
        found = search.least(cheap, {PERIOD: grid.number(place)})
        proven = tried < search.max_circles
        if found is not None:
            held_by = CIRCLE if place > first else most_asking(search.needs(found), ratio=search.ratio(found)).key
            return option(search, title, found, held_by=held_by)._replace(proven=proven)
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
        one = with_payload(goal, size) or {}
        return not (search.allows(one) and search.reaches(one, cheap))

    first = bisect_left(sizes, execution.ascends_from_bytes)
    sizes = sizes[: bisect_left(sizes, True, lo=first, key=is_out) + 1]
    place, failed = len(sizes) - 1, 0
    while place >= 0:
        size = sizes[place]
        one = with_payload(goal, size) or {}
        if search.allows(one):
            is_near = search.reaches(one, cheap)
            found = search.least(cheap, one) if is_near else None
            if found is not None:
                bound = payloads.bound if size == largest else "execution"
                held_by = bound if tried is None else search.binding(cheap, tried).key
                return option(search, title, found, held_by=held_by)._replace(proven=failed < search.max_circles)
            tried = one
            failed += is_near  # in time, and refused for something else
        place -= 1 if failed < search.max_circles else 2 ** (failed - search.max_circles + 1)
    if tried is None:
        return Impossible(title, "the execution table holds no whole step of the payload")
    return Impossible(title, f"not even the smallest fits: {search.binding(cheap, tried).why}")


def _most_nodes(search: Search, cheap: Sequence[Freedom]) -> Option | Impossible:
    title = "most nodes"
    nodes = most_nodes(search, {}, cheap, below=MAX_COUNT + 1)
    found = search.least(cheap, with_nodes(nodes)) if nodes else None
    if found is None:
        return Impossible(title, search.binding(cheap, with_nodes(max(nodes, 1))).why)
    held_by = search.binding(cheap, with_nodes(nodes + 1)).key if nodes < MAX_COUNT else None
    return option(search, title, found, held_by=held_by)
