"""How well each value of a profile is known, as the docstring of `given` ranks it: grade, source and symbol."""

from typing import Any

import pytest

import busplan
from busplan.elementwise import GivenTable, Traced
from busplan.questions.fit.graded import given, traced_network
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at

LINEAR = {"kind": "linear", "base_us": 150, "per_byte_us": 0}
ETHERCAT = "profile ethercat-servo-8"


@pytest.mark.parametrize(
    ("name", "changes", "key", "known"),
    [
        # A sourced default, in the file or not, until it has another value.
        ("paper-1ms", {}, "cycle.sync.ping_us", ("ping", "measured", "profile paper-1ms, as paper, section IV-A")),
        ("paper-1ms", {"cycle.sync.ping_us": 0.4}, "cycle.sync.ping_us", ("ping", "given", "profile paper-1ms")),
        (
            "sercos2-servo-8",
            {},
            "bus.pipeline_cycles",
            (
                "n",
                "assumed",
                "default, as chosen: the master computes between the feedback of a cycle and the next MDT",
            ),
        ),
        # The key beside it, and that of its section or of one above it.
        ("ethercat-servo-8", {}, "bus.master_us", ("T_master", "assumed", f"{ETHERCAT}; graded by bus.master_grade")),
        (
            "paper-1ms",
            {},
            "node.execution.time_us",
            ("time_us", "derived", "profile paper-1ms; graded by node.execution.grade"),
        ),
        (
            "paper-1ms",
            {"servo.x": {"position_gain_per_s": 5}},
            "servo.x.position_gain_per_s",
            ("position_gain_per_s", "calibrated", "profile paper-1ms; graded by servo.grade"),
        ),
        # It is about what was measured: a word that selects a formula was not, nor a zero that nobody wrote.
        (
            "paper-1ms",
            {},
            "node.execution.grade",
            ("grade", "given", "profile paper-1ms"),
        ),
        (
            "can-servo-8",
            {"node.execution": {**LINEAR, "grade": "measured"}},
            "node.execution.worst_extra_us",
            ("T_extra", "given", "default"),
        ),
        (
            "can-servo-8",
            {"node.execution": {**LINEAR, "grade": "measured", "worst_extra_us": 0}},
            "node.execution.worst_extra_us",
            ("T_extra", "measured", "profile can-servo-8; graded by node.execution.grade"),
        ),
        # A worst of so many cycles, though of another machine where a comment calls it assumed.
        (
            "paper-1ms",
            {"bus.sync_jitter_us": 9.0, "bus.sync_jitter_cycles": 100_000},
            "bus.sync_jitter_us",
            ("J", "measured", "profile paper-1ms; the worst of 100,000 measured cycles"),
        ),
        (
            "ethercat-servo-8",
            {"bus.master_jitter_cycles": 100_000},
            "bus.master_jitter_us",
            ("J", "assumed", f"{ETHERCAT}; the worst of 100,000 measured cycles; graded by its comment"),
        ),
        # A comment in the file, which says nothing of a default, and of a changed value that it stays assumed.
        ("ethercat-servo-8", {}, "node.port", ("port", "assumed", f"{ETHERCAT}; graded by its comment")),
        ("ethercat-servo-8", {}, "cycle.period_us", ("T_s", "published", f"{ETHERCAT}; graded by its comment")),
        ("ethercat-servo-8", {"cycle.period_us": 999.0}, "cycle.period_us", ("T_s", "given", ETHERCAT)),
        (
            "ethercat-servo-8",
            {"node.cable_length_m": 3.0},
            "node.cable_length_m",
            ("L", "assumed", f"{ETHERCAT}; graded by its comment"),
        ),
        # A grade of the kind of bus stands behind that of a comment alone.
        (
            "sercos2-servo-8",
            {"bus.at_gap_us": 6.0},
            "bus.at_gap_us",
            ("t_gap", "assumed", "profile sercos2-servo-8; graded by its comment"),
        ),
        # Groups and messages have their names in symbols.
        (
            "gantry-24",
            {},
            "group.io.execution.base_us",
            ("base,io", "assumed", "profile gantry-24; graded by group.io.execution.grade"),
        ),
        ("gantry-24", {"group.drives.nodes": 5}, "group.drives.nodes", ("N,drives", "given", "profile gantry-24")),
        ("gantry-24", {"group.io.axes": 2}, "group.io.axes", ("axes_node,io", "given", "profile gantry-24")),
        (
            "gantry-24",
            {},
            "group.drives.read_bytes_per_axis",
            ("read_bytes_per_axis,drives", "assumed", "profile gantry-24; graded by its comment"),
        ),
        (
            "can-servo-8",
            {},
            "message.sdo-request.period_us",
            ("T,sdo-request", "assumed", "profile can-servo-8; graded by its comment"),
        ),
    ],
)
def test_a_value_is_known_as_the_first_that_speaks_of_it_says(
    name: str, changes: dict[str, Any], key: str, known: tuple[str, str, str]
) -> None:
    found = given(busplan.load_profile(name, changes=changes), key)
    assert (found.symbol, found.grade, found.source) == known
    assert found.name == key


@pytest.mark.parametrize(
    ("key", "unit"), [("bus.nodes", ""), ("cycle.period_us", "us"), ("payload.read_bytes", "bytes")]
)
def test_a_value_has_its_unit_and_a_plain_number_none(key: str, unit: str) -> None:
    found = given(busplan.load_profile("can-servo-8"), key)
    assert found.unit == unit
    assert found.meaning
    assert "[" not in found.meaning


@pytest.mark.parametrize(
    ("name", "words", "numbers"),
    [
        ("paper-1ms", {"node.execution.grade", "node.execution.residual"}, {"bus.nodes", "cycle.slice_ratio"}),
        ("dynamixel-arm-14", {"node.execution.grade"}, {"bus.adapter.timer_us"}),
        ("gantry-24", {"group.io.execution.grade"}, {"group.io.execution.base_us", "group.drives.nodes"}),
    ],
)
def test_numbers_and_the_words_that_choose_a_formula_are_traced(name: str, words: set[str], numbers: set[str]) -> None:
    own = busplan.load_profile(name)
    profile = traced_network(network_of(own)).profile
    for key in words | numbers:
        value = value_at(profile, key)
        assert isinstance(value, Traced), key
        assert value.value == value_at(own, key)
        assert value.given is not None
        assert value.given.name == key


@pytest.mark.parametrize("key", ["bus.cycle_master", "bus.speed", "node.read_response"])
def test_what_is_on_or_off_and_any_other_word_stay_as_they_are(key: str) -> None:
    own = busplan.load_profile("paper-1ms")
    assert value_at(traced_network(network_of(own)).profile, key) is value_at(own, key)


@pytest.mark.parametrize(
    ("name", "key", "symbol", "points"),
    [
        ("paper-1ms", "node.execution.time_us", "table", 8),
        ("gantry-24", "group.drives.execution.time_us", "table,drives", 5),
    ],
)
def test_a_table_of_execution_times_is_one_input(name: str, key: str, symbol: str, points: int) -> None:
    table = value_at(traced_network(network_of(busplan.load_profile(name))).profile, key)
    assert isinstance(table, GivenTable)
    assert (table.given.symbol, table.given.value, table.given.name) == (symbol, f"{points} points", key)
