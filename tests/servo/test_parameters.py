"""What cannot be simulated is refused by the names of its parameters; a step divides its period."""

import math
import pickle
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.servo.parameters import (
    Axis,
    Delivery,
    LoopTiming,
    Mechanics,
    ParameterError,
    Refused,
    dividing_step_us,
    no_multiple,
    parameters,
)


@pytest.mark.parametrize("of", [Axis, Delivery, Mechanics])
def test_every_field_but_the_delay_that_is_computed_declares_its_range(of: type) -> None:
    assert [parameter.name for parameter in parameters(of)] == [
        field.name for field in fields(of) if field.name != "delay_us"
    ]


@pytest.mark.parametrize("of", [Axis, Delivery, Mechanics])
def test_a_value_out_of_its_range_is_refused_by_name(of: type) -> None:
    for name, _, _, known in parameters(of):
        if known.least is None or known.most is None:
            continue
        for bad in (known.least - 1, known.most * 2, math.nan):
            with pytest.raises(ParameterError) as caught:
                of(**{name: bad})
            assert [(refused.name, refused.value) for refused in caught.value.refused] == [(name, bad)]


def test_everything_that_is_wrong_is_named_together() -> None:
    with pytest.raises(ParameterError) as caught:
        LoopTiming(period_us=0.0, step_us=-1.0, loop="cloud")  # type: ignore[arg-type]
    assert [refused.name for refused in caught.value.refused] == ["period_us", "loop", "step_us"]


def test_the_names_travel_between_processes() -> None:
    error = ParameterError(Refused("radius_mm", 0, "must be above 0"), Refused("step_us", 3, "too long"))
    copy = pickle.loads(pickle.dumps(error))
    assert copy.refused == error.refused
    assert copy.problems == error.problems == ("radius_mm = 0: must be above 0", "step_us = 3: too long")


@pytest.mark.parametrize(
    ("period_us", "most_us", "step_us"),
    [
        (1000.0, 100.0, 100.0),
        (250.0, 100.0, 62.5),  # 83.333... divides it, too, and nobody can write it
        (1000 / 3, 100.0, 250 / 3),
        (50.0, 100.0, 50.0),
        (0.1 + 0.2, 0.1, 0.1),
        (747.3, 100.0, 74.73),
        (1000.001, 20.0, 9.901),  # 101 x 9901 ns: from 51 steps on the last but one
        (1000.003, 20.0, 1000.003 / 51),  # a prime number of ns
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
