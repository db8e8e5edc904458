"""Measurements from CSV: what is right is read, what is wrong is said at its place, all at once."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan import BusplanError
from busplan.profile.measurements import measurements_from, parse_measurements

EXPECTED = "expected payload_bytes,latency_us and, where known, transaction"


@pytest.fixture(autouse=True)
def _work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def calibrated(content: str | bytes) -> busplan.CalibrateAnswer:
    Path("m.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    return busplan.calibrate("paper-two-node", "m.csv")


def refusals(content: str | bytes) -> list[str]:
    with pytest.raises(BusplanError) as raised:
        calibrated(content)
    return list(raised.value.problems)


def test_columns_in_any_order_comments_blank_lines_quotes_space_and_any_line_end() -> None:
    header = '\ufeff# bench 3\r\n\r\n"latency_us", transaction ,payload_bytes # as logged\r\n'
    text = f'{header} 5e1 ,READ,"4"\n\r\n.8e2,write, 16#\n'
    plain = busplan.calibrate("paper-two-node", [(4, 50.0, "read"), (16, 80.0, "write")], source="m.csv")
    assert calibrated(text).edits == plain.edits


@given(st.one_of(st.binary(max_size=60), st.text('payload_bytes,latency_us\n4.-e#";\t', max_size=60).map(str.encode)))
def test_no_bytes_lead_to_a_traceback(content: bytes) -> None:
    for text in (content, b"payload_bytes,latency_us\n" + content):
        try:
            assert calibrated(text).edits
        except BusplanError as error:
            assert all(problem.startswith("m.csv:") for problem in error.problems)  # noqa: PT017


def test_headers_that_are_wrong() -> None:
    for header, problem in [
        ("", f"m.csv:1:1: no header; {EXPECTED}"),
        ("4,48.7", f"m.csv:1:1: the first line has no names of columns; {EXPECTED}"),
        ("payload_bytes,latency_us", "m.csv:1:1: no measurement below the header"),
        ("payload_bytes;latency_us", "m.csv:1:1: semicolons between the columns; expected commas, and a point"),
        ("payload_bytes\tlatency_us", "m.csv:1:1: tabs between the columns; expected commas, and a point"),
        ("payload_bytes|latency_us", "m.csv:1:1: bars between the columns; expected commas, and a point"),
        ("payload_bytes latency_us", "m.csv:1:1: spaces between the columns; expected commas, and a point"),
        (
            "payload_bytes, latency_ms",
            "m.csv:1:16: column 'latency_ms': its unit looks like ms; give us in a column latency_us (multiply",
        ),
        ("latency (s),payload_bytes", "m.csv:1:1: column 'latency (s)': its unit looks like s; give us in a column"),
        ("latency_ns,payload_bytes", "m.csv:1:1: column 'latency_ns': its unit looks like ns; give us in a column"),
        ("latency_us,payload_bits", "m.csv:1:12: column 'payload_bits': its unit looks like bits; give bytes in"),
        ("latency_us,payload", "m.csv:1:12: column 'payload': call it payload_bytes if it is in bytes"),
        ("latency_us,paylod_bytes", "m.csv:1:12: column 'paylod_bytes': unknown; did you mean payload_bytes?"),
        ("payload_bytes,latency_us,seconds", f"m.csv:1:26: column 'seconds': unknown; {EXPECTED}"),
        ("payload_bytes,latency_us,latency_us", "m.csv:1:26: column latency_us is there twice"),
        ("payload_bytes,transaction", f"m.csv:1:1: column latency_us is missing; {EXPECTED}"),
    ]:
        assert refusals(header)[0].startswith(problem)


def test_a_column_in_another_unit_is_one_problem_and_not_a_missing_column_besides() -> None:
    assert len(refusals("payload_bytes,latency_ms\n4,0.0487\n")) == 1


def test_all_rows_that_are_wrong_are_told_at_once() -> None:
    text = """payload_bytes,latency_us,transaction
