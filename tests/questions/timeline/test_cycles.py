"""Every cycle of the common multiple of the rates, as a timeline draws and lists it."""

from collections.abc import Callable, Sequence
from math import fsum, lcm
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.network import Rate, numbers_by_due
from busplan.profile.edit import profile_text
from tests.registers import at_least

Run = Callable[..., Any]
WORST, NONE = "worst-stuffing", "no-stuffing"


class Rated(NamedTuple):
    """A group of nodes on CAN."""

    every: int = 1
    nodes: int = 1
    size: int = 8
    base_us: float = 40.0
    place: int = 0
    """Of its identifiers among those of all groups."""


LOW = ({"name": "low", "identifier": 0x700, "payload_bytes": 8, "period_us": 1e4},)
"""A message behind all PDOs."""


def network(groups: Sequence[Rated], *, messages: Sequence[dict[str, Any]] = LOW, **bus: Any) -> busplan.Profile:
    data = {
        "schema_version": 1,
        "name": "mixed",
        "bus": {"kind": "can", "bit_rate_kbit_s": 1000, **bus},
        "cycle": {"period_us": 4000.0},
        "group": [
            {
                "name": f"g{number}",
                "nodes": group.nodes,
                "axes": 1,
                "every": group.every,
                "read_bytes": group.size,
                "write_bytes": group.size,
                "feedback_identifier": 0x181 + 8 * group.place,
                "command_identifier": 0x201 + 8 * group.place,
                "execution": {"kind": "linear", "grade": "measured", "base_us": group.base_us, "per_byte_us": 1.0},
            }
            for number, group in enumerate(groups)
        ],
        "message": messages,
    }
    return kind_named("can").profile_model().model_validate(data)


RATES = st.sampled_from([1, 1, 2, 3, 4, 6])
GROUPS = st.lists(
    st.builds(Rated, RATES, st.integers(1, 4), st.sampled_from([1, 4, 8]), st.sampled_from([0.0, 40.0, 300.0])),
    min_size=1,
    max_size=4,
).flatmap(
    lambda groups: st.permutations(range(len(groups))).map(
        lambda places: [group._replace(place=place) for group, place in zip(groups, places, strict=True)]
    )
)


def drawn(answer: Any) -> list[tuple[str, str, float]]:
    """Its events without their nodes, which have other numbers in another profile."""
    events = (event for event in answer.cycle_events if event.kind != "idle")
    return [(event.kind, event.label, event.duration_us) for event in events]


def multiple_of(groups: Sequence[Rated]) -> range:
    return range(1, lcm(*(group.every for group in groups)) + 1)


@pytest.mark.slow
@settings(max_examples=at_least(20))
@given(GROUPS, st.sampled_from([WORST, NONE]), st.sampled_from([0.0, 50.0]))
def test_a_cycle_on_can_is_that_of_a_network_of_the_groups_that_are_due(
    groups: list[Rated], model: str, host_us: float
) -> None:
    bus: dict[str, Any] = {"host_us": host_us, "pipeline_cycles": 0}
    profile = network(groups, **bus)
    for number in multiple_of(groups):
        answer = busplan.timeline(profile, timing_model=model, cycle=number)
        due = [group._replace(every=1) for group in groups if (number - 1) % group.every == 0]
        if due:
            alone = busplan.timeline(network(due, **bus), timing_model=model)
            assert drawn(answer) == drawn(alone)
            assert (answer.required_us, answer.margin_us) == (alone.figures.required_us, alone.figures.margin_us)
        else:
            assert [kind for kind, *_ in drawn(answer)] == ["blocking", "sync"]


BETWEEN = st.lists(
    st.tuples(
        st.sampled_from([0x90, 0x185, 0x18C, 0x19A, 0x205, 0x20C, 0x21A, 0x7F0]),
        st.sampled_from([1, 8]),
        st.sampled_from([700.0, 2000.0, 9000.0]),
        st.sampled_from([0.0, 600.0]),
    ),
    max_size=4,
    unique_by=lambda message: message[0],
)


