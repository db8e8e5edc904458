"""Values of a map's directions that nobody gave: the edge of what fits is among them, and the profile's own values."""

from math import ceil, floor, log10
from typing import Final

from busplan.questions.fit.circle_refusal import step_refusals
from busplan.questions.fit.network import bus_of, varied_nodes
from busplan.questions.fit.node_steps import NodeSteps, node_steps, telling_periods
from busplan.questions.map.direction import AXES, PERIOD, Direction, own_value
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MIN_STEP_US
from busplan.sections.profile import Profile

_FACTORS: Final = ((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 2, 5), (1,))
"""Round numbers of a decade, the finest choice first."""
_MOST: Final = 20
"""Most values of a direction, but for the profile's own."""
_BEYOND: Final = 2
"""Nodes drawn beyond the most that fit."""


def default_direction(key: str, profile: Profile, *, with_circle: bool) -> Direction:
    """Choose the values of `AXES` or of `PERIOD` about what fits.

    Parameters
    ----------
    key
        `AXES` or `PERIOD`.
    profile
        The network.
    with_circle
        Whether circles are run, though the profile may not ask for one.
    """
    varied = varied_nodes(profile)
    steps = node_steps(profile, model=bus_of(profile).deciding_model, group=varied.name)
    from_us, to_us = telling_periods(profile, [steps])
    if key == AXES:
        nodes, each = _nodes(steps, to_us), int(varied.node.axes)
        if not each:  # nodes without axes are counted themselves
            return Direction(varied.nodes_key, nodes)
        others = own_value(AXES, profile) - steps.own_nodes * each
        return Direction(AXES, tuple(others + one * each for one in nodes))
    own_us = own_value(PERIOD, profile)
    least_us, most_us = max(from_us, MIN_STEP_US), min(to_us, MAX_TIME_US)
    known = [one for one in bus_of(profile).periods.us if least_us <= one <= most_us]
    periods_us = _thinned(known) if known else _round_numbers(least_us, most_us)
    if with_circle or profile.asks_for_circle:
        # Periods whose circle can be run; all, where the step goes with none.
        periods_us = [one for one in periods_us if not any(step_refusals(profile, one))] or periods_us
    return Direction(PERIOD, tuple(sorted({*periods_us, own_us})))


def _nodes(steps: NodeSteps, to_us: float) -> tuple[int, ...]:
    """Numbers of nodes, from one to some beyond the most that fit the longest period drawn."""
    last = min(max(steps.own_nodes + 1, steps.max_nodes(to_us) + _BEYOND), MAX_COUNT)
    step = next(one for one in (f * 10**p for p in range(7) for f in (1, 2, 5)) if last <= _MOST * one)
    return tuple(sorted({1, steps.own_nodes, *range(step, min(last + step, MAX_COUNT + 1), step)}))


def _round_numbers(least: float, most: float) -> list[float]:
    """Round numbers between two, as many as are drawn."""
    powers = range(floor(log10(least)), ceil(log10(most)) + 1)
    found: list[float] = []
    for factors in _FACTORS:
        numbers = [float(f"{factor}e{power}") for power in powers for factor in factors]
        found = [one for one in numbers if least <= one <= most]
        if len(found) <= _MOST:
            break
    return _thinned(found)


def _thinned(numbers: list[float]) -> list[float]:
    """As many of some numbers as are drawn, evenly."""
    return numbers[:: ceil(len(numbers) / _MOST) or 1]
