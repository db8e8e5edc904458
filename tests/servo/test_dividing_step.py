"""The step of a simulation divides the period."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.servo.checks import dividing_step_us, no_multiple


@pytest.mark.parametrize(
    ("period_us", "most_us", "step_us"),
    [
        (1000.0, 100.0, 100.0),
        (250.0, 100.0, 62.5),  # 83.333... divides it, too, and nobody can write it
        (1000 / 3, 100.0, 250 / 3),
        (50.0, 100.0, 50.0),
        (0.1 + 0.2, 0.1, 0.1),
        (747.3, 100.0, 74.73),
    ],
)
def test_the_step_is_the_longest_that_can_be_written(period_us: float, most_us: float, step_us: float) -> None:
    assert dividing_step_us(period_us, most_us=most_us) == pytest.approx(step_us, rel=1e-12)


@given(period_us=st.floats(1e-2, 1e9), most_us=st.floats(1e-2, 1e9))
def test_it_is_no_longer_than_asked_and_is_taken_as_it_is_written(period_us: float, most_us: float) -> None:
    step_us = dividing_step_us(period_us, most_us=most_us)
    assert step_us <= most_us * (1 + 1e-9)
    written_us = float(f"{step_us:.15g}")
    assert not list(no_multiple(period_us=period_us, step_us=written_us))
