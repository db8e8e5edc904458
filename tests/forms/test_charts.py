"""Any drawing as SVG, PNG and characters: everything is there once, in its place, in words that fit."""

import re
from functools import cache
from io import BytesIO
from itertools import pairwise
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import pytest
from PIL import Image

import busplan
from busplan.forms.charts import (
    ChartGrid,
    Curve,
    Curves,
    Dial,
    Drawing,
    Entry,
    Guide,
    Lane,
    Lanes,
    Panel,
    Span,
    legend,
    numbers,
)
from busplan.forms.svg import content, inline

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = '<b>$x_1$ & "q" ]]> </svg>機械'


@cache
def shown() -> dict[str, Drawing]:
    """A picture of each question that has one."""
    return {
        "map": busplan.map_("dvrk").drawing(),
        "compare": busplan.compare("paper-1ms").drawing(),
        "timeline": busplan.timeline("paper-1ms").drawing(),
        "transaction": busplan.timeline("paper-1ms", transaction="read:1").drawing(),
        "sensitivity": busplan.capacity("gantry-24", sensitivity=True).drawing(),
        "curves": busplan.sweep("paper-1ms", vary={"bus.nodes": range(1, 40)}).drawing(),
        "colours": busplan.sweep(
            "paper-1ms", vary={"bus.gap_count": [5, 7, "optimal"], "cycle.period_us": range(250, 4001, 250)}
        ).drawing(),
        "circle": busplan.circle_test("dvrk", contributions=True).drawing(),
    }


EACH = pytest.mark.parametrize(
    "name", ["map", "compare", "timeline", "transaction", "sensitivity", "curves", "colours", "circle"]
)


def svg_of(plot: ChartGrid | Curves | Lanes | Dial) -> Element:
    return fromstring(inline(Drawing("title", (Panel(plot),))))


def percent(element: Element, key: str) -> float:
    return float((element.get(key) or "").rstrip("%"))


def texts(root: Element) -> list[str]:
    return [text.text or "" for text in root.iter(f"{SVG}text")]


@EACH
def test_a_file_has_its_title_its_legend_and_both_schemes_of_colours(name: str) -> None:
    drawing = shown()[name]
    root = fromstring(str(content(drawing, "svg", note="With x.")))
    assert (root.get("width"), root.get("role")) == ("100%", "img")
    assert root.findtext(f"{SVG}title") == f"{drawing.title} With x."
    assert " ".join(texts(root)).startswith(f"{drawing.title} With x.")
    style = root.findtext(f"{SVG}style") or ""
    assert "prefers-color-scheme:dark" in style
    assert "var(" not in style
    said = " ".join(texts(root))
    assert len(set(legend(drawing.panels))) == len(legend(drawing.panels))
    for entry in legend(drawing.panels):
        assert entry.words in said
        # Whatever is drawn has a colour.
        assert re.search(rf"\.{entry.ink}\b", style), entry


@EACH
def test_words_are_no_wider_than_a_phone_and_those_of_a_png_use_its_width(name: str) -> None:
    drawing = shown()[name]._replace(title="word " * 30)
    root, png = fromstring(str(content(drawing, "svg"))), content(drawing, "png")
    assert max(map(len, texts(root))) <= 42
    assert isinstance(png, bytes)
    width, height = Image.open(BytesIO(png)).size
    assert width == 1280
    # Two pixels for a px, and two lines less for the title alone.
    assert height <= 2 * (int(root.get("height") or 0) - 40)


@EACH
def test_hostile_names_are_text(name: str) -> None:
    root = fromstring(str(content(shown()[name]._replace(title=HOSTILE, words=(HOSTILE,)), "svg")))
    assert root.findtext(f"{SVG}title") == HOSTILE
    assert {element.tag.removeprefix(SVG) for element in root.iter()} <= {
        *("svg", "title", "desc", "style", "rect", "line", "text", "path", "circle"),
    }


# --- cells


# --- curves


def curves(*points: tuple[float, float | None], **more: Any) -> Curves:
    curve = Curve(Entry("first", "one", "o", "line"), points)
    return Curves(numbers("x", 0, 10), numbers("y", 0, 100), (curve,))._replace(**more)


def points_of(root: Element) -> list[list[tuple[float, float]]]:
    """Pieces of the line in percent of the plot's width and height, from its lower left corner."""
    (box,) = (svg for svg in root.iter(f"{SVG}svg") if svg.get("viewBox"))
    width, height = map(float, (box.get("viewBox") or "").split()[2:])
    (path,) = box
    return [
        [(100 * float(x) / width, 100 - 100 * float(y) / height) for x, y in re.findall(r"([-\d.]+) ([-\d.]+)", piece)]
        for piece in (path.get("d") or "").split("M")[1:]
    ]


