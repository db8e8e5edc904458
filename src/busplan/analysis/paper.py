"""Every published figure that the equations reach, beside the computed one."""

import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from busplan.analysis.circle.roundness import CircleFigures
from busplan.analysis.latency import BOTH_MODELS, phases
from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    ARBITRATION_GAP_TICKS,
    ARBITRATION_HOLD_US,
    BITS_PER_BYTE,
    DATA_END_US,
    DATA_RATE_MBIT_S,
    REFERENCE_CABLE_M,
)
from busplan.buses.ieee1394.timing import TIMING_MODELS, Phases
from busplan.profile.model import Profile

Unit = Literal["us", "1", "s", "mm"]

BENCH_PROFILE: Final = "paper-two-node"
"""Shipped profile of the bench that Tables I and II were measured on."""
CIRCLE_PROFILES: Final = ("paper-4ms", "paper-1ms")
"""Shipped profiles of the two circles of section IV-B, in the order of the data file."""
_DATA: Final = Path(__file__).resolve().parents[1] / "data" / "paper.toml"


class Comparison(NamedTuple):
    """One published figure and one way to compute it."""

    section: str
    quantity: str
    unit: Unit
    published: float | None
    """As printed, or the quotient of two printed figures; None where the paper gives a formula and no figure."""
    method: str
    """The equation or timing model behind the computed figure."""
    computed: float

    @property
    def residual(self) -> float | None:
        """Computed less published, in `unit`."""
        return None if self.published is None else self.computed - self.published

    @property
    def relative_residual(self) -> float | None:
        """The residual as a share of the published figure [1]."""
        return None if self.published is None else (self.computed - self.published) / self.published


class PaperSection(NamedTuple):
    """One table or passage of the paper."""

    title: str
    note: str
    comparisons: tuple[Comparison, ...]


@cache
def published() -> dict[str, Any]:
    """The published figures, as the package's data file holds them."""
    return tomllib.loads(_DATA.read_text(encoding="utf-8"))


def paper_sections(bench: Profile, *, circles: Sequence[CircleFigures]) -> tuple[PaperSection, ...]:
    """Compare every published figure that the equations reach with what they give.

    Parameters
    ----------
    bench
        The profile of the paper's bench, `BENCH_PROFILE`.
    circles
        Circle tests of `CIRCLE_PROFILES`, in this order.

    Returns
    -------
    tuple
        Sections in the order of the paper.

    References
    ----------
    Paper, Tables I and II, sections IV-A and IV-B, equations (3)-(15), Figs. 9 and 10.
    """
    return (
        _theory(),
        _first_half(bench),
        _latency(bench),
        *_ratios(bench),
        _can(bench),
        _equation_15(),
        _equation_10(bench),
        _circles(circles),
        _sercos(circles),
    )


def _write_phases(bench: Profile, payload_bytes: int) -> Iterator[tuple[str, Phases]]:
    """Phases of a write of that payload under each model: Table I was measured with writes."""
    for model in BOTH_MODELS:
        yield f"{model} model", phases(bench, "write", model=model, payload_bytes=payload_bytes)


def _theory() -> PaperSection:
    title = "Table I: T1+T2, theory"
    table = published()["table_1"]
    rows = zip(table["payload_bytes"], table["request_and_acknowledge_theory_us"], strict=True)
    return PaperSection(
        title,
        "Equation (15), not rounded; the table prints two decimals.",
        tuple(
            Comparison(
                title,
                f"{size} bytes",
                "us",
                value,
                "eq (15)",
                equations.published_request_and_acknowledge_us(size),
            )
            for size, value in rows
        ),
    )


def _first_half(bench: Profile) -> PaperSection:
    title = "Table I: T1+T2, measured"
    table = published()["table_1"]
    rows = zip(table["payload_bytes"], table["request_and_acknowledge_us"], strict=True)
    return PaperSection(
        title,
        "Equation (13) under either timing model; nothing here is fitted.",
        tuple(
            Comparison(title, f"{size} bytes", "us", value, method, one.request_and_acknowledge_us)
            for size, value in rows
            for method, one in _write_phases(bench, size)
        ),
    )


def _latency(bench: Profile) -> PaperSection:
    title = "Table I: T_lant, measured"
    table = published()["table_1"]
    rows = zip(table["payload_bytes"], table["latency_us"], strict=True)
    return PaperSection(
        title,
        "Equation (3). T_exec is derived from the same table, T_lant - 2 (T1+T2) as measured: the residual is that "
        "of the two halves alone, and no test of T_exec.",
        tuple(
            Comparison(title, f"{size} bytes", "us", value, method, one.latency_us)
            for size, value in rows
            for method, one in _write_phases(bench, size)
        ),
    )


