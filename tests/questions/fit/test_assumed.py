"""What carries much of a verdict and is assumed: said by the verdict, by rule BP112 and first on the page."""

import pytest

import busplan
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.assumed import heavy_assumptions
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of
from busplan.sections.profile import Profile

_SAID = "The execution time behind these figures is assumed."


def heavy(profile: Profile) -> dict[tuple[str, ...], str]:
    found = figures(profile, model=bus_of(profile).deciding_model)
    return {one.keys: one.carries for one in heavy_assumptions(found, profile)}


def said(profile: Profile) -> str:
    return str(busplan.capacity(profile).to_dict()["verdicts"][0]["text"])


# Shares of the variance: of the largest doubt; of the time 40 of 104.290 us, 244.600 of 420.448 us, and less than
# a quarter of the other: 42.4 of 200.779 us.
@pytest.mark.parametrize(
    ("name", "keys", "carries"),
    [
        ("ethercat-servo-8", ["bus.master_us"], "carries 99% of the variance and 38% of the required time"),
        ("paper-dma", ["node.execution"], "carries 80% of the variance"),
        (
            "gantry-24",
            ["group.drives.execution", "group.tool.execution", "group.io.execution"],
            "together carry 74% of the variance and 58% of the required time",
        ),
    ],
)
def test_a_verdict_says_the_assumptions_that_carry_it_with_their_shares(
    name: str, keys: list[str], carries: str
) -> None:
    profile = load(name).profile
    assert heavy(profile) == {tuple(keys): carries}
    *before, last = keys
    names = f"{', '.join(before)} and {last}" if before else last
    text = said(profile)
    assert f"Assumed: {names}, which {carries}." in text
    assert _SAID not in text


def test_an_assumed_bit_rate_carries_what_goes_without_it() -> None:
    # All of 2950 us but the executions, 400.
    profile = load("can-servo-8").profile
    carried = {
        ("node.execution",): "carries 100% of the variance",
        ("bus.bit_rate_kbit_s",): "carries 86% of the required time",
    }
    assert heavy(profile) == carried
    words = "; ".join(f"{keys[0]}, which {carries}" for keys, carries in carried.items())
    assert f"Assumed: {words}." in said(profile)


def test_execution_times_of_some_groups_have_their_part_of_the_common_doubt() -> None:
    slow = {"group.drives.execution.grade": "measured", "group.tool.execution.base_us": 100}
    profile = override(load("gantry-24").profile, slow)
    ((keys, carries),) = heavy(profile).items()
    assert keys == ("group.tool.execution", "group.io.execution")
    none: dict[str, object] = {
        f"group.{one}.execution.{key}": 0 for one in ("tool", "io") for key in ("base_us", "per_byte_us")
    }
    both, all_of_it = (figures(one, model="standard") for one in (override(profile, none), profile))
    left_us, whole_us = (next(d.us for d in one.doubts if d.key == "group.execution") for one in (both, all_of_it))
    variance = sum(one.us**2 for one in all_of_it.doubts)
    assert f" {whole_us * (whole_us - left_us) / variance:.0%} of the variance" in carries


def test_what_is_known_or_carries_little_is_not_said() -> None:
    measured = override(load("ethercat-servo-8").profile, {"bus.master_grade": "measured", "bus.master_us": 1})
    assert "bus.master_us" not in said(measured)
    light = override(
        load("paper-two-node").profile,
        {"node.execution": {"kind": "linear", "base_us": 0.1, "per_byte_us": 0, "grade": "assumed"}},
    )
    assert heavy(light) == {}
    assert _SAID in said(light)
    assert "BP112" not in str(busplan.check(light).to_dict())
    assert "BP112" in str(busplan.check(override(light, {"node.execution.base_us": 30})).to_dict())
