"""The timing models: the phases of an asynchronous transaction under `paper` and under `standard`.

`paper` takes the equations as they are published: gaps and PHY delays are counted in the data rate, and both
packets of a transaction carry the payload and the same overhead. `standard` counts gaps and PHY delays in the base
rate, as the gap tables of three independent stacks show, and gives every packet its real size on the wire.
Gaps are added up in `paper`, and are thresholds of an idle period in `standard` (`busplan.buses.ieee1394.timing`).
Operators only, as in `equations`: floats in, floats out; arrays in, arrays out.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    BASE_RATE_MBIT_S,
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
    QUADLET_BYTES,
    QUADLET_READ_REQUEST_BYTES,
    QUADLET_READ_RESPONSE_BYTES,
    QUADLET_WRITE_REQUEST_BYTES,
    WRITE_RESPONSE_BYTES,
    padded_bytes,
)
from busplan.elementwise import Number, choose, is_off, larger, named, smaller, traced_with, worded
from busplan.sections.base import TransactionKind

Answer = Literal["split", "concatenated", "unified"]
"""Answer of a node to a request.

split: it acknowledges, executes, and arbitrates for its response. concatenated: its response follows its acknowledge,
and the bus stays busy. unified: its acknowledge completes the transaction.
"""


class Gaps(NamedTuple):
    """The gaps of a bus [us], and whether a single node answers on it."""

    subaction_us: Number
    """T_sub."""
    arbitration_reset_us: Number
    """T_reset."""
    both_us: Number
    """T_sum, equation (10)."""
    alone: Number
    """Whether there is a single node: a boolean, or an array of booleans."""


class IdleTime(NamedTuple):
    """Idle bus around a transaction, without the execution [us]."""

    idle_us: Number
    """Idle bus of the gaps."""
    host_us: Number
    """Idle bus while the host takes longer than the gaps."""


def gaps_added_up(_answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> IdleTime:  # noqa: ARG001
    """Both gaps after every transaction, whatever the node and the host do, as equation (11) has it."""
    return IdleTime(gaps.both_us, 0.0)


def gaps_as_thresholds(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> IdleTime:
    """Idle bus of a transaction as the bus runs it.

    Parameters
    ----------
    answer
        How the node answers.
    gaps
        The gaps.
    execution_us
        Upper bound of the execution time of a split transaction [us]; of any sort.
    host_us
        The host's own time between a response and its next request [us]; of any sort.

    Examples
    --------
    >>> gaps = Gaps(10.5, 21.0, 31.5, alone=False)
    >>> gaps_as_thresholds("split", gaps=gaps, execution_us=36.5, host_us=0.0)
    IdleTime(idle_us=10.5, host_us=0.0)
    >>> gaps_as_thresholds("split", gaps=gaps, execution_us=0.0, host_us=30.0)
    IdleTime(idle_us=31.5, host_us=9.0)
    """
    if answer == "split":
        without_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=0.0)
        if is_off(host_us):
            return IdleTime(without_host_us - execution_us, 0.0)
        with_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us)
        return IdleTime(without_host_us - execution_us, with_host_us - without_host_us)
    idle_us = gaps.arbitration_reset_us
    return IdleTime(
        idle_us, between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us) - idle_us
    )


def between_packets_us(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> Number:
    """Time of a transaction without its packets: execution, gaps and host [us].

    A split transaction has two idle periods, before and after its response. A fast node ends the first before the
    arbitration reset gap has passed; then the second must be as long as that gap. A single node on the bus may have
    used its turn in the fairness interval; then the first must be as long.

    Parameters
    ----------
    answer, gaps, execution_us, host_us
        As in `gaps_as_thresholds`.
    """
    sub_us, reset_us = gaps.subaction_us, gaps.arbitration_reset_us
    if answer != "split":
        return larger(reset_us, host_us)
    first_us = choose(gaps.alone, reset_us, larger(sub_us, smaller(execution_us, reset_us)))
    fast_us = first_us + larger(reset_us, host_us)
    return larger(fast_us, execution_us + larger(sub_us, host_us))


TimingModelName = Literal["paper", "standard"]
BroadcastRequest = Literal["isochronous", "priority", "timed"]
"""Way in which a node gets the bus to broadcast its data."""


class PacketSizes(NamedTuple):
    """Bytes on the wire of a transaction's two packets [bytes]."""

    request_bytes: Number
    response_bytes: Number


class PacketTiming(NamedTuple):
    """One reading of the equations.

    Parameters
    ----------
    name
        Name in profiles and reports.
    gap_clock_mbit_s
        From the data rate [Mbit/s] to the clock of gaps and PHY delays [Mbit/s].
    packets
        From transaction kind, payload [bytes] and the profile's overhead [bytes] to the packet sizes.
    idle
        Idle bus around a transaction.
    """

    name: TimingModelName
    gap_clock_mbit_s: Callable[[Number], Number]
    packets: Callable[[TransactionKind, Number, Number], PacketSizes]
    idle: Callable[..., IdleTime]


