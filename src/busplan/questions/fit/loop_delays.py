"""The delay that a bus puts into the position loops; nothing is simulated."""

from itertools import accumulate

from busplan.buses.cycle import BusCycle
from busplan.elementwise import Number, plain
from busplan.questions.fit.certainty import cycle_of
from busplan.questions.fit.network import bus_of
from busplan.sections.base import value_at
from busplan.sections.profile import Profile


def loop_delays_us(profile: Profile) -> tuple[float, float]:
    """Bus delay inside the loops of x and y: none on a node [us].

    On the host it is one period, for the synchronous packet triggers both the sample and the update with the last
    command; more where the kind of bus says so. Where nodes apply their commands on arrival it lasts from the sample to
    the end of the command's execution: x is taken to be on the first node of the cycle with axes and y on the last,
    which differ most.

    References
    ----------
    Paper, section III-C.
    """
    if profile.servo.loop == "node":
        return 0.0, 0.0
    cycle = _deciding_cycle(profile)
    at_sync = profile.servo.update == "next_sync"
    whole_us = cycle.loop_periods(at_sync=at_sync) * profile.cycle.period_us
    if at_sync:
        return whole_us, whole_us
    since_us = whole_us - cycle.sampled_us()
    first_us, last_us = _first_and_last_us(cycle)
    return since_us + first_us, since_us + last_us


def skew_us(profile: Profile) -> float:
    """How much later the last node with axes takes its set-point than the first, where no clock is common to them [us].

    A loop on the host has it in its delays.
    """
    if profile.servo.loop == "host" or acts_at_once(profile):
        return 0.0
    first_us, last_us = _first_and_last_us(_deciding_cycle(profile))
    return last_us - first_us


def acts_at_once(profile: Profile) -> bool:
    """Whether the nodes take their set-points at one time; otherwise each does when it has its own."""
    clock = bus_of(profile).key_of("clock")
    return not clock or bool(value_at(profile, clock))


def jitter_us(profile: Profile) -> float:
    """Jitter of the synchronous packet, either way of its mean: the profile's own and what the bus adds [us]."""
    return float(plain(any_jitter_us(profile)))


def any_jitter_us(profile: Profile) -> Number:
    """As `jitter_us`, of a profile whose numbers may be arrays [us]."""
    us: Number = profile.delivery.jitter_us + _deciding_cycle(profile).sync_jitter_us()
    return us


def _deciding_cycle(profile: Profile) -> BusCycle:
    return cycle_of(profile, model=bus_of(profile).deciding_model)


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
