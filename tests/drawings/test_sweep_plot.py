"""The picture of a sweep: choices are categories, zero is in the middle of its colours, units and words are there."""

from collections.abc import Sequence
from typing import Any

import pytest

from busplan.analysis.sweep.axis_values import listed, stepped
from busplan.analysis.sweep.blocks import sweep
from busplan.analysis.sweep.grid import Values, checked_grid
from busplan.drawings.sweep_plot import FigureData
from busplan.drawings.sweep_scales import key_label, plot_scale, plotted_figure
from busplan.drawings.sweep_words import Plotted, caption
from busplan.profile.shipped import load
from busplan.profile.toml import override

pytest.importorskip("matplotlib")
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from busplan.drawings.sweep_panels import draw_curves, draw_maps

PAPER = load("paper-4ms").profile
MODELS = ("paper", "standard")


def values(given: Sequence[Any] | range) -> Values:
    if isinstance(given, range):
        return stepped(given, name="vary")
    return listed(list(given), name="vary", words=("optimal",))


def added(figure: str, profile: Any = PAPER, **vary: Any) -> FigureData:
    grid = checked_grid(profile, {key.replace("__", "."): values(one) for key, one in vary.items()}, with_circle=False)
    data = FigureData(profile, grid, figure=figure, timing_models=MODELS)
    for block in sweep(profile, grid, timing_models=MODELS, chunk_points=7):
        data.add(block)
    return data


def plotted(figure: str, profile: Any = PAPER, **vary: Any) -> Plotted:
    return added(figure, profile, **vary).plotted()


def drawn(one: Plotted) -> Any:
    figure = Figure()
    (draw_maps if len(one.scales) == 2 else draw_curves)(figure, one)
    return figure


@pytest.mark.parametrize("vary", [{"bus__nodes": (1, 2)}, {"bus__gap_count": (7, 63), "cycle__period_us": (250, 4000)}])
def test_the_same_sweep_draws_the_same_bytes(vary: dict[str, Any]) -> None:
    data = added("margin_us", **vary)
    assert data.draw("x", file_format="png") == data.draw("x", file_format="png")


@pytest.mark.parametrize("given", [(5, 7, 63), (63, "optimal"), ("optimal",), range(5, 64)])
def test_gap_counts_are_categories(given: Any) -> None:
    scale = plot_scale(PAPER, "bus.gap_count", values(given), as_cells=False)
    assert scale.places.tolist() == list(range(len(given)))
    assert scale.labels == tuple(map(str, given))
    assert scale.own == (scale.labels.index("63") if "63" in scale.labels else None)
    places, names = scale.marks
    assert [scale.labels[one] for one in places] == names
    assert len(places) <= 16


def test_no_line_joins_choices_and_a_line_joins_numbers() -> None:
    (axes,) = drawn(plotted("margin_us", bus__gap_count=(5, 63, "optimal"))).axes
    assert [line.get_linestyle() for line in axes.lines[:1]] == ["None"]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["5", "63", "optimal"]
    assert axes.get_xlim() == (-0.5, 2.5)
    (axes,) = drawn(plotted("margin_us", bus__nodes=range(1, 7))).axes
    assert [line.get_linestyle() for line in axes.lines[:2]] == ["-", "--"]


@pytest.mark.parametrize("nodes", [range(1, 4), range(1, 7), range(1, 40)])
def test_whole_numbers_have_whole_ticks(nodes: range) -> None:
    (axes,) = drawn(plotted("max_nodes", bus__nodes=nodes)).axes
    for ticks in (axes.get_xticks(), axes.get_yticks()):
        assert all(float(one).is_integer() for one in ticks)


def test_uneven_numbers_are_equal_cells_and_a_true_scale_of_a_curve() -> None:
    periods = values([250, 500, 1000, 4000])
    assert plot_scale(PAPER, "cycle.period_us", periods, as_cells=True).labels == ("250", "500", "1000", "4000")
    curve = plot_scale(PAPER, "cycle.period_us", periods, as_cells=False)
    assert (curve.labels, curve.places.tolist(), curve.own) == ((), [250, 500, 1000, 4000], 4000)
    assert plot_scale(PAPER, "cycle.period_us", values([4000, 250]), as_cells=False).labels == ("4000", "250")
    assert plot_scale(PAPER, "cycle.period_us", values([250, 500]), as_cells=False).own is None


def test_colours_of_a_margin_have_zero_in_their_middle() -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=range(250, 1001, 250))
    figure = drawn(one)
    for axes in figure.axes[:2]:
        (mesh,) = (each for each in axes.collections if isinstance(each, QuadMesh))
        assert isinstance(mesh.norm, TwoSlopeNorm)
        assert mesh.norm(0.0) == 0.5
        assert (mesh.norm.vmin, mesh.norm.vmax) == (
            min(panel.values.min() for panel in one.panels),
            max(panel.values.max() for panel in one.panels),
        )
    # Without a margin below zero, none looks like one.
    (mesh, *_) = drawn(plotted("margin_us", bus__nodes=(1, 2), cycle__period_us=(2000, 4000))).axes[0].collections
    assert mesh.norm(1.0) > 0.5
    (mesh, *_) = drawn(plotted("max_nodes", bus__nodes=(1, 2), cycle__period_us=(250, 4000))).axes[0].collections
    assert not isinstance(mesh.norm, TwoSlopeNorm)


