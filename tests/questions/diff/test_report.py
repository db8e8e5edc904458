"""What `busplan diff` says: the verdict first, differences that are seen, Markdown that is nothing but its text."""

import re
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.errors import BusplanError
from busplan.forms import render
from busplan.forms.blocks import Report, Table, TableRow
from busplan.forms.terminal import block_lines
from busplan.printable import to_json
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.circle.figures import CircleFigures
from busplan.questions.circle.roundness import circle_test
from busplan.questions.diff.difference import Difference, cycle_figures, difference, plan_figures
from busplan.questions.diff.report import diff_document, diff_records, diff_report, regression_words, shown_value
from busplan.questions.fit.network import bus_of
from busplan.sections.profile import Profile

AB = ("a.toml", "b.toml")


@pytest.fixture
def paper() -> Profile:
    """A profile without a circle."""
    keys = {"description", "servo", "circle", "tolerance"}
    data = load("paper-1ms").profile.model_dump(exclude_unset=True, exclude=keys)
    return Ieee1394Profile.model_validate(data)


def run_circle(profile: Profile) -> CircleFigures:
    return circle_test(profile, explain=False).results[0]


def text(found: Difference) -> list[str]:
    return render(diff_report(found, arguments=AB), "table").splitlines()


def comment(found: Difference, *, arguments: tuple[str, str] = AB) -> str:
    return render(diff_report(found, arguments=arguments), "markdown")


def figures(found: Difference) -> list[TableRow]:
    """Rows of the table of figures; none where there is no such table."""
    tables = (block for block in diff_report(found, arguments=AB).blocks() if isinstance(block, Table))
    return [row for table in tables if table.columns[0].heading == "figure" for row in table.rows]


def verdict(a: Profile, changes: dict[str, object], **options: Any) -> str:
    return text(difference(a, override(a, changes), **options))[0]


class Page(HTMLParser):
    """Tags and texts of a page, the cells of its tables apart."""

    def __init__(self, markdown: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""
        self.rows: list[list[str]] = []
        self.feed(MarkdownIt("commonmark", {"html": True, "linkify": False}).enable("table").render(markdown))

    def handle_starttag(self, tag: str, attrs: object) -> None:
        del attrs
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag == "table":
            self.tags.append("/table")

    def handle_data(self, data: str) -> None:
        self.text += data
        inside = self.tags.count("table") > self.tags.count("/table")
        if inside and self.rows and self.rows[-1] and data.strip():
            self.rows[-1][-1] += data


# --- the verdict ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cycle.period_us": 200}, "B is not shown to fit where A is; B is worse in "),
        (
            {"bus.gap_count": 3},
            "B has an unsafe gap count where A has a safe one; B is worse in 2 figures: safe nodes, safe axes; B is ",
        ),
        # The verdict is by the standard in both.
        ({"bus.timing_model": "standard"}, "B is neither better nor worse: 1 key differs, and no figure."),
        ({"name": "other"}, "B is neither better nor worse: 1 key differs, and no figure."),
        ({}, "A and B are the same profile: every key has the same value."),
        (
            {"cycle.nonperiodic_us": 250},
            "B is not shown to fit where A is; B is worse in 10 figures: corrected margin, safe nodes, safe axes, ",
        ),
        (
            {"node.axes": 5},
            "B is better in 2 figures: safe axes, most axes.",
        ),
        (
            {"bus.gap_count": 62},
            "B is better in 12 figures: corrected margin, period with enough time, margin, utilisation and 8 more.",
        ),
        (
            {"payload.overhead_bytes": 24},
            "B is worse in 10 figures: margin (paper), utilisation (paper), required time (paper), smallest period ",
        ),
    ],
)
def test_the_first_line_is_the_verdict(paper: Profile, changes: dict[str, object], said: str) -> None:
    assert verdict(paper, changes).startswith(said)


def test_a_closed_form_that_changes_alone_says_that_the_verdict_does_not(paper: Profile) -> None:
    # Four nodes need 410 us by the paper's equations, and are far from fitting by the standard's.
    four = override(paper, {"bus.nodes": 4})
    assert verdict(four, {"cycle.nonperiodic_us": 100}).startswith(
        "B does not fit where A does by the closed form of paper, which does not change the verdict; B is worse in "
    )


def test_the_verdict_of_circles(paper: Profile) -> None:
    def passes_above_900(profile: Profile) -> CircleFigures:
        result = run_circle(override(profile, {"cycle.period_us": 1000}))
        return result._replace(passed=profile.cycle.period_us > 900)

    asks = override(paper, {"servo.grade": "measured"})
    assert verdict(asks, {"cycle.period_us": 800}, circle=passes_above_900).startswith(
        "B does not pass the circle where A does; B is worse in 7 figures: corrected margin, safe nodes, "
    )
    small = override(asks, {"cycle.period_us": 800})
    assert verdict(small, {"cycle.period_us": 1000}, circle=passes_above_900).startswith(
        "B passes the circle where A does not; B is better in 7 figures: "
    )


