"""Every row of a sweep is what `capacity` gives for its point; grids come in order and in pieces."""

import re
from collections.abc import Callable, Mapping
from itertools import product
from math import prod
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.certainty import cycle_of
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import model_names
from busplan.questions.sweep import checked_sweep, computed
from busplan.questions.sweep.grid import Grid
from busplan.sections.profile import Profile

Make = Callable[..., Profile]

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
    profile: Profile,
    vary: Mapping[str, Any],
    *,
    chunk_points: int,
    model: str | None = None,
    circle: bool = False,
) -> None:
    asked = checked_sweep(
        profile,
        vary,
        timing_models=None if model is None else [model],
        group=None,
        circle=circle,
        summary=False,
        force=False,
    )
    with patch("busplan.questions.sweep.table.CHUNK_POINTS", chunk_points):
        rows = iter(computed(asked._replace(circle=False)).to_dict()["rows"])
    for changes in asked.grid.each_point():
        variant = override(profile, changes)
        for name in asked.timing_models:
            expected = {**changes, **figures(variant, model=name).by_key()}
            row = next(rows)
            # Bit for bit: they are the same operations in the same order. As text, so that 4 is not 4.0.
            assert {key: repr(row[key]) for key in expected} == {key: repr(one) for key, one in expected.items()}
    assert not list(rows)


@settings(max_examples=12)
@given(data=st.data())
def test_every_row_equals_capacity_of_its_point(data: st.DataObject, any_profile: st.SearchStrategy[Profile]) -> None:
    profile = data.draw(any_profile)
    strategies = {**FLOATS, **COUNTS, **WORDS}
    if profile.bus.isochronous_us:
        del strategies["bus.cycle_master"]
    if data.draw(st.booleans()):
        changes: dict[str, object] = {"node.execution": TABLE, "payload.read_bytes": 4, "payload.write_bytes": 40}
        profile = override(profile, changes)
        strategies = {key: one for key, one in strategies.items() if not key.startswith("node.execution")}
    keys = data.draw(st.lists(st.sampled_from(sorted(strategies)), min_size=1, max_size=4, unique=True))
    vary = {key: data.draw(st.lists(strategies[key], min_size=1, max_size=4, unique=True)) for key in keys}
    assert_rows_are_those_of_capacity(profile, vary, chunk_points=data.draw(st.integers(1, 40)))


@pytest.mark.parametrize(
    ("name", "key", "values"),
    [
        ("paper-4ms", "circle.feed_mm_per_min", (1000.0, 500_000.0)),
        ("can-servo-8", "bus.bit_rate_kbit_s", (500.0, 1000.0)),  # the bus adds jitter of its own
        ("sercos3-servo-8", "bus.master_jitter_us", (1.0, 400.0)),
        ("ethercat-servo-8", "bus.nodes", (2, 8)),
    ],
)
def test_a_circle_is_refused_at_the_points_where_capacity_refuses_it(
    name: str, key: str, values: tuple[float, ...]
) -> None:
    # Steps that divide a period and others; jitter that the period has room for, with that of the bus or without.
    vary = {
        "cycle.period_us": (1000.0, 1003.0, 8000.0),
        "servo.step_us": (25.0, 300.0),
        "delivery.jitter_us": (0.0, 460.0, 3900.0, 4100.0),
        key: values,
    }
    assert_rows_are_those_of_capacity(load(name).profile, vary, chunk_points=14, circle=True)


