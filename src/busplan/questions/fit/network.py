"""A profile as a network: its kind of bus, and its nodes with their payloads and execution times."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, choose, is_everywhere, total
from busplan.profile.document import override
from busplan.sections.base import TRANSACTION_KINDS, Section, with_all_unchecked, with_unchecked
from busplan.sections.machine import ProfileGroup
from busplan.sections.profile import Profile
from busplan.sourced import changed_constants

PERIOD: Final = "cycle.period_us"


def bus_of(profile: Profile) -> Bus:
    """The kind of bus that a profile describes."""
    return kind_named(profile.bus.kind)


def network_of(profile: Profile) -> Network:
    """Network from which the cycle of a profile is computed.

    Values of the profile may be numbers, arrays or traced numbers.
    """
    if profile.constants != changed_constants():
        raise RuntimeError(f"{profile.name}: computed with other constants than its own; see busplan.sourced")
    cycle = profile.cycle
    groups = tuple(_group(members) for members in _runs_of_alike(profile.node_groups))
    return Network(profile, bus_of(profile), groups, cycle.period_us, cycle.slice_ratio, cycle.nonperiodic_us)


def _group(members: Sequence[ProfileGroup]) -> Group:
    first = members[0]
    execution = first.node.execution
    read_bytes, write_bytes = (first.bytes_of(kind) for kind in TRANSACTION_KINDS)
    read_us, write_us = (_if_any(size, execution.execution_us) for size in (read_bytes, write_bytes))
    return Group(
        members=tuple(members),
        nodes=first.nodes if len(members) == 1 else total(member.nodes for member in members),
        axes=first.node.axes,
        read_bytes=read_bytes,
        write_bytes=write_bytes,
        read_execution_us=read_us,
        write_execution_us=write_us,
        worst_extra_us=execution.worst_extra_us,
        read_uncertainty_us=_if_any(read_bytes, lambda _: execution.standard_uncertainty_us(read_us)),
        write_uncertainty_us=_if_any(write_bytes, lambda _: execution.standard_uncertainty_us(write_us)),
    )


def _if_any(size_bytes: Number, time_us: Callable[[Number], Number]) -> Number:
    """Time of a payload [us]; 0 where it has 0 bytes, for nothing is sent then."""
    if is_everywhere(size_bytes <= 0):
        return 0.0
    us, has_data = time_us(size_bytes), size_bytes > 0
    return us if is_everywhere(has_data) else choose(has_data, us, 0.0)


def _runs_of_alike(groups: Sequence[ProfileGroup]) -> list[list[ProfileGroup]]:
    """Join neighbours that differ only in name and number, so that their cycle is that of a uniform bus."""
    runs: list[list[ProfileGroup]] = []
    for group in groups:
        # A group that sends at a slower rate has cycles of its own; one that starts a frame, frames.
        is_in_every = is_everywhere(getattr(group.payload, "every", 1) <= 1)
        is_joined = is_in_every and getattr(group.payload, "starts", None) is None
        if runs and is_joined and _is_alike(runs[-1][0].node, group.node):
            runs[-1].append(group)
        else:
            runs.append([group])
    return runs


_NOT_COMPARED: Final = ("name", "nodes")


def _is_alike(left: object, right: object) -> bool:
    """Whether two groups, sections or values are equal; an array equals only itself."""
    if isinstance(left, Section) and type(left) is type(right):
        keys = (key for key in type(left).model_fields if key not in _NOT_COMPARED)
        return all(_is_alike(getattr(left, key), getattr(right, key)) for key in keys)
    return left is right or (isinstance(left, _COMPARED) and isinstance(right, _COMPARED) and bool(left == right))


_COMPARED: Final = (int, float, str, tuple, Traced)


def trial(network: Network, values: Mapping[str, object]) -> Network:
    """The network with other values by dotted key, unchecked: only for values that are known to be valid.

    ValueError: the execution time of a payload is not known.
    """
    return network_of(with_all_unchecked(network.profile, values))


def at_period(network: Network, period_us: Number) -> Network:
    """The network at another communication period, unchecked [us]."""
    return network._replace(profile=with_unchecked(network.profile, PERIOD, period_us), period_us=period_us)


def with_payloads(network: Network, sizes_bytes: Iterable[tuple[Number, Number]]) -> Network:
    """The network with other payloads for the read and the write of each group of the profile [bytes].

    ValueError: the execution time of a payload is not known.
    """
    values: dict[str, object] = {}
    for group, sizes in zip(network.profile.node_groups, sizes_bytes, strict=True):
        section = f"group.{group.name}" if group.name else "payload"
        for kind, size_bytes in zip(TRANSACTION_KINDS, sizes, strict=True):
            values |= {f"{section}.{kind}_bytes": size_bytes, f"{section}.{kind}_bytes_per_axis": None}
    return trial(network, values)


def at_once(group: Group) -> Group:
    """The same nodes with an execution time of exactly zero."""
    return group._replace(
        read_execution_us=0.0, write_execution_us=0.0, read_uncertainty_us=0.0, write_uncertainty_us=0.0
    )


def changed(network: Network, changes: Mapping[str, object]) -> Network:
    """The network with other values by dotted key, checked by the profile's schema.

    BusplanError: the schema refuses them.
    """
    return network_of(override(network.profile, dict(changes)))


def at_periods(network: Network, periods_us: Sequence[float] | None) -> list[Network]:
    """A network at each of several communication periods [us]; for None, at its own.

    BusplanError: the profile's schema refuses a period.
    """
    if periods_us is None:
        return [network]
    return [
        network_of(override(network.profile, {PERIOD: period_us}, origin={PERIOD: f"period {period_us}"}))
        for period_us in periods_us
    ]


def warnings_of(network: Network) -> tuple[str, ...]:
    """Warnings for a network with its own number of nodes; they hold whatever the verdict."""
    return tuple(network.bus.warnings(network, nodes=[int(network.nodes)]))


def not_applicable(network: Network) -> dict[str, tuple[str, ...]]:
    """Keys in the profile that a timing model has no term for, by the names of those models."""
    bus = network.bus
    missing = {model.name: bus.cannot_express(network, model=model.name) for model in bus.timing_models}
    return {name: keys for name, keys in missing.items() if keys}


def model_names(network: Network) -> tuple[str, ...]:
    """Names of the timing models that can express a network, in the order reports show them."""
    without = not_applicable(network)
    return tuple(model.name for model in network.bus.timing_models if model.name not in without)
