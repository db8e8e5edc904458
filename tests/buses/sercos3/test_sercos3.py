"""A SERCOS III network: its window by hand, by each timing method, and what it breaks."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import busplan
from busplan import Profile
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import network_of

TEXT = """\
schema_version = 1
name = "press"
[bus]
kind = "sercos3"
nodes = 40
version = "V1.0"
hot_plug_field = "first"
gap_bytes = 25
[cycle]
period_us = 500.0
nonperiodic_us = 125.0
[payload]
read_bytes = 10
write_bytes = 6
[node]
axes = 1
execution = {kind = "linear", grade = "measured", base_us = 40.0, per_byte_us = 1.0}
"""
MDT_US = (12 + 40 * (6 + 2 + 6) + 32 + 25) * 0.08
AT_US = (8 + 40 * (6 + 2 + 10) + 32 + 25) * 0.08
JITTER_US = (1 + 25 * 0.08) / 2
RING_US = 2 * 40 * 0.9 + 1 + 1.8
HEADER_US, MASTER_US, CHANNELS_US = 28 * 0.08, 2.56, 32 * 0.4


@cache
def press() -> Profile:
    with TemporaryDirectory() as folder:
        path = Path(folder, "press.toml")
        path.write_text(TEXT, encoding="utf-8")
        return busplan.load_profile(path)


def profile(**changes: Any) -> Profile:
    """That profile with other values by dotted key, __ for the dot."""
    return busplan.load_profile(press(), changes={key.replace("__", "."): one for key, one in changes.items()})


def terms(one: Profile, model: str = "window") -> dict[str, float]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return {term.name: float(term.us) for term in found.terms}


@pytest.mark.parametrize(
    ("method", "jitter_us", "master_us", "ring_us"),
    [
        # T6 + UCC <= T7: two jitters before t6, one before the next cycle, its header and the master.
        ("mdt-at-ucc", 3 * JITTER_US, HEADER_US + MASTER_US, 0.0),
        # The AT end before the service channels are through, and the ring.
        ("mdt-ucc-at", 3 * JITTER_US, CHANNELS_US - JITTER_US, RING_US),
        ("at-last", 2 * JITTER_US, CHANNELS_US - JITTER_US, RING_US),
    ],
)
def test_its_window_is_that_by_hand(method: str, jitter_us: float, master_us: float, ring_us: float) -> None:
    found = terms(profile(bus__timing_method=method))
    expected = {"mdt": MDT_US, "wait": 0, "at": AT_US, "jitter": jitter_us, "master": master_us, "ring": ring_us}
    assert found == pytest.approx({**expected, "nonperiodic": 125.0})
    alone = terms(profile(bus__timing_method=method), "telegrams")
    idle = dict.fromkeys(("wait", "jitter", "master", "ring"), 0)
    assert alone == pytest.approx({"mdt": MDT_US, "at": AT_US, "nonperiodic": 125, **idle})


def library_margin_us(method: str, *, devices: int, least_us: float, ucc_us: float) -> float:
    """What CoSeMa's own check leaves of a period of 500 us: t7 less t6 and the channel, or t1max less a later t1."""
    mdt_us, at_us = ((own + devices * (8 + size) + 32 + 25) * 0.08 for own, size in ((12, 6), (8, 10)))
    ring_us = 2 * devices * 0.9 + 25 * 0.08 / 2 + 1.8
    behind_us = max(JITTER_US + MASTER_US, min(devices, 32) * 0.4)
    t1_max_us = 500 - (at_us + behind_us + ring_us)
    if method == "mdt-at-ucc":
        t6_us = max(mdt_us + JITTER_US, least_us) + JITTER_US + at_us
        return 500 - (JITTER_US + HEADER_US + MASTER_US) - ucc_us - t6_us
    t6_us = mdt_us - HEADER_US + (JITTER_US if method == "mdt-ucc-at" else 0)
    t7_us = t1_max_us - (JITTER_US + HEADER_US)
    return min(t7_us - t6_us - ucc_us, t1_max_us - least_us)


def test_each_method_is_what_the_library_asks() -> None:
    for method in ["mdt-at-ucc", "mdt-ucc-at", "at-last"]:
        for least_us in [0.0, 100.0, 230.0]:
            for devices, ucc_us in [(3, 125.0), (40, 125.0), (40, 0.0)]:
                changes: dict[str, Any] = {
                    "bus__timing_method": method,
                    "bus__nodes": devices,
                    "bus__at_start_us": least_us,
                }
                one = profile(**changes, cycle__nonperiodic_us=ucc_us)
                (found,) = busplan.capacity(one, timing_model=["window"]).results
                expected_us = library_margin_us(method, devices=devices, least_us=least_us, ucc_us=ucc_us)
                assert found.margin_us == pytest.approx(expected_us)
                events = busplan.timeline(one, timing_model="window").cycle_events
                assert sum(event.duration_us for event in events if event.term) == pytest.approx(found.required_us)