@given(data=st.data(), nodes=st.integers(1, 20))
def test_points_that_fit_exactly_are_decided_as_capacity_decides_them(
    data: st.DataObject, nodes: int, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    model = data.draw(st.sampled_from(model_names(profile)))
    ratio = profile.cycle.slice_ratio
    exact_us = float(cycle_of(profile, model=model, nodes=nodes).required_us) / ratio
    around = (
        exact_us,
        exact_us * (1 + 1e-12),
        exact_us * (1 - 1e-12),
        exact_us * (1 - 3e-12),
        np.nextafter(exact_us, 0),
    )
    vary = {
        "cycle.period_us": list(dict.fromkeys(float(one) for one in around)),
        "bus.nodes": [nodes],
        "bus.gap_count": [profile.bus.gap_count],
    }
    assert_rows_are_those_of_capacity(profile, vary, chunk_points=4, model=model)


@given(
    sizes=st.lists(st.integers(1, 5), min_size=1, max_size=4),
    most=st.integers(1, 60),
)
def test_chunks_cover_the_grid_in_row_major_order(sizes: list[int], most: int) -> None:
    grid = Grid({f"key{number}": np.arange(size) for number, size in enumerate(sizes)})
    points: list[tuple[int, ...]] = []
    for chunk in grid.chunks(most):
        assert prod(chunk.shape) <= most
        columns = [np.broadcast_to(own, chunk.shape).ravel().tolist() for own in chunk.values.values()]
        points += zip(*columns, strict=True)
    assert points == list(product(*(range(size) for size in sizes)))
    assert [tuple(point.values()) for point in grid.each_point()] == points
    assert grid.points == prod(sizes)


def test_what_no_profile_could_have_is_refused_in_the_profiles_own_words(make: Make) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"bus.nods": [1]}, "vary bus.nods: no such key of this profile; did you mean bus.nodes?"),
        ({"bsu.nodes": [1]}, "vary bsu.nodes: no such key of this profile; did you mean bus.nodes?"),
        ({"node.execution": [1]}, "vary node.execution: is a section; expected the key of one number"),
        (
            {"node.execution.per_byte_us": [1]},
            "known in node.execution are residual, measured_gap_count, grade, uncertainty_us, worst_extra_us, kind",
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
        profile = override(make(), {"node.execution": TABLE})
        with pytest.raises(BusplanError, match=re.escape(message)):
            busplan.sweep(profile, vary=vary)


def test_a_table_is_read_at_its_points_between_them_and_at_both_ends(make: Make) -> None:
    changes: dict[str, object] = {"node.execution": TABLE, "payload.read_bytes": 4, "payload.write_bytes": 4}
    profile = override(make(), changes)
    vary = {"payload.read_bytes": (4, 5, 15, 16, 17, 32, 33, 34, 2499, 2500), "payload.write_bytes": (2500, 4)}
    assert_rows_are_those_of_capacity(profile, vary, chunk_points=20)


def test_of_equal_terms_the_first_binds_as_in_capacity(make: Make) -> None:
    # One node, twice 100 us of execution, and 200 us for the rest: both terms are the largest.
    profile = make(bus__nodes=1, node__execution__base_us=100.0, node__execution__per_byte_us=0.0)
    vary = {"cycle.nonperiodic_us": (199, 200, 201)}
    binding = busplan.sweep(profile, vary=vary, timing_model="paper")["binding_term"]
    assert binding.tolist() == ["execution", "execution", "nonperiodic"]
    assert_rows_are_those_of_capacity(profile, vary, chunk_points=3)


# --- groups -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dvrk", "gantry-24"])
def test_a_machine_of_groups_has_numbers_of_the_largest_group_or_of_the_one_that_is_named(name: str) -> None:
    profile = load(name).profile
    by_name = {group.name: group for group in profile.group}
    largest = max(by_name.values(), key=lambda group: group.nodes * group.axes)
    vary = {f"group.{profile.group[-1].name}.nodes": (1, 2), "cycle.period_us": (100, 500, 1000, 2000)}
    for named in (None, *by_name):
        varied = by_name[named or largest.name]
        answer = busplan.sweep(profile, vary=vary, group=named)
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
                    one = figures(override(profile, {**changes, key: number}), model="standard")
                    assert (one.fits, one.verdict == "fits" and one.safe) == (number <= most, number <= safe)
                    assert number != most or row["max_axes"] == one.axes
                    assert number != safe or row["safe_axes"] == one.axes


def test_a_group_that_is_not_there_and_keys_that_each_group_has_are_named() -> None:
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("gantry-24", {"group": "arms"}, "group arms: gantry-24 has the groups drives, tool, io"),
        ("paper-4ms", {"group": "arms"}, "group arms: paper-4ms has no groups"),
    ]
    for name, options, message in cases:
        with pytest.raises(BusplanError, match=re.escape(message)):
            busplan.sweep(name, vary={"cycle.period_us": [500]}, **options)
    for key, own in (("payload.read_bytes", "read_bytes"), ("node.axes", "axes"), ("bus.nodes", "nodes")):
        with pytest.raises(BusplanError) as caught:
            busplan.sweep("dvrk", vary={key: [4]})
        assert str(caught.value) == (
            f"vary {key}: each group of dvrk has its own; give group.full.{own} or group.partial.{own}"
        )
