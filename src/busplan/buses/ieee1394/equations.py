"""Equations (3)-(15) of the paper, a function each; (1) and (2) stand in `busplan.buses.time_slice`.

The functions are operators only: a float in gives a float, NumPy arrays broadcast. Times are in us, rates in
Mbit/s (which is bit/us, so that bits / rate is in us), lengths in m, sizes in bytes. Nothing is checked here:
the profile has refused what makes no sense, and a rate of zero raises ZeroDivisionError.

The paper writes the same `Bandwidth` for the data rate and for the clock that gaps and PHY delays are counted in.
Here they are two parameters, `data_rate_mbit_s` and `gap_clock_mbit_s`: the timing models differ in the second.

References
----------
G. Gu, L. Zhu, Z. Xiong, H. Ding, "Design of a Distributed Multiaxis Motion Control System Using the IEEE-1394
Bus", IEEE Transactions on Industrial Electronics 57 (12), December 2010, pp. 4209 ff.
"""

from busplan.buses.ieee1394.constants import (
    BITS_PER_BYTE,
    c,
)
from busplan.elementwise import Number
from busplan.sourced import SYMBOLS, published

SYMBOLS.update(
    {
        "sync_us": "CTS",
        "request_us": "T_req",
        "response_us": "T_resp",
        "request_acknowledge_us": "T_ack1",
        "response_acknowledge_us": "T_ack2",
        "execution_us": "T_exec",
        "cable_length_m": "L",
        "phy_delay_us": "T_phy",
        "hop_us": "hop",
        "hops": "H",
        "gap_count": "g",
        "data_rate_mbit_s": "R",
        "gap_clock_mbit_s": "C",
        "packet_bytes": "B",
        "payload_bytes": "P",
        "arbitration_us": "ArbP",
        "data_us": "DTP",
        "acknowledge_phase_us": "AckP",
        "acknowledge_us": "T_ack",
        "latency_us": "T_lant",
        "gaps_us": "T_sum",
        **{f"t{number}_us": f"T{number}" for number in range(1, 6)},
    }
)
# The paper's own symbols, but for what it writes out or calls N and Bandwidth alike: hops H, gap count g, rate R,
# clock C, packet B, payload P, cable L.


@published(3, symbol="T_lant", section="III-E")
def transaction_latency_us(
    request_us: Number,
    *,
    request_acknowledge_us: Number,
    execution_us: Number,
    response_us: Number,
    response_acknowledge_us: Number,
) -> Number:
    """Latency of an asynchronous transaction from its five parts.

    Parameters
    ----------
    request_us
        Request time T_req of equation (7) [us]; float or array.
    request_acknowledge_us
        Acknowledge of the request T_ack1 of equation (9) [us]; float or array.
    execution_us
        Execution time T_exec in the responder, measured [us]; float or array.
    response_us
        Response time T_resp of equation (8) [us]; float or array.
    response_acknowledge_us
        Acknowledge of the response T_ack2 of equation (9) [us]; float or array.

    Returns
    -------
    float
        T_lant = T_req + T_ack1 + T_exec + T_resp + T_ack2 [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> transaction_latency_us(
    ...     2.5, request_acknowledge_us=0.5, execution_us=36.0, response_us=2.5, response_acknowledge_us=0.5
    ... )
    42.0
    """
    return request_us + request_acknowledge_us + execution_us + response_us + response_acknowledge_us


@published(4, 5, 6, symbol="T_phy", section="III-E", part="14 / Bandwidth, in the clock of the gaps")
def phy_delay_us(gap_clock_mbit_s: Number) -> Number:
    """Repeat delay of a PHY.

    Parameters
    ----------
    gap_clock_mbit_s
        Clock that PHY delays are counted in [Mbit/s]; float or array.

    Returns
    -------
    float
        T_phy = 14 / C [us]; the shape of the argument.

    Raises
    ------
    ZeroDivisionError
        `gap_clock_mbit_s` is zero.

    Examples
    --------
    >>> round(phy_delay_us(98.304), 6)
    0.142415
    """
    return c.PHY_DELAY_TICKS / gap_clock_mbit_s


@published(
    4,
    5,
    6,
    symbol="hop",
    section="III-E",
    part="their bracket, for a cable of 4.5 m; in proportion to the length for others",
)
def hop_delay_us(cable_length_m: Number, *, phy_delay_us: Number) -> Number:
    """Delay of a hop, cable and PHY.

    Parameters
    ----------
    cable_length_m
        Length of a cable [m]; float or array.
    phy_delay_us
        Repeat delay of a PHY [us]; float or array.

    Returns
    -------
    float
        hop = 0.023 L / 4.5 + T_phy [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> round(hop_delay_us(4.5, phy_delay_us=0.144), 6)
    0.167
    """
    return c.CABLE_DELAY_US * cable_length_m / c.REFERENCE_CABLE_M + phy_delay_us


