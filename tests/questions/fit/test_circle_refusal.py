"""Why a circle cannot be run: by its key, before any is run, and alike in every answer."""

import re
from typing import Any

import pytest

import busplan
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.circle.roundness import circle_test
from busplan.questions.fit.circle_refusal import circle_refusals, refusals
from busplan.questions.map.direction import Direction
from busplan.questions.map.trade_off import trade_off
from busplan.questions.plan.planning import plan
from busplan.sections.profile import Profile
from busplan.servo.checks import ParameterError

CAUSES: dict[str, dict[str, object]] = {
    "servo.step_us": {"servo.step_us": 300.0},
    "circle.feed_mm_per_min": {"circle.feed_mm_per_min": 1e6},
    "servo.y.drive_offset_mm_s": {"servo.y": {"drive_offset_mm_s": 1e6}},
    "servo.encoder_resolution_mm": {"servo.encoder_resolution_mm": 1e-12},
    "delivery.jitter_us": {"delivery.jitter_us": 501.0},
}


def refused(changes: dict[str, object], *, of: str = "paper-1ms") -> Profile:
    return override(load(of).profile, changes)


@pytest.mark.parametrize(("key", "changes"), CAUSES.items())
def test_each_cause_has_the_words_of_the_circle_test(key: str, changes: dict[str, object]) -> None:
    profile = refused(changes)
    (cause,) = refusals(profile)
    with pytest.raises(ParameterError) as caught:
        circle_test(profile)
    assert caught.value.problems == (cause.message,)
    assert cause.message.startswith(f"{key} = ")


@pytest.mark.parametrize("key", ["servo.step_us", "delivery.jitter_us"])
def test_every_answer_names_the_key(key: str) -> None:
    profile = refused(CAUSES[key])
    (cause,) = refusals(profile)
    answer = busplan.capacity(profile)
    assert {one.circle_refused_by for one in answer.results} == {(key,)}
    assert re.search(r"^paper-1ms .* 1 ms +FITS, BUT$", str(answer), re.MULTILINE)
    assert f"\n  circle          cannot be run: {cause.message}\n" in str(answer)
    rows = busplan.sweep(profile, vary={"bus.nodes": [1, 2]}).to_dict()["rows"]
    assert [row["circle_refused_by"] for row in rows] == [[key]] * 4
    own = trade_off(profile, x=Direction("bus.nodes", (1, 2)), y=Direction("cycle.period_us", (1000,))).own
    assert own is not None
    assert (own.state, own.limited_by, own.circle_refused_by) == ("circle cannot be run", (key,), (key,))
    asked = plan(profile, free=["gap_count"])  # without a circle
    assert asked.binding is not None
    assert (asked.recommended, asked.binding.key, asked.binding.why) == (None, key, cause.message)
    (file,) = busplan.check(profile, circle=False).files
    (finding,) = (one for one in file.findings if one.code == "BP203")
    assert cause.right.partition("; ")[0] in finding.message


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        ({"circle.path": "trapezoid", "circle.radius_mm": 0.01}, ["circle.feed_mm_per_min"]),
        ({"circle.path": "trapezoid", "circle.radius_mm": 1e6}, ["circle.feed_mm_per_min", "servo.step_us"]),
        ({"circle.path": "iso230-4", "circle.radius_mm": 1e6}, ["circle.feed_mm_per_min", "servo.step_us"]),
        # Too long for memory with the longest lead-in that there is, and not with its own.
        ({"circle.path": "iso230-4", "servo.step_us": 1.25}, []),
        ({"servo.step_us": 0.01}, ["servo.step_us"]),
    ],
)
def test_a_move_is_too_short_or_too_long_as_the_simulation_has_it(changes: dict[str, object], keys: list[str]) -> None:
    profile = refused(changes)
    assert [one.name for one in refusals(profile)] == keys


def test_a_cycle_that_does_not_fit_has_no_circle_but_its_loop() -> None:
    late: dict[str, object] = {"cycle.period_us": 100.0, "delivery.jitter_us": 90.0, "circle.feed_mm_per_min": 1e6}
    assert refusals(refused(late)) == ()
    assert [one.name for one in refusals(refused({**late, "servo.step_us": 30.0}))] == ["servo.step_us"]
    rows: list[Any] = busplan.sweep(refused(late), vary={"cycle.period_us": [100, 1000]}).to_dict()["rows"]
    deciding = [row for row in rows if row["verdict"]]
    assert [row["circle_refused_by"] for row in deciding] == [[], ["circle.feed_mm_per_min"]]


def test_a_profile_that_asks_for_no_circle_has_none_to_be_refused() -> None:
    profile = refused({"cycle.period_us": 4050.0}, of="paper-two-node")
    assert not profile.asks_for_circle
    assert refusals(profile) != () == circle_refusals(profile)
    with pytest.raises(BusplanError, match=r"it is the default of servo\.step_us"):
        circle_test(profile)
