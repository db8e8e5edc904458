"""Compare published figures of the bus and of the circle with computed ones."""

import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

from busplan.analysis.circle.roundness import CircleFigures
from busplan.analysis.network import bus_of, network_of
from busplan.buses.published import Comparison, PaperSection, Unit
from busplan.sections.profile import Profile

BENCH_PROFILE: Final = "paper-two-node"
"""Shipped profile of the bench that Tables I and II were measured on."""
CIRCLE_PROFILES: Final = ("paper-4ms", "paper-1ms")
"""Shipped profiles of the two circles of section IV-B, in the order of the data file."""
_DATA: Final = Path(__file__).resolve().parents[1] / "data" / "paper.toml"


@cache
def published() -> dict[str, Any]:
    """The published figures, as the package's data file holds them."""
    return tomllib.loads(_DATA.read_text(encoding="utf-8"))


def paper_sections(bench: Profile, *, circles: Sequence[CircleFigures]) -> tuple[PaperSection, ...]:
    """Compare every published figure that the equations give with the computed one.

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
    sections = bus_of(bench).published_sections(network_of(bench), published())
    return (*sections, _circles(circles), _sercos(circles))


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
