"""The picture of a map: its cells are the states of the settings, explained and framed."""

from functools import cache
from typing import Any

import pytest

import busplan

MAPS: dict[str, tuple[str, Any, Any]] = {
    "default": ("paper-4ms", None, None),
    "gaps": ("paper-4ms", {"bus.gap_count": range(7, 71)}, {"bus.nodes": range(5)}),
    "words": ("paper-4ms", {"bus.gap_count": [5, 7, 63, "optimal"]}, {"bus.speed": ["S100", "S400"]}),
    "holes": ("paper-4ms", {"axes": range(1, 17)}, {"node.axes": [1, 2, 3, 4]}),
    "crowded": ("paper-4ms", {"bus.nodes": [2, 20, 70]}, {"cycle.period_us": [4000]}),
}
EVERY = pytest.mark.parametrize("name", MAPS)


@cache
def mapped(name: str) -> busplan.MapAnswer:
    profile, x, y = MAPS[name]
    return busplan.map_(profile, x=x, y=y)


def grid_of(answer: busplan.MapAnswer) -> Any:
    (panel,) = answer.drawing().panels
    return panel.plot


def lines_of(name: str) -> list[str]:
    return str(mapped(name)).splitlines()


@EVERY
def test_each_cell_has_the_mark_of_its_state_and_says_its_setting(name: str) -> None:
    answer = mapped(name)
    grid = grid_of(answer)
    meanings = {entry.mark: entry.words for entry in grid.legend}
    tips = []
    for settings, cells in zip(answer.rows, grid.rows, strict=True):
        for setting, cell in zip(settings, cells, strict=True):
            assert (cell is None) == (setting in answer.not_drawn)
            if isinstance(setting, type(answer.cells[0])):
                assert meanings[cell.mark].startswith(setting.state.replace("unsafe", "unsafe gap count"))
                tips.append(cell.words)
    assert len(set(tips)) == len(tips) == len(answer.cells)


@EVERY
def test_the_legend_explains_every_mark_once_and_this_design(name: str) -> None:
    answer = mapped(name)
    grid = grid_of(answer)
    marks = {cell.mark for row in grid.rows for cell in row if cell is not None}
    assert sorted(entry.mark for entry in grid.legend if entry.mark) == sorted(marks)
    words = [entry.words for entry in grid.legend]
    assert ("blank: cannot exist" in words) == bool(answer.not_drawn)
    assert ("this design" in words) == (answer.design is not None)


def test_limits_where_no_period_helps_have_letters() -> None:
    entries = {entry.mark: entry.words for entry in grid_of(mapped("crowded")).legend}
    assert entries == {"#": "fits", "h": "does not fit: hops", "b": "does not fit: nodes and hops", "": "this design"}


def test_this_design_is_framed_and_marked_in_characters() -> None:
    grid = grid_of(mapped("default"))
    column, row = grid.own
    assert grid.rows[row][column].words == "8 axes, period 4 ms: fits"
    lines = lines_of("default")
    (design,) = [line for line in lines if line.startswith("> ")]
    assert design.startswith(">   4 ms | # [#] #")
    (pointer,) = [line for line in lines if line.strip() == "^"]
    assert design[pointer.index("^")] == "#"
    assert lines[lines.index(pointer) + 1][pointer.index("^")] == "8"


@pytest.mark.parametrize(
    ("periods_us", "label"),
    [([500, 1000, 1500], "period"), ([500, 1000, 4000], "period in unequal steps"), ([500], "period")],
)
def test_rows_have_equal_steps_or_say_that_they_do_not(periods_us: list[int], label: str) -> None:
    answer = busplan.map_("paper-4ms", x={"axes": [4, 8]}, y={"cycle.period_us": periods_us})
    grid = grid_of(answer)
    assert (grid.up.label, grid.across.label) == (label, "axes (bus.nodes)")
    assert ("Period against axes (bus.nodes); steps are unequal" in str(answer)) == ("unequal" in label)
    words = grid_of(mapped("words"))
    assert (words.up.label, words.across.label) == ("bus.speed", "bus.gap_count")
