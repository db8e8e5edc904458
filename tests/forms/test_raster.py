"""A PNG has what its SVG has: the marks in their places, and every letter."""

import re
from functools import cache, partial
from io import BytesIO
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
import resvg_py
from numpy.typing import NDArray
from PIL import Image

import busplan
from busplan.forms.inks import INKS
from busplan.forms.svg import png

SVG = "{http://www.w3.org/2000/svg}"
Pixels = NDArray[np.uint8]


@cache
def pixels(svg: str) -> Pixels:
    return np.asarray(Image.open(BytesIO(png(svg))).convert("RGB"))


def drawn(text: str, *, css: str = "") -> Pixels:
    """Some text at the left edge, without colours."""
    style = f"<style>.a{{font:13px system-ui,'Segoe UI',serif;{css}}}</style>"
    root = '<svg xmlns="http://www.w3.org/2000/svg" width="100%" height="30">'
    return pixels(f'{root}{style}<text class="a" x="4" y="20">{text}</text></svg>')


def ink(image: Pixels) -> int:
    return int((255 - image[..., 0].astype(int)).sum())


def test_a_picture_has_two_pixels_for_each_px() -> None:
    assert drawn("x").shape == (60, 1280, 3)


@pytest.mark.parametrize("text", ["Margin", "Größe ± 5 µm", "Łódź", "δ → ω", "Ждфя"])
def test_letters_are_of_the_font_that_travels_with_the_package(text: str) -> None:
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="640" height="30"><text x="4" y="20">{text}</text></svg>'
    nothing = resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=True, background="#ffffff")
    assert ink(np.asarray(Image.open(BytesIO(bytes(nothing))).convert("RGB"))) == 0
    for letter in filter(str.strip, text):
        assert ink(drawn(letter)) > 0
        assert not np.array_equal(drawn(letter), drawn("\uf8fe"))


def test_a_picture_is_the_same_on_every_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    svg = busplan.timeline("paper-4ms").svg()
    here = png(svg)
    monkeypatch.setattr(resvg_py, "svg_to_bytes", partial(resvg_py.svg_to_bytes, skip_system_fonts=True))
    assert png(svg) == here


def test_a_character_that_no_font_has_is_a_box() -> None:
    assert ink(drawn("\uf8fe")) > 0
    assert ink(drawn("a\uf8feb")) > ink(drawn("ab"))


def test_bold_letters_are_bold() -> None:
    assert ink(drawn("Margin", css="font-weight:600")) > 1.2 * ink(drawn("Margin"))


def test_each_cell_of_a_map_has_its_colour_in_its_place_and_its_mark_on_it() -> None:
    answer = busplan.map_("paper-4ms", x={"axes": "4:72:4"}, y={"cycle.period_us": [500, 1000, 2000, 4000, 8000]})
    svg = answer.svg()
    image, root = pixels(svg), fromstring(svg)
    (body,) = root.findall(f"{SVG}svg")
    (area,) = body.findall(f"{SVG}svg")

    def px(box: str | None, of: float) -> float:
        return float((box or "").rstrip("%")) / 100 * of

    body_px = px(body.get("width"), 640)
    left, width = px(body.get("x"), 640) + px(area.get("x"), body_px), px(area.get("width"), body_px)
    cells = [rect for rect in area.iter(f"{SVG}rect") if (rect.get("class") or "").startswith("cell ")]
    assert len(cells) == len(answer.cells) == 90
    for cell in cells:
        x, across = left + px(cell.get("x"), width), px(cell.get("width"), width)
        y = float(cell.get("y") or 0)
        colour = INKS[(cell.get("class") or "").split()[1]].light
        corner = image[round(2 * (y + 3)), round(2 * (x + 3))]
        assert "#" + "".join(f"{one:02x}" for one in corner) == colour
        middle = image[round(2 * y) + 8 : round(2 * y) + 34, round(2 * (x + across / 2)) - 10 :][:, :20]
        assert middle.min() < 60


def test_a_curve_has_its_light_colour_and_a_file_no_variable() -> None:
    answer = busplan.capacity("paper-4ms", sensitivity=True)
    svg = answer._repr_svg_() or ""
    assert "var(" not in svg
    light, dark = re.findall(r"\.chart \.takes \{ fill: (#[0-9a-f]+);", svg)
    assert svg.index(light) < svg.index("@media") < svg.index(dark)
    wanted = [int(light[at : at + 2], 16) for at in (1, 3, 5)]
    assert (pixels(svg) == wanted).all(axis=2).sum() > 1000


def test_a_very_high_picture_has_fewer_pixels() -> None:
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="100%" height="128000"><rect width="9" height="9"/></svg>'
    assert pixels(svg).shape == (16000, 80, 3)


def test_text_that_looks_like_a_variable_stays_text() -> None:
    assert ink(drawn("var(--ink)")) > 0
