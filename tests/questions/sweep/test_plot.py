"""The picture of a sweep: choices are categories, colours part at zero, units and words are there."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import busplan

MODELS = ("paper", "standard")
TOO_FAST_AND_NOT = {"cycle.period_us": [100.0, 2000.0, 4000.0], "circle.radius_mm": [10.0]}
"""At 100 us the cycle does not fit, so that it has no circle."""


def swept(**vary: Any) -> busplan.SweepAnswer:
    values = {key.replace("__", "."): given for key, given in vary.items()}
    return busplan.sweep("paper-4ms", vary=values, timing_model=MODELS)


def drawn(figure: str | None, **vary: Any) -> Any:
    return swept(**vary).drawing(figure=figure)


def curves(drawing: Any) -> Any:
    (panel,) = drawing.panels
    return panel.plot


def grids(drawing: Any) -> list[Any]:
    """The map of each timing model."""
    return [panel.plot for panel in drawing.panels if panel.plot is not None]


def words(drawing: Any) -> list[str]:
    """Words of the legend."""
    entries = []
    for panel in drawing.panels:
        if hasattr(panel.plot, "legend"):
            entries += panel.plot.legend
        elif panel.plot is not None:
            entries += [part.entry for part in (*panel.plot.curves, *panel.plot.guides, *panel.plot.shades)]
    return [entry.words for entry in dict.fromkeys(entries)]


def test_points_stand_at_their_values_and_this_design_at_its_own() -> None:
    periods_us = (250, 500, 1000, 4000)
    answer = swept(cycle__period_us=periods_us)
    plot = curves(answer.drawing(figure="margin_us"))
    assert [curve.entry.words for curve in plot.curves] == ["paper model", "standard model"]
    assert len({curve.entry.mark for curve in plot.curves}) == 2
    for curve, margins_us in zip(plot.curves, answer["margin_us"].reshape(4, 2).T, strict=True):
        assert curve.points == tuple(zip(periods_us, margins_us, strict=True))
    assert {guide.entry.words: (guide.x, guide.y) for guide in plot.guides} == {
        "margin of 0": (None, 0.0),
        "this design": (4000.0, None),
    }


def test_a_curve_has_a_gap_and_a_map_a_blank_where_a_value_is_missing() -> None:
    answer = busplan.sweep("paper-4ms", vary=TOO_FAST_AND_NOT, circle=True, timing_model="standard")
    (curve,) = curves(answer.drawing(figure="max_contour_error_mm")).curves
    assert [y is None for _, y in curve.points] == [True, False, False]
    both = {**TOO_FAST_AND_NOT, "circle.radius_mm": [10.0, 20.0]}
    drawing = busplan.sweep("paper-4ms", vary=both, circle=True, timing_model="standard").drawing(
        figure="max_contour_error_mm"
    )
    (grid,) = grids(drawing)
    assert [[cell is None for cell in row] for row in grid.rows] == [[True] * 2, [False] * 2, [False] * 2]
    assert "blank: no value" in words(drawing)


def test_colours_of_a_margin_are_red_below_zero_and_blue_from_it_on() -> None:
    answer = swept(bus__gap_count=(7, 63), cycle__period_us=range(250, 1001, 50))
    margins_us = answer["margin_us"].reshape(2, 16, 2)
    for number, grid in enumerate(grids(answer.drawing(figure="margin_us"))):
        looks = sorted(
            (value, cell.ink)
            for values, row in zip(margins_us[:, :, number], grid.rows, strict=True)
            for value, cell in zip(values, row, strict=True)
            if cell
        )
        assert looks[0][0] < 0 < looks[-1][0]
        assert all(ink.startswith("above" if value >= 0 else "below") for value, ink in looks)
        # Farther from zero is stronger, on either side.
        for side in ([ink for value, ink in looks if value < 0][::-1], [ink for value, ink in looks if value >= 0]):
            assert side == sorted(side)
    # Without a margin below zero, none looks like one.
    (grid, _) = grids(drawn("margin_us", bus__nodes=(1, 2), cycle__period_us=(2000, 4000)))
    assert all(cell.ink.startswith("above") for row in grid.rows for cell in row if cell)


def test_the_line_and_the_grey_are_of_the_verdict() -> None:
    # At 540 us the margin is above zero, and less than its uncertainty.
    answer = swept(bus__nodes=(2, 3), cycle__period_us=(500, 540, 4000))
    drawing = answer.drawing(figure="margin_corrected_us")
    (grid,) = grids(drawing)
    assert (answer["margin_corrected_us"][1:6:2] >= 0).tolist() == [False, True, True]
    assert [cell.is_inside for cell in grid.rows[0] if cell] == [False, False, True]
    assert words(drawing)[-2:] == ["edge of what is shown to fit", "this design"]
    (shade,) = curves(drawn("safe_axes", cycle__period_us=(500, 540, 4000))).shades
    assert (shade.entry.words, shade.low, shade.high) == ("not shown to fit", 500, (540 + 4000) / 2)


def test_a_figure_that_does_not_vary_gives_way_to_the_margin() -> None:
    # Whatever number of nodes there is, as many axes would fit.
    assert curves(drawn(None, bus__nodes=(1, 2))).up.label == "corrected margin, us"
    assert curves(drawn(None, cycle__period_us=(500, 4000))).up.label == "safe axes"


def test_unsafe_settings_and_this_design_are_marked() -> None:
    drawing = drawn("margin_us", bus__gap_count=(5, 7, 63), cycle__period_us=(250, 4000))
    for grid in grids(drawing):
        assert [[cell.mark for cell in row if cell] for row in grid.rows] == [["!", "!"], ["", ""], ["", ""]]
        assert grid.own == (4000, 2)
    assert {"unsafe gap count", "this design"} < set(words(drawing))
    (shade,) = curves(drawn("margin_us", bus__gap_count=(5, 9, 63))).shades
    assert (shade.entry.words, shade.low, shade.high) == ("unsafe gap count", 5, 7)


def test_what_has_no_picture_says_why() -> None:
    three = {key: [1, 2] for key in ("bus.nodes", "node.axes", "cycle.nonperiodic_us")}
    many = {"cycle.nonperiodic_us": np.linspace(0, 1000, 250_001)}
    for vary, message in (
        (three, "draws one or two keys, and bus.nodes, node.axes, cycle.nonperiodic_us vary"),
        (many, "250,001 points; a figure shows at most 250,000"),
    ):
        answer = busplan.sweep("paper-1ms", vary=vary, timing_model="standard")
        assert answer._repr_svg_() is None
        with pytest.raises(busplan.BusplanError, match=message):
            answer.drawing()


@pytest.mark.parametrize(
    ("name", "key", "label"),
    [
        ("paper-4ms", "cycle.period_us", "period T_s, us"),
        ("paper-4ms", "bus.nodes", "nodes N"),
        ("paper-4ms", "bus.gap_count", "gap count"),
        ("paper-4ms", "node.axes", "node axes"),
        ("paper-4ms", "payload.read_bytes", "payload read, bytes"),
        ("gantry-24", "group.tool.nodes", "group tool nodes"),
    ],
)
def test_keys_are_named_in_words_with_their_unit(name: str, key: str, label: str) -> None:
    answer = busplan.sweep(name, vary={key: [8, 9]})
    assert curves(answer.drawing(figure="margin_us")).across.label == label


def test_figures_are_drawn_in_the_unit_of_their_label() -> None:
    plot = curves(drawn("utilisation", bus__nodes=(1, 2)))
    assert plot.up.label == "utilisation, %"
    assert [y for _, y in plot.curves[0].points] == pytest.approx([100 * 102.955 / 2000, 10.356], abs=0.001)
    circle = busplan.sweep("paper-4ms", vary=TOO_FAST_AND_NOT, circle=True, timing_model="standard")
    plot = curves(circle.drawing(figure="max_contour_error_mm"))
    assert plot.up.label.endswith(", um")
    assert plot.curves[0].points[2][1] == pytest.approx(1000 * circle["max_contour_error_mm"][2])


@pytest.mark.parametrize(
    ("figure", "vary", "caption"),
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
def test_the_caption_says_what_to_see(figure: str, vary: dict[str, Any], caption: str) -> None:
    assert drawn(figure, **vary).words == (caption,)


def test_a_line_begins_behind_a_gap(run: Callable[..., Any], tmp_path: Path) -> None:
    circles = ("--set", "circle.radius_mm=10", "--circle", "--jobs", "1", "--timing-model", "standard")
    picture = ("--plot", "f.svg", "--figure", "max_contour_error_mm")
    run("sweep", "paper-4ms", "--vary", "cycle.period_us=100,2000,4000", *circles, *picture, cwd=tmp_path)
    lines = re.findall(r' d="([^"]*)"', (tmp_path / "f.svg").read_text(encoding="utf-8"))
    assert [line for line in lines if line.count("M") != 1 or line[0] != "M"] == []
    assert lines


def test_a_figure_that_no_model_has_is_said() -> None:
    answer = busplan.sweep("paper-4ms", vary={"circle.radius_mm": [10.0, 20.0]}, circle=True)
    drawing = answer.drawing(figure="circular_deviation_mm")
    assert drawing.words == ("No timing model gives circular deviation G here.",)
    assert drawing.panels == ()
