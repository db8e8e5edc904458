"""Play, scales, squareness."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.servo.axis import add_backlash, move_to_table
from busplan.servo.contour import measure_contour
from busplan.servo.parameters import Mechanics

RADIUS_MM = 100.0
ANGLE = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
X, Y = RADIUS_MM * np.cos(ANGLE), RADIUS_MM * np.sin(ANGLE)


def circular_deviation(mechanics: Mechanics) -> float:
    x, y = X.copy(), Y.copy()
    move_to_table(x, y_mm=y, mechanics=mechanics)
    found = measure_contour(x, y_mm=y, radius_mm=RADIUS_MM, part=slice(0, len(x)), turn_share=1.0)
    assert found.circular_deviation_mm is not None
    return found.circular_deviation_mm


def test_the_table_turns_only_after_the_whole_gap() -> None:
    motor = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, -1, 201), np.linspace(-1, 0, 101)])
    table = motor.copy()
    add_backlash(table, backlash_mm=0.2)
    assert table[:11].max() == pytest.approx(0.0, abs=1e-12)
    assert table[100] == pytest.approx(0.9)
    assert table[101:121] == pytest.approx(0.9)
    assert table[301] == pytest.approx(-0.9)
    assert table[-1] == pytest.approx(-0.1)


@pytest.mark.parametrize("engine", ["auto", "python"])
@given(
    steps=st.lists(st.floats(-1, 1), min_size=1, max_size=50),
    backlash_mm=st.floats(1e-3, 3),
)
def test_the_table_moves_only_while_it_is_pushed(engine: str, steps: list[float], backlash_mm: float) -> None:
    motor = np.cumsum(steps)
    table = motor.copy()
    add_backlash(table, backlash_mm=backlash_mm, engine=engine)  # type: ignore[arg-type]
    gap = motor - table
    assert np.abs(gap).max() <= backlash_mm / 2 * (1 + 1e-12) + 1e-12
    moved = np.diff(table)
    pushed = np.abs(np.abs(gap[1:]) - backlash_mm / 2) < 1e-9
    assert np.all((moved == 0) | (pushed & (np.sign(moved) == np.sign(gap[1:]))))


def test_ideal_mechanics_change_nothing() -> None:
    x, y = X.copy(), Y.copy()
    move_to_table(x, y_mm=y, mechanics=Mechanics())
    np.testing.assert_array_equal(x, X)
    np.testing.assert_array_equal(y, Y)


def test_scale_mismatch_shows_as_radius_times_difference() -> None:
    found = circular_deviation(Mechanics(scale_x_ppm=30.0, scale_y_ppm=-20.0))
    assert found == pytest.approx(RADIUS_MM * 50e-6, rel=1e-4)
    assert circular_deviation(Mechanics(scale_x_ppm=30.0, scale_y_ppm=30.0)) < 1e-10


def test_squareness_shows_as_radius_times_angle() -> None:
    assert circular_deviation(Mechanics(squareness_um_per_m=40.0)) == pytest.approx(RADIUS_MM * 40e-6, rel=1e-4)


def test_the_y_axis_leans_towards_x() -> None:
    x = np.zeros(1)
    move_to_table(x, y_mm=np.array([1000.0]), mechanics=Mechanics(squareness_um_per_m=7.0))
    assert x[0] == pytest.approx(0.007)


def test_bad_values_are_named() -> None:
    with pytest.raises(BusplanError) as caught:
        Mechanics(backlash_mm=-1.0, scale_x_ppm=float("inf"))
    assert [problem.split(" = ")[0] for problem in caught.value.problems] == ["backlash_mm", "scale_x_ppm"]
