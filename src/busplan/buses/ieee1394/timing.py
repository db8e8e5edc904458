"""The timing models: phases of an asynchronous transaction under `paper` and under `standard`.

`paper` takes the equations as published: gaps and PHY delays are counted in the data rate, both packets of a
transaction carry the payload and the same overhead, and both gaps follow every transaction. `standard` counts gaps and
PHY delays in the base rate, as the gap tables of three independent stacks show, gives every packet its real size on the
wire, and takes the gaps as thresholds of an idle period. Floats in, floats out; arrays in, arrays out: the operators
and the functions of `elementwise` take both.
"""

from typing import Final, Literal, NamedTuple, Self

from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    QUADLET_BYTES,
    c,
    padded_bytes,
)
from busplan.elementwise import Number, choose, is_off, larger, named, smaller, worded
from busplan.sections.base import TransactionKind

TimingModelName = Literal["paper", "standard"]
Answer = Literal["split", "concatenated", "unified"]
"""Answer of a node to a request.

split: the node acknowledges, executes, and arbitrates for its response. concatenated: the response follows the
acknowledge, and the bus stays busy. unified: the acknowledge completes the transaction.
"""


class Link(NamedTuple):
    """Path of a packet between host and node."""

    data_rate_mbit_s: Number
    gap_count: Number
    hops: Number
    """Cable hops between host and node [1]."""
    cable_length_m: Number
    """Length of one cable [m]."""
    phy_delay_us: Number | None = None
    """Repeat delay of a PHY [us]; None for 14 ticks of the gap clock, as in equations (4)-(6)."""
    has_gaps: bool = True
    """Whether the bus arbitrates with gaps, as up to S400. Without gaps all times are lower bounds."""


class Gaps(NamedTuple):
    """Gaps of a bus [us], and whether a single node answers on it."""

    subaction_us: Number
    """T_sub, equation (10)."""
    arbitration_reset_us: Number
    """T_reset, equation (10)."""
    both_us: Number
    """T_sum, equation (10)."""
    alone: Number
    """Whether a single node answers: a boolean, or an array of booleans."""


class Delays(NamedTuple):
    """Delays over a link that are the same for every packet [us]."""

    link: Link
    clock_mbit_s: Number
    """Clock that gaps and PHY delays are counted in [Mbit/s]."""
    gaps: Gaps
    hop_us: Number
    arbitration_us: Number
    acknowledge_us: Number
    arbitration_hops: Number
    """Cable hops that an arbitration is charged [1]."""

    @classmethod
    def of(cls, link: Link, *, clock_mbit_s: Number, gaps: Gaps, hop_us: Number) -> Self:
        """Delays over all hops of a link."""
        if link.has_gaps:
            arbitration_us = equations.arbitration_phase_us(
                link.hops, hop_us=hop_us, gap_count=link.gap_count, gap_clock_mbit_s=clock_mbit_s
            )
            acknowledge_us = equations.acknowledge_us(equations.acknowledge_phase_us(link.hops, hop_us=hop_us))
        else:
            arbitration_us = c.BETA_ARBITRATION_US
            acknowledge_us = c.BETA_ACKNOWLEDGE_US
        return cls(
            link=link,
            clock_mbit_s=clock_mbit_s,
            gaps=gaps,
            hop_us=hop_us,
            arbitration_us=named(arbitration_us, "arbitration_us", "ArbP"),
            acknowledge_us=named(acknowledge_us, "acknowledge_us", "T_ack"),
            arbitration_hops=link.hops,
        )

    def data_us(self, packet_bytes: Number) -> Number:
        """Data phase of a packet over the link [us]."""
        link = self.link
        return equations.data_phase_us(
            link.hops, hop_us=self.hop_us, packet_bytes=packet_bytes, data_rate_mbit_s=link.data_rate_mbit_s
        )

    def over(self, hops: Number) -> "Delays":
        """These delays over another number of hops of the same bus."""
        link = self.link._replace(hops=hops)
        return Delays.of(link, clock_mbit_s=self.clock_mbit_s, gaps=self.gaps, hop_us=self.hop_us)