def test_the_line_parts_the_cells_of_zero_or_more_from_the_others() -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63, "optimal"), cycle__period_us=range(250, 2001, 250))
    figure = drawn(one)
    for axes, panel in zip(figure.axes[:2], one.panels, strict=True):
        (border,) = (each for each in axes.collections if isinstance(each, LineCollection))
        segments = {tuple(map(tuple, each.tolist())) for each in border.get_segments()}
        fits = panel.values >= 0
        expected = set()
        x, y = [125 + 250 * step for step in range(9)], [step - 0.5 for step in range(4)]
        for row in range(3):
            for column in range(8):
                if column < 7 and fits[row, column] != fits[row, column + 1]:
                    expected.add(((x[column + 1], y[row]), (x[column + 1], y[row + 1])))
                if row < 2 and fits[row, column] != fits[row + 1, column]:
                    expected.add(((x[column], y[row + 1]), (x[column + 1], y[row + 1])))
        assert segments == expected
        assert segments


def test_unsafe_points_and_this_design_are_marked() -> None:
    one = plotted("margin_us", bus__gap_count=(5, 7, 63), cycle__period_us=(250, 4000))
    figure = drawn(one)
    for axes in figure.axes[:2]:
        crossed = [line.get_data() for line in axes.lines if line.get_marker() == "x"]
        assert {place for x, y in crossed for place in zip(x, y, strict=True)} == {(250, 0), (4000, 0)}
        (ring, _) = (line for line in axes.lines if line.get_marker() == "o")
        assert [list(each) for each in ring.get_data()] == [[4000], [2]]
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert said == ["margin of 0", "unsafe gap count", "this design"]
    (axes,) = drawn(plotted("margin_us", bus__gap_count=(5, 63))).axes
    assert [list(line.get_xdata()) for line in axes.lines if line.get_marker() == "x"] == [[0], [0]]


def test_another_design_is_not_marked_as_this_one() -> None:
    one = plotted("margin_us", bus__nodes=range(1, 9), cycle__period_us=(1000,))
    assert [scale.own for scale in one.scales] == [None]
    assert "this design" not in caption(one)


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("cycle.period_us", "period T_s, us"),
        ("bus.nodes", "nodes N"),
        ("bus.gap_count", "gap count"),
        ("bus.slice_ratio", "bus slice ratio"),
        ("node.axes", "node axes"),
        ("payload.read_bytes", "payload read, bytes"),
        ("servo.position_gain_per_s", "servo position gain per s"),
        ("circle.feed_mm_per_min", "circle feed, mm/min"),
        ("group.gantry.nodes", "group gantry nodes"),
    ],
)
def test_keys_are_said_in_words_with_their_unit(key: str, label: str) -> None:
    assert key_label(PAPER, key) == label


def test_figures_are_drawn_in_the_unit_of_their_label() -> None:
    assert plotted_figure(PAPER, "margin_us")[1] == 1
    one = plotted("utilisation", bus__nodes=(1, 2))
    assert one.label == "utilisation, %"
    assert one.panels[0].values.tolist() == pytest.approx([100 * 102.955 / 2000, 10.356], abs=0.001)
    figure, factor = plotted_figure(PAPER, "max_contour_error_mm")
    assert (figure.column, factor) == ("um", 1000)


@pytest.mark.parametrize(
    ("figure", "vary", "said"),
    [
        (
            "margin_us",
            {"cycle__period_us": (250, 500, 4000)},
            (
                "A margin of 0 or more in 1 of 3 settings by the standard model, on one side of the dashed line; "
                "this design has 1737 us."
            ),
        ),
        (
            "safe_axes",
            {"bus__gap_count": (63, "optimal")},
            "Safe axes by the standard model: 52 to 56; this design has 52.",
        ),
        ("safe_axes", {"cycle__period_us": (500, 1000)}, "Safe axes by the standard model: 4 to 12."),
        ("max_nodes", {"bus__nodes": (1, 2)}, "Most nodes by the standard model: 13; this design has 13."),
    ],
)
def test_the_caption_says_what_to_see(figure: str, vary: dict[str, Any], said: str) -> None:
    assert caption(plotted(figure, **vary)) == said


def test_a_figure_that_no_model_has_is_said() -> None:
    quiet = override(PAPER, {"bus.nodes": 2})
    one = plotted("margin_us", quiet, bus__nodes=(1, 2))
    empty = one._replace(panels=())
    assert caption(empty) == "No timing model gives margin here."
    assert drawn(empty).axes