def test_a_least_time_that_nobody_has_said_is_not_in_it() -> None:
    least = "no least time before the AT"
    assert least in str(busplan.capacity(profile()))
    assert least not in str(busplan.capacity(profile(bus__at_start_us=0.0)))


@pytest.mark.parametrize("method", ["mdt-at-ucc", "mdt-ucc-at", "at-last"])
def test_its_uncertainty_is_that_of_the_published_ranges(method: str) -> None:
    # Three devices: the service channels of more hide the jitter in the master's own time.
    one = profile(bus__timing_method=method, bus__nodes=3)

    def required_us(key: str, value: float) -> float:
        (found,) = busplan.capacity(busplan.load_profile(one, changes={key: value}), timing_model=["window"]).results
        return float(found.required_us)

    def swing_us(key: str, value: float, share: float) -> float:
        # What the ends of a range of this width about the value change; a rectangular one (JCGM 100, 4.3.7).
        steps = (round(value * (1 - share)), round(value * (1 + share))) if key == "bus.gap_bytes" else None
        low, high = steps or (value * (1 - share), value * (1 + share))
        return (required_us(key, high) - required_us(key, low)) / (high - low) * value

    parts_us = (
        swing_us("bus.gap_bytes", 25, 0.4) * 25 / 37 / 12**0.5,
        swing_us("bus.master_jitter_us", 1.0, 0.1) / 12**0.5,
        swing_us("bus.device_delay_us", 0.9, 0.1) * 0.4 / 0.9 / 12**0.5,
    )
    (found,) = busplan.capacity(one, timing_model=["window"]).results
    assert found.uncertainty_us == pytest.approx(2 * sum(us**2 for us in parts_us) ** 0.5)
    (measured,) = busplan.capacity(
        busplan.load_profile(one, changes={"bus.ring_grade": "measured"}), timing_model=["window"]
    ).results
    assert (measured.uncertainty_us, measured.bias_us) == (None, None)


def test_few_service_channels_are_through_before_the_master_begins() -> None:
    assert terms(profile(bus__timing_method="at-last", bus__nodes=3))["master"] == MASTER_US


def test_connection_control_comes_with_v1_1_and_hot_plug_fields_in_all_telegrams() -> None:
    assert terms(profile(bus__version="V1.1"))["mdt"] == pytest.approx(MDT_US + 40 * 2 * 0.08)
    assert terms(profile(bus__hot_plug_field="all"))["mdt"] == pytest.approx(MDT_US + 2 * 0.08)
    assert terms(profile(bus__hot_plug_field="all"))["at"] == pytest.approx(AT_US)


@pytest.mark.parametrize(
    ("changes", "exceeded"),
    [
        ({}, ()),
        ({"cycle.period_us": 300.0}, ("period",)),
        ({"cycle.period_us": 125.0}, ("time",)),
        ({"payload.read_bytes": 1494}, ("node", "telegrams", "time")),
        ({"payload.read_bytes": 1493}, ("node", "telegrams", "time")),
        ({"payload.read_bytes": 1495}, ("node", "payload", "telegrams", "time")),
        ({"bus.nodes": 512, "cycle.period_us": 2000.0}, ("nodes", "telegrams")),
    ],
)
def test_what_it_breaks_does_not_fit(changes: dict[str, Any], exceeded: tuple[str, ...]) -> None:
    (found,) = busplan.capacity(busplan.load_profile(profile(), changes=changes), timing_model=["window"]).results
    assert found.exceeded == exceeded
    assert (found.verdict == "does not fit") == bool(exceeded)


def test_delays_are_those_by_hand() -> None:
    found = {one.transaction: one for one in busplan.latency(profile(), timing_model=["window"]).transactions}
    assert found["feedback"].phases["delay_us"] == pytest.approx(50 + AT_US + RING_US)
    # CoSeMa: commands are valid at t3 = MDT - header + ring, counted from the end of the first header.
    t3_us = MDT_US - HEADER_US + RING_US
    assert found["command"].phases["delay_us"] == pytest.approx(46 + MASTER_US + t3_us)
    assert (found["feedback"].phases["before_us"], found["command"].phases["before_us"]) == pytest.approx((0.0, 0.32))
    (alone, command) = busplan.latency(profile(), timing_model=["telegrams"]).transactions
    assert alone.phases["delay_us"] == pytest.approx(50 + AT_US)
    assert command.phases["delay_us"] == pytest.approx(46 + MDT_US)


