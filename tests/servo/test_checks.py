"""What cannot be simulated is refused by the names of its parameters."""

import math
import pickle
from dataclasses import fields

import pytest

from busplan.servo.checks import ParameterError, Refused, parameters
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics


@pytest.mark.parametrize("of", [Axis, Delivery, Mechanics])
def test_every_field_but_the_delay_that_is_computed_declares_its_range(of: type) -> None:
    assert [one.name for one in parameters(of)] == [one.name for one in fields(of) if one.name != "delay_us"]


@pytest.mark.parametrize("of", [Axis, Delivery, Mechanics])
def test_a_value_out_of_its_range_is_refused_by_name(of: type) -> None:
    for name, _, _, known in parameters(of):
        if known.least is None or known.most is None:
            continue
        for bad in (known.least - 1, known.most * 2, math.nan):
            with pytest.raises(ParameterError) as caught:
                of(**{name: bad})
            assert [(one.name, one.value) for one in caught.value.refused] == [(name, bad)]


def test_everything_that_is_wrong_is_said_together() -> None:
    with pytest.raises(ParameterError) as caught:
        LoopTiming(period_us=0.0, step_us=-1.0, loop="cloud")  # type: ignore[arg-type]
    assert [one.name for one in caught.value.refused] == ["period_us", "loop", "step_us"]


def test_the_names_travel_between_processes() -> None:
    error = ParameterError(Refused("radius_mm", 0, "must be above 0"), Refused("step_us", 3, "too long"))
    copy = pickle.loads(pickle.dumps(error))
    assert copy.refused == error.refused
    assert copy.problems == error.problems == ("radius_mm = 0: must be above 0", "step_us = 3: too long")
