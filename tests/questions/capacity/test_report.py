"""Capacity and latency: from results to answers."""

import csv
import io
import json
import re
from collections.abc import Callable

import pytest
from busplan.questions.capacity.sentences import verdict_sentences

from busplan.forms import render
from busplan.forms.blocks import Report
from busplan.forms.csv_rows import to_csv
from busplan.forms.numbers import sentence_text
from busplan.printable import to_json
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.questions.capacity.report import capacity_document, capacity_records, capacity_report
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.fit.figures import capacity
from busplan.questions.latency.figures import latency
from busplan.questions.latency.report import latency_document, latency_report
from busplan.sections.profile import Profile


@pytest.fixture
def profile() -> Profile:
    return load("paper-1ms").profile


def words(profile: Profile) -> str:
    result = capacity(profile)
    return "\n".join(map(sentence_text, verdict_sentences(verdicts(result)[0], profile)))


@pytest.mark.parametrize("name", shipped_names())
def test_documents_hold_the_results_own_numbers(name: str) -> None:
    profile = load(name).profile
    result = capacity(profile)
    document = json.loads(to_json(capacity_document(result, verdicts(result))))
    assert document["results"] == [
        json.loads(
            json.dumps(one.by_key() | ({"groups": [group.record() for group in one.groups]} if one.groups else {}))
        )
        for one in result.results
    ]
    single = latency(profile)
    transactions = json.loads(to_json(latency_document(single)))["transactions"]
    assert [
        {key: one[key] for key in own.phases} for one, own in zip(transactions, single.transactions, strict=True)
    ] == [dict(one.phases) for one in single.transactions]


def test_csv_holds_the_same_numbers_to_the_last_digit(profile: Profile) -> None:
    rows = capacity_records(capacity(profile, periods_us=[1000.0, 123.456]))
    read = list(csv.DictReader(io.StringIO(to_csv(rows))))
    assert len(read) == 4
    for written, row in zip(read, rows, strict=True):
        assert list(written) == list(row)
        assert float(written["required_us"]) == row["required_us"]
        assert written["fits"] == ("true" if row["fits"] else "false")


def test_the_verdict_names_margin_term_limit_and_change(profile: Profile) -> None:
    text = words(override(profile, {"cycle.period_us": 500}))
    _, one = capacity(override(profile, {"cycle.period_us": 500})).results
    margin = f"Margin {one.margin_corrected_us:.3f} us +/- {one.uncertainty_us:.3f} us of 250.000 us"
    assert text.startswith(f"paper-1ms at 500 us: does not fit. {margin}, less a bias of {one.bias_us:.3f} us. ")
    assert "Largest doubt: execution time, 54% of the variance." in text
    assert (
        "Not included: host time (host.transaction_us), the slowest execution (node.execution.worst_extra_us)." in text
    )
    assert "The paper model says otherwise: 207.117 us needed of 250.000 us. It does not affect the verdict." in text
    assert f"Largest term: execution, 146.933 us of {one.required_us:.3f} us." in text
    assert "Shown to fit: 1 node (4 axes), limited by time." in text
    assert "Cheapest way to make it fit: bus.gap_count = 7, which leaves a margin of " in text


def test_a_way_to_more_nodes_is_advised_only_where_none_is_spare(profile: Profile) -> None:
    assert "Cheapest way to" not in words(profile)
    assert "Shown to fit: 3 nodes" in words(profile)
    assert "Cheapest way to 1 more node: " in words(override(profile, {"bus.nodes": 3}))


def test_a_verdict_that_is_not_shown_says_so_with_its_reserve(profile: Profile) -> None:
    narrow = override(profile, {"cycle.period_us": 550, "servo.step_us": 50})
    assert words(narrow).startswith("paper-1ms at 550 us: not shown to fit. Margin 5.064 us +/- 6.311 us of 275.000 us")
    reserved = override(profile, {"cycle.period_us": 600, "limits.reserve": 0.15})
    text = words(reserved)
    assert text.startswith("paper-1ms at 600 us: not shown to fit. Margin 30.064 us +/- 6.311 us of 300.000 us")
    assert "15% of the slice must stay free (limits.reserve)." in text


def test_an_execution_that_no_answer_puts_on_the_bus_is_not_spoken_of(profile: Profile) -> None:
    off = override(profile, {"node.read_response": "concatenated", "node.write_response": "unified"})
    for text in (words(off), render(latency_report(latency(off)), "table")):
        assert "The execution time behind these figures" not in text
    assert "slowest execution" not in words(off)
    assert "The execution time behind these figures is derived." in words(
        override(off, {"node.read_response": "split"})
    )


