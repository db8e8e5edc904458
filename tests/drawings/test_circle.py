"""The circle with its error magnified, and the error over the angle in characters."""

import math
import re
from xml.etree import ElementTree as ET

import pytest

from busplan.analysis.circle.contour_profile import CONTOUR_SECTORS, ContourProfile
from busplan.drawings.circle import CircleDrawing

SVG = "{http://www.w3.org/2000/svg}"


def radii(path: str) -> list[float]:
    return [math.hypot(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", path)]


def test_a_circle_is_drawn_as_far_out_as_its_error() -> None:
    profile = ContourProfile((0.0, -0.01, 0.0, 0.0), (0.01, 0.0, 0.0, 0.0))
    drawing = CircleDrawing(profile, tolerance_mm=0.02)
    scale = drawing.scale
    assert scale is not None
    assert (scale.largest_mm, scale.ring_um, scale.tolerance_mm) == (0.02, 10.0, 0.02)
    assert scale.times(100.0) == pytest.approx(0.25 / 0.02 * 100)
    root = ET.fromstring(drawing.svg() or "")
    rings = {ring.get("class"): float(ring.get("r") or 0) for ring in root.iter(f"{SVG}circle")}
    (path,) = root.iter(f"{SVG}path")
    assert max(radii(path.get("d", ""))) == pytest.approx(rings["nominal"] * 1.125, abs=0.1)
    assert min(radii(path.get("d", ""))) == pytest.approx(rings["nominal"] * 0.875, abs=0.1)
    assert rings["tolerance"] == pytest.approx(rings["nominal"] * 1.25, abs=0.1)


def test_a_gap_in_the_circle_stays_a_gap() -> None:
    low: tuple[float | None, ...] = (None, 0.001, 0.001, None, 0.001, 0.001)
    drawing = CircleDrawing(ContourProfile(low, low), tolerance_mm=None)
    (path,) = ET.fromstring(drawing.svg() or "").iter(f"{SVG}path")
    assert [part.count("L") for part in path.get("d", "").split("M")[1:]] == [3, 3]


@pytest.mark.parametrize("error_mm", [0.0, 1e-12])
def test_no_error_is_no_drawing(error_mm: float) -> None:
    drawing = CircleDrawing(ContourProfile((-error_mm,), (error_mm,)), tolerance_mm=0.01)
    assert (drawing.scale, drawing.svg(), drawing.characters(80)) == (None, None, None)


def test_a_tolerance_far_outside_flattens_nothing() -> None:
    scale = CircleDrawing(ContourProfile((0.0,), (0.001,)), tolerance_mm=0.1).scale
    assert scale is not None
    assert (scale.largest_mm, scale.tolerance_mm) == (0.001, None)


# --- in characters ----------------------------------------------------------------------------------------


def plot(*low_and_high_um: tuple[float, float], width: int = 80) -> list[str]:
    """The plot of a circle in equal parts, each with its smallest and largest error."""
    parts = [one for one in low_and_high_um for _ in range(CONTOUR_SECTORS // len(low_and_high_um))]
    low, high = (tuple(one[side] / 1e3 for one in parts) for side in (0, 1))
    drawn = CircleDrawing(ContourProfile(low, high), tolerance_mm=None).characters(width)
    assert drawn is not None
    return [line.text for line in drawn]


def test_each_quarter_stands_over_its_angle() -> None:
    lines = plot((8.0, 9.0), (-9.0, -8.0), (0.0, 0.0), (0.0, 9.0))
    assert lines[0].split() == ["um"]
    assert lines[1] == f"+9.0 |{'#' * 18}{' ' * 36}{'#' * 18}"
    assert lines[5] == f"   0 |{'-' * 36}{'#' * 36}"
    assert lines[9] == f"-9.0 |{' ' * 18}{'#' * 18}".rstrip()
    assert lines[10].split() == ["deg", "0", "90", "180", "270"]
    assert [lines[10].index(angle) for angle in ("90", "180", "270")] == [6 + 18, 6 + 36, 6 + 54]


@pytest.mark.parametrize(
    ("width", "columns"), [(200, 72), (80, 72), (78, 72), (77, 60), (66, 60), (65, 48), (40, 24), (1, 24)]
)
def test_a_plot_is_no_wider_than_its_place(width: int, columns: int) -> None:
    lines = plot((1.0, 1.0), width=width)
    assert lines[1] == f"+1.0 |{'#' * columns}"
    assert max(map(len, lines)) <= max(width, 6 + 24)


def test_an_end_of_the_scale_has_digits_that_tell_it_from_nothing() -> None:
    def label(error_um: float) -> str:
        return plot((0.0, error_um))[1].split()[0]

    assert [label(one) for one in (1234.56, 0.06, 0.04, 2e-5)] == ["+1234.6", "+0.1", "+0.04", "+2e-05"]
    assert plot((-1e-7, 5.0))[9].split()[0] == "0"


def test_where_nothing_fell_nothing_is_drawn() -> None:
    ends = (None,) * (CONTOUR_SECTORS // 2) + (0.001,) * (CONTOUR_SECTORS // 2)
    drawn = CircleDrawing(ContourProfile(ends, ends), tolerance_mm=None).characters(80)
    assert drawn is not None
    assert drawn[1].text == f"+1.0 |{' ' * 36}{'#' * 36}"