class Link(NamedTuple):
    """The way of a packet between host and node.

    Parameters
    ----------
    data_rate_mbit_s
        Data rate R [Mbit/s].
    gap_count
        Gap count g of the bus [1].
    hops
        Cable hops H between host and node [1].
    cable_length_m
        Length of a cable [m].
    phy_delay_us
        Repeat delay of a PHY [us]; None for that of the equations, 14 ticks of the gap clock.
    """

    data_rate_mbit_s: Number
    gap_count: Number
    hops: Number
    cable_length_m: Number
    phy_delay_us: Number | None = None


class Responder(NamedTuple):
    """Answer of a node to a transaction, and the host's time after it.

    Parameters
    ----------
    execution_us
        Execution time T_exec of a split transaction [us].
    answer
        Way in which the node answers.
    worst_extra_us
        Time of the slowest execution beyond T_exec [us].
    hold_us
        Time from the acknowledge to a concatenated response [us]; the bus stays busy.
    host_us
        The host's own time between a response and its next request [us].
    """

    execution_us: Number
    answer: Answer = "split"
    worst_extra_us: Number = 0.0
    hold_us: Number = 0.0
    host_us: Number = 0.0


class Phases(NamedTuple):
    """Every phase of a transaction [us]; the equation behind each stands in `busplan.buses.ieee1394.figures`.

    Phases that the answer does not have are 0: a unified answer has no response, only a split answer an execution time.
    """

    request_bytes: Number
    response_bytes: Number
    arbitration_us: Number
    """Arbitration of a packet that arbitrates."""
    request_data_us: Number
    response_data_us: Number
    request_us: Number
    response_us: Number
    acknowledge_us: Number
    """Acknowledge of a packet that is acknowledged."""
    hold_us: Number
    execution_us: Number
    worst_extra_us: Number
    latency_us: Number
    request_and_acknowledge_us: Number
    response_and_acknowledge_us: Number
    subaction_gap_us: Number
    arbitration_reset_gap_us: Number
    gaps_us: Number
    latency_with_gaps_us: Number
    """T_lant + T_sum."""
    idle_us: Number
    host_us: Number
    transaction_us: Number
    """Time of the transaction in the cycle."""


def _paper_packets(_kind: TransactionKind, payload_bytes: Number, overhead_bytes: Number) -> PacketSizes:
    return PacketSizes(request_bytes=payload_bytes + overhead_bytes, response_bytes=payload_bytes + overhead_bytes)


def _standard_packets(kind: TransactionKind, payload_bytes: Number, _overhead_bytes: Number) -> PacketSizes:
    is_quadlet, data_bytes = payload_bytes == QUADLET_BYTES, padded_bytes(payload_bytes)
    if kind == "read":
        return PacketSizes(
            request_bytes=choose(is_quadlet, QUADLET_READ_REQUEST_BYTES, BLOCK_READ_REQUEST_BYTES),
            response_bytes=choose(
                is_quadlet, QUADLET_READ_RESPONSE_BYTES, BLOCK_READ_RESPONSE_OVERHEAD_BYTES + data_bytes
            ),
        )
    return PacketSizes(
        request_bytes=choose(is_quadlet, QUADLET_WRITE_REQUEST_BYTES, BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + data_bytes),
        response_bytes=worded(traced_with(WRITE_RESPONSE_BYTES, payload_bytes), WRITE_RESPONSE_BYTES.meaning),
    )


TIMING_MODELS: Final[Mapping[TimingModelName, PacketTiming]] = MappingProxyType(
    {
        "paper": PacketTiming("paper", lambda data_rate_mbit_s: data_rate_mbit_s, _paper_packets, gaps_added_up),
        "standard": PacketTiming(
            "standard", lambda _data_rate_mbit_s: BASE_RATE_MBIT_S, _standard_packets, gaps_as_thresholds
        ),
    }
)
"""The timing models by name, in the order reports show them."""


class Delays(NamedTuple):
    """Delays that do not depend on the packet [us]."""

    hop_us: Number
    arbitration_us: Number
    acknowledge_us: Number
    gaps: Gaps


def delays(link: Link, *, model: PacketTiming, alone: Number, shared: Delays | None = None) -> Delays:
    """Arbitration, acknowledge and gaps of any transaction, equations (4), (6), (9) and (10).

    Parameters
    ----------
    link
        Rate, gap count and distance.
    model
        Timing model, of `TIMING_MODELS`.
    alone
        Whether a single node answers on the bus.
    shared
        The delays over other hops of the bus, where they have been computed: delay of a hop and gaps are the same.
    """
    clock_mbit_s = traced_with(model.gap_clock_mbit_s(link.data_rate_mbit_s), link.data_rate_mbit_s)
    if shared is None:
        phy_us = equations.phy_delay_us(clock_mbit_s) if link.phy_delay_us is None else link.phy_delay_us
        hop_us = named(equations.hop_delay_us(link.cable_length_m, phy_delay_us=phy_us), "hop_us", "hop")
    else:
        hop_us = shared.hop_us
    arbitration_us = equations.arbitration_phase_us(
        link.hops, hop_us=hop_us, gap_count=link.gap_count, gap_clock_mbit_s=clock_mbit_s
    )
    acknowledge_us = equations.acknowledge_us(equations.acknowledge_phase_us(link.hops, hop_us=hop_us))
    if shared is not None:
        return Delays(hop_us, arbitration_us, acknowledge_us, shared.gaps)
    gaps = Gaps(
        equations.subaction_gap_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s),
        equations.arbitration_reset_gap_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s),
        equations.gaps_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s),
        alone,
    )
    return Delays(hop_us, arbitration_us, acknowledge_us, gaps)


