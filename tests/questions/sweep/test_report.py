"""A sweep for people: how many points fit, the top rows, and what is wrong at some points."""

import re
from collections.abc import Callable
from itertools import takewhile
from typing import Any

import pytest

import busplan
from busplan.forms import render

ValuesIn = Callable[[object], Any]

GRID: dict[str, Any] = {
    "bus.nodes": (1, 17, 33),
    "bus.gap_count": (63, "optimal"),
    "cycle.period_us": (250, 333.3, 4000),
}


@pytest.fixture(scope="module")
def answer() -> busplan.SweepAnswer:
    return busplan.sweep("paper-4ms", vary=GRID)


def sentences_of(answer: busplan.SweepAnswer) -> list[str]:
    """The lines before the number of rows."""
    return list(takewhile(lambda line: not re.match(r"\d+ (of \d+ )?rows?", line), str(answer).splitlines()))


def shown(report: Any, heading: str) -> list[Any]:
    """Values of a column of the table."""
    *_, table = report.blocks
    place = [column.heading for column in table.columns].index(heading)
    return [row.cells[place].value for row in table.rows]


def test_the_rows_of_a_report_are_the_first(answer: busplan.SweepAnswer) -> None:
    rows = answer.to_dict()["rows"]
    assert len(rows) == 36
    for most, shown_rows in ((3, rows[:3]), (None, rows)):
        for name in ("bus.nodes", "margin_us", "max_axes"):
            assert shown(answer.report(most=most), name) == [row[name] for row in shown_rows]
    assert "20 of 36 rows." in render(answer.report(), "table")


def test_the_summary_counts_points_under_each_model(answer: busplan.SweepAnswer, values_in: ValuesIn) -> None:
    rows = answer.to_dict()["rows"]
    paper, standard = ([row for row in rows if row["timing_model"] == model] for model in ("paper", "standard"))
    by_hand = sum(row["fits"] for row in paper), sum(row["verdict"] == "fits" for row in standard)
    assert by_hand[1] <= sum(row["fits"] for row in standard) < by_hand[0] < 18
    fitting = f"{by_hand[1]} shown to fit (standard model), {by_hand[0]} fit by the paper model."
    assert sentences_of(answer)[0] == f"paper-4ms: 18 points; {fitting}"
    assert (len(sentences_of(answer)) == 2) == any(not row["gap_count_safe"] for row in standard)
    # The whole grid's number is in the document.
    assert next((value.value, value.key) for value in values_in(answer.sentences()[0])) == (18, "points")


def test_a_varied_gap_count_below_the_safe_one_is_counted() -> None:
    # Two hops need 7: 0 to 6 are unsafe.
    # The period, which it does not depend on, counts each twice.
    answer = busplan.sweep("paper-4ms", vary={"bus.gap_count": range(64), "cycle.period_us": (1000, 2000)})
    assert sentences_of(answer)[-1] == "At 14 points the gap count is unsafe (gap_count_safe)."
    assert answer.sentences()[-1].state == "warns"
    one = busplan.sweep("paper-4ms", vary={"bus.gap_count": [6, 7]})
    assert sentences_of(one)[-1] == "At 1 point the gap count is unsafe (gap_count_safe)."


@pytest.mark.parametrize("follows", [False, True])
def test_a_payload_that_the_axes_do_not_change_is_said_to_be_so(follows: bool) -> None:
    profile = busplan.load_profile("paper-4ms", changes={"payload.read_bytes_per_axis": 8} if follows else {})
    words = (
        "The payload does not depend on the axes of a node: payload.read_bytes_per_axis and "
        "payload.write_bytes_per_axis say what each adds."
    )
    assert (words in sentences_of(busplan.sweep(profile, vary={"node.axes": (1, 2, 3)}))) is not follows


def test_of_groups_it_is_said_which_one_varies() -> None:
    swept = busplan.sweep("gantry-24", vary={"cycle.period_us": [500, 1000]})
    assert sentences_of(swept)[1] == "Axes are counted with more nodes of drives, with the other groups unchanged."
    assert shown(swept.report(), "group.drives.safe_nodes") == swept["group.drives.safe_nodes"].tolist()


def test_a_report_shows_no_more_rows_than_one_reads() -> None:
    swept = busplan.sweep("paper-4ms", vary={"cycle.nonperiodic_us": range(5001)})
    assert "20 of 10,002 rows." in str(swept)
    with pytest.raises(busplan.BusplanError, match=r"^10,002 rows are more than the 10,000 that a report shows; CSV"):
        swept.report(most=None)
