"""The delay that a bus puts into the position loops; nothing is simulated."""

from busplan.analysis.capacity.cycle import cycle_of
from busplan.analysis.network import bus_of, network_of
from busplan.elementwise import plain
from busplan.sections.profile import Profile


def loop_delays_us(profile: Profile) -> tuple[float, float]:
    """Bus delay inside the loops of x and y: none on a node [us].

    On the host it is one period, for the synchronous packet triggers both the sample and the update with the last
    command; more where the kind of bus says so. A node that applies its command on arrival has it earlier: x is taken
    to be on the first node of the cycle with axes and y on the last, which differ most.

    References
    ----------
    Paper, section III-C.
    """
    if profile.servo.loop == "node":
        return 0.0, 0.0
    period_us, own, network = profile.cycle.period_us, bus_of(profile), network_of(profile)
    at_sync = profile.servo.update == "next_sync"
    whole_us = own.loop_periods(network, at_sync=at_sync) * period_us
    if at_sync:
        return whole_us, whole_us
    first_us, last_us = _first_and_last_us(profile)
    # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
    return whole_us + min(first_us, period_us), whole_us + min(last_us, period_us)


def skew_us(profile: Profile) -> float:
    """How much later the last node with axes takes its set-point than the first, where no clock is common to them [us].

    A loop on the host has it in its delays.
    """
    if profile.servo.loop == "host" or bus_of(profile).acts_at_once(network_of(profile)):
        return 0.0
    first_us, last_us = _first_and_last_us(profile)
    return last_us - first_us


def jitter_us(profile: Profile) -> float:
    """Jitter of the synchronous packet, either way of its mean: the profile's own and what the bus adds [us].

    A cycle that does not fit is never simulated: its jitter must not stop the report that says so, and is cut.
    """
    delivery, network = profile.delivery, network_of(profile)
    most_us = max(profile.cycle.period_us / 2 - delivery.jitter_us - abs(delivery.skew_us), 0.0)
    return float(delivery.jitter_us + min(plain(bus_of(profile).sync_jitter_us(network)), most_us))


def _first_and_last_us(profile: Profile) -> tuple[float, float]:
    """When the first and the last node with axes have their commands, from the start of the cycle [us]."""
    own = bus_of(profile)
    cycle = cycle_of(profile, model=own.deciding_model)
    arrived_us = own.arrivals_us(cycle)
    nodes = (group for group in cycle.network.groups for _ in range(int(group.nodes)))
    moved = [place for place, group in enumerate(nodes, start=1) if group.axes] or list(arrived_us)
    return arrived_us[moved[0]], arrived_us[moved[-1]]
