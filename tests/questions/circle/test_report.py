"""The answer of `busplan circle-test`: sentences, tables, drawing and data of the same figures."""

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Literal, TypeVar

import pytest

import busplan
from busplan.forms import render
from busplan.forms.blocks import Bar, Block, Chart, Sentence, ShownValue, Table
from busplan.forms.numbers import figure_text, sentence_text

ValuesIn = Callable[[object], Iterator[ShownValue]]

SMALL = {"circle.radius_mm": 25.0, "circle.ramp_periods": 20}
TIGHT = {**SMALL, "tolerance.max_contour_error_mm": 0.001, "tolerance.mean_contour_error_mm": 0.0005}
UNSTABLE = {**SMALL, "servo.position_gain_per_s": 1e5}
Of = TypeVar("Of", bound=Block)


@cache
def circle_of(
    *changes: tuple[str, object], periods_us: tuple[float, ...] = (4000.0,), ranked: bool = True
) -> busplan.CircleTestAnswer:
    profile = busplan.load_profile("paper-4ms", changes={"name": "mine", **dict(changes)})
    return busplan.circle_test(profile, period_us=periods_us, contributions=ranked)


def small(*, ranked: bool = True, **changes: object) -> busplan.CircleTestAnswer:
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return circle_of(*{**SMALL, **given}.items(), ranked=ranked)


def uncached(**changes: object) -> busplan.CircleTestAnswer:
    """As `small`, with whole sections of the profile among the changes."""
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return busplan.circle_test(busplan.load_profile("paper-4ms", changes={"name": "mine", **SMALL, **given}))


def blocks(test: busplan.CircleTestAnswer, kind: type[Of]) -> list[Of]:
    return [block for block in test.report().blocks if isinstance(block, kind)]


def texts(test: busplan.CircleTestAnswer) -> list[str]:
    return [sentence_text(words) for words in blocks(test, Sentence)]


# --- sentences --------------------------------------------------------------------------------------------------


def test_a_circle_that_no_error_source_shapes_is_no_claim_of_roundness() -> None:
    # Equal axes without friction: a G of picometres, whatever the machine is.
    profile = busplan.load_profile("ethercat-servo-8")
    test = busplan.circle_test(busplan.load_profile(profile, changes={"tolerance": {}}))
    (result,) = test.results
    assert (result.passed, result.sources_matter, result.failures) == (None, False, ())
    assert test.passed is None
    verdict = blocks(test, Sentence)[0]
    assert sentence_text(verdict) == (
        "ethercat-servo-8 at 1 ms and 3000 mm/min: no error source of this profile matters; circular deviation G "
        "below 0.1 um, so the test says nothing about the roundness of a machine: friction at reversals, backlash, "
        "squareness and "
        "jitter are 0."
    )
    assert verdict.state == "warns"
    forms: tuple[Literal["table", "markdown", "html"], ...] = ("table", "markdown", "html")
    for form in forms:
        shown = render(test.report(), form)
        assert "no error source of this profile matters" in shown
        assert "PASSED" not in shown
        assert "every tolerance" not in shown
    assert test.to_dict()["results"][0]["passed"] is None
    assert test.to_dict()["results"][0]["sources_matter"] is False
    assert ">NO SOURCE MATTERS: 1 ms, " in test.svg()
    # It is no failure, and without a tolerance the largest error says the same.
    assert busplan.check("ethercat-servo-8").passed
    ideal = busplan.circle_test("dvrk")
    assert "largest contour error below 0.1 um" in texts(ideal)[0]
    # The sources that a machine usually has are named where they are 0: of both axes.
    assert "machine: drive lag, friction at reversals, backlash, squareness and jitter are 0." in texts(ideal)[0]
    small = {"servo.x.drive_lag_us": 1, "servo.y.reversal_mm_s": 1e-6, "mechanics.squareness_um_per_m": 1e-6}
    some = busplan.circle_test(busplan.load_profile("dvrk", changes={**small, "delivery.jitter_us": 1e-6}))
    assert "machine: backlash is 0." in texts(some)[0]
    # Without a tolerance G of a whole turn says it, though chords leave the largest error over 0.1 um.
    changes = {"tolerance": {}, "servo.drive_lag_us": 1000, "circle.feed_mm_per_min": 3000}
    turn = busplan.circle_test(busplan.load_profile("ethercat-servo-8", changes=changes))
    (of_turn,) = turn.results
    assert of_turn.circular_deviation_mm is not None
    assert of_turn.max_contour_error_mm is not None
    assert of_turn.circular_deviation_mm < 1e-4 < of_turn.max_contour_error_mm
    assert (of_turn.passed, of_turn.sources_matter) == (None, False)
    assert "no error source of this profile matters; circular deviation G below 0.1 um" in texts(turn)[0]
    # With one of the largest error that error is judged.
    largest = busplan.load_profile("ethercat-servo-8", changes={**changes, "tolerance": {"max_contour_error_mm": 0.02}})
    assert (busplan.circle_test(largest).passed, busplan.circle_test(largest).results[0].sources_matter) == (True, True)
    # A tolerance that is broken fails, however small the error.
    tight = busplan.load_profile("ethercat-servo-8", changes={"tolerance.circular_deviation_mm": 1e-10})
    assert busplan.circle_test(tight).passed is False


