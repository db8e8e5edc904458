"""Every cell of a map is what `capacity` says of its setting; what cannot exist is no cell."""

import re
from itertools import islice, product
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.registers import at_least, some

AXES, PERIOD, TIME = "axes", "cycle.period_us", "time"
SHORTEST_US, LONGEST_US = 1e-3, 1e9
"""Ends of a period."""
PAPERS = ("paper-4ms", "paper-1ms", "paper-dma", "paper-optimal-gap", "paper-two-node")
PAPER = busplan.load_profile("paper-4ms")


def up(answer: busplan.MapAnswer) -> Any:
    """The vertical direction of a map of two keys."""
    assert answer.y is not None
    return answer.y


VALUES: dict[str, st.SearchStrategy[Any]] = {
    AXES: st.integers(0, 90),
    PERIOD: st.one_of(st.floats(1.0, 20_000.0), st.integers(0, 9)),
    "bus.nodes": st.integers(0, 80),
    "bus.gap_count": st.one_of(st.integers(0, 70), st.just("optimal")),
    "bus.max_hops": st.integers(0, 20),
    "bus.cycle_master": st.booleans(),
    "bus.cable_length_m": st.floats(0.1, 9.0),
    "cycle.slice_ratio": st.floats(0.01, 1.2),
    "node.axes": st.integers(0, 8),
    "payload.read_bytes": st.integers(4, 2500),
}


def at(profile: busplan.Profile, changes: dict[str, Any]) -> busplan.Profile | None:
    """The profile with other values, a number of axes among them; None if there is none."""
    axes = changes.pop(AXES, None)
    try:
        changed = busplan.load_profile(profile, changes=changes)
        if axes is None:
            return changed
        (group,) = changed.node_groups
        nodes, rest = divmod(axes, group.node.axes)
        return None if rest else busplan.load_profile(changed, changes={"bus.nodes": nodes})
    except busplan.BusplanError:
        return None


def is_drawn(cell: Any) -> bool:
    return hasattr(cell, "state")


def assert_cells_are_those_of_capacity(answer: busplan.MapAnswer, *, step: int = 1) -> None:
    """Each cell, or one in so many."""
    columns = len(answer.x.values)
    assert [len(row) for row in answer.rows] == [columns] * len(up(answer).values)
    for place, (y, x) in islice(enumerate(product(up(answer).values, answer.x.values)), 0, None, step):
        cell: Any = answer.rows[place // columns][place % columns]
        wanted = at(answer.profile, {answer.x.key: x, up(answer).key: y})
        assert (cell.x, cell.y) == (x, y)
        if wanted is None:
            assert cell in answer.not_drawn
            continue
        assert is_drawn(cell), cell
        (figures,) = busplan.capacity(wanted, timing_model="standard").results
        assert (cell.nodes, cell.axes, cell.verdict, cell.is_safe) == (
            figures.nodes,
            figures.axes,
            figures.verdict,
            figures.safe,
        )
        assert repr(cell.margin_corrected_us) == repr(figures.margin_corrected_us)
        assert repr(cell.uncertainty_us) == repr(figures.uncertainty_us)
        assert cell.binding_term == figures.binding_term
        assert cell.state == (figures.verdict if figures.safe or figures.verdict == "does not fit" else "unsafe")
        broken = tuple(key for key in figures.exceeded if key != TIME)
        limits = {
            "fits": (),
            "unsafe": ("gap table",),
            "not shown to fit": (TIME,),
            "does not fit": broken or (TIME,),
        }
        assert cell.reasons == limits[cell.state]


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_every_cell_is_what_capacity_says(data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]) -> None:
    profile = data.draw(any_profile)
    pairs = st.lists(st.sampled_from(sorted(VALUES)), min_size=2, max_size=2, unique=True)
    keys = data.draw(pairs.filter(lambda two: set(two) != {AXES, "bus.nodes"}))
    x, y = ({key: data.draw(st.lists(VALUES[key], min_size=1, max_size=4, unique=True))} for key in keys)
    try:
        answer = busplan.map_(profile, x=x, y=y)
    except busplan.BusplanError as error:
        assert str(error).startswith("no setting of this map can exist: ")  # noqa: PT017 - others are failures
        return
    assert_cells_are_those_of_capacity(answer)


