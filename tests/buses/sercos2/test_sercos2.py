"""A SERCOS I or II ring: its cycle by hand, the gap that must be given, and what it breaks."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import busplan
from busplan import BusplanError, Profile

TEXT = """\
schema_version = 1
name = "press"
[bus]
kind = "sercos2"
data_rate_mbit_s = 4
at_gap_us = 7.0
nodes = 3
recovery_us = 9.0
[cycle]
period_us = 1000.0
[payload]
read_bytes = 9
write_bytes = 4
[node]
axes = 1
execution = {kind = "linear", grade = "measured", base_us = 40.0, per_byte_us = 1.0}
"""
# Ten bytes of data in whole words; flags 16, stuff bits a fifth.
MST_BITS = 16 + 8 * 4 + 8 * 4 // 5
AT_BITS = 16 + 8 * (3 + 4 + 10) + 8 * (3 + 4 + 10) // 5
MDT_BITS = 16 + 8 * (3 + 3 * 8) + 8 * (3 + 3 * 8) // 5


@cache
def press() -> Profile:
    with TemporaryDirectory() as folder:
        path = Path(folder, "press.toml")
        path.write_text(TEXT, encoding="utf-8")
        return busplan.load_profile(path)


def profile(**changes: Any) -> Profile:
    """That profile with other values by dotted key, __ for the dot."""
    return busplan.load_profile(press(), changes={key.replace("__", "."): one for key, one in changes.items()})


def terms(one: Profile, model: str = "worst-stuffing") -> dict[str, float]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return {term.name: float(term.us) for term in found.terms}


def test_its_cycle_is_that_by_hand() -> None:
    assert terms(profile()) == {
        "mst": MST_BITS / 4,
        "at": 3 * AT_BITS / 4,
        "gap": 2 * 7,
        "mdt": MDT_BITS / 4,
        "wait": 12 + 12 + 9,
        "nonperiodic": 0,
    }
    assert terms(profile(), "no-stuffing")["at"] == 3 * (16 + 8 * 17) / 4
    assert terms(profile(bus__data_rate_mbit_s=16))["wait"] == 4 + 12 + 9
    assert terms(profile(bus__at_start_us=30.0))["wait"] == 30 + 12 + 9


def test_the_record_of_each_drive_is_its_data_control_and_service() -> None:
    of_drives = {"payload.read_bytes": 6, "payload.write_bytes": 10, "bus.data_rate_mbit_s": 8}
    plan = busplan.load_profile("sercos2-servo-8", changes=of_drives)
    mdt = [event for event in busplan.timeline(plan).cycle_events if event.term == "cycle_mdt_us"]
    assert [(event.kind, event.node) for event in mdt] == [*(("record", node) for node in range(1, 9)), ("mdt", None)]
    assert [event.duration_us for event in mdt[:-1]] == [8 * (10 + 2 + 2) / 8] * 8
    assert sum(event.duration_us for event in mdt) == pytest.approx(terms(plan)["mdt"], rel=1e-12)


def test_the_gap_is_in_the_uncertainty() -> None:
    (found,) = busplan.capacity(profile(), timing_model=["worst-stuffing"]).results
    assert found.uncertainty_us == pytest.approx(2 * 0.1 * 2 * 7)
    assert found.bias_us is None


def test_delays_are_those_by_hand() -> None:
    found = {one.transaction: one for one in busplan.latency(profile(), timing_model=["worst-stuffing"]).transactions}
    until_at_us = MST_BITS / 4 + 12 + 3 * AT_BITS / 4 + 14
    assert found["feedback"].phases["delay_us"] == 49 + until_at_us
    assert found["command"].phases["delay_us"] == 44 + until_at_us + 12 + MDT_BITS / 4


def test_a_gap_must_be_given_and_the_message_says_why(tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(TEXT.replace("at_gap_us = 7.0\n", ""), encoding="utf-8")
    with pytest.raises(BusplanError) as caught:
        busplan.load_profile(path)
    assert "bus.at_gap_us: missing key" in str(caught.value)
    assert "not published: take it from the master's time slots" in str(caught.value)


def test_a_gap_is_assumed_whoever_gives_it() -> None:
    (derivation,) = busplan.explain(profile(), "required_us", timing_model="worst-stuffing").derivations
    grades = {one.name: one.grade for one in derivation.inputs}
    assert (grades["bus.at_gap_us"], grades["bus.data_rate_mbit_s"]) == ("assumed", "given")


@pytest.mark.parametrize(
    ("changes", "exceeded"),
    [
        ({}, ()),
        ({"cycle.period_us": 1500.0}, ("period",)),
        ({"cycle.period_us": 250.0}, ("time",)),
        ({"bus.nodes": 255, "cycle.period_us": 65_000.0}, ("nodes",)),
        ({"payload.write_bytes": 21_840, "bus.data_rate_mbit_s": 16, "cycle.period_us": 60_000.0}, ()),
        ({"payload.write_bytes": 21_842, "bus.data_rate_mbit_s": 16, "cycle.period_us": 60_000.0}, ("payload",)),
    ],
)
def test_what_it_breaks_does_not_fit(changes: dict[str, Any], exceeded: tuple[str, ...]) -> None:
    (found,) = busplan.capacity(
        busplan.load_profile(profile(), changes=changes), timing_model=["worst-stuffing"]
    ).results
    assert found.exceeded == exceeded


def test_no_published_figure_tests_it_and_evidence_says_so() -> None:
    (evidence,) = busplan.evidence("sercos2").kinds
    (section,) = evidence.sections
    assert evidence.tested.parts == {}
    assert "0.0448 mm" in section.note
    assert "validates no schedule" in section.note
    assert all(one.published is None for one in section.comparisons)


def test_the_gap_of_the_evidence_fills_the_period() -> None:
    ((section,),) = (kind.sections for kind in busplan.evidence("sercos2").kinds)
    base = busplan.load_profile("sercos2-servo-8")
    changes = {"bus.nodes": 6, "payload.read_bytes": 4, "payload.write_bytes": 4, "cycle.period_us": 500.0}
    assert len(section.comparisons) == 3
    for one in section.comparisons:
        rate = int(one.quantity.split()[2])
        own = {
            "bus.data_rate_mbit_s": rate,
            "bus.at_gap_us": one.computed,
            "bus.at_start_us": 12.0 if rate < 8 else 4.0,
        }
        (found,) = busplan.capacity(
            busplan.load_profile(base, changes={**changes, **own}), timing_model=["worst-stuffing"]
        ).results
        assert found.required_us == pytest.approx(500.0)
