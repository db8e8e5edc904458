"""The picture of a sweep: choices are categories, zero is in the middle of its colours, units and words are there."""

from collections.abc import Callable, Sequence
from re import findall
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest

import busplan
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.sweep.grid import Array, axis_of
from busplan.questions.sweep.panels import sweep_svg
from busplan.questions.sweep.plot import FigureData
from busplan.questions.sweep.plotted import Plotted, caption, key_label, plot_scale, plotted_figure

SVG = "{http://www.w3.org/2000/svg}"
Plots = Callable[[Element], list[Any]]
PAPER = load("paper-4ms").profile
MODELS = ("paper", "standard")


def values(given: Sequence[Any] | range) -> Array:
    return axis_of(list(given))


def added(figure: str | None, profile: Any = PAPER, **vary: Any) -> FigureData:
    own = {key.replace("__", "."): one for key, one in vary.items()}
    answer = busplan.sweep(profile, vary=own, timing_model=MODELS)
    return FigureData(answer.sweep, answer.table, figure=figure)


def plotted(figure: str | None, profile: Any = PAPER, **vary: Any) -> Plotted:
    return added(figure, profile, **vary).plotted()


def drawn(one: Plotted) -> Element:
    return fromstring(sweep_svg(one, title="x"))


def texts(root: Element) -> list[str]:
    return [text.text or "" for text in root.iter(f"{SVG}text")]


def marks(plot: Any, tag: str, css: str) -> list[tuple[float, float]]:
    """Values at the places of marks of a class."""
    top, height = float(plot.path.get("y")), float(plot.path.get("height"))
    return [
        (
            round(plot.x(float(one.get("x", "").rstrip("%")) / 100), 6),
            round(plot.y((float(one.get("y", "")) - top) / height), 6),
        )
        for one in plot.area.findall(f"{SVG}svg")
        if one.find(f"{SVG}{tag}[@class='{css}']") is not None
    ]


Cell = tuple[float, float, float, float, tuple[int, ...]]


def cells(plot: Any) -> list[Cell]:
    """Rectangles of a map as shares, and their colours."""
    width, height = map(float, plot.path.get("viewBox").split()[2:])
    number = r"(-?[\d.]+)"
    found = []
    for path in plot.path.iter(f"{SVG}path"):
        colour = tuple(int(path.get("fill", "#000000")[at : at + 2], 16) for at in (1, 3, 5))
        for run in findall(rf"M{number} {number}H{number}V{number}H", path.get("d", "")):
            left, top, right, bottom = map(float, run)
            found.append((left / width, right / width, top / height, bottom / height, colour))
    return found


def colours_of(plot: Any, rows: int, columns: int) -> list[list[tuple[int, ...] | None]]:
    """Colour of each cell, the lowest row first; None where nothing is drawn."""
    found = cells(plot)

    def at(row: int, column: int) -> tuple[int, ...] | None:
        x, y = (column + 0.5) / columns, 1 - (row + 0.5) / rows
        hits = [colour for left, right, top, bottom, colour in found if left < x < right and top < y < bottom]
        assert len(hits) <= 1
        return hits[0] if hits else None

    return [[at(row, column) for column in range(columns)] for row in range(rows)]


@pytest.mark.parametrize("vary", [{"bus__nodes": (1, 2)}, {"bus__gap_count": (7, 63), "cycle__period_us": (250, 4000)}])
def test_the_same_sweep_draws_the_same_picture(vary: dict[str, Any]) -> None:
    data = added("margin_us", **vary)
    assert data.svg("x") == data.svg("x")


@pytest.mark.parametrize("given", [(5, 7, 63), (63, "optimal"), ("optimal",), range(5, 64)])
def test_gap_counts_are_categories(given: Any) -> None:
    scale = plot_scale(PAPER, "bus.gap_count", values(given), as_cells=False)
    assert scale.places.tolist() == list(range(len(given)))
    assert scale.labels == tuple(map(str, given))
    assert scale.own == (scale.labels.index("63") if "63" in scale.labels else None)


def test_no_line_joins_choices_and_a_line_joins_numbers(plots: Plots) -> None:
    root = drawn(plotted("margin_us", bus__gap_count=(5, 63, "optimal")))
    (plot,) = plots(root)
    assert plot.paths == {}
    assert plot.across == pytest.approx({"5": 1 / 6, "63": 3 / 6, "optimal": 5 / 6}, abs=1e-4)
    (plot,) = plots(drawn(plotted("margin_us", bus__nodes=range(1, 7))))
    assert set(plot.paths) == {"curve first", "curve second"}


