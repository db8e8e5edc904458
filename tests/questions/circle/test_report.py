"""The answer of `busplan circle-test`: sentences, tables, drawing and data of the same figures."""

import json
import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Literal

import pytest

import busplan
from busplan.forms import render
from busplan.forms.blocks import Bar, Chart, Report, Sentence, ShownValue, Table
from busplan.forms.numbers import figure_text, sentence_text
from busplan.printable import to_json
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.circle.contour import TRACE_COLUMNS, trace_records
from busplan.questions.circle.failures import Failure, Stated
from busplan.questions.circle.figures import CircleTest
from busplan.questions.circle.report import (
    circle_document,
    circle_records,
    circle_report,
    circle_sentences,
    circle_table,
    contributions_table,
    servo_sentence,
    verdict_words,
)
from busplan.questions.circle.roundness import circle_test

ValuesIn = Callable[[object], Iterator[ShownValue]]

SMALL = {"circle.radius_mm": 25.0, "circle.ramp_periods": 20}
TIGHT = {**SMALL, "tolerance.max_contour_error_mm": 0.001, "tolerance.mean_contour_error_mm": 0.0005}
MINE = load("paper-4ms").profile.model_copy(update={"name": "mine"})
UNSTABLE = {**SMALL, "servo.position_gain_per_s": 1e5}


@cache
def circle_of(
    *changes: tuple[str, object], periods_us: tuple[float, ...] = (4000.0,), ranked: bool = True
) -> CircleTest:
    profile = override(load("paper-4ms").profile, dict(changes))
    return circle_test(profile, periods_us=periods_us, with_contributions=ranked)


def small(*, ranked: bool = True, **changes: object) -> CircleTest:
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return circle_of(*{**SMALL, **given}.items(), ranked=ranked)


def texts(test: CircleTest, *, with_contributions: bool = True) -> list[str]:
    blocks = circle_report(test._replace(with_contributions=with_contributions)).blocks()
    return [sentence_text(block) for block in blocks if isinstance(block, Sentence)]


@pytest.mark.parametrize("with_contributions", [True, False])
@pytest.mark.parametrize("changes", [SMALL, TIGHT, UNSTABLE])
def test_every_figure_stands_in_its_place(
    changes: dict[str, object], with_contributions: bool, values_of_the_document: Callable[[Report], int]
) -> None:
    test = circle_of(*changes.items(), periods_us=(4000.0, 2000.0, 100.0), ranked=with_contributions)
    assert values_of_the_document(circle_report(test._replace(with_contributions=with_contributions))) > 3 * 18


@pytest.mark.parametrize("form", ["table", "markdown", "html"])
def test_each_period_has_a_column(form: str, values_in: ValuesIn) -> None:
    test = circle_of(*SMALL.items(), periods_us=(4000.0, 2000.0, 100.0))
    table = circle_table(test.results)
    assert [column.heading for column in table.columns] == ["figure", "eq", "unit", "4 ms", "2 ms", "100 us"]
    rows = {str(row.cells[0]): row.cells for row in table.rows}
    for cells in rows.values():
        shown = [cell for cell in cells if isinstance(cell, ShownValue)]
        assert [cell.value for cell in shown] == [getattr(result, shown[0].key) for result in test.results]
    assert [figure_text(cell) for cell in rows["passed"] if isinstance(cell, ShownValue)] == ["yes", "yes", "no"]
    # What was not simulated is a dash; only what fails is set apart.
    assert [figure_text(cell) for cell in rows["circular deviation G"] if isinstance(cell, ShownValue)][2] == "-"
    assert [value for value in values_in(table) if value.state == "fails"] == [rows["passed"][-1]]
    assert "nan" not in render(circle_report(test._replace(with_contributions=True)), form).lower()  # type: ignore[arg-type]


def test_the_table_has_every_figure_of_the_answer_that_a_reader_asks_for(values_in: ValuesIn) -> None:
    shown = {value.key for value in values_in(circle_table(small().results))}
    record = circle_document(small()._replace(with_contributions=False))["results"][0]
    assert {key for key in record if key not in shown} == {
        *("steps", "timing_model", "bus_fits", "verdict", "required_us", "available_us", "servo_grade"),
        *("centre_offset_mm", "constant_speed_deg", "failures", "settled", "ideal_drive", "sources_matter"),
        *("update", "delay_us", "delay_x_us", "delay_y_us", "jitter_us"),
    }
    host = circle_of(*SMALL.items(), ("servo.loop", "host"))
    assert {value.key for value in values_in(circle_table(host.results))} == shown | {"update", "delay_us"}