@settings(max_examples=at_least(3, 24))
@given(data=st.data())
def test_the_default_map_has_this_design_and_a_longer_period_never_hurts(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    answer = busplan.map_(profile)
    assert (answer.x.key, up(answer).key) == (AXES, PERIOD)
    assert answer.design is not None
    (nodes,) = profile.node_groups
    assert (answer.design.x, answer.design.y) == (nodes.nodes * nodes.node.axes, profile.cycle.period_us)
    assert max(len(answer.x.values), len(up(answer).values)) <= 24
    assert list(up(answer).values) == sorted(set(up(answer).values))
    assert not answer.not_drawn
    for x in answer.x.values:
        fits = [cell.verdict == "fits" for cell in answer.cells if cell.x == x]
        assert fits == sorted(fits)
    assert_cells_are_those_of_capacity(answer, step=7)


@pytest.mark.parametrize("name", some(PAPERS, 2))
def test_the_edge_of_what_fits_is_in_the_picture(name: str) -> None:
    answer = busplan.map_(busplan.load_profile(name))
    assert {cell.state for cell in answer.cells} >= {"fits", "not shown to fit", "does not fit"}
    assert {cell.state for cell in answer.cells if cell.y == answer.profile.cycle.period_us} >= {"fits", "does not fit"}
    assert answer.regions[0].state == "fits"
    assert sum(region.cells for region in answer.regions) == len(answer.cells)


STRANGE = [
    ({"bus.gap_count": 13}, {"fits", "not shown to fit", "unsafe", "does not fit"}),
    ({"bus.nodes": 900, "bus.max_hops": 3}, {"fits", "not shown to fit", "does not fit"}),
    ({"bus.nodes": 1_000_000}, {"fits", "does not fit"}),
    ({"cycle.period_us": SHORTEST_US}, {"fits", "does not fit"}),
    ({"cycle.period_us": LONGEST_US}, {"fits", "not shown to fit", "does not fit"}),
    ({"cycle.slice_ratio": 1e-6}, {"fits", "does not fit"}),
    ({"cycle.nonperiodic_us": LONGEST_US}, {"does not fit"}),
    ({"limits.reserve": 0.99}, {"fits", "not shown to fit"}),
]


@pytest.mark.parametrize(("changes", "states"), some(STRANGE, 3))
def test_a_strange_design_has_a_map_with_its_edge_too(changes: dict[str, object], states: set[str]) -> None:
    answer = busplan.map_(busplan.load_profile(PAPER, changes=changes))
    assert answer.design is not None
    assert {cell.state for cell in answer.cells} == states
    assert max(len(answer.x.values), len(up(answer).values)) <= 24


def test_a_number_of_axes_that_no_nodes_have_is_not_drawn() -> None:
    answer = busplan.map_(PAPER, x={AXES: range(1, 9)}, y={"node.axes": (2, 3, 4)})
    drawn = [[is_drawn(cell) for cell in row] for row in answer.rows]
    assert drawn == [[axes % each == 0 for axes in range(1, 9)] for each in (2, 3, 4)]
    assert answer.not_drawn[0].reason == "axes = 1: no whole number of nodes, with 2 axes each"
    turned = busplan.map_(PAPER, x={"node.axes": (2, 3, 4)}, y={AXES: range(1, 9)})
    assert [[is_drawn(cell) for cell in row] for row in turned.rows] == [
        list(column) for column in zip(*drawn, strict=True)
    ]


GANTRY = busplan.load_profile("gantry-24")


def test_of_unlike_nodes_the_axes_are_by_the_group_that_has_the_most() -> None:
    answer = busplan.map_(GANTRY)
    assert answer.design is not None
    assert (answer.design.x, answer.design.y, answer.design.nodes) == (24, 2000, 6)
    # Four axes of the tool beside five of each drive.
    assert answer.x.values == tuple(4 + 5 * nodes for nodes in range(1, 17))
    assert {cell.state for cell in answer.cells} == {"fits", "not shown to fit", "does not fit"}
    for cell in answer.cells[::41]:
        changes: dict[str, object] = {"group.drives.nodes": (int(cell.x) - 4) // 5, PERIOD: cell.y}
        (figures,) = busplan.capacity(busplan.load_profile(GANTRY, changes=changes), timing_model="standard").results
        assert (cell.axes, cell.verdict, cell.margin_corrected_us) == (
            figures.axes,
            figures.verdict,
            figures.margin_corrected_us,
        )


def test_groups_are_directions_too() -> None:
    answer = busplan.map_(GANTRY, x={AXES: (8, 9, 18, 24)}, y={"group.tool.axes": (3, 4)})
    assert [[is_drawn(cell) for cell in row] for row in answer.rows] == [
        [True, False, True, False],
        [False, True, False, True],
    ]
    assert answer.not_drawn[0].reason == "axes = 9: no whole number of nodes, with 5 axes each beside 3 others"
    assert answer.design_place == (1, 3)
    with pytest.raises(busplan.BusplanError, match=r"both vary group\.drives\.nodes"):
        busplan.map_(GANTRY, x={AXES: (24,)}, y={"group.drives.nodes": (1, 2)})
    with pytest.raises(busplan.BusplanError, match=r"x bus\.nodes: "):
        busplan.map_(GANTRY, x={"bus.nodes": [1]})


def test_nodes_without_axes_are_counted_themselves() -> None:
    sizes = {f"group.{name}.{kind}_bytes": 8 for name in ("drives", "tool") for kind in ("read", "write")}
    still = busplan.load_profile(GANTRY, changes={"group.drives.axes": 0, "group.tool.axes": 0, **sizes})
    answer = busplan.map_(still)
    assert (answer.x.key, up(answer).key) == ("group.drives.nodes", PERIOD)
    assert answer.design is not None
    with pytest.raises(busplan.BusplanError, match="axes = 5: no whole number of nodes, with 0 axes each"):
        busplan.map_(still, x={AXES: (5,)})


def test_a_combination_that_the_schema_refuses_is_not_drawn() -> None:
    x, y = {"bus.gap_count": (63, 64, "optimal")}, {"bus.cable_length_m": (4.5, 9.0)}
    answer = busplan.map_(PAPER, x=x, y=y)
    assert [[is_drawn(cell) for cell in row] for row in answer.rows] == [
        [True, False, True],
        [True, False, False],
    ]
    assert "bus.gap_count 64: expected a whole number from 0 to 63" in answer.not_drawn[0].reason
    assert "the table behind it holds for cables of up to 4.5 m" in answer.not_drawn[2].reason


def test_y_alone_chooses_x() -> None:
    assert busplan.map_(PAPER, y={"bus.nodes": (1, 2)}).x.key == PERIOD
    assert busplan.map_(PAPER, y={"bus.gap_count": (63,)}).x.key == AXES


def test_a_design_with_other_values_is_not_on_its_map() -> None:
    answer = busplan.map_(PAPER, x={"bus.gap_count": (7, 10)})
    assert (answer.design, answer.design_place) == (None, None)
    beside = busplan.map_(PAPER, x={"bus.gap_count": (7, 63)}, y={PERIOD: (1000, 4000)})
    assert beside.design_place == (1, 1)


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        ({AXES: (8,)}, {"bus.nodes": (2,)}, "x = axes and y = bus.nodes both vary bus.nodes"),
        ({PERIOD: (8,)}, {PERIOD: (9,)}, "both vary cycle.period_us; give two keys"),
        ({AXES: (1, 2, 3)}, None, "no setting of this map can exist: axes = 1: no whole number of nodes"),
        ({AXES: (0,)}, None, "no setting of this map can exist: axes = 0: no whole number of nodes"),
        ({"bus.gap_count": (64,)}, None, "no setting of this map can exist: bus.gap_count 64"),
    ],
)
def test_a_map_of_nothing_is_refused(x: dict[str, Any], y: dict[str, Any] | None, message: str) -> None:
    with pytest.raises(busplan.BusplanError, match=re.escape(message)):
        busplan.map_(PAPER, x=x, y=y)