def test_a_circle_that_holds_says_so() -> None:
    verdict, margins = blocks(small(ranked=False), Sentence)[:2]
    assert sentence_text(verdict) == (
        "mine at 4 ms and 2500 mm/min: the circle holds, mean contour error 4.529 um of 6 um, "
        "largest contour error 20.710 um of 25 um."
    )
    assert verdict.state == "passes"
    assert sentence_text(margins) == (
        "The loop is stable, with a phase margin of 30 deg (default) or more "
        "and a gain margin of 6 dB (default) or more."
    )


@pytest.mark.parametrize(("name", "matters"), [("ethercat-servo-8", False), ("can-servo-8", True)])
def test_a_tolerance_that_is_held_is_named_and_what_is_missing_of_the_machine(name: str, matters: bool) -> None:
    test = busplan.circle_test(busplan.load_profile(name, changes={"tolerance.circular_deviation_mm": 0.02}))
    assert test.results[0].sources_matter is matters
    said = texts(test)[0]
    assert re.search(r": the circle holds, circular deviation G [\d.]+ um of 20 um; but friction at reversals, ", said)
    assert said.endswith("squareness and jitter are 0 in this profile, so it says little.")


def test_a_margin_that_the_profile_asks_for_is_no_default() -> None:
    asking = small(tolerance__min_phase_margin_deg=40.0)
    assert "a phase margin of 40 deg or more and a gain margin of 6 dB (default)" in texts(asking)[1]


@pytest.mark.parametrize(
    ("path", "measure", "key"),
    [
        ("iso230-4", "circular deviation G", "circular_deviation_mm"),
        # A trapezoid has no G.
        ("trapezoid", "largest contour error", "max_contour_error_mm"),
    ],
)
def test_a_circle_without_a_tolerance_leads_with_its_figure(path: str, measure: str, key: str) -> None:
    test = uncached(tolerance={}, circle__path=path)
    (result,) = test.results
    verdict = blocks(test, Sentence)[0]
    um = f"{getattr(result, key) * 1e3:.3f}"
    assert sentence_text(verdict) == (
        f"mine at 4 ms and 2500 mm/min: {measure} {um} um; no tolerance set: tolerance.{key}."
    )
    assert verdict.state == "warns"
    assert ">NOT JUDGED: 4 ms, " in test.svg()


def test_a_circle_that_the_bus_does_not_carry_is_not_run() -> None:
    test = circle_of(*SMALL.items(), periods_us=(100.0,))
    verdict = blocks(test, Sentence)[0]
    assert sentence_text(verdict).startswith(
        "mine at 100 us and 2500 mm/min: NOT RUN, the cycle does not fit the bus: "
    )
    assert verdict.state == "fails"
    assert not [text for text in texts(test) if "servo values" in text]


def test_a_circle_that_fails_says_by_how_much_and_what_to_attack(values_in: ValuesIn) -> None:
    test = circle_of(*TIGHT.items())
    (result,) = test.results
    failed, attack = blocks(test, Sentence)[:2]
    text = ", and ".join(failure.text for failure in result.failures)
    assert sentence_text(failed) == f"mine at 4 ms and 2500 mm/min: FAILED, {text}."
    assert failed.state == "fails"
    assert {value.key for value in values_in(failed) if getattr(result, value.key, None) == value.value} == {
        *("period_us", "feed_mm_per_min", "mean_contour_error_mm", "max_contour_error_mm"),
    }
    best = min(result.contributions or (), key=lambda source: source.mean_contour_error_mm)
    assert sentence_text(attack).startswith(f"Attack {best.words} first: without it the mean contour error is ")
    assert next(values_in(attack)).value == best.mean_contour_error_mm


def test_what_no_single_source_explains_is_said() -> None:
    test = circle_of(*TIGHT.items())
    none = replace(test, results=(test.results[0]._replace(contributions=()),))
    assert "No error source of the profile, when removed, reduces the mean contour error." in texts(none)
    assert "The profile has no error source that could be removed." in texts(none)


