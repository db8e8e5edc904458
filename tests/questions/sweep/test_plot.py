"""The picture of a sweep: choices are categories, colours part at zero, units and words are there."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import busplan
from busplan.forms.charts import Curves, Drawing, Grid, legend
from busplan.forms.picture import INKS
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.network import network_of
from busplan.questions.sweep.grid import Array, axis_of
from busplan.questions.sweep.panels import sweep_drawing
from busplan.questions.sweep.plot import FigureData
from busplan.questions.sweep.plotted import Plotted, caption, key_label, plot_scale, plotted_figure

PAPER = load("paper-4ms").profile
MODELS = ("paper", "standard")


def values(given: Sequence[Any] | range) -> Array:
    return axis_of(list(given))


def plotted(figure: str | None, profile: Any = PAPER, **vary: Any) -> Plotted:
    own = {key.replace("__", "."): one for key, one in vary.items()}
    answer = busplan.sweep(profile, vary=own, timing_model=MODELS)
    return FigureData(answer.sweep, answer.table, figure=figure).plotted()


def drawn(one: Plotted) -> Drawing:
    return sweep_drawing(one, title="x")


def curves(one: Plotted) -> Curves:
    (panel,) = drawn(one).panels
    assert isinstance(panel.plot, Curves)
    return panel.plot


def grids(one: Plotted) -> list[Grid]:
    return [panel.plot for panel in drawn(one).panels if isinstance(panel.plot, Grid)]


def words(one: Plotted) -> list[str]:
    return [entry.words for entry in legend(drawn(one).panels)]


@pytest.mark.parametrize("given", [(63, "optimal"), ("optimal",), (63, 7)])
def test_words_and_numbers_among_them_are_categories(given: Any) -> None:
    scale = plot_scale(PAPER, "bus.gap_count", values(given), as_cells=False)
    assert scale.places.tolist() == list(range(len(given)))
    assert scale.labels == tuple(map(str, given))
    assert scale.own == (scale.labels.index("63") if "63" in scale.labels else None)


def test_no_line_joins_choices_and_a_line_joins_numbers() -> None:
    plot = curves(plotted("margin_us", bus__gap_count=(5, 63, "optimal")))
    assert not any(curve.has_line for curve in plot.curves)
    assert all(curve.has_dots for curve in plot.curves)
    assert [tick.label for tick in plot.across.ticks] == ["5", "63", "optimal"]
    assert all(curve.has_line for curve in curves(plotted("margin_us", bus__nodes=range(1, 7))).curves)


def test_points_stand_at_their_values_and_this_design_at_its_own() -> None:
    one = plotted("margin_us", cycle__period_us=(250, 500, 1000, 4000))
    plot = curves(one)
    assert [curve.entry.words for curve in plot.curves] == ["paper model", "standard model"]
    assert len({curve.entry.mark for curve in plot.curves}) == 2
    for curve, panel in zip(plot.curves, one.panels, strict=True):
        assert curve.points == tuple(zip((250, 500, 1000, 4000), panel.values, strict=True))
    assert {guide.entry.words: (guide.x, guide.y) for guide in plot.guides} == {
        "margin of 0": (None, 0.0),
        "this design": (4000.0, None),
    }


def test_a_curve_has_a_gap_where_a_value_is_missing() -> None:
    one = plotted("margin_us", bus__nodes=range(1, 7))
    one.panels[0].values[2] = float("nan")
    missing = [number for number, (_, y) in enumerate(curves(one).curves[0].points) if y is None]
    assert missing == [2]


@pytest.mark.parametrize("nodes", [(2,), range(1, 4), range(1, 7), range(1, 40)])
def test_whole_numbers_have_whole_ticks(nodes: Any) -> None:
    plot = curves(plotted("max_nodes", bus__nodes=nodes))
    assert all(tick.label.lstrip("-").isdigit() for tick in (*plot.up.ticks, *plot.across.ticks))


def test_many_points_are_a_curve_without_marks() -> None:
    (curve, _) = curves(plotted("margin_us", cycle__nonperiodic_us=range(250))).curves
    assert (len(curve.points), curve.has_dots) == (250, False)


def test_uneven_numbers_are_equal_cells_and_a_true_scale_of_a_curve() -> None:
    periods = values([250, 500, 1000, 4000])
    assert plot_scale(PAPER, "cycle.period_us", periods, as_cells=True).labels == ("250", "500", "1000", "4000")
    curve = plot_scale(PAPER, "cycle.period_us", periods, as_cells=False)
    assert (curve.labels, curve.places.tolist(), curve.own) == ((), [250, 500, 1000, 4000], 4000)
    assert plot_scale(PAPER, "cycle.period_us", values([4000, 250]), as_cells=False).labels == ("4000", "250")
    assert plot_scale(PAPER, "cycle.period_us", values([250, 500]), as_cells=False).own is None


def test_colours_of_a_margin_are_red_below_zero_and_blue_from_it_on() -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=range(250, 1001, 50))
    for grid, panel in zip(grids(one), one.panels, strict=True):
        looks = sorted(
            (value, cell.ink)
            for values, row in zip(panel.values, grid.rows, strict=True)
            for value, cell in zip(values, row, strict=True)
            if cell
        )
        assert all(ink.startswith("above" if value >= 0 else "below") for value, ink in looks)
        # Farther from zero is stronger, on either side.
        for side in ([ink for value, ink in looks if value < 0][::-1], [ink for value, ink in looks if value >= 0]):
            assert side == sorted(side)
    # Without a margin below zero, none looks like one.
    (grid, _) = grids(plotted("margin_us", bus__nodes=(1, 2), cycle__period_us=(2000, 4000)))
    assert all(cell.ink.startswith("above") for row in grid.rows for cell in row if cell)


@pytest.mark.parametrize("figure", ["margin_us", "max_axes", "utilisation"])
def test_each_colour_is_explained_by_the_values_that_it_stands_for(figure: str) -> None:
    one = plotted(figure, bus__nodes=range(1, 9), cycle__period_us=range(250, 8001, 250))
    (grid, *_) = grids(one)
    ranges = {
        entry.ink: tuple(map(float, entry.words.removesuffix(" us").removesuffix("%").split(" to ")))
        for entry in grid.legend
        if entry.ink in INKS
    }
    assert len(ranges) > 3
    ends = sorted(ranges.values())
    for (_, end), (start, _) in pairwise(ends):
        assert start - end in ((1.0,) if one.figure.sort == "count" else (0.0,))
    for row, cells in zip(one.panels[0].values, grid.rows, strict=True):
        for value, cell in zip(row, cells, strict=True):
            low, high = ranges[cell.ink]  # type: ignore[union-attr]
            assert low - abs(low) * 1e-3 <= value <= high + abs(high) * 1e-3


def test_a_missing_value_is_blank() -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=(250, 500, 1000))
    one.panels[0].values[1, 1] = float("nan")
    (grid, _) = grids(one)
    assert [[cell is None for cell in row] for row in grid.rows] == [[False] * 3, [False, True, False]]
    assert "blank: no value" in words(one)


def test_the_line_and_the_grey_are_of_the_verdict() -> None:
    # At 540 us the margin is above zero, and less than its uncertainty.
    one = plotted("margin_corrected_us", bus__nodes=(2, 3), cycle__period_us=(500, 540, 4000))
    (panel,), (grid,) = one.panels, grids(one)
    assert (panel.values[0] >= 0).tolist() == [False, True, True]
    assert [cell.is_inside for cell in grid.rows[0] if cell] == [False, False, True]
    assert words(one)[-2:] == ["edge of what is shown to fit", "this design"]
    (shade,) = curves(plotted("safe_axes", cycle__period_us=(500, 540, 4000))).shades
    assert (shade.entry.words, shade.low, shade.high) == ("not shown to fit", 500, (540 + 4000) / 2)


def test_a_figure_that_does_not_vary_gives_way_to_the_margin() -> None:
    # Whatever number of nodes there is, as many axes would fit.
    assert plotted(None, bus__nodes=(1, 2)).figure.key == "margin_corrected_us"
    assert plotted(None, cycle__period_us=(500, 4000)).figure.key == "safe_axes"


def test_a_map_of_one_value_is_a_sentence() -> None:
    one = plotted("max_nodes", bus__nodes=(1, 2), cycle__period_us=(500, 501))
    assert grids(one) == []
    assert [panel.title for panel in drawn(one).panels] == ["paper model: 2 at every setting"]
    assert drawn(one).words[0].startswith("Most nodes by the standard model: 1 at every setting.")


def test_unsafe_settings_and_this_design_are_marked() -> None:
    one = plotted("margin_us", bus__gap_count=(5, 7, 63), cycle__period_us=(250, 4000))
    for grid in grids(one):
        assert [[cell.mark for cell in row if cell] for row in grid.rows] == [["!", "!"], ["", ""], ["", ""]]
        assert grid.own == (4000, 2)
    assert {"unsafe gap count", "this design"} < set(words(one))
    (shade,) = curves(plotted("margin_us", bus__gap_count=(5, 9, 63))).shades
    assert (shade.entry.words, shade.low, shade.high) == ("unsafe gap count", 5, 7)


def test_the_largest_map_is_a_small_picture() -> None:
    one = plotted("margin_us", bus__nodes=(1, 2), cycle__period_us=(250, 500))
    up, across = (scale._replace(places=np.arange(500.0), own=None) for scale in one.scales)
    values = np.add.outer(np.arange(500.0), np.arange(500.0)) - 400
    panel = one.panels[0]._replace(values=values, unsafe=values > 500, fits=values > 0)
    (grid,) = grids(one._replace(scales=(up, across), panels=(panel,)))
    assert len({id(cell) for row in grid.rows for cell in row}) < 100


def test_a_sweep_over_three_keys_has_no_picture() -> None:
    answer = busplan.sweep(
        "paper-1ms", vary={key: [1, 2] for key in ("bus.nodes", "node.axes", "cycle.nonperiodic_us")}
    )
    assert answer._repr_svg_() is None


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
    assert plotted_figure(network_of(PAPER), "margin_us")[1] == 1
    one = plotted("utilisation", bus__nodes=(1, 2))
    assert one.label == "utilisation, %"
    assert one.panels[0].values.tolist() == pytest.approx([100 * 102.955 / 2000, 10.356], abs=0.001)
    figure, factor = plotted_figure(network_of(PAPER), "max_contour_error_mm")
    assert (figure.column, factor) == ("um", 1000)


@pytest.mark.parametrize(
    ("figure", "vary", "said"),
    [
        (
            "margin_us",
            {"cycle__period_us": (250, 500, 4000)},
            (
                "Margin by the standard model: -138.3 us to 1737 us; this design has 1737 us. "
                "Shown to fit: 1 of 3 settings, outside the grey."
            ),
        ),
        (
            "utilisation",
            {"bus__nodes": (1, 2)},
            (
                "Utilisation by the standard model: 7.125% to 13.17%; this design has 13.17%. "
                "Every setting is shown to fit."
            ),
        ),
        (
            "safe_axes",
            {"bus__gap_count": (63, "optimal")},
            "Safe axes by the standard model: 52 to 56; this design has 52. Every setting is shown to fit.",
        ),
        (
            "safe_axes",
            {"cycle__period_us": (250, 500)},
            "Safe axes by the standard model: 0 to 4. No setting is shown to fit.",
        ),
        (
            "max_nodes",
            {"bus__nodes": (1, 2), "cycle__period_us": (4000, 4001)},
            "Most nodes by the standard model: 13 at every setting; this design has 13. Every setting is shown to fit.",
        ),
    ],
)
def test_the_caption_says_what_to_see(figure: str, vary: dict[str, Any], said: str) -> None:
    assert caption(plotted(figure, **vary)) == said


def test_a_figure_that_no_model_has_is_said() -> None:
    quiet = override(PAPER, {"bus.nodes": 2})
    one = plotted("margin_us", quiet, bus__nodes=(1, 2))
    empty = one._replace(panels=())
    assert caption(empty) == "No timing model gives margin here."
    assert drawn(empty).words == ("No timing model gives margin here.",)
    assert drawn(empty).panels == ()