4,nan,write
4,-48.7,write
3.5,48.7,write
0,48.7,write
x,1e400,dma
4,48,7,write
4,48.7
4,1_0,write
"""
    assert refusals(text) == [
        "m.csv:2:3: latency_us 'nan': expected a number with a point, as 48.7",
        "m.csv:3:3: latency_us '-48.7': must be greater than 0 and no more than 1,000,000,000",
        "m.csv:4:1: payload_bytes '3.5': must be a whole number",
        "m.csv:5:1: payload_bytes '0': must be greater than 0 and no more than 1,000,000",
        "m.csv:6:1: payload_bytes 'x': expected a number with a point, as 48.7",
        "m.csv:6:3: latency_us '1e400': must be greater than 0 and no more than 1,000,000,000",
        "m.csv:6:9: transaction 'dma': expected read or write",
        "m.csv:7:1: 4 values for 3 columns; is there a decimal comma? Write 48.7",
        "m.csv:8:1: 2 values for 3 columns",
        "m.csv:9:3: latency_us '1_0': expected a number with a point, as 48.7",
    ]


def test_the_largest_values_are_taken_and_long_ones_are_shortened() -> None:
    (most,) = parse_measurements(b"payload_bytes,latency_us\n1000000,1e9", name="m.csv")
    assert most == (2, "write", 1_000_000, 1e9)
    for digits, shown in ((40, "x" * 40), (41, f"{'x' * 40}...")):
        text = f"payload_bytes,latency_us\n4,{'x' * digits}"
        assert refusals(text) == [f"m.csv:2:3: latency_us '{shown}': expected a number with a point, as 48.7"]
    assert refusals("payload_bytes,latency_us\n1000001,1000000000.1") == [
        "m.csv:2:1: payload_bytes '1000001': must be greater than 0 and no more than 1,000,000",
        "m.csv:2:9: latency_us '1000000000.1': must be greater than 0 and no more than 1,000,000,000",
    ]


class Frame:
    """What a data frame has: names of columns, and an array of each."""

    def keys(self) -> list[str]:
        return ["latency_us", "payload_bytes"]

    def __getitem__(self, name: str) -> np.ndarray:
        return np.array([48.7, 55.0] if name == "latency_us" else [4, 16])


@pytest.mark.parametrize(
    "given",
    [
        [(4, 48.7), (16, 55.0)],
        [[4, 48.7, "write"], [16, 55.0, "WRITE"]],
        np.array([[4, 48.7], [16, 55.0]]),
        [np.array([4, 48.7]), np.array([16, 55.0])],
        iter([(4, 48.7), (16, 55.0)]),
        [{"latency_us": 48.7, "payload_bytes": 4}, {"payload_bytes": 16, "latency_us": np.float64(55)}],
        {"payload_bytes": (4, 16), "latency_us": np.array([48.7, 55.0]), "transaction": ["write", "write"]},
        Frame(),
    ],
    ids=lambda given: type(given).__name__,
)
def test_tables_of_python_are_read_as_a_file(given: Any) -> None:
    assert measurements_from(given, name="m") == ((1, "write", 4, 48.7), (2, "write", 16, 55.0))


TABLE = "expected a CSV file, CSV text, columns by name, or rows: each a mapping"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (4, f"m 4: {TABLE}"),
        ({}, f"m: {TABLE}"),
        ({"payload_bytes": "4", "latency_us": [48.7]}, f"m: {TABLE}"),
        ({"payload_bytes": 4, "latency_us": 48.7}, f"m: {TABLE}"),
        ([(4,)], f"m: {TABLE}"),
        ([(4, 48.7, "write", 1)], f"m: {TABLE}"),
        (["4,48.7"], f"m: {TABLE}"),
        (
            {"payload_bytes": [4, 16], "latency_us": [48.7]},
            "m: payload_bytes has 2 values, latency_us has 1 values; expected one of each for a measurement",
        ),
        (
            [{"payload_bytes": 4, "latency_us": 1}, {"payload_bytes": 4}],
            "m: row 2 has payload_bytes, and row 1 has payload_bytes, latency_us",
        ),
        ([(4, 48.7), (16, "x")], "m:2:2: latency_us 'x': expected a number with a point, as 48.7"),
        ([(4, 48.7), (16,)], "m:2:1: 1 value for 2 columns"),
        ([], "m:1:1: no measurement below the header"),
    ],
    ids=str,
)
def test_what_is_no_table_of_measurements_is_refused(given: Any, words: str) -> None:
    with pytest.raises(BusplanError) as caught:
        measurements_from(given, name="m")
    assert str(caught.value).startswith(words)


def test_very_many_problems_are_counted() -> None:
    problems = refusals("payload_bytes,latency_us\n" + "4,x\n" * 70)
    assert (len(problems), problems[-1]) == (51, "m.csv: and 20 more problems")


def test_no_text_and_too_much_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.profile.measurements._MOST_ROWS", 3)
    assert refusals("payload_bytes,latency_us\n" + "4,40\n" * 4) == [
        "m.csv:5:1: more than 3 measurements; give fewer repetitions"
    ]
    assert refusals(b"payload_bytes,latency_us\n4,\xff\n")[0].startswith("m.csv:2:3: not a text file: byte 0xff")
    assert refusals(b"#" * 20_000_001)[0].startswith("m.csv:1:1: the file is larger than 20,000,000 bytes")


def test_a_file_of_ones_own_is_never_taken_for_the_example() -> None:
    assert " of 8 measurements at " in str(busplan.calibrate("paper-two-node", "table-1.csv"))
    Path("table-1.csv").write_text("payload_bytes,latency_us\n4,50\n")
    assert " of 1 measurement at " in str(busplan.calibrate("paper-two-node", "table-1.csv"))
    with pytest.raises(BusplanError, match=r"no such file, and no shipped example of that name; shipped is table-1"):
        busplan.calibrate("paper-two-node", "table-2.csv")
