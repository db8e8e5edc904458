"""Latency of single transactions: a profile in, every phase under each timing model out."""

from collections.abc import Sequence
from typing import NamedTuple

from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    TRANSACTION_KINDS,
    Phases,
    TimingModelName,
    TransactionKind,
    transaction,
)
from busplan.errors import BusplanError
from busplan.profile.bus import TableExecution
from busplan.profile.model import Profile

BOTH_MODELS: tuple[TimingModelName, ...] = tuple(TIMING_MODELS)


class Transaction(NamedTuple):
    """One transaction of the farthest node, taken apart."""

    timing_model: TimingModelName
    transaction: TransactionKind
    payload_bytes: int
    nodes: int
    hops: int
    gap_count: int
    phases: Phases


class LatencyResult(NamedTuple):
    """Answer of `latency`."""

    profile: str
    transactions: tuple[Transaction, ...]


def latency(
    profile: Profile,
    *,
    payloads_bytes: Sequence[int] | None = None,
    timing_models: Sequence[TimingModelName] = BOTH_MODELS,
) -> LatencyResult:
    """Take the read and the write of a profile apart.

    Parameters
    ----------
    profile
        The network; the transaction is that of its farthest node.
    payloads_bytes
        Payloads of both read and write [bytes]; without them the profile's own.
    timing_models
        Which timing models, in this order.

    Returns
    -------
    LatencyResult
        One transaction for each payload, kind and model, in this nesting.

    Raises
    ------
    BusplanError
        The execution time of a payload is not known.

    References
    ----------
    Paper, equations (3)-(10), (12)-(14).
    """
    own = {"read": profile.payload.read_bytes, "write": profile.payload.write_bytes}
    wanted: list[tuple[TransactionKind, int]] = (
        [(kind, own[kind]) for kind in TRANSACTION_KINDS]
        if payloads_bytes is None
        else [(kind, size) for size in payloads_bytes for kind in TRANSACTION_KINDS]
    )
    _require_execution(profile, [size for _, size in wanted])
    return LatencyResult(
        profile.name,
        tuple(
            Transaction(
                timing_model=model,
                transaction=kind,
                payload_bytes=size,
                nodes=profile.bus.nodes,
                hops=profile.bus.hops(profile.bus.nodes),
                gap_count=profile.bus.gap_count_for(profile.bus.nodes),
                phases=phases(profile, kind, model=model, payload_bytes=size),
            )
            for kind, size in wanted
            for model in timing_models
        ),
    )


def phases(
    profile: Profile,
    kind: TransactionKind,
    *,
    model: TimingModelName,
    payload_bytes: int,
    nodes: int | None = None,
) -> Phases:
    """Phases of one transaction of a profile's farthest node.

    Parameters
    ----------
    profile
        The network.
    kind
        "read" or "write".
    model
        Timing model.
    payload_bytes
        Payload [bytes].
    nodes
        Nodes on the bus [1]; without it the profile's own number.

    Raises
    ------
    ValueError
        The execution time of that payload is not known (`latency` and the profile have checked).
    """
    return transaction(
        kind,
        model=TIMING_MODELS[model],
        link=profile.bus.link(profile.bus.nodes if nodes is None else nodes),
        payload_bytes=payload_bytes,
        overhead_bytes=profile.payload.overhead_bytes,
        execution_us=profile.node.execution.execution_us(payload_bytes),
    )


def _require_execution(profile: Profile, payloads_bytes: Sequence[int]) -> None:
    """Refuse payloads whose execution time is not known, all of them at once."""
    execution = profile.node.execution
    if not isinstance(execution, TableExecution):
        return
    unknown = dict.fromkeys(size for size in payloads_bytes if not execution.covers(size))
    if unknown:
        raise BusplanError(
            *(
                f"payload {size} bytes: outside the execution table of {profile.name}, {execution.range_bytes}; "
                "nothing is extrapolated"
                for size in unknown
            )
        )
