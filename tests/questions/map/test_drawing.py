"""The picture of a map: its cells are the states of the settings, explained and framed."""

from functools import cache
from typing import Any

import pytest

import busplan
from busplan.forms import terminal
from busplan.forms.charts import ChartCell, ChartGrid, legend
from busplan.forms.inks import INKS
from busplan.questions.map import MapAnswer, NotDrawn
from busplan.questions.map.report import LOOKS

MAPS: dict[str, tuple[str, Any, Any]] = {
    "shown": ("paper-4ms", {}, {}),
    "gaps": ("paper-4ms", {"bus.gap_count": range(7, 71)}, {"bus.nodes": range(5)}),
    "words": ("paper-4ms", {"bus.gap_count": [5, 7, 63, "optimal"]}, {"bus.speed": ["S100", "S400"]}),
    "holes": ("paper-4ms", {"axes": range(1, 17)}, {"node.axes": [1, 2, 3, 4]}),
    "crowded": ("paper-4ms", {"bus.nodes": [2, 20, 70]}, {"cycle.period_us": [4000]}),
}
EVERY = pytest.mark.parametrize("name", MAPS)


@cache
def mapped(name: str) -> MapAnswer:
    profile, x, y = MAPS[name]
    return busplan.map_(profile, x=x or None, y=y or None)


def grid_of(name: str) -> ChartGrid:
    (panel,) = mapped(name).drawing().panels
    assert isinstance(panel.plot, ChartGrid)
    return panel.plot


def text_of(name: str, width: int = 80) -> list[str]:
    return terminal.text(mapped(name).report(), width=width).splitlines()


@EVERY
def test_each_cell_has_the_look_of_its_state_and_says_its_setting(name: str) -> None:
    found, grid = mapped(name), grid_of(name)
    marks = {entry.mark: entry.words for entry in grid.legend}
    tips = []
    for row, cells in zip(found.rows, grid.rows, strict=True):
        for setting, cell in zip(row, cells, strict=True):
            assert (cell is None) == isinstance(setting, NotDrawn)
            if cell is not None and not isinstance(setting, NotDrawn):
                assert marks[cell.mark].startswith(setting.state.replace("unsafe", "unsafe gap count"))
                assert cell.ink == LOOKS[setting.state].ink or cell.ink == "barred"
                tips.append(cell.words)
    assert len(set(tips)) == len(tips) == len(found.cells)


@EVERY
def test_the_legend_explains_every_mark_once_and_this_design(name: str) -> None:
    entries = legend(mapped(name).drawing().panels)
    cells = {cell for row in grid_of(name).rows for cell in row if isinstance(cell, ChartCell)}
    assert sorted(entry.mark for entry in entries if entry.mark) == sorted({cell.mark for cell in cells})
    words = [entry.words for entry in entries]
    assert ("blank: cannot exist" in words) == bool(mapped(name).not_drawn)
    assert ("this design" in words) == (mapped(name).own is not None)


@EVERY
def test_in_characters_it_fits_its_width_in_ascii(name: str) -> None:
    for width in (80, 100, 200):
        lines = text_of(name, width)
        drawn = [line for line in lines if line.endswith("|")]
        assert len(drawn) == len(mapped(name).rows)
        assert max(map(len, drawn)) <= width
        assert all(line.isascii() for line in lines)


def test_the_longest_labels_and_the_most_cells_fit_80_columns() -> None:
    found = busplan.map_(
        "paper-4ms", x={"bus.nodes": range(1, 65)}, y={"node.execution.worst_extra_us": [0.0000123456789, 1234.56789]}
    )
    assert max(len(line) for line in str(found).splitlines() if line.endswith("|")) <= 80


def test_states_differ_in_more_than_colour() -> None:
    assert len({look.mark for look in LOOKS.values()}) == len(LOOKS)
    assert len({INKS[look.ink] for look in LOOKS.values()}) == len(LOOKS)


def test_limits_that_no_time_helps_have_letters_of_their_own() -> None:
    entries = {entry.mark: entry.words for entry in grid_of("crowded").legend}
    assert entries == {"#": "fits", "h": "does not fit: hops", "n": "does not fit: nodes and hops", "": "this design"}


def test_this_design_is_framed_and_marked_in_characters() -> None:
    grid = grid_of("shown")
    assert grid.own is not None
    column, row = map(int, grid.own)
    cell = grid.rows[row][column]
    assert cell is not None
    assert cell.words == "8 axes, period 4 ms: fits"
    lines = text_of("shown")
    (own,) = [line for line in lines if line.startswith("> ")]
    assert own.startswith(">   4 ms | # [#] #")
    (pointer,) = [line for line in lines if line.strip() == "^"]
    assert own[pointer.index("^")] == "#"
    assert lines[lines.index(pointer) + 1][pointer.index("^")] == "8"


def test_values_stand_below_their_columns() -> None:
    lines = text_of("words")
    (row,) = [line for line in lines if line.startswith("> ")]
    below = lines[lines.index(row) + 3]
    assert below.split() == ["5", "7", "63", "optimal"]
    assert row.index("[#]") <= below.index("63") <= row.index("[#]") + 1


@pytest.mark.parametrize(
    ("periods_us", "label"),
    [([500, 1000, 1500], "period"), ([500, 1000, 4000], "period in unequal steps"), ([500], "period")],
)
def test_rows_have_equal_steps_or_say_that_they_do_not(periods_us: list[int], label: str) -> None:
    found = busplan.map_("paper-4ms", x={"axes": [4, 8]}, y={"cycle.period_us": periods_us})
    (panel,) = found.drawing().panels
    assert isinstance(panel.plot, ChartGrid)
    assert (panel.plot.up.label, panel.plot.across.label) == (label, "axes (bus.nodes)")
    assert ("period against axes (bus.nodes), in unequal steps" in str(found)) == ("unequal" in label)
    assert (grid_of("words").up.label, grid_of("words").across.label) == ("bus.speed", "bus.gap_count")
