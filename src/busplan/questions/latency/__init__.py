"""`busplan.latency`."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

from busplan.buses.network import Network
from busplan.elementwise import Number, existing, plain
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, ProfileLike, checked_models, load_network, one_or_several, whole
from busplan.questions.fit.network import model_names, network_of
from busplan.sections.base import TRANSACTION_KINDS, with_unchecked
from busplan.sections.cycle import TableExecution
from busplan.sections.profile import Profile


class Transaction(NamedTuple):
    """The phases of a read or a write of the farthest node, or of a whole cycle."""

    timing_model: str
    transaction: str
    group: str
    """Of which group of nodes; empty where all are alike."""
    payload_bytes: int | None
    nodes: int
    phases: Mapping[str, float | None]
    """Figures by their key in the register of the bus."""


class LatencyResult(NamedTuple):
    """Answer of `latency`."""

    network: Network
    transactions: tuple[Transaction, ...]
    payloads_bytes: tuple[int, ...] = ()
    """Payloads asked for [bytes]; empty for the profile's own."""

    @property
    def profile(self) -> Profile:
        """The profile of the network."""
        profile: Profile = self.network.profile
        return profile


def latency_figures(
    network: Network,
    *,
    payloads_bytes: Sequence[int] | None = None,
    timing_models: Sequence[str] | None = None,
) -> LatencyResult:
    """Compute the phases of each transaction.

    Parameters
    ----------
    network
        The network; a transaction is that of its farthest node.
    payloads_bytes
        Payloads of both read and write [bytes]; by default the profile's own.
    timing_models
        Timing models, in this order; by default all of the kind of bus.

    Returns
    -------
    LatencyResult
        One transaction for each payload, kind and model, nested in this order.

    Raises
    ------
    BusplanError
        The execution time of a payload is not known.

    References
    ----------
    Paper, equations (3)-(10), (12)-(14).
    """
    models = model_names(network) if timing_models is None else timing_models
    nodes = int(plain(network.nodes))
    _require_execution(network.profile, payloads_bytes or ())
    variants = [network] if payloads_bytes is None else [with_payload(network, size) for size in payloads_bytes]
    return LatencyResult(
        network,
        tuple(
            Transaction(
                model,
                bus_latency.name,
                bus_latency.group,
                bus_latency.payload_bytes,
                nodes,
                _whole_bytes(bus_latency.phases),
            )
            for variant in variants
            for alike in zip(*(variant.bus.cycle(variant, model=model).latencies() for model in models), strict=True)
            for model, bus_latency in zip(models, alike, strict=True)
        ),
        tuple(payloads_bytes or ()),
    )


def _whole_bytes(phases: Mapping[str, Number]) -> dict[str, float | None]:
    """Phases with the sizes of packets as whole numbers; None for one that does not exist."""
    numbers = {key: existing(value) for key, value in phases.items()}
    return {
        key: int(value) if value is not None and key.endswith("_bytes") else value for key, value in numbers.items()
    }


def with_payload(network: Network, size_bytes: int) -> Network:
    """The network with another payload of both read and write [bytes], unvalidated."""
    profile = network.profile
    sections = [f"group.{group.name}" for group in profile.group] or ["payload"]
    for section, kind in product(sections, TRANSACTION_KINDS):
        profile = with_unchecked(profile, f"{section}.{kind}_bytes", size_bytes)
        profile = with_unchecked(profile, f"{section}.{kind}_bytes_per_axis", None)
    return network_of(profile)


def _require_execution(profile: Profile, payloads_bytes: Sequence[int]) -> None:
    """Refuse payloads whose execution time is not known, all in one error."""
    unknown = dict.fromkeys(
        f"payload {size} bytes: outside the execution table of {alike.name or profile.name}, {execution.range_bytes}; "
        "nothing is extrapolated"
        for alike in profile.node_groups
        if isinstance(execution := alike.node.execution, TableExecution)
        for size in payloads_bytes
        if not execution.covers(size)
    )
    if unknown:
        raise BusplanError(*unknown)


class LatencyAnswer(Answer, LatencyResult):
    """Answer of `latency`: `transactions`, one for each payload, kind and timing model, with its `phases`."""

    __slots__ = ()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.latency.report import latency_report

        return latency_report(self)

    def _headline(self) -> str:
        return f"{self.profile.name}: {self.network.bus.latency_subject(self.network)}"


def latency(
    profile: ProfileLike,
    *,
    payload_bytes: int | Iterable[int] | None = None,
    timing_model: Models | None = None,
) -> LatencyAnswer:
    """Show how long data takes to arrive, phase by phase, as `busplan latency` does.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    payload_bytes
        Payload of both read and write [bytes], or n of them; by default the profile's own.
    timing_model
        Name of a timing model, or several in this order; by default all of the kind of bus. IEEE 1394 has "paper" for
        the paper's equations as published, and "standard" for the standard's clock and packets.

    Returns
    -------
    LatencyAnswer
        Its `transactions`: on IEEE 1394 2 n for each timing model, a read and a write; on CAN one for each message.
        Times are in us.

    Raises
    ------
    BusplanError
        Not a profile, an invalid payload or one whose execution time is not known, or an unknown timing model.

    References
    ----------
    Paper, equations (3)-(10), (12)-(14).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.latency("paper-two-node", payload_bytes=[4, 1024], timing_model="paper")
    >>> [(row.transaction, row.payload_bytes, round(row.phases["latency_us"], 2)) for row in answer.transactions]
    [('read', 4, 43.17), ('write', 4, 43.17), ('read', 1024, 474.57), ('write', 1024, 474.57)]
    """
    network = load_network(profile)
    sizes = None if payload_bytes is None else one_or_several(payload_bytes, name="payload_bytes")
    result = latency_figures(
        network,
        payloads_bytes=sizes and [whole(size, name="payload_bytes") for size in sizes],
        timing_models=checked_models(timing_model, network),
    )
    return LatencyAnswer(*result)
