"""The picture of a map: its marks are the states of its cells, in characters and as SVG."""

import re
from functools import cache
from xml.etree import ElementTree as ET

import pytest

from busplan.forms.picture import INKS
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.map.direction import AXES, PERIOD, Direction
from busplan.questions.map.drawing import LOOKS, legend_of, look_of, looks_of, map_lines, map_svg
from busplan.questions.map.trade_off import Cell, State, TradeOff, trade_off

SVG = "{http://www.w3.org/2000/svg}"
PAPER = load("paper-4ms").profile
DIRECTIONS = {
    "gaps": (Direction("bus.gap_count", tuple(range(7, 71))), Direction("bus.nodes", tuple(range(5)))),
    "words": (Direction("bus.gap_count", (5, 7, 63, "optimal")), Direction("bus.speed", ("S100", "S400"))),
    "holes": (Direction(AXES, tuple(range(1, 17))), Direction("node.axes", (1, 2, 3, 4))),
    "crowded": (Direction("bus.nodes", (2, 20, 70)), Direction(PERIOD, (4000,))),
}
EVERY = pytest.mark.parametrize("found", ["shown", *DIRECTIONS], indirect=True)


@cache
def mapped(name: str) -> TradeOff:
    if name not in DIRECTIONS:
        return trade_off(PAPER)
    x, y = DIRECTIONS[name]
    return trade_off(override(PAPER, {"bus.nodes": 70}) if name == "crowded" else PAPER, x=x, y=y)


@pytest.fixture
def found(request: pytest.FixtureRequest) -> TradeOff:
    """A map, which its tests share."""
    return mapped(request.param)


def grid_of(found: TradeOff, *, width: int = 80) -> list[str]:
    """What stands between the edges of each row, the first row of the map first."""
    lines = [line.text for line in map_lines(found, width=width)]
    rows = [re.fullmatch(r"(?:> |  ) *\S.* \|(.*)\|", line) for line in lines]
    return [row[1] for row in rows if row][::-1]


@EVERY
def test_each_character_is_the_state_of_its_cell(found: TradeOff) -> None:
    looks = looks_of(found)
    rows = grid_of(found)
    assert len(rows) == len(found.rows)
    for text, row in zip(rows, found.rows, strict=True):
        width = len(text) // len(row)
        cells = [text[width * number : width * (number + 1)].strip(" []") for number in range(len(row))]
        assert cells == [look_of(one, looks).mark if isinstance(one, Cell) else "" for one in row]


@EVERY
def test_it_fits_its_width_in_ascii(found: TradeOff) -> None:
    for width in (80, 100, 200):
        lines = map_lines(found, width=width)
        assert max(len(line.text) for line in lines) <= width
        assert all(line.text.isascii() for line in lines)


def test_the_longest_labels_and_the_most_cells_fit_80_columns() -> None:
    x = Direction("bus.nodes", tuple(range(1, 65)))
    y = Direction("node.execution.worst_extra_us", (0.0000123456789, 1234.56789012))
    assert max(len(line.text) for line in map_lines(trade_off(PAPER, x=x, y=y), width=80)) <= 80


@EVERY
def test_the_legend_explains_every_mark_once(found: TradeOff) -> None:
    looks = looks_of(found)
    text = " ".join(line.text for line in map_lines(found, width=80)).partition("Legend: ")[2]
    entries = legend_of(found, looks)
    assert sorted(entry.letter for entry in entries) == sorted({look.mark for look in looks.values()})
    for entry in entries:
        assert f"{entry.letter} {entry.text}" in " ".join(text.split())
    assert ("blank cannot exist" in text) == bool(found.not_drawn)
    assert ("this design" in text) == (found.own is not None)


def test_states_differ_in_more_than_colour() -> None:
    assert len({look.mark for look in LOOKS.values()}) == len(LOOKS)
    assert len({INKS[look.ink] for look in LOOKS.values()}) == len(LOOKS)


def test_limits_that_no_time_helps_have_letters_of_their_own() -> None:
    looks = looks_of(mapped("crowded"))
    assert {look.mark: limits for (_, limits), look in looks.items()} == {
        "#": (),
        "h": ("hops",),
        "n": ("nodes", "hops"),
    }