def test_how_the_servo_values_are_known_is_said_once() -> None:
    both = circle_of(*SMALL.items(), periods_us=(100.0, 4000.0, 2000.0))
    (mixed,) = (words for words in blocks(both, Sentence) if "servo values" in sentence_text(words))
    assert (sentence_text(mixed), mixed.state) == (
        "The servo values that the profile gives are 6 assumed, 4 calibrated, 2 published.",
        "warns",
    )
    measured = uncached(servo={"drive_lag_us": 7500.0, "grade": "measured"})
    assert "The servo values that the profile gives are measured." in texts(measured)
    assert "The profile has no [servo]: an ideal drive was simulated." in texts(busplan.circle_test("dvrk"))


# --- sources ----------------------------------------------------------------------------------------------------


def test_sources_are_ranked_with_bars_of_one_scale_beside_their_figures() -> None:
    (result,) = small().results
    _, table = blocks(small(), Table)
    bars = [cell for row in table.rows for cell in row.cells if isinstance(cell, Bar)]
    takes = [row.cells[2] for row in table.rows]
    assert [bar.value for bar in bars] == takes
    removed = [source.removed_mm for source in result.contributions or ()]
    assert {(bar.least, bar.most) for bar in bars} == {(min(0.0, *removed), max(0.0, *removed))}
    assert removed == sorted(removed, reverse=True)
    assert figure_text(takes[0]).startswith("+")  # type: ignore[arg-type]


def test_sources_that_take_nothing_have_no_bar() -> None:
    (result,) = small().results
    nothing = tuple(source._replace(removed_mm=0.0) for source in result.contributions or ())
    _, table = blocks(replace(small(), results=(result._replace(contributions=nothing),)), Table)
    assert table.rows
    assert not [cell for row in table.rows for cell in row.cells if isinstance(cell, Bar)]


# --- drawing ----------------------------------------------------------------------------------------------------


def legend_of(test: busplan.CircleTestAnswer) -> str:
    (chart,) = blocks(test, Chart)
    assert chart.legend is not None
    return sentence_text(chart.legend)


@pytest.mark.parametrize(
    ("tolerance_mm", "words"),
    [
        (0.025, "the tolerance of 25 um dashed."),
        (10.0, "the tolerance of 10000 um lies outside the drawing."),
    ],
)
def test_a_page_has_the_magnified_circle_and_how_to_read_it(tolerance_mm: float, words: str) -> None:
    test = small(ranked=False, tolerance__max_contour_error_mm=tolerance_mm)
    legend = legend_of(test)
    assert re.match(r"Magnified \d+ times; rings every [\d.]+ um; bold: the nominal", legend)
    assert "; the dot is the start of the turn, the arrow its direction; " in legend
    assert legend.endswith(words)
    assert test.html.count('<figure class="round">') == test.html.count('class="band first"') == 1
    assert "rings every" in test.html
    assert "ring" not in str(test)


def test_without_a_tolerance_the_legend_says_so() -> None:
    assert legend_of(uncached(tolerance={})).endswith("; the profile has no tolerance of the largest contour error.")


def test_what_was_not_simulated_or_did_not_go_round_has_no_drawing() -> None:
    for test in (circle_of(*SMALL.items(), periods_us=(100.0,)), circle_of(*UNSTABLE.items())):
        assert blocks(test, Chart) == []


# --- data -------------------------------------------------------------------------------------------------------


def test_documents_hold_the_results_own_numbers() -> None:
    test = circle_of(*TIGHT.items(), periods_us=(4000.0, 100.0))
    for record, result in zip(json.loads(test.to_json())["results"], test.results, strict=True):
        assert record["max_contour_error_mm"] == result.max_contour_error_mm
        assert record["failures"] == [failure.document() for failure in result.failures]
        assert (record["contributions"] is None) == (result.contributions is None)
    flat, _ = csv.DictReader(io.StringIO(render(test.report(), "csv")))
    assert flat["centre_offset_x_mm"] == str((test.results[0].centre_offset_mm or (None,))[0] or "")
    removed = {source.source: source.removed_mm for source in test.results[0].contributions or ()}
    assert {key: float(value) for key, value in flat.items() if key.startswith("removed_")} == {
        f"removed_{source}_mm": value for source, value in sorted(removed.items())
    }


def test_a_trace_has_the_periods_that_were_simulated() -> None:
    test = circle_of(*SMALL.items(), periods_us=(100.0, 4000.0))
    rows = list(csv.DictReader(io.StringIO("".join(test.trace_csv(every=1000)))))
    assert {float(row["period_us"]) for row in rows} == {4000.0}
    assert len(rows) == test.results[1].steps // 1000
