"""The delay that a bus puts into the position loops; nothing is simulated."""

from itertools import accumulate

from busplan.buses.cycle import BusCycle
from busplan.buses.network import Network
from busplan.elementwise import Number, plain
from busplan.questions.fit.certainty import deciding_cycle
from busplan.sections.base import value_at


def loop_delays_us(network: Network) -> tuple[float, float]:
    """Bus delay inside the loops of x and y: none on a node [us].

    On the host it is one period, for the synchronous packet triggers both the sample and the update with the last
    command; more where the kind of bus says so. Where nodes apply their commands on arrival it lasts from the sample to
    the end of the command's execution: x is taken to be on the first node of the cycle with axes and y on the last,
    which differ most.

    References
    ----------
    Paper, section III-C.
    """
    if network.profile.servo.loop == "node":
        return 0.0, 0.0
    cycle = deciding_cycle(network)
    at_sync = network.profile.servo.update == "next_sync"
    whole_us = cycle.loop_periods(at_sync=at_sync) * network.profile.cycle.period_us
    if at_sync:
        return whole_us, whole_us
    since_us = whole_us - cycle.sampled_us()
    first_us, last_us = _first_and_last_us(cycle)
    return since_us + first_us, since_us + last_us


def skew_us(network: Network) -> float:
    """How much later the last node with axes takes its set-point than the first, where no clock is common to them [us].

    A loop on the host has it in its delays.
    """
    if network.profile.servo.loop == "host" or acts_at_once(network):
        return 0.0
    first_us, last_us = _first_and_last_us(deciding_cycle(network))
    return last_us - first_us


def acts_at_once(network: Network) -> bool:
    """Whether the nodes take their set-points at one time; otherwise each does when it has its own."""
    clock = network.bus.key_of("clock")
    return not clock or bool(value_at(network.profile, clock))


def jitter_us(network: Network) -> float:
    """Jitter of the synchronous packet, either way of its mean: the profile's own and what the bus adds [us]."""
    return float(plain(any_jitter_us(network)))


def any_jitter_us(network: Network) -> Number:
    """As `jitter_us`, of a profile whose numbers may be arrays [us]."""
    us: Number = network.profile.delivery.jitter_us + deciding_cycle(network).sync_jitter_us()
    return us


def _first_and_last_us(cycle: BusCycle) -> tuple[float, float]:
    """When the commands of the first and the last node with axes take effect, from the start of the cycle [us]."""
    network = cycle.network
    ends = list(accumulate(int(plain(group.nodes)) for group in network.groups))
    with_axes = [place for place, group in enumerate(network.groups) if group.axes] or range(len(ends))
    moved = [place for place in with_axes if not network.groups[place].is_slower] or with_axes

    def effect_us(place: int, node: int) -> float:
        # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
        return min(cycle.arrival_us(node), plain(network.period_us)) + cycle.taking_us(network.groups[place])

    first = moved[0]
    return effect_us(first, [0, *ends][first] + 1), effect_us(moved[-1], ends[moved[-1]])