def test_what_the_paper_cannot_express_is_not_applicable(profile: Profile) -> None:
    own = override(profile, {"cycle.retries": 1, "host.transaction_us": 5.0})
    text = words(own)
    assert "The paper model is not applicable: it has no cycle.retries, host.transaction_us." in text
    assert "Not included: the slowest execution (node.execution.worst_extra_us)." in text
    assert [one.timing_model for one in capacity(own).results] == ["standard"]


def test_an_unsafe_gap_count_and_a_long_cable_are_warned_of(profile: Profile) -> None:
    text = words(override(profile, {"bus.gap_count": 5, "bus.cable_length_m": 10}))
    assert "gap count 5 is unsafe for 2 hops (2 nodes); the smallest safe one is 7" in text
    assert "cables of 10 m are longer than the 4.5 m" in text
    assert ": fits, but with an unsafe gap count." in text
    assert "Warning" not in words(override(profile, {"bus.gap_count": 13}))
    # No more nodes are spoken of than the gap count is safe for: 8 for three hops.
    text = words(override(profile, {"bus.gap_count": 9}))
    assert "Shown to fit: 3 nodes (12 axes), limited by gap table." in text
    assert "Warning" not in text


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"bus.nodes": 17, "cycle.period_us": 1e6}, "17 hops are over the 16 of one bus"),
        ({"bus.nodes": 63, "bus.max_hops": 3, "cycle.period_us": 1e6}, "63 nodes are over the 62 of one bus"),
        ({"bus.speed": "S100", "payload.write_bytes": 513}, "a payload of 513 bytes is over the 512 bytes of S100"),
    ],
)
def test_the_verdict_says_which_limit_is_broken(profile: Profile, changes: dict[str, object], reason: str) -> None:
    assert f"does not fit, {reason}." in words(override(profile, changes))


def test_latency_warns_of_payloads_over_the_limit(profile: Profile) -> None:
    slow = override(profile, {"bus.speed": "S100"})
    text = render(latency_report(latency(slow, payloads_bytes=[4, 1024])), "table")
    assert text.endswith("\nWarning: a payload of 1024 bytes is over the 512 bytes of S100.\n")


def test_latency_warns_of_hops_and_gap_count(profile: Profile) -> None:
    long = override(profile, {"bus.nodes": 17, "bus.gap_count": 5})
    text = render(latency_report(latency(long)), "table")
    assert "17 hops are over the 16 of one bus" in text
    assert "gap count 5 is unsafe for 17 hops (17 nodes); the smallest safe one is 46" in text


def test_one_table_a_payload_and_one_for_all_periods(profile: Profile) -> None:
    heads = render(latency_report(latency(profile, payloads_bytes=[4, 16, 32])), "table")
    assert heads.count("\nfigure ") == 3
    result = capacity(profile, periods_us=[1000.0, 500.0])
    text = render(capacity_report(result, verdicts(result)), "table")
    assert text.count("\navailable time") == 1
    assert re.search(r" 1 ms +1 ms +500 us +500 us\n", text)
    assert re.search(r" paper +standard +paper +standard\n", text)
    # What holds for all periods is said once, at the end.
    assert text.count("  not included ") == text.count("  largest part ") == 1
    assert text.index(" 500 us ") < text.index("  not included ")
    whole = render(capacity_report(result, verdicts(result))._replace(is_whole=True), "table")
    assert whole.count("Not included: ") == whole.count("The execution time behind these figures is") == 1


def test_what_fails_is_marked_where_it_stands_and_the_rest_is_detail(profile: Profile) -> None:
    result = capacity(profile, periods_us=[1000.0, 500.0])
    report = capacity_report(result, verdicts(result))
    lines = render(report, "table").splitlines()
    row = {line[: line.index("  ", 4)].strip(): line for line in lines if line.count("  ") > 2}
    assert [row[name].count(" !") for name in ("corrected margin", "margin", "no limit broken")] == [1, 1, 1]
    assert "does not fit" in row["verdict"]
    assert "!" not in row["verdict"]
    assert lines[-1].startswith("! fails. Not shown: ")
    # What takes no time and what does not decide is detail.
    assert not {"hold", "host", "utilisation", "smallest period"} & set(row)
    whole = render(report._replace(is_whole=True), "table")
    assert all(f"\n{name}  " in whole for name in ("  hold", "  host", "utilisation", "smallest period"))
    assert "Not shown" not in whole


@pytest.mark.parametrize("period_us", [1000.0, 600.0, 100.0])
def test_every_figure_of_the_blocks_stands_in_the_document(
    profile: Profile, period_us: float, values_of_the_document: Callable[[Report], int]
) -> None:
    result = capacity(profile, periods_us=[4000.0, period_us])
    # Two tables of 44 figures under two models, and the figures of the sentences.
    assert values_of_the_document(capacity_report(result, verdicts(result))) > 100
    assert values_of_the_document(latency_report(latency(profile, payloads_bytes=[4, 16]))) == 2 * 4 * 21
