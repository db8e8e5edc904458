"""The published figures that the equations of the bus reach, beside the computed ones."""

from collections.abc import Iterator, Mapping
from typing import Any

from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    ARBITRATION_GAP_TICKS,
    ARBITRATION_HOLD_US,
    BITS_PER_BYTE,
    DATA_END_US,
    DATA_RATE_MBIT_S,
    REFERENCE_CABLE_M,
)
from busplan.buses.ieee1394.table_1 import TABLE_1, residual
from busplan.buses.ieee1394.timing import TIMING_MODELS, Phases
from busplan.buses.ieee1394.transactions import exchange, link_of
from busplan.buses.network import Network
from busplan.buses.published import Comparison, EvidenceSection
from busplan.elementwise import plain

Published = Mapping[str, Any]
"""The published figures, as the package's data file holds them."""


def bus_sections(bench: Network, published: Published) -> tuple[EvidenceSection, ...]:
    """Compare published figures of the bus with what the equations give.

    Parameters
    ----------
    bench
        The bench that Tables I and II were measured on.
    published
        The published figures.

    References
    ----------
    Paper, Tables I and II, section IV-A, equations (3)-(15).
    """
    return (
        _theory(),
        _first_half(bench),
        _latency(bench),
        _bias(),
        *_ratios(bench, published),
        _can(bench, published),
        _equation_15(published),
        _equation_10(bench),
    )


def _write_phases(bench: Network, payload_bytes: int) -> Iterator[tuple[str, Phases]]:
    """Phases of a write of that payload under each model: Table I was measured with writes."""
    execution = bench.profile.node.execution
    (group,) = bench.groups
    changed = group._replace(write_bytes=payload_bytes, write_execution_us=execution.execution_us(payload_bytes))
    for model in TIMING_MODELS:
        yield f"{model} model", exchange(bench, changed, "write", model=model, link=link_of(bench)).phases


def _theory() -> EvidenceSection:
    title = "Table I: T1+T2, theory"
    return EvidenceSection(
        title,
        "Equation (15), not rounded; the table prints two decimals.",
        tuple(
            Comparison(
                title,
                f"{row.payload_bytes} bytes",
                "us",
                row.theory_us,
                "eq (15)",
                plain(equations.published_request_and_acknowledge_us(row.payload_bytes)),
            )
            for row in TABLE_1
        ),
    )


def _first_half(bench: Network) -> EvidenceSection:
    title = "Table I: T1+T2, measured"
    return EvidenceSection(
        title,
        "Equation (13) under either timing model; nothing here is fitted.",
        tuple(
            Comparison(
                title,
                f"{row.payload_bytes} bytes",
                "us",
                row.request_and_acknowledge_us,
                method,
                plain(one.request_and_acknowledge_us),
                "measured",
            )
            for row in TABLE_1
            for method, one in _write_phases(bench, row.payload_bytes)
        ),
    )


def _latency(bench: Network) -> EvidenceSection:
    title = "Table I: T_lant, measured"
    return EvidenceSection(
        title,
        "Equation (3). T_exec is derived from the same table, T_lant less both halves as measured, the second without "
        "a payload: the residual is that of the halves alone, and no test of T_exec.",
        tuple(
            Comparison(
                title, f"{row.payload_bytes} bytes", "us", row.latency_us, method, plain(one.latency_us), "measured"
            )
            for row in TABLE_1
            for method, one in _write_phases(bench, row.payload_bytes)
        ),
    )


def _bias() -> EvidenceSection:
    title = "Table I: what half a transaction takes beyond the model"
    return EvidenceSection(
        title,
        "T1+T2 as measured, less equation (13), over the rows of the table. Every verdict takes the mean of the "
        "standard model off its margin, and counts the standard uncertainty of one more row (JCGM 100).",
        tuple(
            Comparison(title, quantity, "us", None, f"{model} model", float(value), "derived")
            for quantity, key in (("mean", "mean_us"), ("standard uncertainty", "uncertainty_us"))
            for model in TIMING_MODELS
            for value in (getattr(residual(model), key),)
        ),
    )


