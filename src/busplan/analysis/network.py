"""A profile as a network: its kind of bus, and its nodes with their payloads and execution times."""

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.network import Group, Network
from busplan.sections.profile import Profile


def bus_of(profile: Profile) -> Bus:
    """The kind of bus that a profile describes."""
    return kind_named(profile.bus.kind)


def network_of(profile: Profile) -> Network:
    """Network from which the cycle of a profile is computed.

    Parameters
    ----------
    profile
        The profile. Its values may be numbers, arrays or traced numbers.
    """
    payload, node, cycle = profile.payload, profile.node, profile.cycle
    group = Group(
        nodes=profile.bus.nodes,
        axes=node.axes,
        read_bytes=payload.read_bytes,
        write_bytes=payload.write_bytes,
        read_execution_us=node.execution.execution_us(payload.read_bytes),
        write_execution_us=node.execution.execution_us(payload.write_bytes),
    )
    return Network(profile, (group,), cycle.period_us, cycle.slice_ratio, cycle.nonperiodic_us)


def model_names(profile: Profile) -> tuple[str, ...]:
    """Names of the timing models of a profile's kind of bus, in the order reports show them."""
    return tuple(model.name for model in bus_of(profile).timing_models)
