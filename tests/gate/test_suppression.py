"""`# busplan: ignore[CODE] reason`: what it takes out, and what is wrong with it."""

from collections.abc import Callable
from typing import Any

import pytest

Changed = Callable[..., str]
Check = Callable[..., Any]


def said(result: Any) -> list[tuple[str, int, int]]:
    return [(one.code, one.line, one.column) for one in result.findings]


def test_without_it_the_finding_is_there(changed: Changed, check: Check) -> None:
    assert said(check(changed(('"optimal"', "63")))) == [("BP110", 7, 1)]


@pytest.mark.parametrize(
    "line",
    [
        "gap_count = 63  # busplan: ignore[BP110] the firmware's",
        "gap_count = 63 #busplan:ignore[BP110]the firmware's",
        "gap_count = 63  #  busplan:  ignore [ BP110 ]  the firmware's",
        "# busplan: ignore[BP110] the firmware's\ngap_count = 63",
        "  # busplan: ignore[BP110] the firmware's\n\tgap_count = 63",
        "gap_count = 63  # busplan: ignore[BP111, BP110] the firmware's",
    ],
)
def test_it_takes_out_a_finding_on_its_line_or_the_line_below(line: str, changed: Changed, check: Check) -> None:
    result = check(changed(('gap_count = "optimal"', line)))
    assert "BP110" not in {one.code for one in result.findings}
    if "BP111" not in line:
        assert result.findings == ()


def test_each_code_of_a_list_is_judged_alone(changed: Changed, check: Check) -> None:
    result = check(changed(('gap_count = "optimal"', "gap_count = 63 # busplan: ignore[BP110,BP111] firmware")))
    assert said(result) == [("BP902", 7, 16)]
    assert "BP111 has nothing to suppress on line 7" in result.findings[0].message


@pytest.mark.parametrize(
    "lines",
    [
        # Behind another value it speaks of that line, not of the next.
        'speed = "S400"  # busplan: ignore[BP110] the firmware\'s\ngap_count = 63',
        # A line between breaks it.
        'speed = "S400"\n# busplan: ignore[BP110] the firmware\'s\n\ngap_count = 63',
        # Below is too late.
        'speed = "S400"\ngap_count = 63\n# busplan: ignore[BP110] the firmware\'s',
        # Not the code of the finding.
        'speed = "S400"\ngap_count = 63  # busplan: ignore[BP109] the firmware\'s',
        'speed = "S400"\ngap_count = 63  # busplan: ignore[bp110] the firmware\'s',
    ],
)
def test_one_that_misses_is_a_finding_and_hides_nothing(lines: str, changed: Changed, check: Check) -> None:
    result = check(changed(('speed = "S400"\ngap_count = "optimal"', lines)))
    assert sorted(one.code for one in result.findings) == ["BP110", "BP902"]


@pytest.mark.parametrize("reason", ["", " ", "\t"])
def test_without_a_reason_it_suppresses_and_is_a_finding_itself(reason: str, changed: Changed, check: Check) -> None:
    result = check(changed(('"optimal"', f"63  # busplan: ignore[BP110]{reason}")))
    assert said(result) == [("BP901", 7, 17)]
    assert result.findings[0].severity == "warning"


@pytest.mark.parametrize(
    ("comment", "words"),
    [
        ("# busplan: ignore[] why", "nothing is not the code of a rule"),
        ("# busplan: ignore[BP999] why", "BP999 is not the code of a rule"),
        ("# busplan: ignore[gap-count-wasteful] why", "gap-count-wasteful is not the code of a rule"),
        ("# busplan: ignore[BP005] why", "BP005 cannot be suppressed"),
        ("# busplan: ignore[BP901] why", "BP901 cannot be suppressed"),
        ("# busplan: ignore BP110 why", "write # busplan: ignore[CODE] reason"),
        ("# busplan: noqa", "write # busplan: ignore[CODE] reason"),
        ("# busplan: ignore[BP110 why", "write # busplan: ignore[CODE] reason"),
    ],
)
def test_what_is_addressed_to_busplan_and_says_nothing_is_a_finding(
    comment: str, words: str, changed: Changed, check: Check
) -> None:
    result = check(changed(("nodes = 2", f"nodes = 2  {comment}")))
    assert said(result) == [("BP902", 8, 12)]
    assert words in result.findings[0].message