def test_a_direction_is_sorted_and_has_no_more_values_than_gap_counts() -> None:
    assert up(busplan.map_(PAPER, y={PERIOD: [500.0, 0.5, 4000]})).values == (0.5, 500, 4000)
    assert busplan.map_(PAPER, x={"bus.speed": ["S400", "S100"]}).x.values == ("S400", "S100")
    assert len(busplan.map_(PAPER, x={"bus.gap_count": range(64)}, y={PERIOD: [4000]}).x.values) == 64
    for x, message in (
        ({"bus.nodes": range(1, 66)}, "x bus.nodes: 65 values; a map shows up to 64 of a key"),
        ({"bus.node": [1]}, "x bus.node: unknown key; did you mean nodes?"),
        ({"circle.radius_mm": [1]}, "add circle to run circle tests"),
    ):
        with pytest.raises(busplan.BusplanError, match=re.escape(message)):
            busplan.map_(PAPER, x=x)


# --- circles ----------------------------------------------------------------------------------------------

ROUND = {"circle.radius_mm": 20, "circle.ramp_periods": 5, "circle.feed_mm_per_min": 4000}
SMALL = busplan.load_profile(PAPER, changes={**ROUND, "tolerance": {"mean_contour_error_mm": 0.0118}})
"""A circle that passes from some period on: at 2 ms the mean error is 0.01192 mm, at 4 ms 0.01171 mm."""