def test_the_state_is_that_of_the_verdict(paper: Profile) -> None:
    def tone(changes: Any) -> str:
        found = difference(paper, override(paper, changes))
        return next(block_lines(diff_report(found, arguments=AB).blocks())).tone

    assert [tone(one) for one in ({"cycle.period_us": 200}, {"bus.gap_count": 13}, {"name": "x"}, {})] == [
        "fails",
        "passes",
        "neutral",
        "neutral",
    ]


def test_every_figure_that_differs_has_a_row_and_every_figure_a_record(paper: Profile) -> None:
    found = difference(paper, override(paper, {"bus.gap_count": 7}))
    bus = bus_of(paper)
    records = diff_records(found)
    assert len(records) == len(plan_figures(bus)) + 2 * len(cycle_figures(bus))
    differ = [one for one in records if one["judgement"] != "same"]
    assert 0 < len(differ) < len(records)
    lines = text(found)
    assert sum(line.endswith((" better", " worse", " neutral")) for line in lines) == len(differ)
    assert not [line for line in lines if line.endswith(" same")]
    assert re.fullmatch(r"\d\d figures are the same\.", lines[-1])
    report = diff_report(found, arguments=AB)
    whole = render(report._replace(is_whole=True), "table").splitlines()
    assert sum(line.endswith(" same") for line in whole) == len(lines_of_detail(report)) > 20
    (margin,) = (line.split() for line in lines if line.startswith("margin ") and " paper " in line)
    # Four transactions, 56 counts: 48 ticks of eq (10) and twice the 4 of eq (4), at 393.216 MHz.
    assert margin == ["margin", "paper", "us", "292.883", "324.784", "+31.901", "+10.9", "better"]
    assert figures(difference(paper, paper)) == []


def lines_of_detail(report: Report) -> list[TableRow]:
    return [row for block in report.blocks() if isinstance(block, Table) for row in block.rows if row.is_detail]


def test_what_is_worse_fails(paper: Profile) -> None:
    def judged(changes: Any) -> set[Any]:
        rows = figures(difference(paper, override(paper, changes)))
        return {row.cells[-1][:2] for row in rows if not row.is_detail}

    assert judged({"cycle.period_us": 500}) == {("worse", "fails"), ("neutral", "neutral")}
    assert judged({"bus.gap_count": 13}) == {("better", "passes"), ("neutral", "neutral")}


@pytest.mark.parametrize("name", ["paper-1ms", "paper-two-node"])
def test_every_figure_stands_at_its_place(name: str, values_of_the_document: Callable[[Report], int]) -> None:
    found = difference(load("paper-4ms").profile, load(name).profile, circle=run_circle)
    # The table shows the first 20 keys.
    sides = (side.value for one in found.keys[:20] for side in (one.a, one.b) if side is not None)
    numbers = [one for one in sides if isinstance(one, int | float) and not isinstance(one, bool)]
    # Four of each row, the two periods, and the numbers of the keys.
    assert values_of_the_document(diff_report(found, arguments=AB)) == 4 * len(figures(found)) + 2 + len(numbers)


def test_keys_that_differ_in_their_last_digit_are_seen_to_differ() -> None:
    near = override(load("paper-1ms").profile, {"cycle.slice_ratio": 0.1 + 0.2})
    table = render(diff_report(difference(near, override(near, {"cycle.slice_ratio": 0.3})), arguments=AB), "table")
    assert "cycle.slice_ratio  0.30000000000000004  0.29999999999999999" in table


def test_a_terminal_is_commanded_by_no_argument(paper: Profile) -> None:
    report = diff_report(difference(paper, paper), arguments=("\x1b[31m.toml", "b\n.toml"))
    lines = render(report, "table").splitlines()
    assert any(line.startswith("A  \\x1b[31m.toml") for line in lines)
    assert any(line.startswith("B  b .toml") for line in lines)
    assert all(line.isprintable() for line in lines)