@pytest.mark.parametrize(
    "line", ["# see busplan: ignore[BP110] why", "# busplanner: ignore[BP110] why", "# ignore[BP110] busplan: why"]
)
def test_other_comments_are_comments(line: str, clean: str, check: Check) -> None:
    assert check(f"{line}\n{clean}").findings == ()


@pytest.mark.parametrize(
    "text",
    [
        'description = "# busplan: ignore[BP110] no comment"',
        'description = """\n# busplan: ignore[BP110] no comment\n"""',
        "description = '''\n# busplan: ignore[BP110] no comment'''",
    ],
)
def test_text_that_looks_like_one_is_none(text: str, clean: str, check: Check) -> None:
    assert check(clean.replace('name = "example"', f'name = "example"\n{text}')).findings == ()


def test_comments_inside_arrays_are_seen(changed: Changed, check: Check) -> None:
    table = (
        'kind = "table"\ngrade = "measured"\npayload_bytes = [ # busplan: ignore[BP007] why\n4, 16]\ntime_us = [1, 2]'
    )
    text = changed(('kind = "linear"\ngrade = "measured"\nbase_us = 30\nper_byte_us = 0.35', table))
    assert said(check(text)) == [("BP902", 24, 19)]


def test_one_behind_the_end_of_an_array_is_not_alone_on_its_line(changed: Changed, check: Check) -> None:
    table = (
        'kind = "table"\ngrade = "measured"\npayload_bytes = [4,\n16\n] # busplan: ignore[BP110] why\ntime_us = [1, 2]'
    )
    result = check(changed(('kind = "linear"\ngrade = "measured"\nbase_us = 30\nper_byte_us = 0.35', table)))
    assert said(result) == [("BP902", 26, 3)]
    assert "BP110 has nothing to suppress on line 26" in result.findings[0].message


def test_the_shape_of_the_file_cannot_be_suppressed(changed: Changed, check: Check) -> None:
    result = check(changed(("nodes = 2", "nodes = 0  # busplan: ignore[BP005] why not")))
    assert said(result) == [("BP005", 8, 1)]


CIRCLE = "\n[servo]  # busplan: ignore[BP201] an ideal loop\nposition_gain_per_s = 50\n[circle]\nradius_mm = 25\n"


def test_a_rule_that_has_not_run_says_nothing_of_its_suppression(changed: Changed, check: Check, clean: str) -> None:
    overrun = changed(("period_us = 4000", "period_us = 100"), more=CIRCLE)
    assert {one.code for one in check(clean + CIRCLE).findings} == {"BP902"}
    assert check(clean + CIRCLE, circle=False).findings == ()
    assert {one.code for one in check(overrun).findings} == {"BP101"}


def test_a_test_that_cannot_be_run_answers_for_itself_alone(clean: str, check: Check) -> None:
    result = check(clean + CIRCLE + "feed_mm_per_min = 60_000_000\n")
    assert [one.code for one in result.findings] == ["BP203"]


def test_a_baseline_finding_can_be_suppressed_and_is_judged_with_a_baseline_alone(
    changed: Changed, check: Check
) -> None:
    text = changed(("period_us = 4000", "period_us = 4000 # busplan: ignore[BP301] meant"))
    result = check(text)
    assert result.findings == ()
    assert [one.code for one in check(text, baseline={"figures": {}}).findings] == ["BP902"]
    before = check(changed(("period_us = 4000", "period_us = 4001")))
    assert check(text, baseline={"figures": before.figures, "keys": before.keys}).findings == ()


def test_two_suppressions_of_one_finding_leave_the_second_without_effect(changed: Changed, check: Check) -> None:
    lines = "# busplan: ignore[BP110] one\ngap_count = 63 # busplan: ignore[BP110] two"
    assert said(check(changed(('gap_count = "optimal"', lines)))) == [("BP902", 8, 16)]


def test_with_changes_one_that_misses_is_no_finding(changed: Changed, check: Check) -> None:
    text = changed(('"optimal"', "63  # busplan: ignore[BP110] the firmware's"))
    assert check(text, changes={"bus.gap_count": "optimal"}).findings == ()
    # What it hides without them is hidden with them, too.
    assert check(text, changes={"cycle.period_us": 5000.0}).findings == ()
