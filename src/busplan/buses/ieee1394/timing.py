"""The timing models: the phases of one asynchronous transaction under `paper` and under `standard`.

`paper` takes the equations as they are published: gaps and PHY delays are counted in the data rate, and both
packets of a transaction carry the payload and one overhead. `standard` counts gaps and PHY delays in the base
rate, as the gap tables of three independent stacks show, and gives every packet its real size on the wire.
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
from busplan.buses.network import TransactionKind
from busplan.elementwise import Number, alike, choose, worded

TimingModelName = Literal["paper", "standard"]


class PacketSizes(NamedTuple):
    """Bytes on the wire of a transaction's two packets [bytes]."""

    request_bytes: float
    response_bytes: float


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
    """

    name: TimingModelName
    gap_clock_mbit_s: Callable[[float], float]
    packets: Callable[[TransactionKind, int, int], PacketSizes]


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
        Length of one cable [m].
    """

    data_rate_mbit_s: float
    gap_count: float
    hops: float
    cable_length_m: float


class Phases(NamedTuple):
    """Every phase of one transaction [us]; the equation behind each stands in `busplan.buses.ieee1394.figures`."""

    request_bytes: float
    response_bytes: float
    arbitration_us: float
    request_data_us: float
    response_data_us: float
    request_us: float
    response_us: float
    acknowledge_us: float
    execution_us: float
    latency_us: float
    request_and_acknowledge_us: float
    response_and_acknowledge_us: float
    subaction_gap_us: float
    arbitration_reset_gap_us: float
    gaps_us: float
    latency_with_gaps_us: float
    """What the transaction takes of the cycle, T_lant + T_sum."""


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
        response_bytes=worded(alike(WRITE_RESPONSE_BYTES, payload_bytes), WRITE_RESPONSE_BYTES.meaning),
    )


TIMING_MODELS: Final[Mapping[TimingModelName, PacketTiming]] = MappingProxyType(
    {
        "paper": PacketTiming("paper", lambda data_rate_mbit_s: data_rate_mbit_s, _paper_packets),
        "standard": PacketTiming("standard", lambda _data_rate_mbit_s: BASE_RATE_MBIT_S, _standard_packets),
    }
)
"""The timing models by name, in the order reports show them."""


def transaction(
    kind: TransactionKind,
    *,
    model: PacketTiming,
    link: Link,
    payload_bytes: int,
    overhead_bytes: int,
    execution_us: float,
) -> Phases:
    """Take one asynchronous transaction apart, equations (3)-(10), (13) and (14).

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
    execution_us
        Execution time T_exec in the node [us]; float or array.

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
    ...     execution_us=36.7,
    ... )
    >>> phases.request_bytes, phases.response_bytes
    (20.0, 16.0)
    >>> round(phases.request_and_acknowledge_us, 3)
    5.347
    """
    clock_mbit_s = alike(model.gap_clock_mbit_s(link.data_rate_mbit_s), link.data_rate_mbit_s)
    packets = model.packets(kind, payload_bytes, overhead_bytes)

    def data_us(packet_bytes: float) -> float:
        return equations.data_phase_us(
            link.hops,
            packet_bytes=packet_bytes,
            data_rate_mbit_s=link.data_rate_mbit_s,
            gap_clock_mbit_s=clock_mbit_s,
            cable_length_m=link.cable_length_m,
        )

    arbitration_us = equations.arbitration_phase_us(
        link.hops,
        gap_count=link.gap_count,
        gap_clock_mbit_s=clock_mbit_s,
        cable_length_m=link.cable_length_m,
    )
    acknowledge_us = equations.acknowledge_us(
        equations.acknowledge_phase_us(link.hops, gap_clock_mbit_s=clock_mbit_s, cable_length_m=link.cable_length_m)
    )
    request_data_us, response_data_us = data_us(packets.request_bytes), data_us(packets.response_bytes)
    request_us = equations.request_us(arbitration_us, data_us=request_data_us)
    response_us = equations.response_us(arbitration_us, data_us=response_data_us)
    latency_us = equations.transaction_latency_us(
        request_us,
        request_acknowledge_us=acknowledge_us,
        execution_us=execution_us,
        response_us=response_us,
        response_acknowledge_us=acknowledge_us,
    )
    gaps_us = equations.gaps_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s)
    return Phases(
        request_bytes=packets.request_bytes,
        response_bytes=packets.response_bytes,
        arbitration_us=arbitration_us,
        request_data_us=request_data_us,
        response_data_us=response_data_us,
        request_us=request_us,
        response_us=response_us,
        acknowledge_us=acknowledge_us,
        execution_us=execution_us,
        latency_us=latency_us,
        request_and_acknowledge_us=equations.request_and_acknowledge_us(request_us, acknowledge_us=acknowledge_us),
        response_and_acknowledge_us=equations.response_and_acknowledge_us(response_us, acknowledge_us=acknowledge_us),
        subaction_gap_us=equations.subaction_gap_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s),
        arbitration_reset_gap_us=equations.arbitration_reset_gap_us(link.gap_count, gap_clock_mbit_s=clock_mbit_s),
        gaps_us=gaps_us,
        latency_with_gaps_us=latency_us + gaps_us,
    )