def test_why_a_circle_has_no_figures_is_said() -> None:
    one = load("paper-1ms").profile
    lines = text(difference(one, override(one, {"cycle.period_us": 200}), circle=run_circle))
    assert "The circle of B is not simulated: the cycle does not fit the bus: 263.320 us needed of 100.000 us." in lines
    bare = override(one, {"servo": {"grade": "calibrated", "drive_lag_us": 7500.0}})
    lines = text(difference(bare, override(one, {"cycle.period_us": 1050.5}), circle=run_circle))
    assert any(
        line.startswith("The circle of B is not simulated: servo.step_us = 100.0: the period of") for line in lines
    )
    assert "The servo values behind the circle's figures are calibrated in A and assumed in B." in lines
    lines = text(difference(one, override(one, {"tolerance.max_contour_error_mm": 0.01}), circle=run_circle))
    assert any(
        line.startswith("The circle of B FAILED: the largest contour error of 22.085 um is 12.085") for line in lines
    )
    assert "The servo values behind the circle's figures are assumed." in lines


def test_regressions_are_named_with_the_timing_that_has_them(paper: Profile) -> None:
    found = difference(paper, override(paper, {"cycle.nonperiodic_us": 250}))
    assert regression_words(found, found.regressions(tolerance=0.8), tolerance=80) == (
        "regression: B is worse by more than 80 % in 9 figures: verdict, shown to fit, corrected margin, "
        "period with enough time, margin, utilisation, required time, smallest period, no limit broken (standard)"
    )
    assert regression_words(found, found.regressions(), tolerance=0).startswith("regression: B is worse in ")


# --- values -----------------------------------------------------------------------------------------------


def test_a_value_is_shown_as_toml_has_it() -> None:
    for value, other, shown in [
        (63, "optimal", "63"),
        ("optimal", 63, '"optimal"'),
        (0.1, None, "0.1"),
        (1e-7, None, "1e-07"),
        (4000.0, 1.0, "4000"),
        (None, 3, "none"),
        ((4, 16), (4,), "[4, 16]"),
        ((36.7, 36.0), None, "[36.7, 36]"),
        (False, None, "false"),
        (["sdo", "alarm"], None, '["sdo", "alarm"]'),
        ([True, 2.0], None, "[true, 2]"),
        (tuple(range(20)), None, "[0, 1, 2, 3, 4, 5, 6, 7, 12 more]"),
        (tuple(range(20)), tuple(range(21)), "[20 alike]"),
        (tuple(range(21)), tuple(range(20)), "[20 alike, 20]"),
        (tuple(range(20)), (*range(5), 99, *range(6, 20)), "[5 alike, 5, 14 alike]"),
        (tuple([1] * 9), tuple([1] * 10), "[9 alike]"),
        ('a"b\\\n', None, r'"a\"b\\\n"'),
        ("x" * 41, None, f'"{"x" * 40}"..'),
        ("x" * 60 + "a", "x" * 60 + "b", '.."xxxxxxxxa"'),
    ]:
        assert shown_value(value, other) == shown


NUMBERS = st.lists(st.integers(0, 3), max_size=30).map(tuple)


@given(one=NUMBERS, other=NUMBERS)
def test_two_lists_that_differ_look_different(one: tuple[int, ...], other: tuple[int, ...]) -> None:
    assert (shown_value(one, other) == shown_value(other, one)) == (one == other)


@given(one=st.text("ab", max_size=80), other=st.text("ab", max_size=80))
def test_two_texts_that_differ_look_different(one: str, other: str) -> None:
    assert (shown_value(one, other) == shown_value(other, one)) == (one == other)


# --- Markdown ---------------------------------------------------------------------------------------------

ALLOWED = {"h3", "p", "strong", "code", "table", "/table", "thead", "tbody", "tr", "th", "td"}
HOSTILE = (
    "<script>alert(1)</script>", "a|b", "`x`", "```", "\\", "a\\|b", "[x](http://y)", "*a* _b_", "@team #1", "&lt;",
    "![i](j)", "| a | b |", "https://example.org", "<!-- x", "</details>",
)  # fmt: skip


def test_a_comment_has_the_verdict_first_and_what_differs() -> None:
    a, b = load("paper-1ms").profile, load("paper-optimal-gap").profile
    page = Page(comment(difference(a, b), arguments=("main:line.toml", "paper-optimal-gap")))
    title, verdict = page.text.strip().splitlines()[:2]
    assert title == "Changes from main:line.toml to paper-optimal-gap"
    assert verdict.startswith("B is better in 16 figures: corrected margin, safe nodes, safe axes, period with ")
    assert page.rows[1:3] == [
        ["A", "main:line.toml", "paper-1ms", "1000", "paper"],
        ["B", "paper-optimal-gap", "paper-optimal-gap", "1000", "standard"],
    ]
    assert ["bus.gap_count", "63", '"optimal"'] in page.rows
    assert ["margin", "paper", "us", "292.883", "324.784", "+31.901", "+10.9", "better"] in page.rows
    assert not [row for row in page.rows if row[-1] == "same"]
    # Of the terms, five are the same, and those that the gap count is in are neither better nor worse.
    assert {row[0] for row in page.rows if row[-1] == "neutral"} >= {"arbitration", "idle"}
    assert "25 figures are the same." in page.text
    assert set(page.tags) <= ALLOWED


