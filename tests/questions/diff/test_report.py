"""What `busplan diff` says: a sentence and two tables, differences that are seen, and nothing but its text."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.forms import render
from busplan.forms.blocks import Sentence, Table

AB = ("a.toml", "b.toml")


@pytest.fixture
def paper() -> busplan.Profile:
    """A profile."""
    return busplan.load_profile("paper-1ms")


def changed(a: busplan.Profile, changes: dict[str, object], **options: Any) -> busplan.DiffAnswer:
    return busplan.diff(a, busplan.load_profile(a, changes=changes), **{"arguments": AB, **options})


def text(a: busplan.Profile, changes: dict[str, object]) -> list[str]:
    return render(changed(a, changes).report()._replace(is_whole=True), "table").splitlines()


# --- the sentence -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cycle.period_us": 200}, "a.toml (A) fits, b.toml (B) does not fit; B is worse in "),
        (
            {"cycle.nonperiodic_us": 230},
            "a.toml (A) fits, b.toml (B) is not shown to fit; B is worse in ",
        ),
        (
            {"bus.gap_count": 3},
            "a.toml (A) fits, b.toml (B) fits, but gap count is unsafe; B is worse in 3 figures: gap count is ",
        ),
        (
            {"limits.min_spare_nodes": 5},
            (
                "a.toml (A) fits, b.toml (B) fits, but it does not meet limits.min_spare_nodes; no figure is better or "
                "worse."
            ),
        ),
        ({"node.axes": 5}, "a.toml (A) fits, b.toml (B) fits; B is better in 2 figures: safe axes and most axes."),
        (
            {"bus.gap_count": 62},
            "a.toml (A) fits, b.toml (B) fits; B is better in 12 figures: corrected margin, period with enough ",
        ),
        (
            {"payload.overhead_bytes": 24},
            "a.toml (A) fits, b.toml (B) fits; B is worse in 10 figures: margin (paper), utilisation (paper), ",
        ),
        ({}, "a.toml (A) fits, b.toml (B) fits; every key has the same value."),
    ],
)
def test_a_sentence_has_both_verdicts_and_what_is_worse_and_better(
    paper: busplan.Profile, changes: dict[str, object], said: str
) -> None:
    assert text(paper, changes)[0].startswith(said)


def test_the_state_is_that_of_the_worst(paper: busplan.Profile) -> None:
    def state(changes: Any) -> str:
        first = changed(paper, changes).report().blocks[0]
        assert isinstance(first, Sentence)
        return first.state

    assert [state(one) for one in ({"cycle.period_us": 200}, {"bus.gap_count": 13}, {"name": "x"}, {})] == [
        *("fails", "passes", "neutral", "neutral")
    ]


# --- the tables -------------------------------------------------------------------------------------------


def test_every_figure_that_differs_has_a_row_and_every_figure_a_record(paper: busplan.Profile) -> None:
    found = changed(paper, {"bus.gap_count": 7})
    differ = [one for one in found.figures if one.judgement != "same"]
    assert 0 < len(differ) < len(found.figures) == len(found.to_dict()["figures"])
    lines = text(paper, {"bus.gap_count": 7})
    assert sum(line.endswith((" better", " worse", " neutral")) for line in lines) == len(differ)
    (margin,) = (line.split() for line in lines if line.startswith("margin ") and " paper " in line)
    # Four transactions, 56 counts: 48 ticks of eq (10) and twice the 4 of eq (4), at 393.216 MHz.
    assert margin == ["margin", "paper", "us", "292.883", "324.784", "+31.901", "+10.9", "better"]
    assert len(text(paper, {})) == 1


def test_what_is_worse_fails(paper: busplan.Profile) -> None:
    def judged(changes: Any) -> set[Any]:
        _, table = (block for block in changed(paper, changes).report().blocks if isinstance(block, Table))
        return {row.cells[-1][:2] for row in table.rows}

    assert judged({"cycle.period_us": 500}) == {("worse", "fails"), ("neutral", "neutral")}
    assert judged({"bus.gap_count": 13}) == {("better", "passes"), ("neutral", "neutral")}


def test_keys_that_differ_in_their_last_digit_are_seen_to_differ(paper: busplan.Profile) -> None:
    near = busplan.load_profile(paper, changes={"cycle.slice_ratio": 0.1 + 0.2})
    assert any("0.30000000000000004  0.29999999999999999" in line for line in text(near, {"cycle.slice_ratio": 0.3}))


def test_a_default_and_a_key_of_one_kind_alone_are_told_apart(paper: busplan.Profile) -> None:
    lines = [line.split() for line in text(paper, {"cycle.retries": 1})]
    assert ["cycle.retries", "0", "(default)", "1"] in lines
    of_kinds = render(busplan.diff("paper-1ms", "can-servo-8").report(), "table").splitlines()
    assert ["bus.speed", '"S400"', "-"] in [line.split() for line in of_kinds]


@given(
    alike=st.sampled_from(["", "ab" * 20, "ab" * 40]), one=st.text("ab", max_size=9), other=st.text("ab", max_size=9)
)
def test_two_long_values_that_differ_look_different(alike: str, one: str, other: str) -> None:
    a, b = (busplan.load_profile("paper-1ms", changes={"description": alike + end}) for end in (one, other))
    tables = [block for block in busplan.diff(a, b).report().blocks if isinstance(block, Table)]
    rows = [row.cells for table in tables for row in table.rows]
    assert [cells[1] == cells[2] for cells in rows] == [False] * (one != other)


# --- names and forms --------------------------------------------------------------------------------------


def test_the_document_holds_both_sides_in_full(paper: busplan.Profile) -> None:
    document = changed(paper, {"node.execution.grade": "measured", "bus.max_hops": 2}).to_dict()
    assert (document["schema"], document["command"], document["same"]) == (1, "diff", False)
    assert document["a"] == {
        "argument": "a.toml",
        "profile": "paper-1ms",
        "verdict": "fits",
        "missed_limits": [],
    }
    assert document["changes"] == [
        {"key": "bus.max_hops", "a": None, "a_source": "default", "b": 2, "b_source": "file"},
        {"key": "node.execution.grade", "a": "derived", "a_source": "file", "b": "measured", "b_source": "file"},
    ]
    assert document["text"] == text(paper, {"node.execution.grade": "measured", "bus.max_hops": 2})[0]
    keys = ("part", "figure", "better", "a", "b", "difference", "relative_difference", "judgement")
    assert tuple(document["figures"][0]) == keys