def transaction(
    kind: TransactionKind,
    *,
    model: PacketTiming,
    link: Link,
    payload_bytes: Number,
    overhead_bytes: Number,
    responder: Responder,
    alone: Number = False,
    common: Delays | None = None,
) -> Phases:
    """Take an asynchronous transaction apart, equations (3)-(10), (13) and (14).

    Parameters
    ----------
    kind
        "read" or "write".
    model
        Timing model, of `TIMING_MODELS`.
    link
        Rate, gap count and distance.
    payload_bytes
        Payload [bytes]; integer or integer array.
    overhead_bytes
        Overhead of each packet in the `paper` model [bytes]; `standard` knows the real sizes.
    responder
        How the node answers, and how fast the host goes on.
    alone
        Whether a single node answers on the bus.
    common
        The delays that all transactions of the link share, where they have been computed; then `alone` plays no part.

    Returns
    -------
    Phases
        All phases [us], in the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        The data rate is zero.

    References
    ----------
    Paper, equations (3)-(10), (13), (14); packet sizes as in `ieee1394`.

    Examples
    --------
    >>> link = Link(data_rate_mbit_s=393.216, gap_count=63, hops=1, cable_length_m=4.5)
    >>> phases = transaction(
    ...     "write",
    ...     model=TIMING_MODELS["standard"],
    ...     link=link,
    ...     payload_bytes=4,
    ...     overhead_bytes=20,
    ...     responder=Responder(36.8),
    ... )
    >>> phases.request_bytes, phases.response_bytes
    (20.0, 16.0)
    >>> round(phases.request_and_acknowledge_us, 3)
    5.347
    """
    answer = responder.answer
    is_split, has_response = answer == "split", answer != "unified"
    hop_us, arbitration_us, acknowledge_us, gaps = common or delays(link, model=model, alone=alone)
    packets = model.packets(kind, payload_bytes, overhead_bytes)

    def data_us(packet_bytes: Number) -> Number:
        return equations.data_phase_us(
            link.hops, hop_us=hop_us, packet_bytes=packet_bytes, data_rate_mbit_s=link.data_rate_mbit_s
        )

    request_data_us = data_us(packets.request_bytes)
    response_data_us = data_us(packets.response_bytes) if has_response else 0.0
    request_us = equations.request_us(arbitration_us, data_us=request_data_us)
    response_us = equations.response_us(arbitration_us if is_split else 0.0, data_us=response_data_us)
    response_acknowledge_us = acknowledge_us if has_response else 0.0
    execution_us = responder.execution_us if is_split else 0.0
    worst_extra_us = responder.worst_extra_us if is_split else 0.0
    hold_us = responder.hold_us if answer == "concatenated" else 0.0
    latency_us = equations.transaction_latency_us(
        request_us,
        request_acknowledge_us=acknowledge_us,
        execution_us=execution_us if is_split else hold_us,
        response_us=response_us,
        response_acknowledge_us=response_acknowledge_us,
    )
    idle = model.idle(answer, gaps=gaps, execution_us=execution_us + worst_extra_us, host_us=responder.host_us)
    return Phases(
        request_bytes=packets.request_bytes,
        response_bytes=packets.response_bytes if has_response else 0,
        arbitration_us=arbitration_us,
        request_data_us=request_data_us,
        response_data_us=response_data_us,
        request_us=request_us,
        response_us=response_us,
        acknowledge_us=acknowledge_us,
        hold_us=hold_us,
        execution_us=execution_us,
        worst_extra_us=worst_extra_us,
        latency_us=latency_us,
        request_and_acknowledge_us=equations.request_and_acknowledge_us(request_us, acknowledge_us=acknowledge_us),
        response_and_acknowledge_us=equations.response_and_acknowledge_us(
            response_us, acknowledge_us=response_acknowledge_us
        ),
        subaction_gap_us=gaps.subaction_us,
        arbitration_reset_gap_us=gaps.arbitration_reset_us,
        gaps_us=gaps.both_us,
        latency_with_gaps_us=latency_us + gaps.both_us,
        idle_us=idle.idle_us,
        host_us=idle.host_us,
        transaction_us=latency_us + worst_extra_us + idle.idle_us + idle.host_us,
    )
