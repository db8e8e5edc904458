"""The largest number of nodes that a bus carries, and what keeps it from being larger."""

from bisect import bisect_left
from math import floor
from typing import NamedTuple

from busplan.analysis.capacity.cycle import Limit, available_us, cycle, fits_in, limits_broken
from busplan.buses.ieee1394.constants import MAX_HOPS, MAX_NODES
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.profile.bus import Ieee1394Bus
from busplan.profile.model import Profile


def most_nodes(bus: Ieee1394Bus) -> tuple[int, Limit]:
    """Nodes that the standard allows on a bus, whatever the time, and the limit that says so."""
    return (int(min(MAX_NODES, MAX_HOPS)), "hops") if bus.max_hops is None else (int(MAX_NODES), "nodes")


def largest_nodes(profile: Profile, *, model: TimingModelName) -> tuple[int, Limit]:
    """Find the largest number of nodes that fits the profile's period, and what keeps it from being larger.

    Required time is c0 + c1 N + c2 N^2: in a chain each packet crosses N hops, and there are N transactions of
    each kind; in a tree the hops stay, and c2 is zero. The root is the answer but for rounding, which the test of
    its neighbours takes out. An "optimal" gap count in a chain grows with N by the table, and the required time with
    both; there the at most 16 rows are halved until one is left.

    Parameters
    ----------
    profile
        The network; its own number of nodes plays no part.
    model
        Timing model.

    Returns
    -------
    tuple
        Number of nodes [1], and the limit.

    References
    ----------
    Paper, equations (1)-(11), with (11) solved for N.
    """
    bus = profile.bus
    is_chain = bus.max_hops is None
    if limits_broken(profile)["payload"]:
        return 0, "payload"
    if not is_chain and bus.hops(1) > MAX_HOPS:
        return 0, "hops"
    most, structural = most_nodes(bus)
    given_us = available_us(profile)

    def fits(nodes: int) -> bool:
        return fits_in(cycle(profile, model=model, nodes=nodes).required_us, available_us=given_us)

    if is_chain and bus.gap_count == "optimal":
        answer = bisect_left(range(1, most + 1), x=True, key=lambda nodes: not fits(nodes))
    else:
        answer = min(most, floor(required_by_nodes(profile, model=model).nodes(given_us)) + 1)
        while answer and not fits(answer):
            answer -= 1
    return answer, structural if answer == most else "time"


class RequiredByNodes(NamedTuple):
    """Required time over the number of nodes, c0 + c1 N + c2 N^2, with a gap count that is fixed."""

    c0_us: float
    c1_us: float
    c2_us: float

    def nodes(self, available_us: float) -> float:
        """Largest real N whose cycle fits, but for rounding; 0 when there is none. Arrays broadcast."""
        spare_us = available_us - self.c0_us
        spare_us = spare_us * (spare_us > 0)
        # The form without cancellation: c2 may be zero, c1 is not. The power is an operator, and a root for arrays too.
        root: float = (self.c1_us * self.c1_us + 4 * self.c2_us * spare_us) ** 0.5
        return 2 * spare_us / (self.c1_us + root)


def required_by_nodes(profile: Profile, *, model: TimingModelName) -> RequiredByNodes:
    """Required time as a polynomial of the number of nodes; arrays broadcast."""
    # One and two nodes, and the cycle of none, give the three coefficients through the equations themselves.
    one, two = (cycle(profile, model=model, nodes=nodes) for nodes in (1, 2))
    latencies_one = one.read.latency_with_gaps_us + one.write.latency_with_gaps_us
    latencies_two = two.read.latency_with_gaps_us + two.write.latency_with_gaps_us
    sync_per_node_us = two.sync_us - one.sync_us
    c2 = latencies_two - latencies_one
    return RequiredByNodes(
        c0_us=one.nonperiodic_us + one.sync_us - sync_per_node_us,
        c1_us=latencies_one - c2 + sync_per_node_us,
        c2_us=c2,
    )
