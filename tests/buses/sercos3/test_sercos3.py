"""A SERCOS III network: its window by hand, by each timing method, and what it breaks."""

from typing import Any

import pytest

import busplan
from busplan.analysis.circle.delays import loop_delays_us
from busplan.analysis.network import network_of
from busplan.buses import kind_named
from busplan.buses.sercos3.section import Sercos3Profile
from busplan.elementwise import plain
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.sections.profile import Profile

DATA: dict[str, Any] = {
    "schema_version": 1,
    "name": "press",
    "bus": {"kind": "sercos3", "nodes": 40, "version": "V1.0", "hot_plug_field": "first", "gap_bytes": 25},
    "cycle": {"period_us": 500.0, "nonperiodic_us": 125.0},
    "payload": {"read_bytes": 10, "write_bytes": 6},
    "node": {"axes": 1, "execution": {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 1.0}},
}
MDT_US = (12 + 40 * (6 + 2 + 6) + 32 + 25) * 0.08
AT_US = (8 + 40 * (6 + 2 + 10) + 32 + 25) * 0.08
JITTER_US = (1 + 25 * 0.08) / 2
RING_US = 2 * 40 * 0.9 + 1
HEADER_US, MASTER_US, CHANNELS_US = 28 * 0.08, 2.56, 32 * 0.4


def profile(**changes: Any) -> Profile:
    """That profile with other values by dotted key, __ for the dot."""
    return override(Sercos3Profile.model_validate(DATA), {key.replace("__", "."): one for key, one in changes.items()})


def terms(one: Profile, model: str = "window") -> dict[str, float]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return {term.name: plain(term.us) for term in found.terms}


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
    expected = {"mdt": MDT_US, "at": AT_US, "jitter": jitter_us, "master": master_us, "ring": ring_us}
    assert found == pytest.approx({**expected, "nonperiodic": 125.0})
    alone = terms(profile(bus__timing_method=method), "telegrams")
    assert alone == pytest.approx({"mdt": MDT_US, "at": AT_US, "jitter": 0, "master": 0, "ring": 0, "nonperiodic": 125})


def test_the_first_method_is_what_the_library_asks() -> None:
    # CoSeMa: t6 = (MDT + J) + J + AT, t7 = T - (J + header + master), and t6 + UCC <= t7.
    period_us, ucc_us = 500.0, 125.0
    t6_us = MDT_US + JITTER_US + JITTER_US + AT_US
    t7_us = period_us - (JITTER_US + HEADER_US + MASTER_US)
    (found,) = busplan.capacity(profile(), timing_model=["window"]).results
    assert found.margin_us == pytest.approx(t7_us - ucc_us - t6_us)


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
        ({"payload.read_bytes": 1494}, ("telegrams", "time")),
        ({"payload.read_bytes": 1495}, ("payload", "telegrams", "time")),
        ({"bus.nodes": 512, "cycle.period_us": 2000.0}, ("nodes", "telegrams")),
    ],
)
def test_what_it_breaks_does_not_fit(changes: dict[str, Any], exceeded: tuple[str, ...]) -> None:
    (found,) = busplan.capacity(override(profile(), changes), timing_model=["window"]).results
    assert found.exceeded == exceeded
    assert (found.verdict == "does not fit") == bool(exceeded)


def test_delays_are_those_by_hand() -> None:
    found = {one.transaction: one for one in busplan.latency(profile(), timing_model=["window"]).transactions}
    assert found["feedback"].delay_us == pytest.approx(50 + AT_US + RING_US)
    # CoSeMa: commands are valid at t3 = MDT - header + ring, counted from the end of the first header.
    t3_us = MDT_US - HEADER_US + RING_US
    assert found["command"].delay_us == pytest.approx(46 + MASTER_US + t3_us)
    assert (found["feedback"].before_us, found["command"].before_us) == pytest.approx((0.0, 0.32))
    (alone, command) = busplan.latency(profile(), timing_model=["telegrams"]).transactions
    assert alone.delay_us == pytest.approx(50 + AT_US)
    assert command.delay_us == pytest.approx(46 + MDT_US)


def test_a_slow_master_delays_its_commands_and_a_quick_one_never_hurries_them() -> None:
    def before_us(master_delay_us: float) -> float:
        changed = profile(bus__master_delay_us=master_delay_us)
        (_, command) = busplan.latency(changed, timing_model=["window"]).transactions
        return float(command.before_us)

    assert before_us(50.0) == pytest.approx(50.0 - HEADER_US)
    assert before_us(0.0) == 0.0


def test_a_command_has_come_with_the_last_mdt() -> None:
    host = override(load("sercos3-servo-8").profile, {"servo.loop": "host", "servo.update": "on_arrival"})
    mdt_us = terms(host)["mdt"]
    assert loop_delays_us(host) == pytest.approx((mdt_us, mdt_us))


def test_the_order_of_the_cycle_is_that_of_the_method() -> None:
    def order(method: str) -> list[str]:
        events = busplan.timeline(profile(bus__timing_method=method), timing_model="window").cycle_events
        return list(dict.fromkeys(one.term for one in events if one.term))

    first = ["cycle_mdt_us", "cycle_at_us", "nonperiodic_us"]
    assert order("mdt-at-ucc")[:3] == first
    assert order("mdt-ucc-at")[:3] == ["cycle_mdt_us", "nonperiodic_us", "cycle_at_us"]


@pytest.mark.parametrize(("given_us", "warned"), [(0.0, False), (100.0, True), (125.0, False)])
def test_a_channel_that_the_master_does_not_open_is_warned_of(given_us: float, warned: bool) -> None:
    network = network_of(profile(cycle__nonperiodic_us=given_us))
    assert bool(kind_named("sercos3").warnings(network, nodes=[8])) == warned
