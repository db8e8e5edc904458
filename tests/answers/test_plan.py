"""What `busplan plan` says, and the data it gives."""

from collections.abc import Callable
from typing import Any

import pytest
from busplan.forms.json_and_csv import to_csv, to_json

from busplan.analysis.planning.options import plan
from busplan.answers.plan import plan_csv_rows, plan_document, plan_lines
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.sections.profile import Profile

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
}


@pytest.fixture
def paper() -> Profile:
    return load("paper-1ms").profile


def text(profile: Profile, circle: Callable[[Profile], tuple[str, ...]] | None = None, **options: Any) -> str:
    result = plan(profile, circle=circle, **options)
    return "\n".join(line.text for line in plan_lines(result, with_circle=circle is not None))


def test_the_first_line_says_what_to_set(paper: Profile) -> None:
    first = text(paper, wanted={"bus.nodes": 4}).splitlines()[0]
    assert first.startswith("paper-1ms with 4 nodes (16 axes) at 1 ms: set bus.gap_count = 10; then it fits both")
    assert first.endswith("with 85.058 us to spare in the tighter one.")
    assert ": nothing to change; it fits both" in text(load("paper-optimal-gap").profile).splitlines()[0]
    assert "and passes the circle." in text(paper, circle=lambda _: ()).splitlines()[0]


def test_no_plan_says_why(paper: Profile) -> None:
    lines = text(paper, circle=lambda _: ("the circle is an egg",), max_circles=2).splitlines()
    assert "NO PLAN" in lines[0]
    assert lines[0].endswith("; as it is, the circle is an egg.")
    assert "Smallest period: none, no period passes the circle (not proven: the search was cut short" in "\n".join(
        lines
    )


def test_exactly_one_row_is_marked_and_what_is_not_proven_says_so(paper: Profile) -> None:
    def circle(profile: Profile) -> tuple[str, ...]:
        return () if profile.cycle.period_us > 3000 else ("rough",)

    lines = text(paper, circle=circle, max_circles=3).splitlines()
    (recommended,) = (line for line in lines if line.startswith("*") and "recommended." not in line)
    assert recommended.startswith("*?  cheapest that meets both models")
    assert any(line.startswith("?   smallest period") for line in lines)
    assert any("not proven" in line for line in lines)
    (proven,) = (line for line in text(paper).splitlines() if line.startswith("*  "))
    assert "as it is" in proven


def test_a_gate_that_the_plan_would_not_pass_is_said(paper: Profile) -> None:
    tight = override(paper, {"limits.max_utilisation": 0.1})
    assert "limits.max_utilisation allows 10.0%" in text(tight)
    assert "limits.max_utilisation" not in text(paper)


def test_no_line_of_the_table_is_longer_than_a_screen(paper: Profile) -> None:
    result = plan(paper, wanted={"bus.nodes": 17})
    assert max(len(line.text) for line in plan_lines(result, with_circle=False) if line.tone == "table") <= 140


def test_data_holds_the_contract(paper: Profile) -> None:
    result = plan(paper, wanted={"bus.nodes": 4})
    document = plan_document(result)
    to_json(document)  # refuses what is not finite
    assert (document["schema"], document["command"], document["profile"]) == (1, "plan", "paper-1ms")
    assert all(set(option) >= CONTRACT for option in document["options"])
    (recommended,) = (option for option in document["options"] if option["recommended"])
    assert recommended["changes"] == document["recommended_changes"] == {"bus.nodes": 4, "bus.gap_count": 10}
    assert recommended["circle_passed"] is None
    assert to_csv(plan_csv_rows(result)).splitlines()[2].startswith("best gap count,bus.nodes=4 bus.gap_count=10,true,")