def _ratios(bench: Profile) -> Iterator[PaperSection]:
    table = published()["table_2"]
    for which in ("first", "second"):
        title = f"Table II: T_lant as a share of reference [48]'s, {which} figure"
        rows = zip(table["payload_bytes"], table["latency_us"], table[f"reference_{which}_us"], strict=True)
        yield PaperSection(
            title,
            "The quotient of the two printed columns, and of the computed latency and the printed reference.",
            tuple(
                Comparison(title, f"{size} bytes", "1", own / other, method, one.latency_us / other)
                for size, own, other in rows
                for method, one in _write_phases(bench, size)
            ),
        )


def _can(bench: Profile) -> PaperSection:
    can = published()["can"]
    title = f"Section IV-A: against CAN at {can['can_rate_mbit_s']} Mbit/s"
    size, can_us = can["payload_bytes"], can["can_latency_us"]

    def compared(method: str, latency_us: float) -> Iterator[Comparison]:
        yield Comparison(title, f"T_lant, {size} bytes", "us", can["latency_us"], method, latency_us)
        yield Comparison(title, "CAN / T_lant", "1", can["ratio"], method, can_us / latency_us)

    return PaperSection(
        title,
        f"{can_us} us by CAN, which over the printed {can['latency_us']} us is {can_us / can['latency_us']:.1f}. "
        f"T_exec at {size} bytes lies between two rows of Table I.",
        tuple(one for method, half in _write_phases(bench, size) for one in compared(method, half.latency_us)),
    )


def _equation_15() -> PaperSection:
    given = published()["equation_15"]
    title = "Equation (15): its constant"
    rate_mbit_s = DATA_RATE_MBIT_S["S400"]
    hop_us = given["nodes"] * equations.hop_delay_us(REFERENCE_CABLE_M, gap_clock_mbit_s=rate_mbit_s)
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
    return PaperSection(
        title,
        f"The terms add up to {short_ns:.1f} ns less; rounded to two decimals one by one, "
        "they give the printed figure.",
        tuple(
            Comparison(title, "no payload", "us", given["constant_us"], method, value) for method, value in ways.items()
        ),
    )


def _equation_10(bench: Profile) -> PaperSection:
    title = "Equation (10): the clock of the gaps"
    link = bench.bus.link(bench.bus.nodes)
    gaps_us = {
        name: equations.gaps_us(link.gap_count, gap_clock_mbit_s=model.gap_clock_mbit_s(link.data_rate_mbit_s))
        for name, model in TIMING_MODELS.items()
    }
    quantity = f"T_sum, gap count {link.gap_count:g}"
    return PaperSection(
        title,
        "The paper counts gaps in the data rate, the standard in the base rate. The paper prints no figure.",
        (
            *(Comparison(title, quantity, "us", None, f"{name} model", value) for name, value in gaps_us.items()),
            Comparison(title, "standard / paper", "1", None, "standard model", gaps_us["standard"] / gaps_us["paper"]),
        ),
    )


def _circles(circles: Sequence[CircleFigures]) -> PaperSection:
    title = "Figs. 9 and 10: the circle test"
    given = published()["circle"]
    method = "circle test"

    def compared() -> Iterator[Comparison]:
        for index, one in enumerate(circles):
            at = f"{given['period_us'][index] / 1000:g} ms"
            figures: tuple[tuple[str, Unit, str, float | None], ...] = (
                ("execution time", "s", "duration_s", one.duration_s),
                ("mean contour error", "mm", "mean_contour_error_mm", one.mean_contour_error_mm),
                ("largest contour error", "mm", "max_contour_error_mm", one.max_contour_error_mm),
            )
            for name, unit, key, value in figures:
                yield Comparison(title, f"{name}, {at}", unit, given[key][index], method, value or 0.0)

    return PaperSection(
        title,
        "The paper gives no servo value. Four were fitted to these four errors, the others assumed: a calibration, not "
        "a validation. The execution times are computed from the path alone.",
        tuple(compared()),
    )


def _sercos(circles: Sequence[CircleFigures]) -> PaperSection:
    title = "Section IV-B: against SERCOS"
    sercos, given = published()["sercos"], published()["circle"]
    sercos_mm = sercos["mean_contour_error_mm"]

    def compared() -> Iterator[Comparison]:
        for index, one in enumerate(circles):
            quantity = f"mean error / SERCOS, {given['period_us'][index] / 1000:g} ms"
            printed = given["mean_contour_error_mm"][index] / sercos_mm
            yield Comparison(
                title, quantity, "1", printed, "circle test", (one.mean_contour_error_mm or 0.0) / sercos_mm
            )

    below = [mean_mm for mean_mm in given["mean_contour_error_mm"] if mean_mm / sercos_mm < sercos["ratio"]]
    return PaperSection(
        title,
        f"Reference [49]: {sercos_mm} mm. Published is the quotient of printed figures; the paper says just below "
        f"10 %, which holds for {len(below)} of its {len(circles)} circles.",
        tuple(compared()),
    )
