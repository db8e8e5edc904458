"""Capacity and latency: from results to answers."""

import csv
import io
import json
from collections.abc import Callable

import pytest

from busplan.analysis.capacity.figures import capacity
from busplan.analysis.capacity.verdict import verdicts
from busplan.analysis.latency import latency
from busplan.answers.capacity import capacity_document, capacity_records, capacity_report
from busplan.answers.latency import latency_document, latency_report
from busplan.answers.verdict import verdict_sentences
from busplan.forms import render
from busplan.forms.blocks import Report
from busplan.forms.columns import sentence_text
from busplan.forms.csv_rows import to_csv
from busplan.forms.json_document import to_json
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
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
        json.loads(json.dumps({**one.by_key(), "exceeded": list(one.exceeded)})) for one in result.results
    ]
    single = latency(profile)
    transactions = json.loads(to_json(latency_document(single)))["transactions"]
    assert [one["latency_us"] for one in transactions] == [one.phases.latency_us for one in single.transactions]
    assert all(isinstance(one["request_bytes"], int) for one in transactions)


def test_csv_holds_the_same_numbers_to_the_last_digit(profile: Profile) -> None:
    rows = capacity_records(capacity(profile, periods_us=[1000.0, 123.456]))
    read = list(csv.DictReader(io.StringIO(to_csv(rows))))
    assert len(read) == 4
    for written, row in zip(read, rows, strict=True):
        assert list(written) == list(row)
        assert float(written["required_us"]) == row["required_us"]
        assert written["fits"] == ("true" if row["fits"] else "false")


def test_the_verdict_names_margin_term_limit_and_change(profile: Profile) -> None:
    text = words(override(profile, {"cycle.period_us": 600}))
    figures = capacity(override(profile, {"cycle.period_us": 600})).results
    assert text.startswith("paper-1ms at 600 us: THE MODELS DISAGREE. paper: fits, ")
    assert f"{figures[0].margin_us:.3f} us to spare" in text
    assert f"{-figures[1].margin_us:.3f} us short" in text
    assert "The paper model decides." in text
    assert "Largest term: execution, 145.733 us of 205.917 us." in text
    assert "limited by time" in text
    assert "Cheapest way to make it fit (paper and standard): bus.gap_count = 7, which leaves " in text


def test_models_that_agree_on_the_fit_may_carry_different_numbers(profile: Profile) -> None:
    text = words(override(profile, {"cycle.period_us": 4000}))
    assert "standard agrees" in text
    assert "The bus carries 16 nodes (64 axes) by the paper model, limited by hops; 11 nodes (44 axes) by the" in text


def test_an_unsafe_gap_count_and_a_long_cable_are_warned_of(profile: Profile) -> None:
    text = words(override(profile, {"bus.gap_count": 5, "bus.cable_length_m": 10}))
    assert "gap count 5 is unsafe for 2 hops (2 nodes); the smallest safe one is 7" in text
    assert "cables of 10 m are longer than the 4.5 m" in text
    assert "fits, " in text
    assert "but only with an unsafe gap count" in text
    assert "Warning" not in words(override(profile, {"bus.gap_count": 13}))
    # Safe for the nodes there are, and not for those the sentence before speaks of.
    assert "unsafe for 5 hops (5 nodes); the smallest safe one is 13" in words(override(profile, {"bus.gap_count": 9}))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"bus.nodes": 17, "cycle.period_us": 1e6}, "17 hops are over the 16 of one bus"),
        ({"bus.nodes": 63, "bus.max_hops": 3, "cycle.period_us": 1e6}, "63 nodes are over the 62 of one bus"),
        ({"bus.speed": "S100", "payload.write_bytes": 513}, "a payload of 513 bytes is over the 512 bytes of S100"),
    ],
)
def test_the_verdict_says_which_limit_is_broken(profile: Profile, changes: dict[str, object], reason: str) -> None:
    assert f"does not fit, {reason}" in words(override(profile, changes))


def test_latency_warns_of_payloads_over_the_limit(profile: Profile) -> None:
    slow = override(profile, {"bus.speed": "S100"})
    text = render(latency_report(latency(slow, payloads_bytes=[4, 1024]), slow), "table")
    assert text.endswith("\nWarning: a payload of 1024 bytes is over the 512 bytes of S100.\n")


def test_latency_warns_of_hops_and_gap_count(profile: Profile) -> None:
    long = override(profile, {"bus.nodes": 17, "bus.gap_count": 5})
    text = render(latency_report(latency(long), long), "table")
    assert "17 hops are over the 16 of one bus" in text
    assert "gap count 5 is unsafe for 17 hops (17 nodes); the smallest safe one is 46" in text


def test_one_table_a_payload_and_one_block_a_period(profile: Profile) -> None:
    heads = render(latency_report(latency(profile, payloads_bytes=[4, 16, 32]), profile), "table")
    assert heads.count("\nfigure ") == 3
    result = capacity(profile, periods_us=[1000.0, 500.0])
    text = render(capacity_report(result, verdicts(result)), "table")
    assert text.count("\navailable alpha T_s") == 2


@pytest.mark.parametrize("period_us", [1000.0, 600.0, 100.0])
def test_every_figure_of_the_blocks_stands_in_the_document(
    profile: Profile, period_us: float, values_in_their_places: Callable[[Report], int]
) -> None:
    result = capacity(profile, periods_us=[4000.0, period_us])
    # Two tables of 24 figures under two models, and the figures of the sentences.
    assert values_in_their_places(capacity_report(result, verdicts(result))) > 100
    assert values_in_their_places(latency_report(latency(profile, payloads_bytes=[4, 16]), profile)) == 2 * 4 * 16
