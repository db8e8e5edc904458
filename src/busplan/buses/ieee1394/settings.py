"""What a plan may turn on an IEEE 1394 bus without new parts."""

from typing import Final

from busplan.buses.ieee1394.constants import REFERENCE_CABLE_M, safe_gap_count
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of, is_broadcast
from busplan.buses.network import Network
from busplan.buses.parts import Cost, Setting
from busplan.elementwise import plain

SCHEDULE: Final = "cycle.schedule"
"""The key of the schedule."""
_UNSPLIT: Final = {"read_response": "concatenated", "write_response": "unified"}
"""Answers that need no second arbitration."""


def gap_count(network: Network) -> Setting:
    """The smallest safe gap count."""
    key = "bus.gap_count"
    empty = Setting("gap_count", "gap count", Cost.REGISTER, (key,), ())
    if not network.profile.bus.cable_is_standard:
        return empty._replace(reason=f"the table holds for cables of up to {REFERENCE_CABLE_M:g} m")
    safe = plain(safe_gap_count(hops_of(network)))
    return empty if gap_count_of(network) == safe else empty._replace(values=({key: safe},))


def schedule(network: Network) -> Setting:
    """The other way to read and write all nodes."""
    other = "individual" if is_broadcast(network) else "broadcast"
    return Setting("schedule", "schedule", Cost.SCHEDULE, (SCHEDULE,), ({SCHEDULE: other},))


def responses(network: Network) -> Setting:
    """Answers without a second arbitration: of reads, of writes, of both."""
    keys = tuple(group.key(name) for group in network.groups for name in _UNSPLIT)
    if is_broadcast(network):
        return Setting("responses", "responses", Cost.RESPONSES, keys, (), "no node answers a broadcast")
    of_reads, of_writes = (
        {group.key(name): answer for group in network.groups if getattr(group.node, name) == "split"}
        for name, answer in _UNSPLIT.items()
    )
    both = {**of_reads, **of_writes} if of_reads and of_writes else {}
    values = tuple(filter(None, (of_reads, of_writes, both)))
    return Setting("responses", "responses", Cost.RESPONSES, keys, values, "" if values else "no node answers split")
