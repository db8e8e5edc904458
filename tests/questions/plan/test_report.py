"""What `busplan plan` says, and the data it gives."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

import pytest

from busplan.forms import render
from busplan.forms.blocks import Report, Sentence, ShownValue, Table, TableRow, Words
from busplan.forms.csv_rows import to_csv
from busplan.forms.numbers import cell_text, sentence_text
from busplan.printable import to_json
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.plan.planning import Plan, plan
from busplan.questions.plan.report import plan_document, plan_records, plan_report, settings
from busplan.questions.plan.search import MAX_CIRCLES
from busplan.sections.profile import Profile

ValuesIn = Callable[[object], Iterator[ShownValue]]

CONTRACT = {
    "title",
    "changes",
    "max_nodes",
    "max_axes",
    "period_us",
    "margin_us",
    "limited_by",
    "circle_passed",
    "recommended",
    "verdict",
    "margin_corrected_us",
    "uncertainty_us",
    "safe_nodes",
    "safe_axes",
}


@pytest.fixture
def paper() -> Profile:
    return load("paper-1ms").profile


Circle = Callable[[Profile], tuple[str, ...]]


def rough(profile: Profile) -> tuple[str, ...]:
    return () if profile.cycle.period_us > 3000 else ("rough",)


def egg(_: Profile) -> tuple[str, ...]:
    return ("the circle is an egg",)


@cache
def planned(profile: Profile, circle: Circle | None = None, max_circles: int = MAX_CIRCLES, **wanted: Any) -> Plan:
    """The plan for a goal, searched for once; keys of the profile have __ for their dot."""
    goal = {key.replace("__", "."): value for key, value in wanted.items()}
    return plan(profile, circle=circle, max_circles=max_circles, wanted=goal)


def report(profile: Profile, circle: Circle | None = None, **options: Any) -> Report:
    return plan_report(planned(profile, circle, **options))


def text(profile: Profile, circle: Circle | None = None, **options: Any) -> str:
    return render(report(profile, circle, **options), "table")


def rows(answer: Report) -> Sequence[TableRow]:
    (table,) = (block for block in answer.blocks() if isinstance(block, Table))
    return table.rows


def test_the_first_line_says_what_to_set(paper: Profile) -> None:
    first = text(paper, bus__nodes=4).splitlines()[0]
    assert first.startswith("paper-1ms with 4 nodes (16 axes) at 1 ms: set bus.gap_count = 10; then it fits with")
    assert first.endswith(" a margin of 75.567 us +/- 23.911 us.")
    assert ": nothing to change; it fits with a margin of" in text(load("paper-optimal-gap").profile).splitlines()[0]
    assert "and passes the circle." in text(paper, circle=lambda _: ()).splitlines()[0]


def test_no_plan_says_what_binds_and_what_would_be_enough(paper: Profile) -> None:
    found = report(paper, circle=egg, max_circles=2)
    lines = render(found, "table").splitlines()
    assert found.blocks()[0].state == "fails"  # type: ignore[union-attr]
    assert lines[0].endswith(
        ": NO PLAN. No change of gap count, slice ratio and period is enough: the circle is an egg."
    )
    assert lines[1] == "Enough would be to leave out the circle: nothing to change."
    assert "Smallest period: none, the circle is an egg (not proven: the search was cut short" in "\n".join(lines)
    first, *others = text(paper, bus__nodes=8, cycle__period_us=1000.0, limits__reserve=0.2).splitlines()
    assert first.endswith(
        ": NO PLAN. No change of gap count and slice ratio is enough: the cycle needs a slice of 1237.520 us to be "
        "shown to fit, and at most 900.000 us can be given."
    )
    assert others[:4] == [
        (
            'Enough would be to free the responses: node.read_response = "concatenated" (if the nodes can), '
            "cycle.slice_ratio = 0.89, bus.gap_count = 21."
        ),
        'Enough would be to free the schedule: cycle.schedule = "broadcast" (if the firmware of all nodes can).',
        "Enough would be to free the period: cycle.period_us = 1400, cycle.slice_ratio = 0.89, bus.gap_count = 21.",
        "Enough would be to free the nodes: bus.nodes = 6, cycle.slice_ratio = 0.89, bus.gap_count = 16.",
    ]
    weaker = text(paper, limits__max_utilisation=0.15, cycle__period_us=1000.0)
    assert "Enough would be limits.max_utilisation = 0.21: cycle.slice_ratio = 0.9, bus.gap_count = 7." in weaker


def test_a_period_that_must_change_is_said_first(paper: Profile) -> None:
    found = report(paper, bus__nodes=8)
    first = render(found, "table").splitlines()[0]
    assert first.startswith(
        "paper-1ms with 8 nodes (32 axes) at 1 ms: the period must change, for no change of gap count and slice ratio "
        "is enough: set cycle.period_us = 1200, cycle.slice_ratio = 0.83, bus.gap_count = 21; then it fits with"
    )
    assert found.document()["period_is_kept"] is False
    assert "period must change" not in text(paper, bus__nodes=7)


def test_exactly_one_row_is_marked_and_what_is_not_proven_says_so(paper: Profile) -> None:
    found = report(paper, rough, max_circles=3)
    (recommended,) = (row for row in rows(found) if row.highlighted)
    assert recommended.cells[:2] == ("+ period", "*?")
    marks = {str(row.cells[0]): row.cells[1] for row in rows(found)}
    assert [title for title, mark in marks.items() if "*" in str(mark)] == ["+ period"]
    assert marks["smallest period"] == "?"
    assert marks["as it is"] == ""
    # The mark is seen in every form, without weight or colour.
    for form in ("table", "markdown", "html"):
        said = render(found, form)
        assert "* recommended." in said
        assert "? not proven" in said
    (proven,) = (row for row in rows(report(paper)) if row.highlighted)
    assert proven.cells[:2] == ("as it is", "*")
    assert "not proven" not in text(paper)
    assert "recommended" not in text(paper, circle=egg, max_circles=2)


def test_what_fails_is_set_apart(paper: Profile) -> None:
    first = rows(report(paper, rough, max_circles=3))[0]
    assert first.cells[5] == Words("FAILS", "fails")
    result = planned(paper, bus__nodes=4)
    for row, option in zip(rows(plan_report(result)), result.options, strict=True):
        margins = [cell for cell in row.cells if isinstance(cell, ShownValue) and "margin" in cell.key]
        assert [margin.state == "fails" for margin in margins] == [option.deciding.verdict != "fits"]
        assert row.cells[5] == "-"


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("paper-1ms", {}),
        ("paper-1ms", {"bus__nodes": 4}),
        ("paper-dma", {"bus__nodes": 17}),
        ("paper-dma", {"bus__gap_count": 3, "bus__nodes": 4}),
        ("sercos3-servo-8", {}),
    ],
)
def test_every_figure_stands_in_its_place(
    name: str, wanted: dict[str, Any], values_of_the_document: Callable[[Report], int]
) -> None:
    found = report(load(name).profile, **wanted)
    assert values_of_the_document(found) >= 5 * len(rows(found))


def test_a_cell_writes_what_its_option_sets(paper: Profile, values_in: ValuesIn) -> None:
    result = planned(paper, bus__nodes=4)
    cells = [row.cells[2] for row in rows(plan_report(result))]
    for cell, option in zip(cells, result.options, strict=True):
        values = list(values_in(cell))
        assert {value.key for value in values} <= set(option.changes)
        assert {value.value for value in values} == set(option.changes.values())
    assert [*map(cell_text, cells)] == [
        *("-", "gap count 10", "500 us, ratio 0.9, gap count 10", "payload 140 bytes, ratio 0.9, gap count 10"),
        "7 nodes, ratio 0.85, gap count 18",
    ]


def test_a_term_is_called_as_in_capacity() -> None:
    assert {row.cells[3] for row in rows(report(load("sercos3-servo-8").profile))} == {"non-periodic T_npd"}


def test_one_byte_is_singular() -> None:
    sizes = {"payload.read_bytes": 2, "payload.write_bytes": 2}
    full = override(load("can-servo-8").profile, {"bus.nodes": 10, "cycle.period_us": 2500.0, **sizes})
    assert "payload 1 byte" in [cell_text(row.cells[2]) for row in rows(report(full))]


def test_settings_are_written_as_a_profile_has_them(paper: Profile) -> None:
    written = settings(paper, {"cycle.period_us": 900.0, "bus.speed": "S400"})
    assert written.startswith('cycle.period_us = 900, bus.speed = "S400" (')


def test_no_line_of_the_table_is_longer_than_a_screen(paper: Profile) -> None:
    lines = text(paper, bus__nodes=8).splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("option "))
    table = lines[start : lines.index("", start)]
    assert len(table) > 6
    assert max(map(len, table)) <= 130


def test_data_holds_the_contract(paper: Profile) -> None:
    result = planned(paper, bus__nodes=4)
    document = plan_document(result)
    to_json(document)  # refuses what is not finite
    assert (document["schema"], document["command"], document["profile"]) == (1, "plan", "paper-1ms")
    assert all(set(option) >= CONTRACT for option in document["options"])
    (recommended,) = (option for option in document["options"] if option["recommended"])
    assert recommended["changes"] == document["recommended_changes"] == {"bus.nodes": 4, "bus.gap_count": 10}
    assert recommended["circle_passed"] is None
    assert (document["free"], document["binding"]) == (["gap_count", "slice_ratio", "period"], None)
    assert [option["passes"] for option in document["options"]] == [False, True, True, True, True]
    none = plan_document(planned(paper, bus__nodes=8, cycle__period_us=1000.0))
    to_json(none)
    assert (none["recommended_changes"], none["period_is_kept"], none["binding"]["constraint"]) == (None, None, "time")
    assert [one["relaxed"] for one in none["relaxations"]] == ["responses", "schedule", "period", "nodes"]
    assert to_csv(plan_records(result)).splitlines()[2].startswith("gap count,bus.nodes=4 bus.gap_count=10,true,")


def test_a_circle_without_a_tolerance_is_not_said_to_pass() -> None:
    goal = override(load("paper-4ms").profile, {"circle.radius_mm": 25.0, "tolerance": {}})
    plan_ = plan(goal, circle=lambda _: ())
    said = next(block for block in plan_report(plan_).blocks() if isinstance(block, Sentence))
    assert sentence_text(said).endswith(", and its circle is not judged.")
    assert {option.circle_passed for option in plan_.options} == {None}
    assert {option["circle_passed"] for option in plan_report(plan_).document()["options"]} == {None}


def test_a_margin_beyond_its_uncertainty_fails_in_no_row() -> None:
    short = override(load("ethercat-servo-8").profile, {"cycle.period_us": 150.0, "servo.step_us": 75.0})
    result = planned(short)
    assert result.options[0].deciding.verdict != "fits"
    assert result.options[0].held_by == "sync0"
    first = rows(plan_report(result))[0]
    assert all(cell.state != "fails" for cell in first.cells if isinstance(cell, ShownValue) and "margin" in cell.key)
