"""Measurements from CSV: what is right is read, what is wrong is said at its place, all at once."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.published import published
from busplan.errors import BusplanError
from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES, Measurement, parse_measurements
from busplan.profile.sources import locate_measurements

EXPECTED = "expected payload_bytes,latency_us and, where known, transaction"


def refusals(text: str | bytes) -> list[str]:
    with pytest.raises(BusplanError) as raised:
        parse_measurements(text.encode() if isinstance(text, str) else text, name="m.csv")
    return list(raised.value.problems)


def test_the_shipped_example_is_table_1() -> None:
    path, name, shipped = locate_measurements("table-1.csv")
    found = parse_measurements(path.read_bytes(), name=name)
    assert (name, shipped) == ("table-1.csv", True)
    _, _, latencies, *_ = (table["rows"] for table in published("paper")["evidence"])
    assert [one.latency_us for one in found] == [row["published"] for row in latencies]
    assert {f"{one.payload_bytes} bytes" for one in found} == {row["quantity"] for row in latencies}
    assert {one.transaction for one in found} == {"write"}


def test_columns_in_any_order_comments_blank_lines_quotes_space_and_any_line_end() -> None:
    header = '\ufeff# bench 3\r\n\r\n"latency_us", transaction ,payload_bytes # as logged\r\n'
    text = f'{header} 5e1 ,READ,"4"\n\r\n.5,write, 16#\n'
    assert parse_measurements(text.encode(), name="m.csv") == (
        Measurement(4, "read", 4, 50.0),
        Measurement(6, "write", 16, 0.5),
    )


measurements = st.builds(
    Measurement,
    line=st.just(0),
    transaction=st.sampled_from(["read", "write"]),
    payload_bytes=st.integers(1, 10**6),
    latency_us=st.floats(1e-6, 1e9),
)


@given(st.lists(measurements, min_size=1, max_size=5))
def test_what_is_written_is_read(rows: list[Measurement]) -> None:
    lines = [",".join(map(str, row[1:])) for row in rows]
    text = "\n".join(["transaction,payload_bytes,latency_us", *lines])
    found = parse_measurements(text.encode(), name="m.csv")
    assert [one._replace(line=0) for one in found] == rows
    assert [one.line for one in found] == list(range(2, len(rows) + 2))


@given(st.one_of(st.binary(max_size=60), st.text('payload_bytes,latency_us\n4.-e#";\t', max_size=60).map(str.encode)))
def test_no_bytes_lead_to_a_traceback(content: bytes) -> None:
    for text in (content, b"payload_bytes,latency_us\n" + content):
        try:
            assert parse_measurements(text, name="m.csv")
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


def test_very_many_problems_are_counted() -> None:
    problems = refusals("payload_bytes,latency_us\n" + "4,x\n" * 70)
    assert (len(problems), problems[-1]) == (51, "m.csv: and 20 more problems")


def test_no_text_and_too_much_of_it() -> None:
    assert refusals(b"payload_bytes,latency_us\n4,\xff\n")[0].startswith("m.csv:2:3: not a text file: byte 0xff")
    assert "larger than 20,000,000 bytes" in refusals(b"#" * (MAX_MEASUREMENTS_BYTES + 1))[0]


def test_a_file_of_ones_own_is_never_taken_for_the_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert locate_measurements("table-1.csv").shipped
    (tmp_path / "table-1.csv").write_text("payload_bytes,latency_us\n4,50\n")
    assert not locate_measurements("table-1.csv").shipped
    with pytest.raises(
        BusplanError, match=r"no such file, and no shipped example of that name; shipped is table-1\.csv"
    ):
        locate_measurements("table-2.csv")