@pytest.mark.slow
@settings(max_examples=at_least(30))
@given(GROUPS, BETWEEN, st.sampled_from([WORST, NONE]))
def test_the_events_of_each_cycle_add_up_and_none_takes_longer_than_the_verdict_says(
    groups: list[Rated], between: list[tuple[int, int, float, float]], model: str
) -> None:
    keys = ("identifier", "payload_bytes", "period_us", "jitter_us")
    messages = [{"name": f"m{number}", **dict(zip(keys, own, strict=True))} for number, own in enumerate(between)]
    profile = network(groups, messages=messages)
    whole = busplan.timeline(profile, timing_model=model)
    document = whole.to_dict()
    listed = {number: alike for alike in document["distinct_cycles"] for number in alike["numbers"]}
    assert sorted(listed) == list(multiple_of(groups))
    assert document["common_multiple"] == len(listed)
    for number in multiple_of(groups):
        answer = busplan.timeline(profile, timing_model=model, cycle=number)
        sum_us = fsum(us for *_, us in drawn(answer))
        assert sum_us == pytest.approx(answer.required_us, rel=1e-12)
        assert answer.required_us <= whole.required_us * (1 + 1e-12)
        due = [place for place, group in enumerate(groups) if (number - 1) % group.every == 0]
        assert listed[number]["groups"] == [f"g{place}" for place in due]
        assert listed[number]["nodes"] == sum(groups[place].nodes for place in due)
        assert listed[number]["required_us"] == answer.required_us
        assert {event.node for event in answer.cycle_events} - {None} == {
            node for place in due for node in nodes_of(groups, place)
        }
    least_us = min(alike["required_us"] for alike in listed.values())
    assert [document["distinct_cycles"][place]["required_us"] for place in (0, -1)] == [
        max(alike["required_us"] for alike in listed.values()),
        least_us,
    ]
    fullest_us = listed[1]["required_us"]
    assert document["cycle"] == (1 if whole.required_us <= fullest_us * (1 + 1e-12) else None)


def nodes_of(groups: Sequence[Rated], place: int) -> range:
    first = sum(group.nodes for group in groups[:place]) + 1
    return range(first, first + groups[place].nodes)


@given(st.lists(st.integers(1, 8).flatmap(lambda every: st.builds(Rate, st.just(every), st.integers(1, every)))))
def test_every_cycle_is_listed_with_the_groups_that_are_due(rates: list[Rate]) -> None:
    numbers = numbers_by_due(rates)
    assert sorted(number for each in numbers.values() for number in each) == list(
        range(1, lcm(*(rate.every for rate in rates)) + 1)
    )
    for due, each in numbers.items():
        for number in each:
            assert due == tuple(number in range(rate.first, number + 1, rate.every) for rate in rates)
    assert [each[0] for each in numbers.values()] == sorted(each[0] for each in numbers.values())


MIXED = [Rated(nodes=2), Rated(every=2, place=1), Rated(every=3, place=2)]


def test_cycles_beyond_the_common_multiple_repeat() -> None:
    profile = network(MIXED)
    for number in (7, 13, 999_997):
        again = busplan.timeline(profile, cycle=number)
        assert drawn(again) == drawn(busplan.timeline(profile, cycle=1))
        assert f"\nCycle {number} repeats cycle 1.\n" in str(again)
        assert again.to_dict()["cycle"] == 1
    assert "repeats" not in str(busplan.timeline(profile, cycle=6))


def test_the_words_say_which_cycle_is_drawn_and_what_each_needs() -> None:
    whole, third = (str(busplan.timeline(network(MIXED), cycle=number)) for number in (None, 3))
    needs = [busplan.timeline(network(MIXED), cycle=number).required_us for number in (1, 3, 4, 2)]
    assert needs == sorted(needs, reverse=True)
    alike = ("1: g0, g1, g2", "3, 5: g0, g1", "4: g0, g2", "2, 6: g0")
    assert needs[1] == needs[2]
    listed = "; ".join(f"{words} ({us:.3f} us)" for words, us in zip(alike, needs, strict=True))
    assert f"\nThe groups meet every 6 cycles; this is the fullest. Cycles {listed}.\n" in whole
    assert f"\nThe groups meet every 6 cycles; this is cycle 3, with g0, g1. Cycles {listed}.\n" in third
    assert f"0.000 to {needs[1]:.3f} us of cycle 3 of 6" in third
    said = "used 1501.0 us of 4000, 38 %; free 2499.0 us, +/- 0.1."
    assert third.splitlines()[0] == f"mixed at 4 ms: fits by the worst-stuffing model in the fullest cycle; {said}"
    assert "fullest cycle;" not in whole
    assert f"{4000 - needs[1]:.3f} us by the worst-stuffing model" in third.splitlines()[1]


