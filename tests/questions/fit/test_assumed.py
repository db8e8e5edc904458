"""What carries much of a verdict and is assumed: said by the verdict, and by rule BP112."""

from pathlib import Path

import pytest

import busplan


def heavy(profile: busplan.Profile) -> dict[tuple[str, ...], str]:
    (verdict,) = busplan.capacity(profile).verdicts
    return {one.keys: one.carries for one in verdict.assumptions}


def said(profile: busplan.Profile) -> list[str]:
    lines = busplan.capacity(profile).to_dict()["verdicts"][0]["lines"]
    return [line["text"] for line in lines if line["label"] == "assumed"]


def warned(profile: busplan.Profile) -> list[str]:
    (file,) = busplan.check(profile, circle=False).files
    return [finding.message for finding in file.findings if finding.code == "BP112"]


# Shares of the variance: of the largest doubt, a guess x of the time by x / sqrt(3); of the time 40 of 104.290 us,
# 526.1 of 715.333 us (479.6, and four of six cycle starts), and less than a quarter of the other: 42.4 of 200.779 us.
@pytest.mark.parametrize(
    ("name", "keys", "carries"),
    [
        ("ethercat-servo-8", ["bus.master_us"], "carries 99% of the variance and 38% of the required time"),
        ("paper-dma", ["node.execution"], "carries 99% of the variance"),
        (
            "gantry-24",
            ["group.drives.execution", "group.tool.execution", "group.io.execution"],
            "together carry 100% of the variance and 74% of the required time",
        ),
    ],
)
def test_a_verdict_names_the_assumptions_that_carry_it(name: str, keys: list[str], carries: str) -> None:
    profile = busplan.load_profile(name)
    assert heavy(profile) == {tuple(keys): carries}
    # The larger share, the weight of a finding.
    (one,) = busplan.capacity(profile).verdicts[0].assumptions
    assert f" {one.share:.0%} of the variance" in carries
    *before, last = keys
    names, them = (f"{', '.join(before)} and {last}", "them") if before else (last, "it")
    assert said(profile) == [f"{names}: measure {them} first"]
    messages = warned(profile)
    assert len(messages) == len(keys)
    assert all(carries in message for message in messages)


def test_an_assumed_bit_rate_carries_what_goes_without_it() -> None:
    # All of 2950 us but the executions, 400.
    profile = busplan.load_profile("can-servo-8")
    assert heavy(profile) == {
        ("node.execution",): "carries 100% of the variance",
        ("bus.bit_rate_kbit_s",): "carries 86% of the required time",
    }
    assert said(profile) == [
        "node.execution: measure it first; bus.bit_rate_kbit_s: look it up in the configuration of the nodes"
    ]


def test_execution_times_of_some_groups_have_their_part_of_the_common_doubt() -> None:
    slow = {
        "group.drives.execution.grade": "measured",
        "group.tool.execution": {"kind": "linear", "grade": "assumed", "base_us": 100, "per_byte_us": 0.1},
    }
    profile = busplan.load_profile("gantry-24", changes=slow)
    ((keys, carries),) = heavy(profile).items()
    assert keys == ("group.tool.execution", "group.io.execution")
    none = {f"group.{one}.execution.{key}": 0 for one in ("tool", "io") for key in ("base_us", "per_byte_us")}
    without, whole = (
        busplan.capacity(one).verdicts[0].deciding.doubts
        for one in (busplan.load_profile(profile, changes=none), profile)
    )
    left_us, all_us = (next(one.us for one in each if one.key == "group.execution") for each in (without, whole))
    share = all_us * (all_us - left_us) / sum(one.us**2 for one in whole)
    assert f" {share:.0%} of the variance" in carries


def test_what_is_known_or_carries_little_is_not_said() -> None:
    known = {"bus.master_grade": "measured", "bus.master_us": 1}
    measured = busplan.load_profile("ethercat-servo-8", changes=known)
    assert "bus.master_us" not in str(busplan.capacity(measured))
    small = {"kind": "linear", "base_us": 0.1, "per_byte_us": 0, "grade": "assumed"}
    light = busplan.load_profile("paper-two-node", changes={"node.execution": small})
    assert (heavy(light), warned(light)) == ({}, [])
    assert warned(busplan.load_profile(light, changes={"node.execution.base_us": 30}))


MESSAGE = """\
schema_version = 1
name = "car"
[bus]
kind = "can"
bit_rate_kbit_s = 500 # {arbitration}: of this example
data_bit_rate_kbit_s = 2000 # {data}: of this example
[[message]]
name = "m"
identifier = 1
payload_bytes = 32
fd = true
brs = true
period_us = 10000
"""
# Of 244 us at most, 177 us are sent at the higher rate.
OF_DATA, OF_ARBITRATION = "carries 73% of the load", "carries 27% of the load"


@pytest.mark.parametrize(
    ("arbitration", "data", "carries"),
    [
        ("published", "published", {}),
        ("published", "assumed", {("bus.data_bit_rate_kbit_s",): OF_DATA}),
        ("assumed", "published", {("bus.bit_rate_kbit_s",): OF_ARBITRATION}),
        (
            "assumed",
            "assumed",
            {("bus.bit_rate_kbit_s",): OF_ARBITRATION, ("bus.data_bit_rate_kbit_s",): OF_DATA},
        ),
    ],
)
def test_of_messages_alone_an_assumed_rate_carries_the_load_that_goes_without_it(
    arbitration: str, data: str, carries: dict[tuple[str, ...], str], tmp_path: Path
) -> None:
    file = tmp_path / "car.toml"
    file.write_text(MESSAGE.format(arbitration=arbitration, data=data))
    assert heavy(busplan.load_profile(file)) == carries
    assert len(warned(busplan.load_profile(file))) == len(carries)
