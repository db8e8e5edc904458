"""Networks that differ from one in a single small thing."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Perturbation
from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.questions.fit.network import bus_of, network_of, with_execution, with_payloads
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.base import value_at, with_unchecked
from busplan.sections.profile import Profile

_EXECUTION_SHARE: Final = 0.1
_PAYLOAD_STEP_BYTES: Final = 4
"""A quadlet: payloads are padded to it."""


class Perturbed(NamedTuple):
    """A network with one small change."""

    change: str
    key: str
    """What changes: a key of the profile, or a figure of `latency`."""
    before: Any
    """Its value; None where it has no single one."""
    after: Any
    network: Network | None
    """None where the change cannot be made."""
    note: str
    """Why it cannot be made, or why the margin stays as it is, where it does."""


def perturbed(network: Network) -> Iterator[Perturbed]:
    """Make every small change of a network, one at a time.

    Those of every kind of bus are 10 % more execution time, a node and an axis more of each group, four bytes more of
    every payload, and a bus reset; a kind has its own before the last.
    """
    bus = bus_of(network.profile)
    yield _slower(network, if_nothing="" if bus.has_execution(network) else "no execution time is on the bus")
    yield from (_one_node_more(network, one) for one in network.alike)
    yield from (_one_axis_more(network, one) for one in network.alike)
    yield _more_bytes(network)
    own = bus.perturbations(network)
    reset = Perturbation("a bus reset", bus.safety.after_reset, if_nothing="it is set so already")
    yield from (_with_keys(network.profile, one) for one in (*own, *((reset,) if bus.safety.after_reset else ())))


def _slower(network: Network, *, if_nothing: str) -> Perturbed:
    factor = 1 + _EXECUTION_SHARE
    groups = tuple(
        with_execution(one, read_us=factor * one.read_execution_us, write_us=factor * one.write_execution_us)
        for one in network.groups
    )
    before, after = (
        _the_one(us for group in each for us in (group.read_execution_us, group.write_execution_us))
        for each in (network.groups, groups)
    )
    label = f"execution time +{_EXECUTION_SHARE:.0%}"
    return Perturbed(label, "execution_us", before, after, network._replace(groups=groups), if_nothing)


def _one_node_more(network: Network, alike: AlikeNodes) -> Perturbed:
    more = alike.nodes + 1
    found = network.asking(alike.name).with_nodes(more)
    return Perturbed(f"one node more{_in(alike)}", alike.nodes_key, alike.nodes, more, found, "")


def _one_axis_more(network: Network, alike: AlikeNodes) -> Perturbed:
    key, axes = alike.node_key("axes"), alike.node.axes + 1
    found, unknown = _if_known(lambda: network_of(with_unchecked(network.profile, key, axes)))
    note = unknown or ("" if alike.payload.follows_axes else "no payload follows the axes")
    return Perturbed(f"one axis more per node{_in(alike)}", key, axes - 1, axes, found, note)


def _more_bytes(network: Network) -> Perturbed:
    sizes = [(one.read_bytes + _PAYLOAD_STEP_BYTES, one.write_bytes + _PAYLOAD_STEP_BYTES) for one in network.groups]

    def change() -> Network:
        pairs = zip(network.groups, sizes, strict=True)
        return network._replace(
            groups=tuple(with_payloads(one, read_bytes=read, write_bytes=write) for one, (read, write) in pairs)
        )

    before = _the_one(size for one in network.groups for size in (one.read_bytes, one.write_bytes))
    found, unknown = _if_known(change)
    label = f"payload +{_PAYLOAD_STEP_BYTES} bytes"
    return Perturbed(label, "payload_bytes", before, _the_one(size for one in sizes for size in one), found, unknown)


def _with_keys(profile: Profile, one: Perturbation) -> Perturbed:
    """A change that a kind of bus names by keys of the profile."""
    key, before, after = ", ".join(one.changes), None, None
    if len(one.changes) == 1:
        ((_, after),) = one.changes.items()
        before = value_at(profile, key)
    if one.why_not:
        return Perturbed(one.label, key, before, None, None, one.why_not)
    try:
        found = network_of(override(profile, dict(one.changes)))
    except BusplanError as error:
        return Perturbed(one.label, key, before, after, None, "; ".join(error.problems))
    return Perturbed(one.label, key, before, after, found, one.if_nothing)


def _if_known(change: Callable[[], Network]) -> tuple[Network | None, str]:
    """The network after a change, or why its execution time is not known."""
    try:
        return change(), ""
    except ValueError as error:
        return None, f"not known: {error}"


def _in(alike: AlikeNodes) -> str:
    return f" in {alike.name}" if alike.name else ""


def _the_one(values: Iterable[Any]) -> Any:
    """The value that all share; None where they differ."""
    first, *others = values
    return first if all(one == first for one in others) else None
