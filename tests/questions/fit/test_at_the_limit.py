"""What is exactly at a limit keeps it: in figures, in rules and in plans, with one allowance for rounding."""

from math import inf, nextafter

import pytest

from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.parts import Limit
from busplan.elementwise import plain, within
from busplan.gate.gate import check_document
from busplan.profile.document import Document
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.profile.write import profile_text
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.planning import plan
from busplan.sections.profile import Profile

PERIODS_US = [3570.0, 4110.0, 5190.0, 7770.0, 9990.0]


def codes(profile: Profile) -> set[str]:
    found = check_document(Document("a.toml", profile_text(profile)), with_circle=False).findings
    return {one.code for one in found}


def least_period_us(profile: Profile) -> float:
    """The shortest period that a plan takes, of those in steps of 10 us."""
    best = plan(override(profile, {"cycle.period_us": 10.0, "servo.step_us": 10.0}), free=["period"]).recommended
    assert best is not None
    assert not codes(best.profile) & {"BP101", "BP103", "BP121"}
    return best.profile.cycle.period_us


@pytest.mark.parametrize(
    ("name", "period_us"),
    list(
        zip(("paper-1ms", "ethercat-servo-8", "can-servo-8", "paper-1ms", "ethercat-servo-8"), PERIODS_US, strict=True)
    ),
)
def test_a_plan_takes_the_period_at_which_the_share_is_used_exactly(name: str, period_us: float) -> None:
    profile = override(load(name).profile, {"limits": {"max_load": 0.99} if name.startswith("can") else {}})
    required_us = figures(profile, model=bus_of(profile).deciding_model).required_us
    most = required_us / (profile.cycle.slice_ratio * period_us)
    assert least_period_us(override(profile, {"limits.max_utilisation": most})) == period_us


@pytest.mark.parametrize("period_us", PERIODS_US[:3])
def test_a_plan_takes_the_period_at_which_the_load_is_reached_exactly(period_us: float) -> None:
    own = override(load("can-servo-8").profile, {"cycle.period_us": period_us})
    load_at = plain(CanCycle(network_of(own), WORST).load)
    assert least_period_us(override(own, {"limits": {"max_load": load_at}})) == period_us


def test_a_limit_allows_for_rounding_and_no_more() -> None:
    network = network_of(load("paper-1ms").profile)
    for value, is_broken in ((0.3, False), (nextafter(0.3, inf), False), (0.3 + 1e-11, True)):
        assert Limit("a", "", lambda _, value=value: value, lambda _: 0.3).is_broken(network) is is_broken  # type: ignore[misc]
        assert within(value, 0.3) is not is_broken