def test_points_stand_at_their_values(plots: Plots) -> None:
    one = plotted("margin_us", cycle__period_us=(250, 500, 1000, 4000))
    root = drawn(one)
    (plot,) = plots(root)
    for css, panel in zip(("first", "second"), one.panels, strict=True):
        wanted = list(zip((250, 500, 1000, 4000), panel.values, strict=True))
        for drawn_at, (x, y) in zip(plot.values(f"curve {css}"), wanted, strict=True):
            assert drawn_at == pytest.approx((x, y), abs=8)
        for drawn_at, (x, y) in zip(marks(plot, "rect", f"mark {css}"), wanted, strict=True):
            assert drawn_at == pytest.approx((x, y), abs=8)


def test_a_curve_has_a_gap_where_a_value_is_missing() -> None:
    one = plotted("margin_us", bus__nodes=range(1, 7))
    (panel, *_) = one.panels
    panel.values[2] = float("nan")
    root = drawn(one._replace(panels=(panel,)))
    (d,) = (path.get("d", "") for path in root.iter(f"{SVG}path") if path.get("class") == "curve first")
    assert [piece.count("L") for piece in d.split("M")[1:]] == [1, 2]


@pytest.mark.parametrize("nodes", [(2,), range(1, 4), range(1, 7), range(1, 40)])
def test_whole_numbers_have_whole_ticks(nodes: Any, plots: Plots) -> None:
    (plot,) = plots(drawn(plotted("max_nodes", bus__nodes=nodes)))
    for label in (*plot.up, *plot.across):
        assert label.lstrip("-").isdigit()


def test_many_points_are_a_curve_without_marks(plots: Plots) -> None:
    one = plotted("margin_us", cycle__nonperiodic_us=range(250))
    (plot,) = plots(drawn(one))
    assert len(plot.values("curve first")) == 250
    assert marks(plot, "rect", "mark first") == []


def test_uneven_numbers_are_equal_cells_and_a_true_scale_of_a_curve() -> None:
    periods = values([250, 500, 1000, 4000])
    assert plot_scale(PAPER, "cycle.period_us", periods, as_cells=True).labels == ("250", "500", "1000", "4000")
    curve = plot_scale(PAPER, "cycle.period_us", periods, as_cells=False)
    assert (curve.labels, curve.places.tolist(), curve.own) == ((), [250, 500, 1000, 4000], 4000)
    assert plot_scale(PAPER, "cycle.period_us", values([4000, 250]), as_cells=False).labels == ("4000", "250")
    assert plot_scale(PAPER, "cycle.period_us", values([250, 500]), as_cells=False).own is None


def test_colours_of_a_margin_are_red_below_zero_and_blue_from_it_on(plots: Plots) -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=range(250, 1001, 50))
    for plot, panel in zip(plots(drawn(one)), one.panels, strict=True):
        found = colours_of(plot, *panel.values.shape)
        for value, colour in zip(panel.values.ravel(), [each for row in found for each in row], strict=True):
            assert colour is not None
            red, _, blue = colour
            assert (blue > red) == (value >= 0)
        # Farther from zero is darker, on either side.
        ranked = sorted(zip(panel.values.ravel(), [each for row in found for each in row], strict=True))
        for side in ([c for v, c in ranked if v < 0][::-1], [c for v, c in ranked if v >= 0]):
            greens = [colour[1] for colour in side if colour]
            assert greens == sorted(greens, reverse=True)
    # Without a margin below zero, none looks like one.
    (plot, _) = plots(drawn(plotted("margin_us", bus__nodes=(1, 2), cycle__period_us=(2000, 4000))))
    assert all(colour[2] > colour[0] for *_, colour in cells(plot))


def test_a_missing_value_is_blank(plots: Plots) -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=(250, 500, 1000))
    (panel, *_) = one.panels
    panel.values[1, 1] = float("nan")
    root = drawn(one._replace(panels=(panel,)))
    (plot,) = plots(root)
    found = colours_of(plot, 2, 3)
    assert [[colour is None for colour in row] for row in found] == [[False] * 3, [False, True, False]]
    assert texts(root)[-1] == "blank: no value"


