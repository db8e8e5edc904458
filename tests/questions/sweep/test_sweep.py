"""Every row of a sweep is what `capacity` gives for its point; a grid in pieces is the same table."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.sections.base import value_at
from tests.registers import at_least

Make = Callable[..., busplan.Profile]

TABLE = {"kind": "table", "payload_bytes": (4, 16, 33, 2500), "time_us": (36.7, 36.3, 44.7, 900.1)}

FLOATS = {
    "bus.cable_length_m": st.floats(0.1, 4.5),
    "cycle.period_us": st.floats(1.0, 20_000.0),
    "cycle.slice_ratio": st.floats(0.01, 1.0),
    "cycle.nonperiodic_us": st.floats(0.0, 500.0),
    "cycle.sync.ping_us": st.floats(0.0, 5.0),
    "cycle.sync.ping_per_node_us": st.floats(0.0, 5.0),
    "node.execution.base_us": st.floats(0.0, 100.0),
    "node.execution.per_byte_us": st.floats(0.0, 1.0),
    "node.execution.uncertainty_us": st.floats(0.0, 20.0),
    "node.execution.worst_extra_us": st.floats(0.0, 10.0),
    "host.transaction_us": st.one_of(st.just(0.0), st.floats(0.0, 60.0)),
    "host.uncertainty_us": st.floats(0.0, 10.0),
    "bus.phy_delay_us": st.floats(0.01, 0.2),
    "limits.reserve": st.floats(0.0, 0.9),
}
COUNTS: dict[str, st.SearchStrategy[Any]] = {
    "bus.nodes": st.integers(1, 80),
    "bus.max_hops": st.integers(1, 20),
    "bus.gap_count": st.one_of(st.integers(0, 63), st.just("optimal")),
    "payload.read_bytes": st.integers(4, 2500),
    "payload.write_bytes": st.integers(4, 2500),
    "payload.overhead_bytes": st.integers(0, 40),
    "node.axes": st.integers(1, 8),
    "cycle.retries": st.integers(0, 5),
    "node.execution.measured_gap_count": st.integers(0, 63),
}
WORDS = {
    "bus.cycle_master": st.booleans(),
    "node.read_response": st.sampled_from(["split", "concatenated"]),
    "node.write_response": st.sampled_from(["split", "unified"]),
    "node.execution.residual": st.sampled_from(["none", "paper", "standard"]),
    "node.execution.grade": st.sampled_from(["measured", "derived", "calibrated", "assumed"]),
}


def assert_rows_are_those_of_capacity(
    profile: busplan.Profile, vary: Mapping[str, Any], *, timing_model: str | None = None
) -> None:
    answer = busplan.sweep(profile, vary=vary, timing_model=timing_model)
    models = answer.to_dict()["timing_models"]
    rows = iter(answer.to_dict()["rows"])
    for changes in answer.sweep.grid.each_point():
        point = busplan.load_profile(profile, changes=changes)
        for result in busplan.capacity(point, timing_model=models).results:
            expected, row = {**changes, **result.by_key()}, next(rows)
            # Bit for bit: they are the same operations in the same order. As text, so that 4 is not 4.0.
            assert {key: repr(row[key]) for key in expected} == {key: repr(value) for key, value in expected.items()}
    assert not list(rows)


@settings(max_examples=at_least(6))
@given(data=st.data())
def test_every_row_equals_capacity_of_its_point(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    strategies = {**FLOATS, **COUNTS, **WORDS}
    if value_at(profile, "bus.isochronous_us"):
        del strategies["bus.cycle_master"]
    if data.draw(st.booleans()):
        changes = {"node.execution": TABLE, "payload.read_bytes": 4, "payload.write_bytes": 40}
        profile = busplan.load_profile(profile, changes=changes)
        strategies = {key: strategy for key, strategy in strategies.items() if not key.startswith("node.execution")}
    keys = data.draw(st.lists(st.sampled_from(sorted(strategies)), min_size=1, max_size=4, unique=True))
    vary = {key: data.draw(st.lists(strategies[key], min_size=1, max_size=4, unique=True)) for key in keys}
    assert_rows_are_those_of_capacity(profile, vary)


@settings(max_examples=at_least(4, 40))
@given(data=st.data(), nodes=st.integers(1, 20))
def test_points_that_fit_exactly_are_decided_as_capacity_decides_them(
    data: st.DataObject, nodes: int, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    figures = busplan.capacity(busplan.load_profile(profile, changes={"bus.nodes": nodes})).results
    drawn = data.draw(st.sampled_from(figures))
    exact_us, model = drawn.required_us / profile.cycle.slice_ratio, drawn.timing_model
    around = (
        exact_us,
        exact_us * (1 + 1e-12),
        exact_us * (1 - 1e-12),
        exact_us * (1 - 3e-12),
        np.nextafter(exact_us, 0),
    )
    vary = {
        "cycle.period_us": list(dict.fromkeys(float(us) for us in around)),
        "bus.nodes": [nodes],
        "bus.gap_count": [value_at(profile, "bus.gap_count")],
    }
    assert_rows_are_those_of_capacity(profile, vary, timing_model=model)


def test_a_grid_that_is_computed_in_pieces_is_one_table() -> None:
    # More points than are computed at once, before and behind the key that is cut; each line alone is in one piece.
    lines = {"cycle.nonperiodic_us": np.linspace(0, 1900, 6000)}
    gaps, nodes = [63, "optimal"], (1, 3, 17)
    whole = busplan.sweep(
        "paper-4ms", vary={"bus.gap_count": gaps, **lines, "bus.nodes": nodes}, timing_model="standard"
    )
    for gap in gaps:
        for number in nodes:
            here = (whole["bus.gap_count"] == str(gap)) & (whole["bus.nodes"] == number)
            point = busplan.load_profile("paper-4ms", changes={"bus.gap_count": gap, "bus.nodes": number})
            alone = busplan.sweep(point, vary=lines, timing_model="standard")
            for name in alone:
                np.testing.assert_array_equal(whole[name][here], alone[name], err_msg=name)


def test_what_no_profile_could_have_is_refused_in_the_profiles_own_words(make: Make) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"bus.nods": [1]}, "vary bus.nods: unknown key; did you mean nodes?"),
        ({"bsu.nodes": [1]}, "vary bsu.nodes: bsu: unknown key; did you mean bus?"),
        ({"node.execution": [1]}, "vary node.execution: is a section; expected the key of one number"),
        (
            {"node.execution.per_byte_us": [1]},
            'vary node.execution.per_byte_us: unknown key where kind is "table"; it is a key of kind = "linear"',
        ),
        ({"node.execution.time_us": [1]}, "vary node.execution.time_us: is a list"),
        ({"bus.nodes": [1, 0]}, "bus.nodes 0: must be 1 or more"),
        ({"bus.nodes": [1, 2.5]}, "bus.nodes 2.5: expected a whole number"),
        ({"bus.nodes": [*range(1, 200), 2.5]}, "bus.nodes 2.5: expected a whole number"),
        ({"bus.gap_count": range(200)}, "bus.gap_count 199: expected a whole number from 0 to 63"),
        ({"payload.read_bytes": range(4, 5004)}, "payload.read_bytes 5003: is outside the execution table"),
        ({"bus.speed": [1]}, "bus.speed 1: expected"),
        (
            {"limits.min_spare_nodes": [1]},
            "vary limits.min_spare_nodes: no figure of capacity depends on it",
        ),
        ({"servo.drive_lag_us": [1]}, "add circle to run circle tests"),
        (
            {"bus.gap_count": [63, "optimal"], "bus.cable_length_m": [4.5, 6.0]},
            "cable_length_m is 6",
        ),
        ({"cycle.period_us": range(1, 5000), "bus.nodes": range(1, 5000)}, "vary less"),
    ]
    for vary, message in cases:
        profile = busplan.load_profile(make(), changes={"node.execution": TABLE})
        with pytest.raises(busplan.BusplanError, match=re.escape(message)):
            busplan.sweep(profile, vary=vary)


def test_a_table_is_read_at_its_points_between_them_and_at_both_ends(make: Make) -> None:
    changes = {"node.execution": TABLE, "payload.read_bytes": 4, "payload.write_bytes": 4}
    profile = busplan.load_profile(make(), changes=changes)
    vary = {"payload.read_bytes": (4, 5, 15, 16, 17, 32, 33, 34, 2499, 2500), "payload.write_bytes": (2500, 4)}
    assert_rows_are_those_of_capacity(profile, vary)


def test_of_equal_terms_the_first_binds_as_in_capacity(make: Make) -> None:
    # One node, twice 100 us of execution, and 200 us for the rest: both terms are the largest.
    profile = make(bus__nodes=1, node__execution__base_us=100.0, node__execution__per_byte_us=0.0)
    vary = {"cycle.nonperiodic_us": (199, 200, 201)}
    binding = busplan.sweep(profile, vary=vary, timing_model="paper")["binding_term"]
    assert binding.tolist() == ["execution", "execution", "nonperiodic"]
    assert_rows_are_those_of_capacity(profile, vary)


# --- groups -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [pytest.param("dvrk", marks=pytest.mark.slow), "gantry-24"])
def test_a_machine_of_groups_has_numbers_of_the_largest_group(name: str) -> None:
    profile = busplan.load_profile(name)
    varied = max(profile.group, key=lambda group: group.nodes * group.axes)
    vary = {f"group.{profile.group[-1].name}.nodes": (1, 2), "cycle.period_us": (500, 2000)}
    answer = busplan.sweep(profile, vary=vary)
    assert answer.to_dict()["group"] == varied.name
    assert answer["safe_axes"].max() > 0
    for row in answer.to_dict()["rows"]:
        changes, key = {key: row[key] for key in vary}, f"group.{varied.name}.nodes"
        beside = row["nodes"] - row.get(key, varied.nodes)
        most, safe = (number - beside if number else 0 for number in (row["max_nodes"], row["safe_nodes"]))
        assert [row[f"group.{varied.name}.{limit}"] for limit in ("max_nodes", "limited_by")] == [
            most,
            row["limited_by"],
        ]
        # So many fit, or are shown to, and one more does not or is not.
        for number in (most, most + 1, safe, safe + 1):
            if number:
                own = busplan.load_profile(profile, changes={**changes, key: number})
                (one,) = busplan.capacity(own, timing_model="standard").results
                assert (one.fits, one.verdict == "fits" and one.safe) == (number <= most, number <= safe)
                assert number != most or row["max_axes"] == one.axes
                assert number != safe or row["safe_axes"] == one.axes


def test_keys_that_each_group_has_are_named() -> None:
    for key, own in (("payload.read_bytes", "read_bytes"), ("node.axes", "axes"), ("bus.nodes", "nodes")):
        with pytest.raises(busplan.BusplanError) as caught:
            busplan.sweep("dvrk", vary={key: [4]})
        assert str(caught.value) == (
            f"vary {key}: each group of dvrk has its own; give group.full.{own} or group.partial.{own}"
        )
