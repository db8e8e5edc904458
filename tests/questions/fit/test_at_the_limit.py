"""What is exactly at a limit keeps it: in figures, in rules and in plans, with one allowance for rounding."""

from math import inf, nextafter

import pytest

import busplan

PERIODS_US = [3570.0, 4110.0, 5190.0, 7770.0, 9990.0]
NAMES = ["paper-1ms", "ethercat-servo-8", "can-servo-8", "paper-1ms", "ethercat-servo-8"]


def codes(profile: busplan.Profile) -> set[str]:
    return {one.code for file in busplan.check(profile, circle=False).files for one in file.findings}


def least_period_us(profile: busplan.Profile) -> float:
    """The shortest period that a plan takes, of those in steps of 10 us."""
    short = busplan.load_profile(profile, changes={"cycle.period_us": 10.0, "servo.step_us": 10.0})
    best = busplan.plan(short, free=["period"]).recommended
    assert best is not None
    assert not codes(best.profile) & {"BP101", "BP103", "BP121"}
    return best.profile.cycle.period_us


@pytest.mark.parametrize(("name", "period_us"), [*zip(NAMES, PERIODS_US, strict=True)])
def test_a_plan_takes_the_period_at_which_the_share_is_used_exactly(name: str, period_us: float) -> None:
    profile = busplan.load_profile(name, changes={"limits": {"max_load": 0.99} if name.startswith("can") else {}})
    required_us = busplan.capacity(profile).verdicts[0].deciding.required_us
    most = required_us / (profile.cycle.slice_ratio * period_us)
    assert least_period_us(busplan.load_profile(profile, changes={"limits.max_utilisation": most})) == period_us


@pytest.mark.parametrize("period_us", PERIODS_US[:3])
def test_a_plan_takes_the_period_at_which_the_load_is_reached_exactly(period_us: float) -> None:
    own = busplan.load_profile("can-servo-8", changes={"cycle.period_us": period_us})
    (figures,) = busplan.capacity(own, timing_model="worst-stuffing").results
    limits = {"limits": {"max_load": busplan.CanFigures.of(figures).bus_load}}
    assert least_period_us(busplan.load_profile(own, changes=limits)) == period_us


def test_a_period_at_its_limit_allows_for_rounding_and_no_more() -> None:
    profile = busplan.load_profile("paper-1ms", changes={"cycle.slice_ratio": 1.0})
    required_us = busplan.capacity(profile, timing_model="paper").results[0].required_us
    for period_us, fits in (
        (required_us, True),
        (nextafter(required_us, -inf), True),
        (required_us * (1 - 3e-11), False),
    ):
        (figures,) = busplan.capacity(profile, period_us=period_us, timing_model="paper").results
        assert (figures.fits, figures.margin_us < 0) == (fits, not fits)


def test_a_load_at_its_limit_allows_for_rounding_and_no_more() -> None:
    profile = busplan.load_profile("can-servo-8")
    load = busplan.CanFigures.of(busplan.capacity(profile, timing_model="worst-stuffing").results[0]).bus_load
    assert isinstance(load, float)
    for most, is_broken in ((load, False), (nextafter(load, 0), False), (load * (1 - 3e-11), True)):
        limited = busplan.load_profile(profile, changes={"limits": {"max_load": most}})
        (figures,) = busplan.capacity(limited, timing_model="worst-stuffing").results
        assert ("load" in figures.exceeded) == is_broken


def test_what_cannot_be_right_allows_for_rounding_and_no_more() -> None:
    profile = busplan.load_profile("paper-1ms", changes={"cycle.slice_ratio": 1.0})
    now = busplan.capacity(profile).verdicts[0].deciding
    assert now.bias_us is not None
    assert now.uncertainty_us is not None
    least_us = now.required_us + now.bias_us - now.uncertainty_us
    for period_us, verdict in (
        (least_us * (1 + 2e-13), "not shown to fit"),
        (least_us * (1 - 2e-13), "not shown to fit"),
        (least_us * (1 - 3e-11), "does not fit"),
    ):
        assert busplan.capacity(profile, period_us=period_us).verdict == verdict