def test_a_slow_master_delays_its_commands_and_a_quick_one_never_hurries_them() -> None:
    def before_us(master_delay_us: float) -> float:
        changed = profile(bus__master_delay_us=master_delay_us)
        (_, command) = busplan.latency(changed, timing_model=["window"]).transactions
        return command.phases["before_us"] or 0.0

    assert before_us(50.0) == pytest.approx(50.0 - HEADER_US)
    assert before_us(0.0) == 0.0


def delay_us(update: str, **changes: Any) -> float:
    """Delay of a loop on the host of the shipped profile at 1 ms, of both axes alike."""
    own = {"servo.loop": "host", "servo.update": update, "cycle.period_us": 1000.0, "cycle.nonperiodic_us": 0}
    one = busplan.load_profile(
        "sercos3-servo-8",
        changes={**own, **{key.replace("__", "."): to for key, to in changes.items()}},
    )
    (found,) = busplan.circle_test(one).to_dict()["results"]
    assert found["delay_x_us"] == found["delay_y_us"]
    return float(found["delay_x_us"])


def test_a_loop_on_the_host_rests_on_the_feedback_of_the_cycle_before() -> None:
    mdt_us, at_us, ring_us = 20.72, 20.24, 2 * 8 * 0.9 + 37 * 0.08 / 2 + 1.8
    jitter_us = (1 + 37 * 0.08) / 2
    # Sampled 60 us before the AT, which follow the MDT; executed 60 us behind the next one.
    effect_us = 2.56 - HEADER_US + mdt_us + ring_us + 60
    sampled_us = 2.56 - HEADER_US + mdt_us + jitter_us - 60
    assert delay_us("on_arrival") == pytest.approx(1000 + effect_us - sampled_us)
    assert delay_us("next_sync") == 2000
    assert delay_us("on_arrival", bus__pipeline_cycles=2) == pytest.approx(2000 + effect_us - sampled_us)
    assert delay_us("next_sync", bus__pipeline_cycles=2) == 3000
    # By the last method the AT end with the cycle, and the next MDT follows: one period is enough.
    last_us = 1000 - at_us - ring_us - max(2.56, 8 * 0.4 - jitter_us) - jitter_us - 60
    assert delay_us("on_arrival", bus__timing_method="at-last") == pytest.approx(1000 + effect_us - last_us)
    assert delay_us("next_sync", bus__timing_method="at-last") == 1000


@pytest.mark.parametrize(
    ("changes", "due_us"),
    # Feedback is due when the first AT begins: behind the MDT, the channel that is open, or the devices' least time.
    [
        ({}, 20.72 + 1.98),
        ({"bus__at_start_us": 20.0}, 20.72 + 1.98),
        ({"bus__at_start_us": 90.0}, 90.0),
        ({"bus__timing_method": "mdt-ucc-at"}, 20.72 + 1.98),
        ({"bus__timing_method": "mdt-ucc-at", "cycle__nonperiodic_us": 130.0}, 20.72 + 2 * 1.98 + 130 + 17.68),
    ],
)
def test_feedback_is_due_when_the_first_at_begins(changes: dict[str, Any], due_us: float) -> None:
    keys = {"cycle.nonperiodic_us": 0} | {key.replace("__", "."): to for key, to in changes.items()}
    cycle = deciding_cycle(network_of(busplan.load_profile("sercos3-servo-8", changes=keys)))
    # All sample 60 us before; the first byte leaves 0.32 us behind the start of the cycle.
    assert cycle.sampled_us() == pytest.approx(0.32 + due_us - 60)


def test_the_order_of_the_cycle_is_that_of_the_method() -> None:
    def order(method: str) -> list[str]:
        events = busplan.timeline(profile(bus__timing_method=method), timing_model="window").cycle_events
        return list(dict.fromkeys(one.term for one in events if one.term))

    first = ["cycle_mdt_us", "cycle_at_us", "nonperiodic_us"]
    assert order("mdt-at-ucc")[:3] == first
    assert order("mdt-ucc-at")[:3] == ["cycle_mdt_us", "nonperiodic_us", "cycle_at_us"]


@pytest.mark.parametrize(("given_us", "warned"), [(0.0, False), (100.0, True), (125.0, False)])
def test_a_channel_that_the_master_does_not_open_is_warned_of(given_us: float, warned: bool) -> None:
    answer = str(busplan.capacity(profile(cycle__nonperiodic_us=given_us)))
    assert ("the master opens no channel for other frames of less than 125 us" in answer) == warned