def test_a_curve_goes_through_its_points_with_gaps_and_has_a_mark_on_each() -> None:
    root = svg_of(curves((0, 0), (5, 50), (6, None), (10, 100)))
    assert points_of(root) == [
        [pytest.approx((0, 0), abs=0.1), pytest.approx((50, 50), abs=0.1)],
        [pytest.approx((100, 100), abs=0.1)],
    ]
    dots = [dot for dot in root.iter(f"{SVG}circle") if (dot.get("cx") or "").endswith("%")]
    assert [percent(dot, "cx") for dot in dots] == [0, 50, 100]
    heights = [float(dot.get("cy") or 0) for dot in dots]
    assert heights[0] - heights[1] == pytest.approx(heights[1] - heights[2])
    last = curves((0, 0), (5, 50)).curves[0]._replace(has_dots=False)
    assert sum((dot.get("cx") or "").endswith("%") for dot in svg_of(curves(curves=(last,))).iter(f"{SVG}circle")) == 1


# --- bars


WORK, WAIT = Entry("work", "work", "="), Entry("idle", "idle", "~")


def lanes(*spans: tuple[Entry, float, float], **more: Any) -> Lanes:
    lane = Lane("node 1", tuple(Span(entry, start, end, f"{start} to {end}") for entry, start, end in spans), "7 us")
    return Lanes(numbers("us", 0, 100), (lane,))._replace(**more)


def test_bars_are_to_scale_with_their_label_figure_and_tooltip() -> None:
    root = svg_of(lanes((WORK, 10, 30), (WAIT, 90, 120), guides=(Guide(Entry("edge", "end", shape="line"), x=50),)))
    bars = {rect.findtext(f"{SVG}title"): rect for rect in root.iter(f"{SVG}rect") if len(rect)}
    assert [(key, percent(bar, "x"), percent(bar, "width")) for key, bar in bars.items()] == [
        *(("10 to 30", 10, 20), ("90 to 120", 90, 10)),
    ]
    (edge,) = (line for line in root.iter(f"{SVG}line") if line.get("x1") == "50%" and line.get("class") == "line edge")
    assert edge.get("x2") == "50%"
    assert {"node 1", "7 us", "=", "~", "end"} <= set(texts(root))


# --- circles


def dial(*radii: float | None, **more: Any) -> Dial:
    rings = ((1.0, Entry("nominal", "nominal circle", shape="line")), (1.25, Entry("ring")))
    return Dial(Entry("first"), radii, radii, rings, ("10 um", "a ring"), is_clockwise=False)._replace(**more)


def band(root: Element) -> list[list[tuple[float, float]]]:
    (path,) = (path for path in root.iter(f"{SVG}path") if (path.get("class") or "").startswith("band"))
    pieces = (path.get("d") or "").split("M")[1:]
    return [[(float(x), -float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", piece)] for piece in pieces]


def test_a_band_is_as_far_out_as_its_radii_and_goes_counter_clockwise_from_the_x_axis() -> None:
    root = svg_of(dial(1.1, 1.0, 0.9, 1.0))
    rings = {ring.get("class"): float(ring.get("r") or 0) for ring in root.iter(f"{SVG}circle")}
    nominal = rings["line nominal"]
    outer, _ = band(root)
    assert [(x**2 + y**2) ** 0.5 / nominal for x, y in outer] == pytest.approx([1.1, 1.0, 0.9, 1.0], abs=0.01)
    assert [(x > 0, y > 0) for x, y in outer] == [(True, True), (False, True), (False, False), (True, False)]
    assert rings["line ring"] == pytest.approx(1.25 * nominal)
    assert {"10 um", "a ring", "nominal circle", "X 0°", "Y 90°"} <= set(texts(root))


# --- scales


@EACH
def test_no_two_labels_of_a_scale_touch_on_a_phone(name: str) -> None:
    root = fromstring(inline(shown()[name]))
    for area in root.findall(f"{SVG}svg"):
        ends: dict[str, list[tuple[float, float]]] = {}
        width = 335 * percent(area, "width") / 100
        for text in area.findall(f"{SVG}text"):
            if (text.get("class") or "").startswith("small"):
                size = 7 * len(text.text or "")
                start = width * percent(text, "x") / 100
                start -= {"start": 0, "middle": size / 2, "end": size}[text.get("text-anchor") or ""]
                ends.setdefault(text.get("y") or "", []).append((start, start + size))
        for row in ends.values():
            assert all(end <= start + 0.1 for (_, end), (start, _) in pairwise(sorted(row)))