def _ratios(bench: Network, published: Published) -> Iterator[EvidenceSection]:
    table = published["table_2"]
    for which in ("first", "second"):
        title = f"Table II: T_lant as a share of reference [48]'s, {which} figure"
        rows = zip(table["payload_bytes"], table["latency_us"], table[f"reference_{which}_us"], strict=True)
        yield EvidenceSection(
            title,
            "The quotient of the two printed columns, and of the computed latency and the printed reference.",
            tuple(
                Comparison(title, f"{size} bytes", "1", own / other, method, one.latency_us / other, "derived")
                for size, own, other in rows
                for method, one in _write_phases(bench, size)
            ),
        )


def _can(bench: Network, published: Published) -> EvidenceSection:
    can = published["can"]
    title = f"Section IV-A: against CAN at {can['can_rate_mbit_s']} Mbit/s"
    size, can_us = can["payload_bytes"], can["can_latency_us"]
    wire_us = can["frame_bits"] / can["can_rate_mbit_s"]

    def compared(method: str, latency_us: float) -> Iterator[Comparison]:
        yield Comparison(title, f"T_lant, {size} bytes", "us", can["latency_us"], method, latency_us, "measured")
        yield Comparison(title, "CAN / T_lant", "1", can["ratio"], method, can_us / latency_us)

    return EvidenceSection(
        title,
        f"{can_us} us by CAN, which over the printed {can['latency_us']} us is {can_us / can['latency_us']:.1f}. A CAN "
        f"frame of {size} bytes takes {wire_us:.0f} us on the wire ({can['frame_source']}); the other "
        f"{(can_us - wire_us) / 1000:.1f} ms are the host's, and no figure of the bus. T_exec at {size} bytes lies "
        "between two rows of Table I.",
        (
            *(one for method, half in _write_phases(bench, size) for one in compared(method, plain(half.latency_us))),
            Comparison(title, f"CAN, {size} bytes", "us", can_us, "CAN frame on the wire", wire_us),
        ),
    )


def _equation_15(published: Published) -> EvidenceSection:
    given = published["equation_15"]
    title = "Equation (15): its constant"
    rate_mbit_s = DATA_RATE_MBIT_S["S400"]
    hop_us = given["nodes"] * equations.hop_delay_us(
        REFERENCE_CABLE_M, phy_delay_us=equations.phy_delay_us(rate_mbit_s)
    )
    terms_us = (
        *(hop_us, ARBITRATION_GAP_TICKS * given["gap_count"] / rate_mbit_s, ARBITRATION_HOLD_US),
        *(hop_us, BITS_PER_BYTE * given["overhead_bytes"] / rate_mbit_s),
        *(hop_us, DATA_END_US),
    )
    ways = {
        "eqs (4)-(6)": sum(terms_us),
        "terms rounded first": sum(round(float(term_us), 2) for term_us in terms_us),
    }
    short_ns = (given["constant_us"] - ways["eqs (4)-(6)"]) * 1000
    return EvidenceSection(
        title,
        f"The terms add up to {short_ns:.1f} ns less; rounded to two decimals one by one, "
        "they give the printed figure.",
        tuple(
            Comparison(title, "no payload", "us", given["constant_us"], method, value) for method, value in ways.items()
        ),
    )


def _equation_10(bench: Network) -> EvidenceSection:
    title = "Equation (10): the clock of the gaps"
    link = link_of(bench)
    gaps_us = {
        name: plain(equations.gaps_us(link.gap_count, gap_clock_mbit_s=model.gap_clock_mbit_s(link.data_rate_mbit_s)))
        for name, model in TIMING_MODELS.items()
    }
    quantity = f"T_sum, gap count {link.gap_count:g}"
    (group,) = bench.groups
    own = {
        name: exchange(bench, group, "write", model=name, link=link).phases  # of the bench's own payload
        for name in TIMING_MODELS
    }
    size = group.write_bytes
    return EvidenceSection(
        title,
        "The paper counts gaps in the data rate, and adds both up behind every transaction. The standard counts them "
        "in the base rate, as thresholds of one idle period (TI TSB12LV01B, p. 7-6): a node's execution counts towards "
        "them. The paper prints no figure.",
        (
            *(Comparison(title, quantity, "us", None, f"{name} model", value) for name, value in gaps_us.items()),
            Comparison(title, "standard / paper", "1", None, "standard model", gaps_us["standard"] / gaps_us["paper"]),
            *(
                Comparison(title, f"idle bus of a write, {size} bytes", "us", None, f"{name} model", plain(one.idle_us))
                for name, one in own.items()
            ),
        ),
    )
