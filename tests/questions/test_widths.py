"""Every answer at every width of a terminal: no line is too long, and no figure is cut, changed or lost unsaid."""

import re
from collections.abc import Callable, Iterator
from functools import cache

import pytest

from busplan.forms.blocks import Block, Chart, Report, Sentence, Table, TableColumn, TableRow
from busplan.forms.terminal import block_lines, text
from busplan.profile.shipped import load
from busplan.questions.capacity.report import capacity_report
from busplan.questions.capacity.sensitivity import sensitivities
from busplan.questions.capacity.sensitivity_report import sensitivity_report
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.circle.report import circle_report
from busplan.questions.circle.roundness import circle_test
from busplan.questions.compare.kinds import compare
from busplan.questions.compare.report import compare_report
from busplan.questions.diff import diff
from busplan.questions.explain import explain
from busplan.questions.fit.figures import capacity
from busplan.questions.latency.figures import latency
from busplan.questions.latency.report import latency_report
from busplan.questions.plan.planning import plan
from busplan.questions.plan.report import plan_report
from busplan.questions.sweep import sweep
from busplan.questions.timeline.events import schedule
from busplan.questions.timeline.report import timeline_report
from busplan.sections.profile import Profile

FIGURE = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
# One of each class of bus, the one of IEEE 1394 with the longest name, and one of groups.
PROFILES = ("paper-optimal-gap", "gantry-24", "can-servo-8", "can-fd-arm-7", "ethercat-servo-8", "sercos3-servo-8")


def swept(profile: Profile) -> Report:
    return sweep(profile, vary={"cycle.period_us": (500, 1000, 4000), "limits.reserve": (0, 0.25)}).report()


def several(profile: Profile) -> Report:
    found = capacity(profile, periods_us=[200.0, 500.0, 1000.0, 4000.0])
    return capacity_report(found, verdicts(found))


def moved(profile: Profile) -> Report:
    found = capacity(profile)
    return sensitivity_report(found, verdicts(found), sensitivities(found))


ANSWERS: dict[str, Callable[[Profile], Report]] = {
    "capacity": several,
    "capacity --sensitivity": moved,
    "latency": lambda profile: latency_report(latency(profile)),
    "plan": lambda profile: plan_report(plan(profile)),
    "explain": lambda profile: explain(profile).report(),
    "explain margin_us": lambda profile: explain(profile, "margin_us").report(),
    "circle-test": lambda profile: circle_report(circle_test(profile)._replace(with_contributions=True)),
    "diff": lambda profile: diff("paper-dma", profile, arguments=("a.toml", "b.toml")).report(),
    "timeline": lambda profile: timeline_report(schedule(profile)),
    "sweep": swept,
    "compare": lambda profile: compare_report(compare(profile, with_circle=True)),
}


ASKED = [
    (name, profile) for row, name in enumerate(ANSWERS) for profile in (PROFILES[row % 5], PROFILES[(row + 2) % 5])
]
"""Each answer of two profiles, each at some widths; all together have every width from 60 to 200."""


@cache
def answer(name: str, profile: str) -> Report:
    report = ANSWERS[name](load(profile).profile)
    blocks = tuple(report.blocks())
    return report._replace(blocks=lambda: blocks)


def figures(lines: Iterator[str] | list[str]) -> set[str]:
    return {figure for line in lines for figure in FIGURE.findall(line)}


def words_of(report: Report) -> list[Block]:
    """Its blocks without drawings: they have the width's own scale."""
    return [block for block in report.blocks() if not isinstance(block, Chart)]


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