@published(4, symbol="ArbP", section="III-E")
def arbitration_phase_us(hops: Number, *, hop_us: Number, gap_count: Number, gap_clock_mbit_s: Number) -> Number:
    """Arbitration phase of a packet.

    Parameters
    ----------
    hops
        Cable hops between the two nodes, N in the paper's chain [1]; float or array.
    hop_us
        Delay of a hop [us]; float or array.
    gap_count
        Gap count of the bus, 0..63 [1]; float or array.
    gap_clock_mbit_s
        Clock that gaps are counted in [Mbit/s]; float or array.

    Returns
    -------
    float
        ArbP = hop H + 4 g / C + 1.63 [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `gap_clock_mbit_s` is zero.

    Examples
    --------
    >>> round(arbitration_phase_us(1, hop_us=0.0586, gap_count=63, gap_clock_mbit_s=393.216), 4)
    2.3295
    """
    return hop_us * hops + c.ARBITRATION_GAP_TICKS * gap_count / gap_clock_mbit_s + c.ARBITRATION_HOLD_US


@published(5, symbol="DTP", section="III-E")
def data_phase_us(hops: Number, *, hop_us: Number, packet_bytes: Number, data_rate_mbit_s: Number) -> Number:
    """Data-transfer phase of a packet.

    Parameters
    ----------
    hops
        Cable hops between the two nodes [1]; float or array.
    hop_us
        Delay of a hop [us]; float or array.
    packet_bytes
        Packet size DataSize, payload and overhead [bytes]; float or array.
    data_rate_mbit_s
        Data rate of the packet [Mbit/s]; float or array.

    Returns
    -------
    float
        DTP = hop H + 8 B / R [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        The rate is zero.

    Examples
    --------
    >>> round(data_phase_us(1, hop_us=0.0586, packet_bytes=32, data_rate_mbit_s=393.216), 4)
    0.7096
    """
    return hop_us * hops + BITS_PER_BYTE * packet_bytes / data_rate_mbit_s


@published(6, symbol="AckP", section="III-E")
def acknowledge_phase_us(hops: Number, *, hop_us: Number) -> Number:
    """Acknowledge phase of a packet.

    Parameters
    ----------
    hops
        Cable hops between the two nodes [1]; float or array.
    hop_us
        Delay of a hop [us]; float or array.

    Returns
    -------
    float
        AckP = hop H + 0.25 [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> round(acknowledge_phase_us(1, hop_us=0.0586), 4)
    0.3086
    """
    return hop_us * hops + c.DATA_END_US


@published(7, symbol="T_req", section="III-E")
def request_us(arbitration_us: Number, *, data_us: Number) -> Number:
    """Request time of a transaction.

    Parameters
    ----------
    arbitration_us
        Arbitration phase ArbP_time of equation (4) [us]; float or array.
    data_us
        Data-transfer phase DTP_time of the request packet, equation (5) [us]; float or array.

    Returns
    -------
    float
        T_req = ArbP + DTP [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> request_us(2.25, data_us=0.5)
    2.75
    """
    return arbitration_us + data_us


@published(8, symbol="T_resp", section="III-E")
def response_us(arbitration_us: Number, *, data_us: Number) -> Number:
    """Response time of a transaction.

    Parameters
    ----------
    arbitration_us
        Arbitration phase ArbP_time of equation (4) [us]; float or array.
    data_us
        Data-transfer phase DTP_time of the response packet, equation (5) [us]; float or array.

    Returns
    -------
    float
        T_resp = ArbP + DTP [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> response_us(2.25, data_us=0.75)
    3.0
    """
    return arbitration_us + data_us


@published(9, symbol="T_ack1 = T_ack2", section="III-E")
def acknowledge_us(acknowledge_phase_us: Number) -> Number:
    """Acknowledge time of either half of a transaction.

    Parameters
    ----------
    acknowledge_phase_us
        Acknowledge phase AckP_time of equation (6) [us]; float or array.

    Returns
    -------
    float
        T_ack1 = T_ack2 = AckP [us]; the shape of the argument.

    Examples
    --------
    >>> acknowledge_us(0.31)
    0.31
    """
    return acknowledge_phase_us