def test_every_cell_is_shown_as_the_table_on_a_terminal_has_it(paper: Profile) -> None:
    found = difference(paper, override(paper, {"cycle.period_us": 200, "bus.nodes": 3}))
    page = Page(comment(found))
    shown = {"  ".join(one for one in row if one) for row in page.rows}
    # A page marks what fails by its weight.
    lines = {"  ".join(line.replace(" - ", "  -  ").replace(" !", "").split()) for line in text(found)}
    words = {" ".join(row.split()) for row in shown}
    assert words >= {" ".join(line.split()) for line in lines if line.endswith(("worse", "better", "neutral"))}


@pytest.mark.parametrize("name", [" ".join(HOSTILE[:8]), " ".join(HOSTILE[8:])])
def test_hostile_names_are_shown_and_do_nothing_else(paper: Profile, name: str) -> None:
    b = override(paper, {"name": name, "description": f"{name}\n{name}", "bus.nodes": 3})
    page = Page(comment(difference(paper, b), arguments=("a.toml", f"main:{name}.toml")))
    assert set(page.tags) <= ALLOWED
    assert page.tags.count("table") == 3
    assert {len(row) for row in page.rows} == {3, 5, 8}
    shown = next(row for row in page.rows if row[0] == "name")
    assert shown == ["name", '"paper-1ms"', shown_value(name)]
    assert page.rows[2][:3] == ["B", f"main:{name}.toml", name]


def test_a_long_comment_is_cut_and_says_so() -> None:
    one = load("paper-4ms").profile
    servo: dict[str, object] = {f"servo.{axis}.{key}": 1.0 for axis in "xy" for key in LONG}
    found = difference(one, override(one, servo))
    page = Page(comment(found))
    assert len(found.keys) == 22
    assert sum(row[0].startswith("servo.") for row in page.rows) == 20
    assert "And 2 more keys." in page.text


LONG = (
    "position_gain_per_s", "integral_gain_per_s2", "derivative_gain", "velocity_feedforward",
    "acceleration_feedforward_s", "drive_lag_us", "drive_offset_mm_s", "max_velocity_mm_s", "encoder_resolution_mm",
    "reversal_mm_s", "reversal_recovery_us",
)  # fmt: skip


def test_the_same_profile_needs_no_table(paper: Profile) -> None:
    page = Page(comment(difference(paper, paper)))
    assert page.tags.count("table") == 1
    assert len(page.rows) == 3
    assert "A and B are the same profile" in page.text


def test_rows_of_a_circle_that_is_not_there_are_left_to_the_note() -> None:
    one = load("paper-1ms").profile
    found = difference(one, override(one, {"cycle.period_us": 200}), circle=run_circle)
    page = Page(comment(found))
    assert [row[0] for row in page.rows if row[1] == "circle"] == ["passed"]
    assert "The circle of B is not simulated: the cycle does not fit the bus: 263.320 us needed" in page.text


def test_why_a_circle_cannot_be_run_is_no_markup(paper: Profile) -> None:
    def circle(_: Profile) -> CircleFigures:
        raise BusplanError("<b> *bold* [x](y)")

    asks = override(paper, {"servo.grade": "measured"})
    page = Page(comment(difference(asks, override(asks, {"bus.nodes": 3}), circle=circle)))
    assert set(page.tags) <= ALLOWED
    assert "The circle of A is not simulated: <b> *bold* [x](y).\n" in page.text


# --- JSON -------------------------------------------------------------------------------------------------


def test_the_document_holds_both_sides_in_full(paper: Profile) -> None:
    found = difference(paper, override(paper, {"node.execution.grade": "measured", "bus.max_hops": 2}))
    document = diff_document(found, arguments=AB)
    assert (document["schema"], document["command"], document["same"]) == (1, "diff", False)
    assert document["a"] == {
        "argument": "a.toml",
        "profile": "paper-1ms",
        "timing_model": "paper",
        "circle_problems": None,
        "circle_refused_by": [],
    }
    assert document["changes"] == [
        {"key": "bus.max_hops", "a": None, "a_source": "default", "b": 2, "b_source": "file"},
        {"key": "node.execution.grade", "a": "derived", "a_source": "file", "b": "measured", "b_source": "file"},
    ]
    assert document["verdict"] == text(found)[0]
    assert set(document["figures"][0]) == {
        "part",
        "figure",
        "better",
        "a",
        "b",
        "difference",
        "relative_difference",
        "judgement",
    }
    assert to_json(document)
