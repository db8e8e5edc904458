"""What `busplan calibrate` says."""

from collections.abc import Callable

import pytest

from busplan.forms import render
from busplan.forms.blocks import Report, Sentence, Snippet
from busplan.profile.measurements import Measurement, parse_measurements
from busplan.profile.shipped import load, locate_measurements
from busplan.questions.calibrate.calibration import Calibration, calibrate
from busplan.questions.calibrate.report import (
    calibration_document,
    calibration_report,
    calibration_warnings,
    execution_changes,
    provenance,
)


def run(rows: list[Measurement], *, form: str = "table") -> Calibration:
    profile = load("paper-two-node").profile
    return calibrate(profile, rows, source="m.csv", form="linear" if form == "linear" else "table")


def rows(*values: tuple[int, float], kind: str = "write") -> list[Measurement]:
    return [
        Measurement(line, "read" if kind == "read" else "write", size, value, None)
        for line, (size, value) in enumerate(values, start=2)
    ]


def report(result: Calibration) -> Report:
    return calibration_report(result, source="m.csv", applied_to=None)


def said(result: Calibration) -> str:
    return render(report(result), "table")


def example() -> list[Measurement]:
    return list(parse_measurements(locate_measurements("table-1.csv").path.read_bytes(), name="table-1.csv"))


def test_table_1_shows_what_the_model_leaves_unexplained() -> None:
    text = said(run(example()))
    assert (
        "Left unexplained by the standard timing model: 0.827 us of T1+T2 on average, 1.139 us at most (4% of" in text
    )
    (groups,) = (line.split() for line in text.splitlines() if line.startswith(" ") and "T1+T2" in line)
    assert groups == ["T1+T2"] * 3
    (headings,) = (line.split() for line in text.splitlines() if line.startswith("payload "))
    assert headings[-3:] == ["measured", "model", "unexplained"]


def test_only_repetitions_have_a_spread_and_only_reads_beside_writes_a_difference() -> None:
    single = said(run(rows((4, 50.0), (64, 80.0))))
    assert "scatter" not in single
    assert "unexplained" not in single
    both = run([*rows((4, 50.0), (4, 52.0)), Measurement(9, "read", 4, 54.0, None)])
    assert "Repetitions scatter by 2.000 us at most (standard deviation)." in said(both)
    assert "T_exec of reads and of writes, which differ by up to 3.000 us." in said(both)


def test_warnings() -> None:
    outside = calibration_warnings(run(rows((64, 80.0))))
    assert outside == [
        "the profile's payload of 4 bytes is outside the table, 64 to 64 bytes: measure it, or use --form linear."
    ]
    assert "is latency_us in us?" in calibration_warnings(run(rows((4, 48_700.0))))[0]
    many = rows(*((4, 50.0 if index % 4 else 90.0 + index) for index in range(60)))
    (warning,) = calibration_warnings(run(many))
    assert warning.startswith(
        "15 slow measurements: line 2 (90 us at 4 bytes: T_exec +40.0 us off what the others say), line 6 (94 us at 4 "
    )
    assert warning.endswith("and 5 more; not in the fit: the slowest execution takes 96.001 us more, worst_extra_us.")
    quick = calibration_warnings(run(rows((4, 50.0), (4, 50.1), (4, 20.0), (4, 50.2), (4, 120.0))))
    assert [one.split(":")[0] for one in quick] == ["1 slow measurement", "1 fast measurement"]
    assert quick[1].endswith("; left out of the fit; measure again.")
    assert "No outlier can be told at 4 bytes: it takes 3 measurements" in said(run(rows((4, 50.0), (4, 198.0))))


def test_a_line_in_words_in_provenance_and_as_changes() -> None:
    result = run(rows((4, 50.0), (64, 80.0)), form="linear")
    base, slope = result.execution.execution_us(0), result.execution.execution_us(1) - result.execution.execution_us(0)
    assert f"Line: {base:g} us + {slope:g} us/byte * payload, by Theil-Sen through the median at each payload." in said(
        result
    )
    assert provenance(result, source="m.csv") == (
        "busplan calibrate: linear (Theil-Sen) of 2 measurements in m.csv, packets by the standard model, "
        "rms residual 0.000 us"
    ).replace("0.000 us", f"{result.rms_residual_us:.3g} us" if 0 < result.rms_residual_us < 0.001 else "0.000 us")
    changes = execution_changes(result)
    assert changes["node.execution.kind"] == "linear"
    assert changes["node.execution.grade"] == "measured"
    assert (changes["node.execution.payload_bytes"], changes["node.execution.time_us"]) == (None, None)
    # Two measurements are used up by a line: no spread is left, and an old uncertainty goes.
    assert changes["node.execution.uncertainty_us"] is None
    assert changes["node.execution.residual"] == "standard"
    assert changes["node.execution.measured_gap_count"] == 63
    assert "node.execution.worst_extra_us" not in changes
    spread = execution_changes(run(rows((4, 50.0), (4, 52.0), (64, 80.0))))
    assert spread["node.execution.uncertainty_us"] == pytest.approx(2**0.5, abs=1e-3)


def test_no_figure_of_the_table_is_rounding_dust() -> None:
    text = said(run(rows((4, 50.0), (4, 50.0004), (4, 51.0))))
    assert "e-" not in text
    assert "-0.000" not in text


@pytest.mark.parametrize("form", ["table", "linear"])
def test_every_figure_stands_at_its_place(form: str, values_of_the_document: Callable[[Report], int]) -> None:
    assert values_of_the_document(report(run(example(), form=form))) > 8 * 8
    repeated = run([*rows((4, 50.0), (4, 52.0), (64, 80.0)), Measurement(9, "read", 4, 54.0, None)], form=form)
    assert values_of_the_document(report(repeated)) > 2 * 6


def test_warnings_are_said_and_stand_in_the_document(values_of_the_document: Callable[[Report], int]) -> None:
    many = rows(*((4, 50.0 if index % 4 else 90.0 + index) for index in range(60)))
    result = run(many)
    warned = [block for block in report(result).blocks() if isinstance(block, Sentence) and block.state == "warns"]
    assert len(warned) == 1
    # Ten lines are named.
    assert len([part for part in warned[0].parts if getattr(part, "key", "") == "line"]) == 10
    assert values_of_the_document(report(result)) > 8
    (warning,) = calibration_document(result, source="m.csv", applied_to=None)["warnings"]
    assert f"Warning: {warning}\n" in said(result)


def test_the_section_of_the_profile_is_toml_to_copy() -> None:
    (section,) = (block for block in report(run(example())).blocks() if isinstance(block, Snippet))
    assert section.language == "toml"
    assert section.lines == (
        "[node.execution]",
        'grade = "measured"',
        'kind = "table"',
        "payload_bytes = [4, 16, 32, 64, 128, 256, 512, 1024]",
        # T_lant - (T1 + T2) - (6.0 - 32 / 393.216), row by row.
        "time_us = [36.781, 36.681, 45.381, 54.681, 84.881, 141.081, 223.181, 426.681]",
        'residual = "none"',
        "measured_gap_count = 63",
    )
