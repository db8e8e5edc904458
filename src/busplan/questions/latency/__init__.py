"""`busplan.latency`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from busplan.buses.network import Network
from busplan.elementwise import Number, existing, plain
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, ProfileLike, checked_models, load_network, one_or_several, whole
from busplan.questions.fit.network import with_payloads
from busplan.sections.cycle import TableExecution
from busplan.sections.profile import Profile


class Transaction(NamedTuple):
    """The phases of a read or a write of the farthest node, of a message, or of a whole cycle."""

    timing_model: str
    transaction: str
    group: str
    """Name of its group of nodes; empty where all are alike."""
    payload_bytes: int | None
    nodes: int
    phases: Mapping[str, float | None]
    """Figures by their key in the register of the bus."""


@dataclass(frozen=True, slots=True, repr=False)
class LatencyAnswer(Answer):
    """Answer of `latency`.

    Parameters
    ----------
    profile
        The network.
    networks
        The network with each payload; without payloads as the profile has it.
    tables
        The transactions of each of these networks, each under every timing model.
    """

    profile: Profile
    networks: tuple[Network, ...]
    tables: tuple[tuple[Transaction, ...], ...]

    @property
    def transactions(self) -> tuple[Transaction, ...]:
        """One transaction for each payload, kind and timing model, nested in this order, with its `phases`."""
        return tuple(transaction for table in self.tables for transaction in table)

    @property
    def subject(self) -> str:
        """What has these latencies, in words."""
        network = self.networks[0]
        return network.bus.latency_subject(network)

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.latency.report import latency_report

        return latency_report(self)

    def _headline(self) -> str:
        return f"{self.profile.name}: {self.subject}"


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
    models = checked_models(timing_model, network)
    networks = [network]
    if payload_bytes is not None:
        given = one_or_several(payload_bytes, name="payload_bytes")
        sizes = [whole(size, name="payload_bytes") for size in given]
        _require_execution(network.profile, sizes)
        networks = [with_payloads(network, [(size, size)] * len(network.alike)) for size in sizes]
    tables = tuple(_transactions(variant, models) for variant in networks)
    return LatencyAnswer(network.profile, tuple(networks), tables)


def _require_execution(profile: Profile, payloads_bytes: Sequence[int]) -> None:
    """Refuse payloads whose execution time is not known, all in one error."""
    unknown = dict.fromkeys(
        f"payload {size} bytes: outside the execution table of {alike.name or profile.name}, {execution.range_bytes}; "
        "nothing is extrapolated"
        for alike in profile.alike_nodes
        if isinstance(execution := alike.node.execution, TableExecution)
        for size in payloads_bytes
        if not execution.covers(size)
    )
    if unknown:
        raise BusplanError(*unknown)


def _transactions(network: Network, models: Sequence[str]) -> tuple[Transaction, ...]:
    nodes = int(plain(network.nodes))
    by_model = (network.bus.cycle(network, model=model).latencies() for model in models)
    return tuple(
        Transaction(model, phased.name, phased.group, phased.payload_bytes, nodes, _whole_bytes(phased.phases))
        for of_models in zip(*by_model, strict=True)
        for model, phased in zip(models, of_models, strict=True)
    )


def _whole_bytes(phases: Mapping[str, Number]) -> dict[str, float | None]:
    """Phases with the sizes of packets as whole numbers; None for one that does not exist."""
    numbers = {key: existing(value) for key, value in phases.items()}
    return {
        key: int(value) if value is not None and key.endswith("_bytes") else value for key, value in numbers.items()
    }
