"""What `busplan calibrate` says."""

import re

import pytest

import busplan

Rows = list[tuple[int, float, str]]


def run(rows: Rows) -> busplan.CalibrateAnswer:
    return busplan.calibrate("paper-two-node", rows, source="m.csv")


def rows(*values: tuple[int, float], kind: str = "write") -> Rows:
    return [(size, value, kind) for size, value in values]


def warnings(answer: busplan.CalibrateAnswer) -> list[str]:
    words: list[str] = answer.to_dict()["warnings"]
    return words


def example() -> busplan.CalibrateAnswer:
    return busplan.calibrate("paper-two-node", "table-1.csv")


def test_only_repetitions_have_a_spread() -> None:
    assert "std dev" not in str(run(rows((4, 50.0), (64, 80.0))))
    assert "std dev" in str(run(rows((4, 50.0), (4, 52.0))))
    assert "Outliers cannot be found at 4 bytes: that needs 3 measurements of a payload." in str(
        run(rows((4, 50.0), (4, 198.0)))
    )


def test_warnings() -> None:
    assert warnings(run(rows((64, 80.0)))) == [
        "the profile's payload of 4 bytes is outside the measured range, 64 to 64 bytes: measure it."
    ]
    assert "is latency_us in us?" in warnings(run(rows((4, 48_700.0))))[0]
    (short,) = warnings(run(rows((4, 20.0))))
    assert short.startswith("the bus waits 10.549 us before any response, so shorter executions do not show in")
    many = run(rows(*((4, 50.0 if index % 4 else 90.0 + index) for index in range(60))))
    (warning,) = warnings(many)
    assert warning.startswith(
        "15 slow measurements: line 1 (90 us at 4 bytes: T_exec +40.0 us off the median), line 5 (94 us at 4 bytes: "
    )
    assert warning.endswith(
        "off the median) and 5 more; left out. The slowest execution takes 96.001 us longer, worst_extra_us."
    )
    assert f"Warning: {warning}\n" in str(many)
    # Ten lines are named.
    assert len(re.findall(r"line \d+ \(", warning)) == 10
    quick = warnings(run(rows((4, 50.0), (4, 50.1), (4, 30.0), (4, 50.2), (4, 120.0))))
    assert [words.split(":")[0] for words in quick] == ["1 slow measurement", "1 fast measurement"]
    assert quick[1].endswith("; left out: measure again.")


def test_a_fit_in_words_in_its_note_and_as_changes() -> None:
    answer = run(rows((4, 50.0), (64, 80.0)))
    assert str(answer).startswith(
        "paper-two-node: T_exec is the median at each payload, of 2 measurements at 2 payloads, m.csv.\n"
    )
    assert answer.notes == {
        "node.execution": "busplan calibrate: median of 2 measurements in m.csv, packets by the standard model"
    }
    edits = answer.edits
    assert (edits["node.execution.kind"], edits["node.execution.grade"]) == ("table", "measured")
    assert (edits["node.execution.base_us"], edits["node.execution.per_byte_us"]) == (None, None)
    # Nothing is repeated: no spread is left, and an old uncertainty goes.
    assert edits["node.execution.uncertainty_us"] is None
    assert (edits["node.execution.residual"], edits["node.execution.measured_gap_count"]) == ("standard", 63)
    assert "node.execution.worst_extra_us" not in edits
    spread = run(rows((4, 50.0), (4, 52.0), (64, 80.0))).edits
    assert spread["node.execution.uncertainty_us"] == pytest.approx(2**0.5, abs=1e-3)


def test_the_section_of_the_profile_is_toml_to_copy() -> None:
    section = """
[node.execution]
grade = "derived"
kind = "table"
payload_bytes = [4, 16, 32, 64, 128, 256, 512, 1024]
time_us = [38.088, 37.881, 46.556, 56.105, 86.603, 142.598, 224.89, 428.473]
residual = "standard"
measured_gap_count = 63"""
    assert str(example()).endswith(section)
