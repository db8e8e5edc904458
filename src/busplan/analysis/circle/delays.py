"""The delay that a bus puts into the position loops; nothing is simulated."""

from busplan.analysis.capacity.cycle import cycle_of
from busplan.analysis.network import bus_of
from busplan.sections.profile import Profile


def loop_delays_us(profile: Profile) -> tuple[float, float]:
    """Bus delay inside the loops of x and y: none on a node [us].

    On the host it is one period, for the synchronous packet triggers both the sample and the update with the last
    command. A node that applies its command on arrival has it earlier: x is taken to be on the first node of the
    cycle with axes and y on the last, which differ most.

    References
    ----------
    Paper, section III-C.
    """
    period_us = profile.cycle.period_us
    if profile.servo.loop == "node":
        return 0.0, 0.0
    if profile.servo.update == "next_sync":
        return period_us, period_us
    own = bus_of(profile)
    cycle = cycle_of(profile, model=own.deciding_model)
    moves = [bool(group.axes) for group in cycle.network.groups for _ in range(int(group.nodes))]
    arrived_us: dict[int, float] = {}
    now_us = 0.0
    for event in cycle.events():
        now_us += event.us
        is_command = (event.transaction, event.kind) in own.command_events
        if is_command:
            # What belongs to no one node is the command of all.
            owners = range(1, len(moves) + 1) if event.node is None else (event.node,)
            arrived_us |= {node: now_us for node in owners if moves[node - 1]}
    first, last = min(arrived_us, default=0), max(arrived_us, default=0)
    # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
    return min(arrived_us.get(first, now_us), period_us), min(arrived_us.get(last, now_us), period_us)
