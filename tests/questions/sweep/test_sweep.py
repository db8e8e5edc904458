"""Every row of a sweep is what `capacity` gives for its point; grids come in order and in pieces."""

import re
from collections.abc import Callable
from itertools import product
from math import prod
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.certainty import cycle_of
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, model_names
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import figure_names, sweep
from busplan.questions.sweep.circle_run import require_circles
from busplan.questions.sweep.execution import Work
from busplan.questions.sweep.grid import Chunk, Even, Grid, Listed, Steps, Values, checked_grid, grid_models
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
    profile: Profile, grid: Grid, *, chunk_points: int, model: str | None = None
) -> None:
    points = 0
    models = grid_models(profile, grid, None if model is None else (model,), name="--timing")
    sorts = {figure.key: figure.sort for figure in bus_of(profile).figures.capacity}

    def written(name: str, wanted: object) -> str:
        # A number that a timing model does not have is NaN in an array.
        return "nan" if wanted is None and sorts[name] in ("number", "count") else repr(wanted)

    for block in sweep(profile, grid, timing_models=models, chunk_points=chunk_points):
        assert block.chunk.start == points
        points += block.chunk.points
        for index in range(block.chunk.points):
            variant = override(profile, block.chunk.point(index))
            for number, each in enumerate(models):
                expected = figures(variant, model=each)
                row = block.row(len(models) * index + number, figure_names(profile))
                # Bit for bit: they are the same operations in the same order. As text, so that 4 is not 4.0.
                assert {name: repr(found) for name, found in row.items()} == {
                    name: written(name, list(wanted) if name == "exceeded" else wanted)
                    for name, wanted in expected.by_key().items()
                }
    assert points == grid.points


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
    axes: dict[str, Values] = {
        key: Listed(tuple(data.draw(st.lists(strategies[key], min_size=1, max_size=4, unique=True)))) for key in keys
    }
    grid = checked_grid(profile, axes, with_circle=False)
    assert_rows_are_those_of_capacity(profile, grid, chunk_points=data.draw(st.integers(1, 40)))


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
    axes: dict[str, Values] = {
        "cycle.period_us": Listed((1000.0, 1003.0, 8000.0)),
        "servo.step_us": Listed((25.0, 300.0)),
        "delivery.jitter_us": Listed((0.0, 460.0, 3900.0, 4100.0)),
        key: Listed(values),
    }
    profile = load(name).profile
    assert_rows_are_those_of_capacity(profile, checked_grid(profile, axes, with_circle=True), chunk_points=14)


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
    axes: dict[str, Values] = {
        "cycle.period_us": Listed(tuple(dict.fromkeys(float(one) for one in around))),
        "bus.nodes": Listed((nodes,)),
        "bus.gap_count": Listed((profile.bus.gap_count,)),
    }
    grid = checked_grid(profile, axes, with_circle=False)
    assert_rows_are_those_of_capacity(profile, grid, chunk_points=4, model=model)


@given(
    sizes=st.lists(st.integers(1, 5), min_size=1, max_size=4),
    most=st.integers(1, 60),
)
def test_chunks_cover_the_grid_in_row_major_order(sizes: list[int], most: int) -> None:
    grid = Grid({f"key{number}": Steps(0, 1, 1, size) for number, size in enumerate(sizes)})
    points: list[tuple[object, ...]] = []
    for chunk in grid.chunks(most):
        assert chunk.points <= most
        assert chunk.start == len(points)
        points += [tuple(chunk.point(index).values()) for index in range(chunk.points)]
    assert points == list(product(*(range(size) for size in sizes)))
    assert grid.points == prod(sizes)


def test_steps_are_exact_decimals() -> None:
    # 0.1 + 2 * 0.1 is not the float 0.3; a third of a slice ratio must be what was typed.
    assert Steps(1, 1, 10, 3).part(0, 3).tolist() == [0.1, 0.2, 0.3]
    assert Steps(5, 2, 1, 3).part(1, 3).tolist() == [7, 9]
    assert Even(0.1, 0.7, 4).part(0, 4)[[0, 3]].tolist() == [0.1, 0.7]


def test_a_chunk_of_a_huge_axis_is_no_larger_than_asked() -> None:
    chunk = next(iter(Grid({"a": Steps(0, 1, 1, 10**9), "b": Steps(0, 1, 1, 10**5)}).chunks(1000)))
    assert isinstance(chunk, Chunk)
    assert chunk.shape == (1, 1000)