def delays(link: Link, *, model: TimingModelName, alone: Number = False) -> Delays:
    """Delays and gaps of any transaction, equations (4), (6), (9), (10); lower bounds without gaps.

    `alone` tells whether a single node answers on the bus.
    """
    rate_mbit_s, gap_count = link.data_rate_mbit_s, link.gap_count
    if not link.has_gaps:
        beta_phy_us = c.BETA_PHY_DELAY_US if link.phy_delay_us is None else link.phy_delay_us
        hop_us = equations.hop_delay_us(link.cable_length_m, phy_delay_us=beta_phy_us)
        # Not every node need have a packet before the next one: only the way to a node and back is surely waited for.
        own, gaps = link._replace(hops=0), Gaps(0.0, 0.0, 0.0, alone)
        return Delays.of(own, clock_mbit_s=rate_mbit_s, gaps=gaps, hop_us=hop_us)
    clock_mbit_s = rate_mbit_s if model == "paper" else c.BASE_RATE_MBIT_S
    phy_us = equations.phy_delay_us(clock_mbit_s) if link.phy_delay_us is None else link.phy_delay_us
    gaps = Gaps(
        equations.subaction_gap_us(gap_count, gap_clock_mbit_s=clock_mbit_s),
        equations.arbitration_reset_gap_us(gap_count, gap_clock_mbit_s=clock_mbit_s),
        equations.gaps_us(gap_count, gap_clock_mbit_s=clock_mbit_s),
        alone,
    )
    hop_us = equations.hop_delay_us(link.cable_length_m, phy_delay_us=phy_us)
    return Delays.of(link, clock_mbit_s=clock_mbit_s, gaps=gaps, hop_us=hop_us)


class Responder(NamedTuple):
    """Answer of a node to a transaction, and the host's time after it."""

    execution_us: Number
    """Execution time T_exec of a split transaction [us]."""
    answer: Answer = "split"
    worst_extra_us: Number = 0.0
    """Time of the slowest execution beyond T_exec [us]."""
    hold_us: Number = 0.0
    """Time from the acknowledge to a concatenated response, while the bus stays busy [us]."""
    host_us: Number = 0.0
    """The host's own time between a response and its next request [us]."""


class IdleTime(NamedTuple):
    """Idle bus around a transaction, execution not counted [us]."""

    idle_us: Number
    """Idle bus of the gaps."""
    host_us: Number
    """Idle bus beyond the gaps, while the host is not ready."""

    @property
    def us(self) -> Number:
        """Gaps and host together."""
        return self.idle_us + self.host_us


def idle_time(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> IdleTime:
    """Idle bus of a transaction, with gaps as thresholds of idle periods.

    `execution_us` is an upper bound of the execution time of a split transaction [us], and `host_us` the host's own
    time between a response and its next request [us].

    Examples
    --------
    >>> gaps = Gaps(10.5, 21.0, 31.5, alone=False)
    >>> idle_time("split", gaps=gaps, execution_us=36.5, host_us=0.0)
    IdleTime(idle_us=10.5, host_us=0.0)
    >>> idle_time("split", gaps=gaps, execution_us=0.0, host_us=30.0)
    IdleTime(idle_us=31.5, host_us=9.0)
    """
    if answer != "split":
        idle_us = gaps.arbitration_reset_us
        busy_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us)
        return IdleTime(idle_us, busy_us - idle_us)
    without_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=0.0)
    if is_off(host_us):
        return IdleTime(without_host_us - execution_us, 0.0)
    with_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us)
    return IdleTime(without_host_us - execution_us, with_host_us - without_host_us)