def test_this_design_is_marked_by_its_row_its_column_and_brackets() -> None:
    lines = [line.text for line in map_lines(mapped("shown"), width=80)]
    (own,) = [line for line in lines if line.startswith("> ")]
    assert own.startswith(">   4 ms | # [#] #")
    (pointer,) = [line for line in lines if line.strip() == "^"]
    assert own[pointer.index("^")] == "#"
    assert lines[lines.index(pointer) + 1][pointer.index("^")] == "8"
    narrow = [line.text for line in map_lines(mapped("gaps"), width=80)]
    (pointer,) = [line for line in narrow if line.strip() == "^"]
    assert mapped("gaps").own_place == (2, 56)
    assert pointer.index("^") == next(line for line in narrow if line.startswith("> ")).index("|") + 1 + 56


def test_values_stand_below_their_columns_and_touch_no_other() -> None:
    lines = [line.text for line in map_lines(mapped("words"), width=80)]
    (row,) = [line for line in lines if line.startswith("> ")]
    below = lines[lines.index(row) + 3]
    assert below.split() == ["5", "7", "63", "optimal"]
    assert below.index("optimal") < row.rindex("#") < below.index("optimal") + len("optimal")
    assert row.index("[#]") <= below.index("63") <= row.index("[#]") + 1
    root = ET.fromstring(map_svg(mapped("words"), title="t", inline=True))
    texts = [text.text for text in root.iter(f"{SVG}text") if text.get("class") in ("small", "small here")]
    assert {"63", "optimal"} <= set(texts)


def test_a_terminal_gets_the_colour_of_each_state() -> None:
    (row,) = [line for line in map_lines(mapped("shown"), width=80) if line.text.startswith(">")]
    assert {(row.text[mark.start : mark.end].strip()[0], mark.tone) for mark in row.marks} == {
        ("#", "passes"),
        ("?", "warns"),
    }


def inks(root: ET.Element) -> list[str]:
    cells = (rect.get("class", "").split() for rect in root.iter(f"{SVG}rect"))
    return [css[1] for css in cells if css[:1] == ["cell"]]


@EVERY
@pytest.mark.parametrize("inline", [True, False])
def test_the_svg_has_a_cell_for_each_setting_in_its_colour(found: TradeOff, inline: bool) -> None:
    root = ET.fromstring(map_svg(found, title='<script> & "x"', inline=inline))
    looks = looks_of(found)
    assert inks(root) == [look_of(cell, looks).ink for cell in found.cells]
    assert (root.find(f"{SVG}style") is None) == inline
    titles = [one.text for rect in root.iter(f"{SVG}rect") for one in rect.findall(f"{SVG}title")]
    assert len(set(titles)) == len(titles) == len(found.cells)


def test_the_legend_of_the_svg_is_no_wider_than_a_phone() -> None:
    root = ET.fromstring(map_svg(trade_off(load("dvrk").profile), title="T"))
    texts = [text.text or "" for text in root.iter(f"{SVG}text")]
    assert "does not fit: hops and broadcasting" in texts
    assert all(7 * len(text) < 335 for text in texts)


def test_the_svg_frames_this_design() -> None:
    root = ET.fromstring(map_svg(mapped("shown"), title="t", inline=True))
    (frame,) = [rect for rect in root.iter(f"{SVG}rect") if rect.get("class") == "own"]
    place = {key: frame.get(key) for key in ("x", "y", "width", "height")}
    (cell,) = [
        rect
        for rect in root.iter(f"{SVG}rect")
        if rect.get("class") != "own" and {key: rect.get(key) for key in place} == place
    ]
    assert [title.text for title in cell] == ["8 axes, period 4 ms: fits"]


def test_the_marks_of_the_svg_stand_on_their_cells() -> None:
    root = ET.fromstring(map_svg(mapped("holes"), title="t", inline=True))
    texts = [text for text in root.iter(f"{SVG}text") if text.get("class") == "mark"]
    marks = "".join(text.text or "" for text in texts)
    assert len(marks) == len(mapped("holes").cells)
    assert [len((text.get("x") or "").split()) for text in texts] == [len(text.text or "") for text in texts]


@pytest.mark.parametrize("state", LOOKS)
def test_every_state_has_a_colour(state: State) -> None:
    assert LOOKS[state].ink in INKS
