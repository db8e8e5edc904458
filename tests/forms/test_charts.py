"""Any drawing as SVG and PNG: everything is there once, in its place, in words that fit."""

import re
from collections.abc import Callable, Mapping
from functools import cache
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import pytest
from PIL import Image

import busplan

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = '<b>$x_1$ & "q" ]]> </svg>機械'
ANSWERS: Mapping[str, Callable[[], Any]] = {
    "map": lambda: busplan.map_("dvrk"),
    "compare": lambda: busplan.compare("paper-1ms", buses=["can", "ethercat", "sercos2"]),
    "timeline": lambda: busplan.timeline("paper-1ms"),
    "transaction": lambda: busplan.timeline("paper-1ms", transaction="read:1"),
    "sensitivity": lambda: busplan.capacity("paper-1ms", sensitivity=True),
    "curves": lambda: busplan.map_("paper-1ms", x={"bus.nodes": range(1, 17)}),
    "words": lambda: busplan.map_(
        "paper-1ms", x={"bus.gap_count": [5, 7, "optimal"]}, y={"cycle.period_us": range(250, 4001, 250)}
    ),
    "circle": lambda: busplan.circle_test(
        busplan.load_profile("dvrk", changes={"circle.radius_mm": 40.0}), contributions=True
    ),
}
EACH = pytest.mark.parametrize("name", ANSWERS)


@cache
def answer_of(name: str) -> Any:
    """An answer that has a picture."""
    return ANSWERS[name]()


@cache
def svg_of(name: str) -> Element:
    return fromstring(answer_of(name).svg())


def percent(element: Element, key: str) -> float:
    return float((element.get(key) or "").rstrip("%"))


def texts(root: Element) -> list[str]:
    return [text.text or "" for text in root.iter(f"{SVG}text")]


def styled(root: Element, tag: str, name: str) -> list[Element]:
    """Elements of a class."""
    return [element for element in root.iter(f"{SVG}{tag}") if name in (element.get("class") or "").split()]


@EACH
def test_a_file_has_its_title_its_words_and_both_schemes_of_colours(name: str) -> None:
    root = fromstring(answer_of(name).svg(note="With x."))
    assert (root.get("width"), root.get("role")) == ("100%", "img")
    title = f"{answer_of(name).drawing().title} With x."
    assert root.findtext(f"{SVG}title") == title
    assert " ".join(texts(root)).startswith(title)
    style = root.findtext(f"{SVG}style") or ""
    assert "prefers-color-scheme:dark" in style
    assert "var(" not in style
    # Whatever is filled or drawn has a colour.
    inks = {(rect.get("class") or "").split()[-1] for rect in styled(root, "rect", "cell")}
    inks |= {(line.get("class") or "").split()[-1] for line in styled(root, "path", "line")}
    assert [ink for ink in inks if f".{ink}" not in style] == []


@pytest.mark.slow
@EACH
def test_words_are_no_wider_than_a_phone_and_those_of_a_png_use_its_width(name: str, tmp_path: Path) -> None:
    note = "word " * 30
    assert max(map(len, texts(fromstring(answer_of(name).svg(note=note))))) <= 42
    answer_of(name).save(tmp_path / "x.png")
    width, height = Image.open(BytesIO((tmp_path / "x.png").read_bytes())).size
    assert width == 1280
    # Two pixels for a px.
    assert height <= 2 * int(svg_of(name).get("height") or 0)


@EACH
def test_hostile_words_are_text(name: str) -> None:
    root = fromstring(answer_of(name).svg(note=HOSTILE))
    assert (root.findtext(f"{SVG}title") or "").endswith(HOSTILE)
    assert {element.tag.removeprefix(SVG) for element in root.iter()} <= {
        *("svg", "title", "desc", "style", "rect", "line", "text", "path", "circle"),
    }


# --- what is drawn is what the drawing holds: curves, bars and circles here, cells of maps as pixels


def test_a_curve_goes_through_its_points_and_has_a_mark_on_each() -> None:
    (panel,) = answer_of("curves").drawing().panels
    plot, root = panel.plot, svg_of("curves")
    (curve, *_) = plot.curves
    width, height = (high - low for low, high in ((plot.across.low, plot.across.high), (plot.up.low, plot.up.high)))
    wanted = [(100 * (x - plot.across.low) / width, 100 * (y - plot.up.low) / height) for x, y in curve.points]
    boxes = [svg for svg in root.iter(f"{SVG}svg") if svg.get("viewBox")]
    (path, *_) = styled(boxes[0], "path", curve.entry.ink)
    across, up = map(float, (boxes[0].get("viewBox") or "").split()[2:])
    drawn = re.findall(r"([-\d.]+) ([-\d.]+)", path.get("d") or "")
    for (x, y), place in zip(drawn, wanted, strict=True):
        assert (100 * float(x) / across, 100 - 100 * float(y) / up) == pytest.approx(place, abs=0.1)
    dots = [dot for dot in styled(root, "circle", curve.entry.ink) if (dot.get("cx") or "").endswith("%")]
    assert [percent(dot, "cx") for dot in dots] == pytest.approx([x for x, _ in wanted], abs=0.1)


def test_bars_are_to_scale_with_their_label_figure_and_tooltip() -> None:
    panels, root = answer_of("timeline").drawing().panels, svg_of("timeline")
    bars = [rect for rect in root.iter(f"{SVG}rect") if len(rect)]
    spans = [(panel.plot.across, span) for panel in panels for lane in panel.plot.lanes for span in lane.spans]
    for bar, (across, span) in zip(bars, spans, strict=True):
        size = across.high - across.low
        assert bar.findtext(f"{SVG}title") == span.words
        assert percent(bar, "x") == pytest.approx(100 * (span.start - across.low) / size, abs=0.1)
        assert percent(bar, "width") == pytest.approx(100 * (span.end - span.start) / size, abs=0.1)
    assert {lane.note for panel in panels for lane in panel.plot.lanes} - {""} <= set(texts(root))


def test_a_circle_is_as_far_out_as_its_errors_and_goes_counter_clockwise_from_the_x_axis() -> None:
    (plot, *_) = (panel.plot for panel in answer_of("circle").drawing().panels if hasattr(panel.plot, "outer"))
    root = svg_of("circle")
    (nominal, *_) = styled(root, "circle", "nominal")
    (band, *_) = styled(root, "path", "band")
    piece = (band.get("d") or "").split("M")[1]
    places = [(float(x), -float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", piece)]
    radii = [(x**2 + y**2) ** 0.5 / float(nominal.get("r") or 0) for x, y in places]
    outer = [radius for radius in plot.outer if radius is not None]
    assert radii[: len(outer)] == pytest.approx(outer, abs=0.02)
    assert all(x > 0 < y for x, y in places[5 : len(outer) // 4 - 5])


# --- scales


@EACH
def test_no_two_labels_of_a_scale_touch_on_a_phone(name: str) -> None:
    for area in svg_of(name).findall(f".//{SVG}svg"):
        ends: dict[str, list[tuple[float, float]]] = {}
        if not (area.get("width") or "").endswith("%"):
            continue
        width = 335 * percent(area, "width") / 100
        for text in area.findall(f"{SVG}text"):
            if "small" in (text.get("class") or "").split():
                size = 7 * len(text.text or "")
                start = width * percent(text, "x") / 100
                start -= {"start": 0, "middle": size / 2, "end": size}[text.get("text-anchor") or ""]
                ends.setdefault(text.get("y") or "", []).append((start, start + size))
        for row in ends.values():
            assert all(end <= start + 0.1 for (_, end), (start, _) in pairwise(sorted(row)))
