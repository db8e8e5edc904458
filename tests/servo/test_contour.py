"""Contour errors and the ISO 230-4 measures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.servo.contour import contour_error, covered_deg, measure_contour
from tests.extras import needed

ANGLE = np.linspace(0.3, 0.3 + 2 * np.pi, 70_000, endpoint=False)
"""A whole turn, in more points than one block holds."""


@given(a=st.floats(-1e-3, 1e-3), b=st.floats(-1e-3, 1e-3), deviation=st.floats(-1e-3, 1e-3))
def test_a_nanometre_is_found_on_a_metre(a: float, b: float, deviation: float) -> None:
    angle = ANGLE[::500]
    x, y = (1000 + deviation) * np.cos(angle) + a, (1000 + deviation) * np.sin(angle) + b
    contour = measure_contour(x, y_mm=y, radius_mm=1000.0, part=slice(0, len(x)))
    assert contour.centre_offset_mm == pytest.approx((a, b), abs=1e-10)
    assert contour.radius_deviation_mm == pytest.approx(deviation, abs=1e-10)


def test_the_fit_is_scipys() -> None:
    least_squares = needed("scipy.optimize").least_squares
    random = np.random.default_rng(5)
    distance = 20 + 0.5 * random.standard_normal(400)
    angle = random.uniform(0, 4, 400)
    x, y = distance * np.cos(angle) + 1.0, distance * np.sin(angle) - 2.0
    expected = least_squares(lambda p: np.hypot(x - p[0], y - p[1]) - 20 - p[2], np.zeros(3), xtol=1e-15, ftol=1e-15)
    contour = measure_contour(x, y_mm=y, radius_mm=20.0, part=slice(0, len(x)))
    assert (*contour.centre_offset_mm, contour.radius_deviation_mm) == pytest.approx(expected.x, abs=1e-6)


def test_the_measures_of_an_oval_off_its_place() -> None:
    radial = 0.004 * np.cos(2 * ANGLE)
    x, y = (50 + radial) * np.cos(ANGLE) + 0.002, (50 + radial) * np.sin(ANGLE)
    contour = measure_contour(x, y_mm=y, radius_mm=50.0, part=slice(0, len(ANGLE)), turn_share=1.0)
    error = np.hypot(x, y) - 50
    assert contour.mean_contour_error_mm == pytest.approx(np.abs(error).mean(), rel=1e-12)
    assert contour.max_contour_error_mm == np.abs(error).max()
    assert (contour.radial_deviation_min_mm, contour.radial_deviation_max_mm) == (error.min(), error.max())
    assert contour.circular_deviation_mm == pytest.approx(0.008, rel=2e-3)
    assert contour.centre_offset_mm == pytest.approx((0.002, 0.0), abs=1e-7)


def test_only_the_part_at_constant_speed_counts_for_iso_and_all_of_it_for_the_contour_error() -> None:
    x, y = 10 * np.cos(ANGLE), 10 * np.sin(ANGLE)
    x[:100] *= 1.5
    contour = measure_contour(x, y_mm=y, radius_mm=10.0, part=slice(100, len(x)))
    assert contour.max_contour_error_mm > 1
    assert contour.radial_deviation_max_mm < 1e-12
    assert contour.circular_deviation_mm is None


@given(share=st.floats(0.01, 1))
def test_the_last_step_of_a_turn_counts_by_its_share(share: float) -> None:
    """Off its place by a, a circle has a mean error of 2 a / pi; what is left is of second order in a step."""
    angle = 0.3 + 2 * np.pi * np.arange(200) / (199 + share)
    x, y = 10 * np.cos(angle) + 0.002, 10 * np.sin(angle)
    contour = measure_contour(x, y_mm=y, radius_mm=10.0, part=slice(0, 200), turn_share=share)
    assert contour.mean_contour_error_mm == pytest.approx(0.004 / np.pi, rel=(2 * np.pi / 199) ** 2)
    assert contour.centre_offset_mm == pytest.approx((0.002, 0.0), abs=1e-10)
    assert contour.radius_deviation_mm == pytest.approx(0.0, abs=1e-10)
    assert contour.circular_deviation_mm == pytest.approx(0.0, abs=1e-10)


def test_blocks_do_not_show() -> None:
    x, y = 10.01 * np.cos(ANGLE), 10 * np.sin(ANGLE)
    whole = measure_contour(x, y_mm=y, radius_mm=10.0, part=slice(11, 69_998))
    error = contour_error(x[11:69_998], y_mm=y[11:69_998], radius_mm=10.0)
    assert whole.radial_deviation_min_mm == error.min()
    assert whole.radial_deviation_max_mm == error.max()


def test_the_angle_is_that_from_the_first_to_the_last_point_of_the_part() -> None:
    x, y = 10 * np.cos(ANGLE), 10 * np.sin(ANGLE)
    step_deg = 360 / len(ANGLE)
    assert covered_deg(x, y_mm=y) == pytest.approx(69_999 * step_deg, abs=1e-9)
    assert covered_deg(x, y_mm=y, part=slice(20_000, 60_000)) == pytest.approx(39_999 * step_deg, abs=1e-9)


@given(points=st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=1, max_size=20))
def test_even_a_lost_table_has_finite_measures(points: list[tuple[float, float]]) -> None:
    x, y = (np.array(column) for column in zip(*points, strict=True))
    contour = measure_contour(x, y_mm=y, radius_mm=10.0, part=slice(0, len(x)), turn_share=0.5)
    assert contour.circular_deviation_mm is not None
    numbers = [contour.circular_deviation_mm, contour.radius_deviation_mm, *contour.centre_offset_mm]
    assert np.all(np.isfinite(numbers))