def test_a_message_between_pdos_makes_no_cycle_longer_than_the_fullest() -> None:
    between = {"name": "between", "identifier": 0x300, "payload_bytes": 8, "period_us": 2000.0}
    profile = network([Rated(size=1), Rated(2, size=1, place=0xBF)], messages=[between])
    answer = busplan.timeline(profile)
    needs = [busplan.timeline(profile, cycle=number).required_us for number in (1, 2)]
    assert needs[0] - 2 * 65 == needs[1]  # by its deadline alone it could block twice there
    assert answer.required_us == needs[0]
    assert answer.to_dict()["cycle"] == 1


def test_nodes_that_are_alike_are_all_due_or_none() -> None:
    profile = busplan.load_profile("can-servo-8", changes={"payload.every": 3})
    said = str(busplan.timeline(profile, cycle=3))
    assert "The nodes are due every 3 cycles; this is cycle 3, with no node. Cycles 1: all nodes (" in said
    assert "; 2, 3: no node (" in said
    cycles = busplan.timeline(profile).to_dict()["distinct_cycles"]
    assert [(alike["numbers"], alike["groups"], alike["nodes"]) for alike in cycles] == [([1], [], 8), ([2, 3], [], 0)]


def test_a_long_common_multiple_is_not_listed() -> None:
    profile = network([Rated(every, place=place) for place, every in enumerate((7, 11, 13, 240))])
    answer = busplan.timeline(profile, cycle=240_240 + 8)
    said = str(answer)
    assert (
        "The groups meet every 240240 cycles; this is cycle 8, with g0. More than 64 cycles are not listed.\n" in said
    )
    document = answer.to_dict()
    assert (document["cycle"], document["common_multiple"], document["distinct_cycles"]) == (8, 240_240, None)


@pytest.mark.parametrize("name", ["paper-4ms", "can-servo-8", "ethercat-servo-8"])
def test_with_a_single_rate_all_cycles_are_alike(name: str) -> None:
    whole, asked = busplan.timeline(name), busplan.timeline(name, cycle=5)
    assert asked.cycle_events == whole.cycle_events
    assert "\nAll cycles are alike.\n" in str(asked)
    assert "cycles are" not in str(whole)
    assert str(asked).replace("All cycles are alike.\n", "") == str(whole)
    document = asked.to_dict()
    (alone,) = document["distinct_cycles"]
    assert (document["cycle"], document["common_multiple"], alone["numbers"]) == (1, 1, [1])
    assert alone["required_us"] == document["required_us"]


def test_an_overrun_is_that_of_the_cycle_that_is_drawn() -> None:
    profile = busplan.load_profile(network(MIXED), changes={"cycle.period_us": 1300.0})
    full, second = busplan.timeline(profile), busplan.timeline(profile, cycle=2)
    assert full.figures == second.figures
    assert "time" in full.figures.exceeded
    assert "beyond its slice" in str(full)
    assert "beyond its slice" not in str(second)
    assert str(second).startswith(
        "mixed at 1.3 ms: does not fit by the worst-stuffing model in the fullest cycle; used "
    )
    assert second.to_dict()["margin_us"] == 1300 - second.required_us > 0


def test_windows_and_transactions_are_of_the_cycle_that_is_drawn() -> None:
    profile = network(MIXED)
    (command,) = busplan.timeline(profile, cycle=2, transaction="command:2").events
    assert command in busplan.timeline(profile, cycle=2).events
    with pytest.raises(busplan.BusplanError, match="command:3: no such transaction in this cycle"):
        busplan.timeline(profile, cycle=2, transaction=("command", 3))
    window = busplan.timeline(profile, cycle=2, from_us=100, to_us=200)
    assert [window.events[0].start_us, window.events[-1].end_us] == [100, 200]
    assert "100.000 to 200.000 us of cycle 2 of 6" in str(window)


def test_every_form_has_the_cycle_that_is_asked_for(run: Run, tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(profile_text(network(MIXED)), encoding="utf-8")
    for ending in ("txt", "md", "html", "svg"):
        assert run("timeline", "arm.toml", "--cycle", "2", "-o", f"a.{ending}", cwd=tmp_path).returncode == 0
        said = (tmp_path / f"a.{ending}").read_text(encoding="utf-8")
        assert "of cycle 2 of 6" in said, ending
    rows = run("timeline", "arm.toml", "--cycle", "2", "--format", "csv", cwd=tmp_path).stdout.splitlines()
    assert sum("command_frame" in row for row in rows) == 2
    assert run("timeline", "arm.toml", "--cycle", "2", "-o", "a.png", cwd=tmp_path).returncode == 0
