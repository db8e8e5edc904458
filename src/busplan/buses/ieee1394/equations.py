"""Equations (3)-(15) of the paper, a function each; (1) and (2) stand in `busplan.buses.time_slice`.

Each parameter is a float or an array, and so is the result, in their broadcast shape; a derivation gives traced
numbers. Times are in us, rates in Mbit/s (bit/us, so that bits / rate is in us), lengths in m, sizes in bytes.
Nothing is checked here: the profile has refused what makes no sense, and a divisor of zero raises ZeroDivisionError.

The symbols are the paper's, but for what it writes out or calls N and Bandwidth alike: H cable hops between the two
nodes (N in its chain), g the gap count (0..63), B a packet with its overhead, P its payload, L the length of a cable,
R the data rate, and C the clock that gaps and PHY delays are counted in: the timing models differ in it.

References
----------
G. Gu, L. Zhu, Z. Xiong, H. Ding, "Design of a Distributed Multiaxis Motion Control System Using the IEEE-1394
Bus", IEEE Transactions on Industrial Electronics 57 (12), December 2010, pp. 4209 ff.
"""

from busplan.buses.ieee1394.constants import BITS_PER_BYTE, c
from busplan.elementwise import Number, step
from busplan.sourced import SYMBOLS, published

SYMBOLS.update(
    {
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

    T_lant = T_req + T_ack1 + T_exec + T_resp + T_ack2 [us].

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

    T_phy = 14 / C [us].

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
@step("hop", "hop_us")
def hop_delay_us(cable_length_m: Number, *, phy_delay_us: Number) -> Number:
    """Delay of a hop, cable and PHY.

    hop = 0.023 L / 4.5 + T_phy [us].

    Examples
    --------
    >>> round(hop_delay_us(4.5, phy_delay_us=0.144), 6)
    0.167
    """
    return c.CABLE_DELAY_US * cable_length_m / c.REFERENCE_CABLE_M + phy_delay_us


@published(4, symbol="ArbP", section="III-E")
def arbitration_phase_us(hops: Number, *, hop_us: Number, gap_count: Number, gap_clock_mbit_s: Number) -> Number:
    """Arbitration phase of a packet.

    ArbP = hop H + 4 g / C + 1.63 [us].

    Examples
    --------
    >>> round(arbitration_phase_us(1, hop_us=0.0586, gap_count=63, gap_clock_mbit_s=393.216), 4)
    2.3295
    """
    return hop_us * hops + c.ARBITRATION_GAP_TICKS * gap_count / gap_clock_mbit_s + c.ARBITRATION_HOLD_US


@published(5, symbol="DTP", section="III-E")
def data_phase_us(hops: Number, *, hop_us: Number, packet_bytes: Number, data_rate_mbit_s: Number) -> Number:
    """Data-transfer phase of a packet.

    DTP = hop H + 8 B / R [us].

    Examples
    --------
    >>> round(data_phase_us(1, hop_us=0.0586, packet_bytes=32, data_rate_mbit_s=393.216), 4)
    0.7096
    """
    return hop_us * hops + BITS_PER_BYTE * packet_bytes / data_rate_mbit_s


@published(6, symbol="AckP", section="III-E")
def acknowledge_phase_us(hops: Number, *, hop_us: Number) -> Number:
    """Acknowledge phase of a packet.

    AckP = hop H + 0.25 [us].

    Examples
    --------
    >>> round(acknowledge_phase_us(1, hop_us=0.0586), 4)
    0.3086
    """
    return hop_us * hops + c.DATA_END_US


@published(7, symbol="T_req", section="III-E")
def request_us(arbitration_us: Number, *, data_us: Number) -> Number:
    """Request time of a transaction.

    T_req = ArbP + DTP [us].

    Examples
    --------
    >>> request_us(2.25, data_us=0.5)
    2.75
    """
    return arbitration_us + data_us


@published(8, symbol="T_resp", section="III-E")
def response_us(arbitration_us: Number, *, data_us: Number) -> Number:
    """Response time of a transaction.

    T_resp = ArbP + DTP [us].

    Examples
    --------
    >>> response_us(2.25, data_us=0.75)
    3.0
    """
    return arbitration_us + data_us


@published(9, symbol="T_ack1 = T_ack2", section="III-E")
def acknowledge_us(acknowledge_phase_us: Number) -> Number:
    """Acknowledge time of either half of a transaction.

    T_ack1 = T_ack2 = AckP [us].

    Examples
    --------
    >>> acknowledge_us(0.31)
    0.31
    """
    return acknowledge_phase_us


@published(10, symbol="T_sub", section="III-E", part="its part of 82 + 48 g, as IEEE 1394 has it")
@step("T_sub")
def subaction_gap_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Subaction gap.

    T_sub = (29 + 16 g) / C [us].

    Examples
    --------
    >>> round(subaction_gap_us(63, gap_clock_mbit_s=98.304), 4)
    10.5489
    """
    return (c.SUBACTION_GAP_TICKS + c.SUBACTION_GAP_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(10, symbol="T_reset", section="III-E", part="its part of 82 + 48 g, as IEEE 1394 has it")
@step("T_reset")
def arbitration_reset_gap_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Arbitration reset gap.

    T_reset = (53 + 32 g) / C [us].

    Examples
    --------
    >>> round(arbitration_reset_gap_us(63, gap_clock_mbit_s=98.304), 4)
    21.047
    """
    return (c.RESET_GAP_TICKS + c.RESET_GAP_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(10, symbol="T_sum", section="III-E")
@step("T_sum")
def gaps_us(gap_count: Number, *, gap_clock_mbit_s: Number) -> Number:
    """Subaction gap and arbitration reset gap together.

    T_sum = (82 + 48 g) / C [us].

    Examples
    --------
    >>> round(gaps_us(63, gap_clock_mbit_s=393.216), 2), round(gaps_us(63, gap_clock_mbit_s=98.304), 2)
    (7.9, 31.6)
    """
    return (c.GAPS_TICKS + c.GAPS_TICKS_PER_COUNT * gap_count) / gap_clock_mbit_s


@published(11, symbol="N", section="III-E")
def published_nodes(available_us: Number, *, sync_us: Number, latency_us: Number, gaps_us: Number) -> Number:
    """Number of nodes as the paper publishes it.

    N = (alpha T_s - CTS) / (2 (T_lant + T_sum)) [1], not rounded. T_lant and CTS hold N themselves, so this is exact
    only where they were taken at the answer. It is reported as published; the capacity itself solves for N.

    Examples
    --------
    >>> published_nodes(2000.4, sync_us=0.4, latency_us=42.0, gaps_us=8.0)
    20.0
    """
    return (available_us - sync_us) / (2 * (latency_us + gaps_us))


@published(12, symbol="T_lant", section="IV-A")
def interval_latency_us(t1_us: Number, *, t2_us: Number, t3_us: Number, t4_us: Number, t5_us: Number) -> Number:
    """Latency of a transaction from the five intervals of the bench.

    T_lant = T1 + T2 + T3 + T4 + T5 [us].

    Examples
    --------
    >>> interval_latency_us(2.0, t2_us=1.0, t3_us=36.5, t4_us=2.0, t5_us=1.0)
    42.5
    """
    return t1_us + t2_us + t3_us + t4_us + t5_us


@published(13, symbol="T1 + T2", section="IV-A")
def request_and_acknowledge_us(request_us: Number, *, acknowledge_us: Number) -> Number:
    """First half of a transaction, T1 + T2 of the bench.

    T1 + T2 = T_req + T_ack [us].

    Examples
    --------
    >>> request_and_acknowledge_us(2.75, acknowledge_us=0.25)
    3.0
    """
    return request_us + acknowledge_us


@published(14, symbol="T4 + T5", section="IV-A")
def response_and_acknowledge_us(response_us: Number, *, acknowledge_us: Number) -> Number:
    """Second half of a transaction, T4 + T5 of the bench.

    T4 + T5 = T_resp + T_ack [us].

    Examples
    --------
    >>> response_and_acknowledge_us(3.0, acknowledge_us=0.25)
    3.25
    """
    return response_us + acknowledge_us


@published(15, symbol="T1 + T2", section="IV-A")
def published_request_and_acknowledge_us(payload_bytes: Number) -> Number:
    """First half of a transaction as Table I's theory column has it.

    T1 + T2 = 3.11 + 8 P / 393.216 [us]. The rounded form of equation (13) at one hop, gap count 63 and S400. The terms
    of equations (4)-(6) add up to 6.4 ns less than its constant.

    Examples
    --------
    >>> round(published_request_and_acknowledge_us(1024), 2)
    23.94
    """
    return c.EQ15_CONSTANT_US + BITS_PER_BYTE * payload_bytes / float(c.by_key("DATA_RATE_MBIT_S")["S400"])
