"""Compare the published figures of the paper's circles with computed ones."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from busplan.buses.published import Comparison, EvidenceSection, Unit
from busplan.questions.circle.figures import CircleFigures

BENCH_PROFILE: Final = "paper-two-node"
"""Shipped profile of the bench that Tables I and II were measured on."""
CIRCLE_PROFILES: Final = ("paper-4ms", "paper-1ms")
"""Shipped profiles of the two circles of section IV-B, in the order of the data file."""
PAPER: Final = "paper"
"""Name of the data file with the paper's figures."""


def circle_sections(published: Mapping[str, Any], circles: Sequence[CircleFigures]) -> tuple[EvidenceSection, ...]:
    """Compare the published figures of the circle with computed ones.

    Parameters
    ----------
    published
        The paper's figures.
    circles
        Circle tests of `CIRCLE_PROFILES`, in this order.

    References
    ----------
    Paper, section IV-B, Figs. 9 and 10.
    """
    return (_circles(published, circles), _sercos(published, circles))


def _circles(published: Mapping[str, Any], circles: Sequence[CircleFigures]) -> EvidenceSection:
    title = "Figs. 9 and 10: the circle test"
    given = published["circle"]
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
                yield Comparison(title, f"{name}, {at}", unit, given[key][index], method, value or 0.0, "measured")

    return EvidenceSection(
        title,
        "The paper gives no servo value. Four were fitted to these four errors, the others assumed: a calibration, not "
        "a validation. The execution times are computed from the path alone.",
        tuple(compared()),
    )


def _sercos(published: Mapping[str, Any], circles: Sequence[CircleFigures]) -> EvidenceSection:
    title = "Section IV-B: against SERCOS"
    sercos, given = published["sercos"], published["circle"]
    sercos_mm = sercos["mean_contour_error_mm"]

    def compared() -> Iterator[Comparison]:
        for index, one in enumerate(circles):
            quantity = f"mean error / SERCOS, {given['period_us'][index] / 1000:g} ms"
            printed = given["mean_contour_error_mm"][index] / sercos_mm
            yield Comparison(
                title, quantity, "1", printed, "circle test", (one.mean_contour_error_mm or 0.0) / sercos_mm, "derived"
            )

    below = [mean_mm for mean_mm in given["mean_contour_error_mm"] if mean_mm / sercos_mm < sercos["ratio"]]
    return EvidenceSection(
        title,
        f"Reference [49]: {sercos_mm} mm. Published is the quotient of printed figures; the paper says just below "
        f"10 %, which holds for {len(below)} of its {len(circles)} circles.",
        tuple(compared()),
    )
