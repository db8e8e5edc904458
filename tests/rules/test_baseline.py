"""The baseline: what is a regression, what is none, and what is no baseline."""

import json
from collections.abc import Callable

import pytest

from busplan.errors import BusplanError
from busplan.rules.baseline import MODELS, Baseline, read_baseline, regressions, write_baseline
from busplan.rules.gate import FileResult

Changed = Callable[..., str]
Check = Callable[..., FileResult]


@pytest.mark.parametrize(
    ("old", "new", "lost"),
    [
        ("axes = 4", "axes = 3", {"bus.nodes"}),
        ("nodes = 2", "nodes = 3", {"cycle.period_us"}),
        ("period_us = 4000", "period_us = 3999", {"cycle.period_us"}),
        ("period_us = 4000", "period_us = 3000", {"cycle.period_us", "bus.nodes"}),
        ("base_us = 30", "base_us = 30.001", {"cycle.period_us"}),
    ],
)
def test_a_loss_of_axes_or_margin_is_an_error(
    old: str, new: str, lost: set[str], clean: str, changed: Changed, check: Check
) -> None:
    result = check(changed((old, new)), baseline=check(clean).figures)
    assert {one.code for one in result.findings} == {"BP301"}
    assert {one.key for one in result.findings} == lost
    assert all(one.severity == "error" for one in result.findings)


@pytest.mark.parametrize(
    ("old", "new"),
    [("axes = 4", "axes = 5"), ("period_us = 4000", "period_us = 4001"), ("nodes = 2", "nodes = 1")],
)
def test_a_gain_is_fine(old: str, new: str, clean: str, changed: Changed, check: Check) -> None:
    assert check(changed((old, new)), baseline=check(clean).figures).findings == ()


def test_the_same_is_fine_and_a_profile_without_a_record_too(clean: str, check: Check) -> None:
    assert check(clean, baseline=check(clean).figures).findings == ()
    assert check(clean, baseline={}).findings == ()


def test_it_goes_by_figure_and_not_by_line(clean: str, changed: Changed, check: Check) -> None:
    figures = check(clean).figures
    moved = "# one\n\n# two\n" + clean.replace("[bus]", "# three\n[bus] # four")
    assert check(moved, baseline=figures).findings == ()
    before = check(changed(("nodes = 2", "nodes = 3")), baseline=figures)
    after = check("# one\n\n" + changed(("nodes = 2", "nodes = 3")), baseline=figures)
    assert [one.line + 2 for one in before.findings] == [one.line for one in after.findings]
    assert [one.message for one in before.findings] == [one.message for one in after.findings]


def test_both_timing_models_are_held() -> None:
    now = {"paper.margin_us": 10.0, "standard.margin_us": 5.0}
    (lost,) = regressions(now, {"paper.margin_us": 10.0, "standard.margin_us": 6.0})
    assert "under the standard timing fell to 5 from the 6" in lost.message


@pytest.mark.parametrize(
    ("before", "now", "lost"),
    [
        (100.0, 100.0 * (1 - 1e-12), False),
        (100.0, 100.0 * (1 - 1e-6), True),
        (0.0, -1e-12, False),
        (0.0, -1e-6, True),
        (-5.0, -5.1, True),
        (-5.0, -4.9, False),
    ],
)
def test_rounding_is_no_loss(before: float, now: float, lost: bool) -> None:
    assert bool(list(regressions({"paper.margin_us": now}, {"paper.margin_us": before}))) is lost


def test_what_is_written_can_be_read_and_is_sorted_by_path(check: Check, clean: str) -> None:
    figures = check(clean).figures
    text = write_baseline({"b.toml": figures, "a.toml": figures, "ü\udc80.toml": {}})
    assert list(json.loads(text)["profiles"]) == ["a.toml", "b.toml", "ü\udc80.toml"]
    assert read_baseline(text, name="b.json") == Baseline(
        {"a.toml": figures, "b.toml": figures, "ü\udc80.toml": {}}, MODELS
    )
    # What a user may rely on is the verdict's: the closed forms of the paper have no such figures.
    assert set(figures) == {
        *("paper.max_axes", "paper.margin_us", "standard.max_axes", "standard.margin_us"),
        *("standard.safe_axes", "standard.margin_corrected_us"),
    }


GOOD = {"schema": 1, "command": "baseline", "profiles": {"a.toml": {"paper.max_axes": 4}}}


@pytest.mark.parametrize(
    "document",
    [
        "",
        "{",
        "[]",
        "null",
        '"text"',
        "[" * 100_000,
        "1" * 5_000,
        json.dumps(GOOD)[:-1],
        json.dumps({**GOOD, "schema": 2}),
        json.dumps({**GOOD, "schema": None}),
        json.dumps({**GOOD, "command": "check"}),
        json.dumps({**GOOD, "models": "2"}),
        json.dumps({**GOOD, "models": True}),
        json.dumps({**GOOD, "models": 2.0}),
        json.dumps({**GOOD, "models": None}),
        json.dumps({**GOOD, "profiles": []}),
        json.dumps({**GOOD, "profiles": {"a.toml": []}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": "4"}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": True}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": None}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": float("nan")}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": float("inf")}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": 10**400}}}),
    ],
    ids=lambda text: text[:60],
)
def test_what_is_no_baseline_is_refused_in_one_message(document: str) -> None:
    with pytest.raises(BusplanError, match="remove it, and record one with --update-baseline") as caught:
        read_baseline(document, name="b.json")
    assert len(caught.value.problems) == 1
    assert str(caught.value).startswith("b.json: ")


def test_a_good_one_is_read() -> None:
    assert read_baseline(json.dumps(GOOD), name="b.json").profiles == GOOD["profiles"]


@pytest.mark.parametrize(("models", "is_current"), [(None, False), (1, False), (MODELS, True), (MODELS + 1, False)])
def test_a_record_of_other_timing_models_is_read_and_known_for_it(models: int | None, is_current: bool) -> None:
    document = GOOD if models is None else {**GOOD, "models": models}
    found = read_baseline(json.dumps(document), name="b.json")
    assert (found.models, found.is_current) == (models or 1, is_current)


def test_safe_axes_are_held_where_the_closed_form_still_has_them(clean: str, check: Check) -> None:
    # 2097.465 us make 15 nodes safe and 1942.386 us are needed: a reserve takes safe nodes, and no others.
    before = check(clean).figures
    now = check(f"{clean}\n[limits]\nreserve = 0.1\n", baseline=before)
    assert [(one.code, one.key) for one in now.findings] == [("BP301", "bus.nodes")]
    # 1911.497 us for 14 nodes, and 1737.510 us for 13, of 1800 us.
    assert "safe_axes under the standard timing fell to 52 from the 56" in now.findings[0].message
    assert now.figures["standard.max_axes"] == before["standard.max_axes"] == 60