def test_circles_are_run_where_the_bus_fits_and_nowhere_else() -> None:
    x, y = {"bus.nodes": (1, 2, 3, 17)}, {PERIOD: (500, 1000, 4000)}
    done: list[tuple[int, int]] = []
    plain = busplan.map_(SMALL, x=x, y=y)
    answer = busplan.map_(SMALL, x=x, y=y, circle=True, progress=lambda *counts: done.append(counts))
    assert {cell.state for cell in answer.cells} == {"fits", "circle fails", "does not fit"}
    for cell, before in zip(answer.cells, plain.cells, strict=True):
        if before.state != "fits":
            assert cell == before
            continue
        changes: dict[str, object] = {"bus.nodes": cell.x, PERIOD: cell.y}
        (result,) = busplan.circle_test(busplan.load_profile(SMALL, changes=changes)).results
        assert cell.circle_passed == result.passed
        assert cell.state == ("fits" if result.passed else "circle fails")
        assert cell.reasons == tuple(failure.name for failure in result.failures)
    fitting = sum(cell.state == "fits" for cell in plain.cells)
    assert done[-1] == (fitting, fitting)


def test_what_no_tolerance_judges_and_what_cannot_be_simulated_is_said() -> None:
    y = {"circle.feed_mm_per_min": (4000, 500_000)}
    free = busplan.load_profile(SMALL, changes={"tolerance": {}})
    answer = busplan.map_(free, x={"bus.nodes": (2,)}, y=y, circle=True)
    assert [cell.state for cell in answer.cells] == ["circle not judged", "circle cannot be run"]
    assert [cell.reasons for cell in answer.cells] == [(), ("circle.feed_mm_per_min",)]
    judged = busplan.map_(SMALL, x={"bus.nodes": (2,)}, y=y, circle=True)
    assert [cell.circle_passed is None for cell in judged.cells] == [False, True]


@pytest.mark.slow
def test_too_many_circles_are_refused_before_any_is_run() -> None:
    y = {PERIOD: range(8000, 14400, 100)}
    with pytest.raises(busplan.BusplanError, match="1,024 settings fit, and a map runs up to 1,000 circle tests"):
        busplan.map_(SMALL, x={"bus.nodes": range(1, 21)}, y=y, circle=True)


def test_one_key_gives_the_curve_of_the_free_time() -> None:
    measured = {f"group.{group.name}.execution.grade": "measured" for group in GANTRY.group}
    gantry = busplan.load_profile(GANTRY, changes=measured)
    answer = busplan.map_(gantry, x={"cycle.period_us": [500, 1000, 2000]})
    assert answer.y is None
    assert answer.design is answer.rows[0][2]
    for cell, period_us in zip(answer.cells, (500, 1000, 2000), strict=True):
        (deciding,) = busplan.capacity(gantry, period_us=period_us, timing_model="standard").results
        assert (cell.verdict, cell.margin_corrected_us, cell.available_us) == (
            deciding.verdict,
            deciding.margin_corrected_us,
            deciding.available_us,
        )
    document = answer.to_dict()
    assert (document["y"], [cell["cycle.period_us"] for cell in document["cells"]]) == (None, [500, 1000, 2000])
    lines = str(answer).splitlines()
    assert [line.split("  ")[0] for line in lines[-3:]] == ["500 us", "1 ms", "2 ms"]
    plot: Any = answer.drawing().panels[0].plot
    curve = plot.curves[0]
    assert curve.points == tuple(
        zip((500.0, 1000.0, 2000.0), (cell.margin_corrected_us for cell in answer.cells), strict=True)
    )
    assert [(shade.entry.words, shade.low, shade.high) for shade in plot.shades] == [
        ("does not fit", 500, 750),
        ("not shown to fit", 750, 1500),
    ]


def test_words_of_one_key_are_points_without_a_line() -> None:
    plot: Any = busplan.map_("paper-4ms", x={"bus.gap_count": [63, "optimal"]}).drawing().panels[0].plot
    assert [tick.label for tick in plot.across.ticks] == ["63", "optimal"]
    assert not any(curve.has_line for curve in plot.curves)


def test_one_key_of_messages_alone_has_verdicts(tmp_path: Path) -> None:
    path = tmp_path / "messages.toml"
    message = 'name = "a"\nidentifier = 1\npayload_bytes = 8\nperiod_us = 5000\n'
    path.write_text(
        f'schema_version = 1\nname = "car"\n[bus]\nkind = "can"\nbit_rate_kbit_s = 125\n[[message]]\n{message}',
        encoding="utf-8",
    )
    answer = busplan.map_(path, x={"bus.bit_rate_kbit_s": [10, 125]})
    assert [cell.verdict for cell in answer.cells] == ["does not fit", "fits"]
    assert [cell.margin_corrected_us for cell in answer.cells] == [None, None]
    assert str(answer).splitlines()[-1].split() == ["125", "fits"]
