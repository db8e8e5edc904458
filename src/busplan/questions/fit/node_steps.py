"""How many nodes a bus carries over its period, exactly: from which period on each further one fits."""

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from busplan.elementwise import FIT_ROUNDING
from busplan.profile.toml import override
from busplan.questions.fit.certainty import certainty
from busplan.questions.fit.figures import shortest_period_us
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.fit.node_limit import largest_nodes, safe_nodes
from busplan.sections.base import MAX_TIME_US
from busplan.sections.profile import Profile


class NodeSteps(NamedTuple):
    """The steps of the largest number of nodes over the period, under one timing model.

    Under the model that decides they are those that are shown to fit; under another those of the closed form.
    """

    timing_model: str
    axes_per_node: int
    from_us: tuple[float, ...]
    """Smallest period that 1, 2, ... nodes fit in; none where no period helps."""
    limited_by: str
    """The limit that ends the steps."""
    is_safe: bool
    """Whether the nodes are shown to fit."""
    own_nodes: int
    """Nodes that the profile has [1]."""

    def max_nodes(self, period_us: float) -> int:
        """Most nodes that a period carries [1]."""
        return bisect_right(self.from_us, period_us * (1 + FIT_ROUNDING))

    def max_axes(self, period_us: float) -> int:
        """Most axes that a period carries [1]."""
        return self.axes_per_node * self.max_nodes(period_us)


def node_steps(profile: Profile, *, model: str, group: str = "") -> NodeSteps:
    """Find the period from which on each number of nodes fits, or is shown to fit under the model that decides.

    Parameters
    ----------
    profile
        The network; its own period and number of nodes play no part.
    model
        Timing model.
    group
        Name of the group whose nodes are counted, the others as they are; empty where all nodes are alike.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> steps = node_steps(load("paper-1ms").profile, model="paper")
    >>> steps.max_axes(1000.0)
    16
    """
    bus = bus_of(profile)
    longest = override(profile, {"cycle.period_us": min(MAX_TIME_US, bus.periods.longest_us)})
    is_safe = model == bus.deciding_model
    most, limit = (
        safe_nodes(network_of(longest), group=group)
        if is_safe
        else largest_nodes(network_of(longest), model=model, group=group)
    )
    network = network_of(profile).asking(group)
    counts = np.arange(1, most + 1)
    cycle = bus.cycle(network.with_nodes(counts), model=model)
    needed_us = np.asarray(certainty(cycle).safe_required_us if is_safe else cycle.most_required_us)
    said = network.asked_nodes
    from_us = shortest_period_us(cycle.network, needed_us, is_shown=is_safe)
    return NodeSteps(
        model,
        said.node.axes,
        tuple(np.broadcast_to(np.asarray(from_us), counts.shape).tolist()),
        limit,
        is_safe,
        int(said.nodes),
    )


def telling_periods(profile: Profile, steps: Sequence[NodeSteps]) -> tuple[float, float]:
    """Range of periods [us]: from the first that carries a node to where its nodes fit, at least twice its own.

    Parameters
    ----------
    profile
        The network.
    steps
        Its steps, one for each timing model of interest.
    """
    own_us = profile.cycle.period_us
    carrying = [step for step in steps if step.from_us]
    lasts = [carrier.from_us[-1] * 1.25 for carrier in carrying]
    needed = [carrier.from_us[min(carrier.own_nodes, len(carrier.from_us)) - 1] * 1.25 for carrier in carrying]
    to_us = max(2 * own_us, *needed, min(4 * own_us, max(lasts, default=0.0)), 0.0)
    from_us = min(own_us, *(carrier.from_us[0] for carrier in carrying), to_us / 4) / 1.25
    return from_us, min(to_us, 4 * MAX_TIME_US)
