"""Every answer at every width of a terminal: no line is too long, and no figure is cut, changed or lost unsaid."""

import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import pytest

import busplan
from busplan.forms.blocks import Block, Chart, Report, Sentence, Table, TableColumn, TableRow
from busplan.forms.terminal import block_lines, text

FIGURE = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
# One of each class of bus, the one of IEEE 1394 with the longest name, and one of groups.
PROFILES = ("paper-optimal-gap", "gantry-24", "can-servo-8", "can-fd-arm-7", "ethercat-servo-8", "sercos3-servo-8")


ANSWERS: dict[str, Callable[[str], Any]] = {
    "capacity": lambda profile: busplan.capacity(profile, period_us=[200, 500, 1000, 4000]),
    "capacity --sensitivity": lambda profile: busplan.capacity(profile, sensitivity=True),
    "latency": busplan.latency,
    "plan": busplan.plan,
    "explain": busplan.explain,
    "explain margin_us": lambda profile: busplan.explain(profile, "margin_us"),
    "circle-test": lambda profile: busplan.circle_test(profile, contributions=True),
    "diff": lambda profile: busplan.diff("paper-dma", profile, arguments=("a.toml", "b.toml")),
    "timeline": busplan.timeline,
    "sweep": lambda profile: busplan.sweep(
        profile, vary={"cycle.period_us": (500, 1000, 4000), "limits.reserve": (0, 0.25)}
    ),
    "compare": busplan.compare,
}


ASKED = [
    (name, profile) for row, name in enumerate(ANSWERS) for profile in (PROFILES[row % 5], PROFILES[(row + 2) % 5])
]
"""Each answer of two profiles, each at some widths; all together have every width from 60 to 200."""


@cache
def answer(name: str, profile: str) -> Report:
    report: Report = ANSWERS[name](profile).report()
    return report


def figures(lines: Iterator[str] | list[str]) -> set[str]:
    return {figure for line in lines for figure in FIGURE.findall(line)}


def words_of(report: Report) -> list[Block]:
    """Its blocks without drawings: they have the width's own scale."""
    return [block for block in report.blocks if not isinstance(block, Chart)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "profile"), ASKED)
def test_an_answer_fits_and_has_no_figure_that_is_cut_or_changed(name: str, profile: str) -> None:
    report = answer(name, profile)
    whole = figures([line.text for line in block_lines(words_of(report), is_whole=True)])
    for width in (80, *range(60 + ASKED.index((name, profile)), 201, len(ASKED))):
        shown = text(report, width=width).splitlines()
        assert [line for line in shown if len(line) > width] == []
        blocks = words_of(report)
        left_out = figures([line.text for line in block_lines(blocks, width=width)]) - whole
        # How many rows are left out is said, and is no figure of the answer.
        assert {one for one in left_out if f"Not shown: {one} row" not in " ".join(shown)} == set()
        assert figures([line.text for line in block_lines(blocks, width=width, is_whole=True)]) == whole


TABLE = Table(
    (
        TableColumn("name", kind="words", wraps=True),
        TableColumn("note", kind="words", rank=3, leaves="below", wraps=True),
        TableColumn("eq", kind="words", rank=9),
        *(TableColumn(f"figure {number}", "us", group=f"group {number // 2}") for number in range(6)),
        TableColumn("last", "us", rank=1),
    ),
    tuple(
        TableRow(
            (
                *(f"the row of number {row}", "words that say much of it", "(1)"),
                *(f"{row}{number}{'123456.789'[: row + 4]}" for number in range(7)),
            )
        )
        for row in range(1, 6)
    ),
    Sentence(("A caption of some words",)),
)


@pytest.mark.parametrize("is_whole", [False, True])
def test_a_table_is_whole_at_every_width(is_whole: bool) -> None:
    for width in range(40, 201):
        lines = [line.text for line in block_lines([TABLE], width=width, is_whole=is_whole)]
        assert max(map(len, lines)) <= width
        told = " ".join(lines)
        words = set(told.split())
        left_out = told.partition("Not shown:")[2].partition("--all")[0]
        for row in TABLE.rows:
            assert words.issuperset(str(row.cells[1]).split()), width
            for column, cell in zip(TABLE.columns[3:], row.cells[3:], strict=True):
                assert (f" {column.name}" in left_out) != (str(cell) in words), (width, column.name)
        assert not is_whole or "Not shown" not in told


def test_the_largest_rank_leaves_first() -> None:
    left_out = [
        " ".join(line.text for line in block_lines([TABLE], width=width)).partition("Not shown: ")[2]
        for width in (200, 120, 90, 60)
    ]
    assert left_out[0] == ""
    assert left_out[1].startswith("column eq.")
    assert left_out[-1].startswith("columns eq, last.")