# --- sentences --------------------------------------------------------------------------------------------------


def test_a_circle_that_no_error_source_shapes_is_no_claim_of_roundness() -> None:
    # Equal axes without friction: a G of picometres, whatever the machine is.
    test = busplan.circle_test("ethercat-servo-8")
    (result,) = test.results
    assert (result.passed, result.sources_matter, result.failures) == (None, False, ())
    assert test.passed is None
    said = next(circle_sentences(test.profile, result))
    assert sentence_text(said) == (
        "ethercat-servo-8 at 1 ms and 3000 mm/min: no error source of this profile matters; circular deviation G "
        "below 0.1 um, which says nothing of how round a machine is."
    )
    assert said.state == "warns"
    forms: tuple[Literal["table", "markdown", "html"], ...] = ("table", "markdown", "html")
    for form in forms:
        shown = render(test.report(), form)
        assert "no error source of this profile matters" in shown
        assert "PASSED" not in shown
        assert "every tolerance" not in shown
    assert test.to_dict()["results"][0]["passed"] is None
    assert test.to_dict()["results"][0]["sources_matter"] is False
    assert ">NO SOURCE MATTERS<" in test.svg()
    compared = render(busplan.compare("ethercat-servo-8", circle=True).report(), "table")
    assert "NO SOURCE MATTERS" in compared
    # It is no failure, and without a tolerance the largest error says the same.
    assert busplan.check("ethercat-servo-8").passed
    ideal = busplan.circle_test("dvrk")
    assert "largest contour error below 0.1 um" in sentence_text(
        next(circle_sentences(ideal.profile, ideal.results[0]))
    )
    # A tolerance that is broken fails, however small the error.
    tight = busplan.load_profile("ethercat-servo-8", changes={"tolerance.circular_deviation_mm": 1e-10})
    assert busplan.circle_test(tight).passed is False


def test_a_circle_that_holds_says_so() -> None:
    said, margins = circle_sentences(MINE, small().results[0])
    assert sentence_text(said) == "mine at 4 ms and 2500 mm/min: the circle holds every tolerance."
    assert said.state == "passes"
    assert sentence_text(margins) == (
        "The loop is stable, with a phase margin of 30 deg (default) or more "
        "and a gain margin of 6 dB (default) or more."
    )


def test_a_margin_that_the_profile_asks_for_is_no_default() -> None:
    asking = override(MINE, {"tolerance.min_phase_margin_deg": 40.0})
    _, margins = circle_sentences(asking, small().results[0])
    assert "a phase margin of 40 deg or more and a gain margin of 6 dB (default)" in sentence_text(margins)


@pytest.mark.parametrize(
    ("g_mm", "measure"),
    [
        (0.0005, "circular deviation G 0.500 um; no tolerance set: tolerance.circular_deviation_mm"),
        # A trapezoid has no G.
        (None, "largest contour error 0.700 um; no tolerance set: tolerance.max_contour_error_mm"),
    ],
)
def test_a_circle_without_a_tolerance_leads_with_its_figure(g_mm: float | None, measure: str) -> None:
    result = small().results[0]._replace(passed=None, circular_deviation_mm=g_mm, max_contour_error_mm=0.0007)
    said, _ = circle_sentences(MINE, result)
    assert sentence_text(said) == f"mine at 4 ms and 2500 mm/min: {measure}."
    assert (said.state, verdict_words(result).text) == ("warns", "NOT JUDGED")


def test_a_circle_that_the_bus_does_not_carry_is_not_run() -> None:
    (result,) = circle_of(*SMALL.items(), periods_us=(100.0,)).results
    (said,) = circle_sentences(MINE, result)
    assert sentence_text(said).startswith("mine at 100 us and 2500 mm/min: NOT RUN, the cycle does not fit the bus: ")
    assert said.state == "fails"