@published(10, symbol="T_sub", section="III-E", part="its part of 82 + 48 g, as IEEE 1394 has it")
def subaction_gap_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Subaction gap.

    Parameters
    ----------
    gap_count
        Gap count of the bus, 0..63 [1]; float or array.
    gap_clock_mbit_s
        Clock that gaps are counted in [Mbit/s]; float or array.

    Returns
    -------
    float
        T_sub = (29 + 16 g) / C [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `gap_clock_mbit_s` is zero.

    Examples
    --------
    >>> round(subaction_gap_us(63, gap_clock_mbit_s=98.304), 4)
    10.5489
    """
    return (c.SUBACTION_GAP_TICKS + c.SUBACTION_GAP_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(10, symbol="T_reset", section="III-E", part="its part of 82 + 48 g, as IEEE 1394 has it")
def arbitration_reset_gap_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Arbitration reset gap.

    Parameters
    ----------
    gap_count
        Gap count of the bus, 0..63 [1]; float or array.
    gap_clock_mbit_s
        Clock that gaps are counted in [Mbit/s]; float or array.

    Returns
    -------
    float
        T_reset = (53 + 32 g) / C [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `gap_clock_mbit_s` is zero.

    Examples
    --------
    >>> round(arbitration_reset_gap_us(63, gap_clock_mbit_s=98.304), 4)
    21.047
    """
    return (c.RESET_GAP_TICKS + c.RESET_GAP_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(10, symbol="T_sum", section="III-E")
def gaps_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Subaction gap and arbitration reset gap together.

    Parameters
    ----------
    gap_count
        Gap count of the bus, 0..63 [1]; float or array.
    gap_clock_mbit_s
        Clock that gaps are counted in [Mbit/s]; float or array.

    Returns
    -------
    float
        T_sum = (82 + 48 g) / C [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `gap_clock_mbit_s` is zero.

    Examples
    --------
    >>> round(gaps_us(63, gap_clock_mbit_s=393.216), 2), round(gaps_us(63, gap_clock_mbit_s=98.304), 2)
    (7.9, 31.6)
    """
    return (c.GAPS_TICKS + c.GAPS_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(11, symbol="N", section="III-E")
def published_nodes(available_us: Number, *, sync_us: Number, latency_us: Number, gaps_us: Number) -> Number:
    """Number of nodes as the paper publishes it.

    T_lant and CTS hold N themselves, so this is exact only where they were taken at the answer. It is reported
    as published; the capacity itself solves for N.

    Parameters
    ----------
    available_us
        Communication share of the period alpha T_s (the paper: 0.5 T_s) [us]; float or array.
    sync_us
        Time of the synchronous packet CTS [us]; float or array.
    latency_us
        Transaction latency T_lant; where a read and a write differ, their mean [us]; float or array.
    gaps_us
        Gaps T_sum after a transaction, equation (10) [us]; float or array.

    Returns
    -------
    float
        N = (alpha T_s - CTS) / (2 (T_lant + T_sum)) [1], not rounded; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `latency_us` and `gaps_us` add up to zero.

    Examples
    --------
    >>> published_nodes(2000.4, sync_us=0.4, latency_us=42.0, gaps_us=8.0)
    20.0
    """
    return (available_us - sync_us) / (2 * (latency_us + gaps_us))


@published(12, symbol="T_lant", section="IV-A")
def interval_latency_us(t1_us: Number, *, t2_us: Number, t3_us: Number, t4_us: Number, t5_us: Number) -> Number:
    """Latency of a transaction from the five intervals of the bench.

    Parameters
    ----------
    t1_us, t2_us
        Requester applies for the bus, and transmits its request until acknowledged [us]; float or array.
    t3_us
        Responder executes [us]; float or array.
    t4_us, t5_us
        Responder applies for the bus, and transmits its response until acknowledged [us]; float or array.

    Returns
    -------
    float
        T_lant = T1 + T2 + T3 + T4 + T5 [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> interval_latency_us(2.0, t2_us=1.0, t3_us=36.5, t4_us=2.0, t5_us=1.0)
    42.5
    """
    return t1_us + t2_us + t3_us + t4_us + t5_us


@published(13, symbol="T1 + T2", section="IV-A")
def request_and_acknowledge_us(request_us: Number, *, acknowledge_us: Number) -> Number:
    """First half of a transaction, T1 + T2 of the bench.

    Parameters
    ----------
    request_us
        Request time T_req of equation (7) [us]; float or array.
    acknowledge_us
        Acknowledge time T_ack1 of equation (9) [us]; float or array.

    Returns
    -------
    float
        T1 + T2 = T_req + T_ack [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> request_and_acknowledge_us(2.75, acknowledge_us=0.25)
    3.0
    """
    return request_us + acknowledge_us


@published(14, symbol="T4 + T5", section="IV-A")
def response_and_acknowledge_us(response_us: Number, *, acknowledge_us: Number) -> Number:
    """Second half of a transaction, T4 + T5 of the bench.

    Parameters
    ----------
    response_us
        Response time T_resp of equation (8) [us]; float or array.
    acknowledge_us
        Acknowledge time T_ack2 of equation (9) [us]; float or array.

    Returns
    -------
    float
        T4 + T5 = T_resp + T_ack [us]; the broadcast shape of the arguments.

    Examples
    --------
    >>> response_and_acknowledge_us(3.0, acknowledge_us=0.25)
    3.25
    """
    return response_us + acknowledge_us


@published(15, symbol="T1 + T2", section="IV-A")
def published_request_and_acknowledge_us(payload_bytes: Number) -> Number:
    """First half of a transaction as Table I's theory column has it.

    The rounded form of equation (13) at one hop, gap count 63 and S400. The terms of equations (4)-(6) add up
    to 6.4 ns less than its constant.

    Parameters
    ----------
    payload_bytes
        Payload, overhead not counted [bytes]; float or array.

    Returns
    -------
    float
        T1 + T2 = 3.11 + 8 P / 393.216 [us]; the shape of the argument.

    Examples
    --------
    >>> round(published_request_and_acknowledge_us(1024), 2)
    23.94
    """
    return c.EQ15_CONSTANT_US + BITS_PER_BYTE * payload_bytes / float(c.by_key("DATA_RATE_MBIT_S")["S400"])