def test_what_no_profile_could_have_is_refused_in_the_profiles_own_words(make: Make) -> None:
    cases: list[tuple[dict[str, Values], str]] = [
        ({"bus.nods": Listed((1,))}, "--vary bus.nods: no such key of this profile; did you mean bus.nodes?"),
        ({"bsu.nodes": Listed((1,))}, "--vary bsu.nodes: no such key of this profile; did you mean bus.nodes?"),
        ({"node.execution": Listed((1,))}, "--vary node.execution: is a section; expected the key of one number"),
        (
            {"node.execution.per_byte_us": Listed((1,))},
            "known in node.execution are residual, measured_gap_count, grade, uncertainty_us, worst_extra_us, kind",
        ),
        ({"node.execution.time_us": Listed((1,))}, "--vary node.execution.time_us: is a list"),
        ({"bus.nodes": Listed((1, 0))}, "bus.nodes 0: must be 1 or more"),
        ({"bus.nodes": Listed((1, 2.5))}, "bus.nodes 2.5: expected a whole number"),
        ({"bus.nodes": Listed((*range(1, 200), 2.5))}, "bus.nodes 2.5: expected a whole number"),
        ({"bus.gap_count": Steps(0, 1, 1, 200)}, "bus.gap_count 199: expected a whole number from 0 to 63"),
        ({"payload.read_bytes": Steps(4, 1, 1, 5000)}, "payload.read_bytes 5003: is outside the execution table"),
        ({"bus.speed": Listed((1,))}, "bus.speed 1: expected"),
        (
            {"limits.min_spare_nodes": Listed((1,))},
            "--vary limits.min_spare_nodes: no figure of capacity depends on it",
        ),
        ({"servo.drive_lag_us": Listed((1,))}, "add --circle to run circle tests"),
        (
            {"bus.gap_count": Listed((63, "optimal")), "bus.cable_length_m": Listed((4.5, 6.0))},
            "cable_length_m is 6",
        ),
        ({"cycle.period_us": Steps(1, 1, 1, 10**7), "bus.nodes": Steps(1, 1, 1, 10**6)}, "vary less"),
    ]
    for axes, message in cases:
        profile = override(make(), {"node.execution": TABLE})
        with pytest.raises(BusplanError, match=re.escape(message)):
            checked_grid(profile, axes, with_circle=False)


def test_a_table_is_read_at_its_points_between_them_and_at_both_ends(make: Make) -> None:
    changes: dict[str, object] = {"node.execution": TABLE, "payload.read_bytes": 4, "payload.write_bytes": 4}
    profile = override(make(), changes)
    axes: dict[str, Values] = {
        "payload.read_bytes": Listed((4, 5, 15, 16, 17, 32, 33, 34, 2499, 2500)),
        "payload.write_bytes": Listed((2500, 4)),
    }
    assert_rows_are_those_of_capacity(profile, checked_grid(profile, axes, with_circle=False), chunk_points=20)


def test_of_equal_terms_the_first_binds_as_in_capacity(make: Make) -> None:
    # One node, twice 100 us of execution, and 200 us for the rest: both terms are the largest.
    profile = make(bus__nodes=1, node__execution__base_us=100.0, node__execution__per_byte_us=0.0)
    axes: dict[str, Values] = {"cycle.nonperiodic_us": Listed((199, 200, 201))}
    (block,) = sweep(profile, checked_grid(profile, axes, with_circle=False), timing_models=("paper",))
    assert [block.row(index, ["binding_term"])["binding_term"] for index in range(3)] == [
        "execution",
        "execution",
        "nonperiodic",
    ]
    assert_rows_are_those_of_capacity(profile, Grid(axes), chunk_points=3)


def test_a_long_sweep_of_circles_says_what_it_costs_before_it_runs(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    big = make(
        circle={"radius_mm": 10_000.0, "feed_mm_per_min": 3000.0, "ramp_periods": 20},
        cycle__period_us=2000.0,
        servo={"step_us": 50.0},
    )
    # 25,133,560 steps of each axis at 2 ms, which take about 5 s; where the cycle does not fit, nothing is simulated.
    two = checked_grid(big, {"cycle.period_us": Listed((2000, 100))}, with_circle=True)
    require_circles(Sweep(big, two, (), ()), Work())
    assert caplog.messages == []
    three = checked_grid(big, {"delivery.seed": Listed((1, 2, 3))}, with_circle=True)
    require_circles(Sweep(big, three, (), ()), Work())
    (said,) = caplog.messages
    assert said.startswith("circle test: 150,801,360 steps, about ")
    # The memory of one: they run one behind the other.
    assert " and 0.58 GB" in said