def test_a_circle_that_fails_says_by_how_much_and_what_to_attack(values_in: ValuesIn) -> None:
    result = circle_of(*TIGHT.items()).results[0]
    failed, attack = circle_sentences(MINE, result)
    text = ", and ".join(failure.text for failure in result.failures)
    assert sentence_text(failed) == f"mine at 4 ms and 2500 mm/min: FAILED, {text}."
    assert failed.state == "fails"
    assert {value.key for value in values_in(failed) if getattr(result, value.key, None) == value.value} == {
        *("period_us", "feed_mm_per_min", "mean_contour_error_mm", "max_contour_error_mm"),
    }
    contributions = result.contributions or ()
    best = min(range(len(contributions)), key=lambda number: contributions[number].mean_contour_error_mm)
    source = contributions[best].source.replace("_", " ")
    assert sentence_text(attack).startswith(f"Attack {source} first: without it the mean contour error is ")
    assert next(values_in(attack)).value == contributions[best].mean_contour_error_mm


def test_what_no_single_source_explains_is_said() -> None:
    result = circle_of(*TIGHT.items()).results[0]._replace(contributions=())
    _, said = circle_sentences(MINE, result)
    assert sentence_text(said) == "No single error source of the profile explains the mean contour error."


@pytest.mark.parametrize(
    "failure",
    [
        Failure("required_us", 205.917, 50.0),
        Failure("stability", None, None),
        Failure("circle_not_followed", 17.0, 360.0),
        Failure("min_phase_margin_deg", 20.125, 30.0),
        Failure("min_gain_margin_db", 2.0, 6.5),
        Failure("mean_contour_error_mm", 0.00456, 0.003),
        Failure("min_phase_margin_deg", 20.125, 30.0, is_default=True, more=" (and why)"),
        Failure("not_settled", None, 60.0),
        Failure("circular_deviation_mm", None, 0.03),
        Failure("circular_deviation_mm", 0.0264, 0.0),
        Failure("nodes", 70.0, 62.0, "70 nodes are too many"),
    ],
)
def test_a_sentence_writes_a_failure_as_its_text_does(failure: Failure, values_in: ValuesIn) -> None:
    result = small().results[0]._replace(passed=False, failures=(failure,))
    first = next(circle_sentences(MINE, result))
    assert sentence_text(first).endswith(f": FAILED, {failure.text}.")
    numbers = [part for part in failure.parts() if isinstance(part, Stated)]
    assert len([*values_in(first)]) == 2 + len(numbers)
    # No number of the failure stands in the words between; a word to set may have digits.
    assert not failure.said or numbers == []
    words = [re.sub('"[^"]*"', "", part) for part in failure.parts() if isinstance(part, str)]
    assert failure.said or not re.search("[0-9]", "".join(words))


def test_how_the_servo_values_are_known_is_said_once_and_only_with_figures() -> None:
    (mixed,) = servo_sentence(MINE, small().results[0])
    assert (sentence_text(mixed), mixed.state) == (
        "The servo values that the profile gives are 6 assumed, 4 calibrated, 2 published.",
        "warns",
    )
    measured = override(MINE, {"servo": {"drive_lag_us": 7500.0, "grade": "measured"}})
    (known,) = servo_sentence(measured, small().results[0]._replace(servo_grade="measured"))
    assert (sentence_text(known), known.state) == ("The servo values that the profile gives are measured.", "neutral")
    (ideal,) = servo_sentence(MINE, small().results[0]._replace(ideal_drive=True))
    assert sentence_text(ideal) == "The profile has no [servo]: an ideal drive was simulated."
    both = circle_of(*SMALL.items(), periods_us=(100.0, 4000.0, 2000.0))
    assert len([text for text in texts(both) if "servo values" in text]) == 1
    assert not [text for text in texts(circle_of(*SMALL.items(), periods_us=(100.0,))) if "servo values" in text]


# --- sources ----------------------------------------------------------------------------------------------------


def test_sources_are_ranked_with_bars_of_one_scale_beside_their_figures() -> None:
    result = small().results[0]
    table = contributions_table(result)
    bars = [cell for row in table.rows for cell in row.cells if isinstance(cell, Bar)]
    takes = [row.cells[2] for row in table.rows]
    assert [bar.value for bar in bars] == takes
    removed = [one.removed_mm for one in result.contributions or ()]
    assert {(bar.least, bar.most) for bar in bars} == {(min(0.0, *removed), max(0.0, *removed))}
    assert removed == sorted(removed, reverse=True)
    assert figure_text(takes[0]).startswith("+")  # type: ignore[arg-type]