def test_the_largest_map_is_few_paths() -> None:
    one = plotted("margin_us", bus__nodes=(1, 2), cycle__period_us=(250, 500))
    up, across = (scale._replace(places=np.arange(500.0), own=None) for scale in one.scales)
    values = np.add.outer(np.arange(500.0), np.arange(500.0)) - 400
    panel = one.panels[0]._replace(values=values, unsafe=values > 500)
    svg = sweep_svg(one._replace(scales=(up, across), panels=(panel,)), title="x")
    assert len(svg) < 1_000_000
    assert len([each for each in fromstring(svg).iter(f"{SVG}path") if each.get("fill")]) <= 60


def test_the_line_parts_the_cells_of_zero_or_more_from_the_others(plots: Plots) -> None:
    one = plotted("margin_us", bus__gap_count=(7, 63, "optimal"), cycle__period_us=range(250, 2001, 250))
    for plot, panel in zip(plots(drawn(one)), one.panels, strict=True):
        fits = panel.values >= 0
        expected = set()
        for row in range(3):
            for column in range(8):
                if column < 7 and fits[row, column] != fits[row, column + 1]:
                    expected.add(((column + 1, row), (column + 1, row + 1)))
                if row < 2 and fits[row, column] != fits[row + 1, column]:
                    expected.add(((column, row + 1), (column + 1, row + 1)))
        (points,) = plot.paths["border"]
        corners = [(round(8 * x), round(3 * (1 - y))) for x, y in points]
        assert set(zip(corners[::2], corners[1::2], strict=True)) == expected
        assert expected


def test_the_line_and_the_grey_are_of_the_verdict(plots: Plots) -> None:
    # At 540 us the margin is above zero, and less than its uncertainty.
    one = plotted("margin_corrected_us", bus__nodes=(2, 3), cycle__period_us=(500, 540, 4000))
    (panel,) = one.panels
    assert (panel.values[0] >= 0).tolist() == [False, True, True]
    (plot,) = plots(drawn(one))
    (points,) = plot.paths["border"]
    assert {round(3 * x) for x, _ in points} == {2}
    assert texts(drawn(one))[-2:] == ["edge of the settings that are shown to fit", "this design"]
    (plot,) = plots(drawn(plotted("safe_axes", cycle__period_us=(500, 540, 4000))))
    assert max(x for x, _ in plot.values("unproven")) == pytest.approx((540 + 4000) / 2, abs=8)


def test_a_figure_that_does_not_vary_gives_way_to_the_margin() -> None:
    # Whatever number of nodes there is, as many axes would fit.
    assert plotted(None, bus__nodes=(1, 2)).figure.key == "margin_corrected_us"
    assert plotted(None, cycle__period_us=(500, 4000)).figure.key == "safe_axes"


def test_a_map_of_one_value_is_a_sentence(plots: Plots) -> None:
    one = plotted("max_nodes", bus__nodes=(1, 2), cycle__period_us=(500, 501))
    root = drawn(one)
    assert plots(root) == []
    written = " ".join(texts(root))
    assert "paper model: 2 at every setting" in written
    assert "Most nodes by the standard model: 1 at every setting." in written


def test_unsafe_points_and_this_design_are_marked(plots: Plots) -> None:
    root = drawn(plotted("margin_us", bus__gap_count=(5, 7, 63), cycle__period_us=(250, 4000)))
    for plot in plots(root):
        plot.up = {str(place): at for place, at in enumerate(plot.up.values())}
        assert marks(plot, "path", "above") == [
            pytest.approx(place, rel=1e-3, abs=1e-3) for place in ((250, 0), (4000, 0))
        ]
        assert marks(plot, "circle", "above") == [pytest.approx((4000, 2), rel=1e-3)]
    assert texts(root)[-3:] == ["margin of 0 (paper model)", "unsafe gap count", "this design"]
    (plot,) = plots(drawn(plotted("margin_us", bus__gap_count=(5, 63))))
    plot.across = {"0": 0.25, "1": 0.75}
    assert {x for x, _ in marks(plot, "path", "cross")} == {0}


def test_the_bar_of_colours_has_the_colours_of_its_values() -> None:
    root = drawn(plotted("margin_us", bus__gap_count=(7, 63), cycle__period_us=range(250, 1001, 250)))
    bar = [one.get("fill", "") for one in root.iter(f"{SVG}rect") if one.get("class") == "cells"]
    assert len(bar) == 60
    reds = [int(fill[1:3], 16) > int(fill[5:], 16) for fill in bar]
    assert reds == sorted(reds, reverse=True)
    assert len(set(reds)) == 2


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
                "Margin by the standard model: -138.3 us to 1737 us; this design has 1737 us. "
                "Shown to fit: 1 of 3 settings, outside the grey."
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
    assert "No timing model gives margin here." in texts(drawn(empty))
