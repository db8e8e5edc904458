"""The picture of `busplan compare` in every form."""

import re
from functools import cache
from itertools import pairwise
from xml.etree.ElementTree import Element, fromstring

import pytest

from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.compare.drawing import axes_labels, compare_lines, compare_svg, kind_lines, own_axes, plane_of
from busplan.questions.compare.kinds import KindComparison, compare

SVG = "{http://www.w3.org/2000/svg}"
EACH = pytest.mark.parametrize("found", ["can-servo-8", "dvrk", "gantry-24", "paper-1ms"], indirect=True)


@cache
def compared(name: str) -> KindComparison:
    return compare(load(name).profile)


@pytest.fixture
def found(request: pytest.FixtureRequest) -> KindComparison:
    """The comparison of a shipped profile, which its tests share."""
    return compared(request.param)


def dots(found: KindComparison) -> list[Element]:
    root = fromstring(compare_svg(found, title="<T> & $x$"))
    return [one for one in root.iter(f"{SVG}circle") if one.find(f"{SVG}title") is not None]


@EACH
def test_every_point_that_carries_axes_is_a_dot_in_its_place(found: KindComparison) -> None:
    plane = plane_of(found)
    points = [(line, point) for line in kind_lines(found) for point in line.points]
    assert sum(bool(each.axes) for one in found.compared for each in one.curve) == len(points)
    drawn = dots(found)
    assert len(drawn) == len(points)
    for dot, (line, (period_us, axes)) in zip(drawn, points, strict=True):
        assert float((dot.get("cx") or "").rstrip("%")) == pytest.approx(100 * plane.x(period_us), abs=1e-2)
        assert line.ink in (dot.get("class") or "")
        assert f"{axes} ax" in (dot.find(f"{SVG}title").text or "")  # type: ignore[union-attr]


@EACH
def test_no_label_lies_on_another_on_a_phone(found: KindComparison) -> None:
    root = fromstring(compare_svg(found, title="T"))
    own = next(text for text in root.iter(f"{SVG}text") if (text.text or "").startswith("this machine"))
    up = next(text for text in root.iter(f"{SVG}text") if text.text == "axes, logarithmic")
    assert float(own.get("y") or 0) - float(up.get("y") or 0) >= 14
    periods = [text for text in root.iter(f"{SVG}text") if re.fullmatch(r"[\d.]+ [um]s", text.text or "")]
    ends = []
    for text in periods:
        width = 7 * len(text.text or "")
        start = 2.65 * float((text.get("x") or "").rstrip("%"))
        start -= {"start": 0, "middle": width / 2, "end": width}[text.get("text-anchor") or ""]
        ends.append((start, start + width))
    assert len(ends) >= 3
    assert all(end < start for (_, end), (start, _) in pairwise(ends))


@EACH
def test_both_scales_are_logarithmic_and_hold_everything(found: KindComparison) -> None:
    plane = plane_of(found)
    assert (plane.x(plane.from_us), plane.x(plane.to_us)) == (0, 1)
    assert plane.y(1) == 0
    assert plane.y(own_axes(found)) <= 1
    assert all(plane.y(axes) <= 1 for line in kind_lines(found) for _, axes in line.points)
    assert plane.x((plane.from_us * plane.to_us) ** 0.5) == pytest.approx(0.5)
    assert set(axes_labels(plane)) >= {1, 10}


@EACH
def test_characters_fit_and_every_letter_is_in_the_legend(found: KindComparison) -> None:
    for width in [60, 80, 120]:
        lines = [line.text for line in compare_lines(found, width=width)]
        assert max(map(len, lines)) <= width
        letters = [line.letter for line in kind_lines(found)]
        assert len(set(letters)) == len(letters)
        body = "".join(line.partition("|")[2] for line in lines)
        for line in kind_lines(found):
            assert f"{line.letter} {line.title}" in " ".join(lines)
            assert not line.points or line.letter in body or "*" in body


def test_points_in_one_place_are_a_star() -> None:
    found = compared("paper-1ms")
    own = found.compared[0]
    twice = found._replace(kinds=(own, own._replace(is_own=False)))
    drawn = "\n".join(line.text for line in compare_lines(twice, width=80))
    assert drawn.count("*") == sum(bool(each.axes) for each in own.curve) + 1
    assert "several" in drawn
    alone = found._replace(kinds=(own,))
    assert "several" not in "\n".join(line.text for line in compare_lines(alone, width=80))


def test_a_picture_takes_any_name() -> None:
    found = compare(override(load("paper-1ms").profile, {"name": "$\\frac<&"}))
    assert fromstring(compare_svg(found, title="<&")).find(f"{SVG}title").text == "<&"  # type: ignore[union-attr]


def test_a_machine_that_no_bus_carries_is_drawn() -> None:
    # Inputs of 40 bytes are over the four frames of a PDO, and no axis has one of its own for them.
    inputs = override(load("gantry-24").profile, {"cycle.period_us": 1.0, "group.io.read_bytes": 40})
    late = compare(inputs, kinds=["can"])
    assert dots(late) == []
    assert compare_lines(late, width=80)
