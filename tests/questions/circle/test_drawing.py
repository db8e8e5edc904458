"""The circle with its error magnified, and the error over the angle in characters."""

import math
import re
from xml.etree import ElementTree as ET

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from busplan.forms.numbers import ROUNDING_UM
from busplan.questions.circle.contour import CONTOUR_SECTORS, ContourProfile
from busplan.questions.circle.drawing import CircleDrawing
from busplan.servo.path import Direction

SVG = "{http://www.w3.org/2000/svg}"


def radii(path: str) -> list[float]:
    return [math.hypot(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", path)]


def test_a_circle_is_drawn_as_far_out_as_its_error() -> None:
    profile = ContourProfile((0.0, -0.01, 0.0, 0.0), (0.01, 0.0, 0.0, 0.0))
    drawing = CircleDrawing(profile, tolerance_mm=0.02, direction="ccw")
    scale = drawing.scale
    assert scale is not None
    assert (scale.largest_mm, scale.ring_um, scale.tolerance_mm) == (0.02, 10.0, 0.02)
    assert scale.times(100.0) == pytest.approx(0.25 / 0.02 * 100)
    root = ET.fromstring(drawing.svg() or "")
    rings = {ring.get("class"): float(ring.get("r") or 0) for ring in root.iter(f"{SVG}circle")}
    path = next(root.iter(f"{SVG}path"))
    assert max(radii(path.get("d", ""))) == pytest.approx(rings["nominal"] * 1.125, abs=0.1)
    assert min(radii(path.get("d", ""))) == pytest.approx(rings["nominal"] * 0.875, abs=0.1)
    assert rings["tolerance"] == pytest.approx(rings["nominal"] * 1.25, abs=0.1)


def test_a_gap_in_the_circle_stays_a_gap() -> None:
    low: tuple[float | None, ...] = (None, 0.001, 0.001, None, 0.001, 0.001)
    drawing = CircleDrawing(ContourProfile(low, low), tolerance_mm=None, direction="ccw")
    path = next(ET.fromstring(drawing.svg() or "").iter(f"{SVG}path"))
    assert [part.count("L") for part in path.get("d", "").split("M")[1:]] == [3, 3]


@pytest.mark.parametrize("error_mm", [0.0, 1e-12])
def test_no_error_is_no_drawing(error_mm: float) -> None:
    drawing = CircleDrawing(ContourProfile((-error_mm,), (error_mm,)), tolerance_mm=0.01, direction="ccw")
    assert (drawing.scale, drawing.svg(), drawing.characters(80)) == (None, None, None)


def test_a_tolerance_far_outside_flattens_nothing() -> None:
    scale = CircleDrawing(ContourProfile((0.0,), (0.001,)), tolerance_mm=0.1, direction="ccw").scale
    assert scale is not None
    assert (scale.largest_mm, scale.tolerance_mm) == (0.001, None)


@pytest.mark.parametrize("error_mm", [0.0011, 0.0039, 0.0041, 0.0099])
def test_no_ring_lies_where_the_angles_stand(error_mm: float) -> None:
    drawing = CircleDrawing(ContourProfile((0.0,), (error_mm,)), tolerance_mm=None, direction="ccw")
    root = ET.fromstring(drawing.svg() or "")
    radius = {float(ring.get("r") or 0) for ring in root.iter(f"{SVG}circle") if ring.get("class") == "ring"}
    assert len(radius) >= 4
    assert max(radius) <= 140 * 1.25 + 0.1


def test_a_tiny_error_has_rings_in_a_tiny_unit() -> None:
    drawing = CircleDrawing(ContourProfile((0.0,), (2e-5,)), tolerance_mm=None, direction="ccw")
    texts = [text.text for text in ET.fromstring(drawing.svg() or "").iter(f"{SVG}text")]
    assert texts == ["X 0°", "Y 90°", "180°", "270°", "10 nm", "a ring"]


@pytest.mark.parametrize(("direction", "upwards"), [("ccw", True), ("cw", False)])
def test_the_arrow_points_in_the_direction_and_the_dot_is_the_start(direction: Direction, upwards: bool) -> None:
    drawing = CircleDrawing(ContourProfile((0.0,), (0.001,)), tolerance_mm=None, direction=direction)
    root = ET.fromstring(drawing.svg() or "")
    (arrow,) = (path.get("d", "") for path in root.iter(f"{SVG}path") if path.get("class") == "direction")
    tail, *_, head, _ = re.findall(r"[ML ](-?[\d.]+) (-?[\d.]+)", arrow)
    # y points down in SVG: the arrow stands right of the centre, above the x axis.
    assert (float(head[1]) < float(tail[1])) is upwards
    (dot,) = (one for one in root.iter(f"{SVG}circle") if one.get("class") == "point")
    (nominal,) = (one for one in root.iter(f"{SVG}circle") if one.get("class") == "nominal")
    assert float(dot.get("cx") or 0) == float(nominal.get("r") or 0)


# --- in characters ----------------------------------------------------------------------------------------


def plot(*low_and_high_um: tuple[float, float], width: int = 80) -> list[str]:
    """The plot of a circle in equal parts, each with its smallest and largest error."""
    parts = [one for one in low_and_high_um for _ in range(CONTOUR_SECTORS // len(low_and_high_um))]
    low, high = (tuple(one[side] / 1e3 for one in parts) for side in (0, 1))
    drawn = CircleDrawing(ContourProfile(low, high), tolerance_mm=None, direction="ccw").characters(width)
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
        lines = plot((0.0, error_um), (0.0, 0.0))
        return f"{lines[1].split()[0]} {lines[0].strip()}"

    assert [label(one) for one in (1234.56, 0.1, 0.06, 1e-4, 2e-5)] == [
        *("+1234.6 um", "+0.10 um", "+60.0 nm", "+0.10 nm", "+0.020 nm"),
    ]
    assert plot((-1e-7, 5.0), (0.0, 0.0))[9].split()[0] == "0"


def test_errors_far_from_zero_are_drawn_without_it() -> None:
    lines = plot((502.4560, 502.4565), (502.4575, 502.4580), width=100)
    assert lines[0] == "       um, 0 lies below"
    assert lines[1] == f"+502.4580 |{' ' * 36}{'#' * 36}"
    assert lines[5] == "          |"
    assert lines[9] == f"+502.4560 |{'#' * 36}"
    assert plot((-502.458, -502.456), (-502.456, -502.456))[0].endswith("um, 0 lies above")
    # A circle that is only too large has no shape to show.
    assert plot((502.456, 502.456))[0].split() == ["um"]


def test_an_error_that_is_the_same_at_every_angle_is_said_and_not_drawn() -> None:
    assert plot((0.4977, 0.4981)) == ["At every angle the error is from +0.49770 to +0.49810 um"]
    assert plot((-5.0, 0.3)) == ["At every angle the error is from -5.0 to +0.3 um"]
    assert "#" in plot((0.4977, 0.4981), (0.4977, 0.4980))[-2]


def test_zero_is_named_beside_an_end_in_its_row() -> None:
    lines = plot((-5.0, 0.3), (0.0, 0.0))
    assert [line.split(" |")[0].strip() for line in lines[1:-1]] == ["0, +0.3", *[""] * 7, "-5.0"]


def ends(*low_and_high_um: tuple[float, float]) -> tuple[list[float], str]:
    """Both ends of the scale as its labels have them [um], and the heading."""
    heading, *rows, _ = plot(*low_and_high_um)
    per_um = 1e3 if heading.strip().startswith("nm") else 1.0
    labels = [rows[row].split(" |")[0].split(",")[-1] for row in (0, -1)]
    return [float(label) / per_um for label in labels], heading


SIZES = st.floats(-6.0, 4.0).map(lambda power: 10**power)
SIGNED = st.builds(lambda size, sign: size * sign, SIZES, st.sampled_from((-1.0, 0.0, 1.0)))


@given(SIGNED, SIGNED)
@example(502.456, 502.458)
@example(-1e-6, 1e-6)
@example(-5.0, 1e-5)
def test_the_labels_of_any_scale_tell_its_ends(one_um: float, other_um: float) -> None:
    low, high = sorted((one_um, other_um))
    assume(max(abs(low), abs(high)) >= ROUNDING_UM)
    (top, bottom), heading = ends((low, low), (high, high))
    assert top > bottom
    drawn = (low, high) if "0 lies" in heading else (min(low, 0.0), max(high, 0.0))
    assert (bottom, top) == pytest.approx(drawn, abs=0.11 * (drawn[1] - drawn[0]))


@given(st.lists(st.tuples(SIGNED, SIGNED), min_size=4, max_size=4))
def test_each_part_of_the_circle_is_drawn(parts: list[tuple[float, float]]) -> None:
    assume(max(abs(end) for part in parts for end in part) >= 2 * ROUNDING_UM)
    rows = [line.split("|")[1].ljust(72) for line in plot(*((min(part), max(part)) for part in parts), width=100)[1:-1]]
    assert all("#" in column for column in zip(*rows, strict=True))


def test_where_nothing_fell_nothing_is_drawn() -> None:
    ends = (None,) * (CONTOUR_SECTORS // 2) + (0.001,) * (CONTOUR_SECTORS // 2)
    drawn = CircleDrawing(ContourProfile(ends, ends), tolerance_mm=None, direction="ccw").characters(80)
    assert drawn is not None
    assert drawn[1].text == f"+1.0 |{' ' * 36}{'#' * 36}"