def test_sources_that_take_nothing_have_no_bar() -> None:
    result = small().results[0]
    nothing = tuple(one._replace(removed_mm=0.0) for one in result.contributions or ())
    report = circle_report(
        small()._replace(results=(result._replace(contributions=nothing),))._replace(with_contributions=True)
    )
    assert "takes" in render(report, "html")
    table = contributions_table(result._replace(contributions=nothing))
    assert not [cell for row in table.rows for cell in row.cells if isinstance(cell, Bar)]


def test_sources_stand_only_where_they_were_asked_for() -> None:
    test = circle_of(*TIGHT.items(), ranked=False)
    assert test.results[0].contributions
    blocks = circle_report(test._replace(with_contributions=False)).blocks()
    assert len([block for block in blocks if isinstance(block, Table)]) == 1
    assert "contributions" not in circle_document(test._replace(with_contributions=False))["results"][0]
    without = small()._replace(results=(small().results[0]._replace(contributions=()),))
    assert "The profile has no error source that could be removed." in texts(without)


# --- drawing ----------------------------------------------------------------------------------------------------


def chart_of(test: CircleTest) -> Chart:
    (chart,) = (
        block for block in circle_report(test._replace(with_contributions=False)).blocks() if isinstance(block, Chart)
    )
    return chart


@pytest.mark.parametrize(
    ("tolerance_mm", "words"),
    [
        (0.025, "the tolerance of 25 um dashed."),
        (10.0, "the tolerance of 10000 um lies outside the drawing."),
    ],
)
def test_a_page_has_the_magnified_circle_and_how_to_read_it(tolerance_mm: float, words: str) -> None:
    test = small(tolerance__max_contour_error_mm=tolerance_mm)
    legend = chart_of(test).legend
    assert legend is not None
    assert re.match(r"Magnified \d+ times; [\d.]+ um from ring to ring, the nominal", sentence_text(legend))
    assert "; the dot is the start of the turn, the arrow its direction; " in sentence_text(legend)
    assert sentence_text(legend).endswith(words)
    report = circle_report(test._replace(with_contributions=False))
    page = render(report, "html")
    assert page.count('class="chart circle"') == 1
    assert "from ring to ring" in page
    text = render(report, "table")
    assert re.search(r"The contour error at constant speed is [\d.]+ um or less, at 4 ms and 2500 mm/min\n +um\n", text)
    assert "ring" not in text


def test_without_a_tolerance_the_legend_says_so() -> None:
    profile = load("paper-4ms").profile
    bare = profile.model_copy(update={"tolerance": profile.tolerance.model_copy(update={"max_contour_error_mm": None})})
    legend = chart_of(small()._replace(profile=bare)).legend
    assert legend is not None
    assert sentence_text(legend).endswith("; the profile has no tolerance of the largest contour error.")


def test_what_was_not_simulated_or_did_not_go_round_has_no_drawing() -> None:
    for test in (circle_of(*SMALL.items(), periods_us=(100.0,)), circle_of(*UNSTABLE.items())):
        assert not [
            block
            for block in circle_report(test._replace(with_contributions=True)).blocks()
            if isinstance(block, Chart)
        ]


# --- data -------------------------------------------------------------------------------------------------------


def test_documents_hold_the_results_own_numbers() -> None:
    test = circle_of(*TIGHT.items(), periods_us=(4000.0, 100.0))
    document = json.loads(to_json(circle_document(test._replace(with_contributions=True))))
    for record, result in zip(document["results"], test.results, strict=True):
        assert record["max_contour_error_mm"] == result.max_contour_error_mm
        assert record["failures"] == [failure.document() for failure in result.failures]
        assert (record["contributions"] is None) == (result.contributions is None)
    flat = circle_records(test._replace(with_contributions=True))
    assert flat[0]["centre_offset_x_mm"] == (test.results[0].centre_offset_mm or (None,))[0]
    removed = {one.source: one.removed_mm for one in test.results[0].contributions or ()}
    assert {key: value for key, value in flat[0].items() if key.startswith("removed_")} == {
        f"removed_{source}_mm": value for source, value in sorted(removed.items())
    }


def test_a_trace_has_the_columns_that_it_says() -> None:
    test = circle_of(*SMALL.items(), periods_us=(100.0, 4000.0))
    rows = list(trace_records(test, every=1000))
    assert {tuple(row) for row in rows} == {TRACE_COLUMNS}
    assert {row["period_us"] for row in rows} == {4000.0}