def between_packets_us(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> Number:
    """Time of a transaction without its packets: execution, gaps and host [us].

    A split transaction has two idle periods, before and after its response. A fast node ends the first before the
    arbitration reset gap has passed; then the second must be as long as that gap. A single node on the bus may have
    used its turn in the fairness interval; then the first must be as long.
    """
    sub_us, reset_us = gaps.subaction_us, gaps.arbitration_reset_us
    if answer != "split":
        return larger(reset_us, host_us)
    first_us = choose(gaps.alone, reset_us, larger(sub_us, smaller(execution_us, reset_us)))
    fast_us = first_us + larger(reset_us, host_us)
    return larger(fast_us, execution_us + larger(sub_us, host_us))


def _packet_bytes(kind: TransactionKind, payload_bytes: Number) -> tuple[Number, Number]:
    """Sizes of request and response on the wire in `standard` [bytes]."""
    is_quadlet, data_bytes = payload_bytes == QUADLET_BYTES, padded_bytes(payload_bytes)
    if kind == "read":
        block_bytes = c.BLOCK_READ_RESPONSE_OVERHEAD_BYTES + data_bytes
        return (
            choose(is_quadlet, c.QUADLET_READ_REQUEST_BYTES, c.BLOCK_READ_REQUEST_BYTES),
            choose(is_quadlet, c.QUADLET_READ_RESPONSE_BYTES, block_bytes),
        )
    return (
        choose(is_quadlet, c.QUADLET_WRITE_REQUEST_BYTES, c.BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + data_bytes),
        worded(c.WRITE_RESPONSE_BYTES, c.WRITE_RESPONSE_BYTES.meaning),
    )


class Phases(NamedTuple):
    """Phases of a transaction [us], in the order of `busplan.buses.ieee1394.figures`.

    Phases that the answer does not have are 0: a unified answer has no response, and only a split answer has an
    execution time.
    """

    request_bytes: Number
    response_bytes: Number
    arbitration_us: Number
    """Arbitration of one packet that arbitrates."""
    request_data_us: Number
    response_data_us: Number
    acknowledge_us: Number
    """Acknowledge of one packet that is acknowledged."""
    request_us: Number
    response_us: Number
    request_and_acknowledge_us: Number
    request_and_acknowledge_eq15_us: Number
    hold_us: Number
    execution_us: Number
    response_and_acknowledge_us: Number
    latency_us: Number
    interval_latency_us: Number
    subaction_gap_us: Number
    arbitration_reset_gap_us: Number
    gaps_us: Number
    latency_with_gaps_us: Number
    """T_lant + T_sum."""
    worst_extra_us: Number
    idle_us: Number
    host_us: Number
    transaction_us: Number
    """Time that the transaction takes of the cycle."""


NO_PHASES: Final = Phases(*(0.0 for _ in Phases._fields))
"""Phases of a direction in which no transaction goes."""


def transaction(
    kind: TransactionKind,
    *,
    model: TimingModelName,
    delays: Delays,
    payload_bytes: Number,
    responder: Responder,
    overhead_bytes: Number = 0,
) -> Phases:
    """Phases of an asynchronous transaction, equations (3)-(10) and (12)-(15).

    `overhead_bytes` are those of each packet in the `paper` model; `standard` knows the real sizes. Arrays give phases
    in their broadcast shape.

    References
    ----------
    Paper, equations (3)-(10), (12)-(15); packet sizes as in `constants`.

    Examples
    --------
    >>> link = Link(data_rate_mbit_s=393.216, gap_count=63, hops=1, cable_length_m=4.5)
    >>> way = delays(link, model="standard")
    >>> phases = transaction("write", model="standard", delays=way, payload_bytes=4, responder=Responder(36.8))
    >>> phases.request_bytes, phases.response_bytes
    (20.0, 16.0)
    >>> round(phases.request_and_acknowledge_us, 3)
    5.347
    """
    answer, gaps, acknowledge_us = responder.answer, delays.gaps, delays.acknowledge_us
    is_split, has_response = answer == "split", answer != "unified"
    if model == "paper":
        request_bytes, response_bytes = payload_bytes + overhead_bytes, payload_bytes + overhead_bytes
    else:
        request_bytes, response_bytes = _packet_bytes(kind, payload_bytes)
    request_data_us = delays.data_us(request_bytes)
    response_data_us = delays.data_us(response_bytes) if has_response else 0.0
    request_us = equations.request_us(delays.arbitration_us, data_us=request_data_us)
    response_us = equations.response_us(delays.arbitration_us if is_split else 0.0, data_us=response_data_us)
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
    if model == "paper":
        idle = IdleTime(gaps.both_us, 0.0)
    else:
        slowest_us = execution_us + worst_extra_us
        idle = idle_time(answer, gaps=gaps, execution_us=slowest_us, host_us=responder.host_us)
    return Phases(
        request_bytes=request_bytes,
        response_bytes=response_bytes if has_response else 0,
        arbitration_us=delays.arbitration_us,
        request_data_us=request_data_us,
        response_data_us=response_data_us,
        acknowledge_us=acknowledge_us,
        request_us=request_us,
        response_us=response_us,
        request_and_acknowledge_us=equations.request_and_acknowledge_us(request_us, acknowledge_us=acknowledge_us),
        request_and_acknowledge_eq15_us=equations.published_request_and_acknowledge_us(payload_bytes),
        hold_us=hold_us,
        execution_us=execution_us,
        response_and_acknowledge_us=equations.response_and_acknowledge_us(
            response_us, acknowledge_us=response_acknowledge_us
        ),
        latency_us=latency_us,
        interval_latency_us=equations.interval_latency_us(
            delays.arbitration_us,
            t2_us=request_data_us + acknowledge_us,
            t3_us=execution_us if is_split else hold_us,
            t4_us=delays.arbitration_us if is_split else 0.0,
            t5_us=response_data_us + response_acknowledge_us,
        ),
        subaction_gap_us=gaps.subaction_us,
        arbitration_reset_gap_us=gaps.arbitration_reset_us,
        gaps_us=gaps.both_us,
        latency_with_gaps_us=latency_us + gaps.both_us,
        worst_extra_us=worst_extra_us,
        idle_us=idle.idle_us,
        host_us=idle.host_us,
        transaction_us=latency_us + worst_extra_us + idle.idle_us + idle.host_us,
    )
