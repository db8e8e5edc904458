"""Measurements from a file, as text, as columns and as rows are the same measurements."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import busplan
from busplan.cli import app
from tests.registers import SHIPPED_FOLDER

ROWS = [(4, 48.7), (4, 48.9), (16, 55.2), (64, 80.9), (256, 184.4)]
TEXT = "payload_bytes,latency_us\n" + "".join(f"{size},{us}\n" for size, us in ROWS)
SIZES, TIMES = [size for size, _ in ROWS], [us for _, us in ROWS]


class Frame:
    """What calibrate asks of a data frame."""

    def __init__(self, **columns: Any) -> None:
        self._columns = columns

    def keys(self) -> list[str]:
        return list(self._columns)

    def __getitem__(self, name: str) -> Any:
        return self._columns[name]


@pytest.mark.parametrize(
    "given",
    [
        TEXT,
        {"payload_bytes": SIZES, "latency_us": TIMES},
        {"latency_us": np.array(TIMES), "payload_bytes": np.array(SIZES)},
        Frame(payload_bytes=np.array(SIZES, dtype=float), latency_us=tuple(TIMES)),
        [{"payload_bytes": size, "latency_us": us} for size, us in ROWS],
        [{"latency_us": np.float64(us), "payload_bytes": np.int64(size)} for size, us in ROWS],
        ROWS,
        np.array(ROWS),
        iter(ROWS),
        [(size, us, "write") for size, us in ROWS],
    ],
)
def test_all_ways_to_give_measurements_are_the_same(given: Any, tmp_path: Path) -> None:
    file = tmp_path / "bench.csv"
    file.write_text(TEXT, encoding="utf-8")
    wanted = busplan.calibrate("paper-two-node", file)
    answer = busplan.calibrate("paper-two-node", given)
    assert (answer.execution, answer.changes, answer.payloads) == (wanted.execution, wanted.changes, wanted.payloads)
    assert (wanted.source, answer.source) == (str(file), "measurements")
    assert busplan.calibrate("paper-two-node", str(file)) == wanted
    read = busplan.calibrate("paper-two-node", TEXT.encode(), source="bench 7")
    assert (read.execution, read.source, read.to_dict()["source"]) == (wanted.execution, "bench 7", "bench 7")
    assert wanted.notes == {"node.execution": read.notes["node.execution"].replace("bench 7", "bench.csv")}


def test_the_changes_are_those_that_apply_writes(tmp_path: Path) -> None:
    own, bench = tmp_path / "own.toml", tmp_path / "bench.csv"
    text = (SHIPPED_FOLDER / "paper-two-node.toml").read_text(encoding="utf-8")
    own.write_text(text.replace("[node.execution]", "[node.execution]\nworst_extra_us = 2.5"), encoding="utf-8")
    bench.write_text(TEXT, encoding="utf-8")
    before = busplan.load_profile(own)
    changes = busplan.calibrate(own, bench).changes
    assert busplan.load_profile(own) == before
    done = CliRunner().invoke(app, ["calibrate", str(own), str(bench), "--apply"])
    assert done.exit_code == 0, done.stderr
    written = busplan.load_profile(own)
    assert busplan.load_profile(before, changes=changes) == written
    (nodes,) = written.node_groups
    assert (nodes.node.execution.kind, nodes.node.execution.worst_extra_us) == ("table", 2.5)


def test_an_outlier_is_named_by_its_row() -> None:
    rows = [(4, 48.7 + number / 100) for number in range(12)]
    rows[7] = (4, 148.7)
    (outlier,) = busplan.calibrate("paper-two-node", rows).outliers
    assert (outlier.line, outlier.latency_us) == (8, 148.7)


REFUSED: dict[str, tuple[Any, str]] = {
    "no file": ("nowhere.csv", "nowhere.csv: no such file, and no shipped example"),
    "standard input": ("-", "-: standard input is read by the command line alone"),
    "a number": (5, "measurements 5: expected a CSV file, CSV text, columns by name, or rows"),
    "no rows": ([], "measurements:1:1: no measurement below the header"),
    "rows of one value": ([(4,)], "measurements: expected a CSV file"),
    "columns of nothing": ({}, "measurements: expected a CSV file"),
    "columns of one value": ({"payload_bytes": 4, "latency_us": 48.7}, "measurements: expected a CSV file"),
    "columns of unlike length": (
        {"payload_bytes": [4, 4], "latency_us": [48.7]},
        "measurements: payload_bytes has 2 values, latency_us has 1 values; expected one of each",
    ),
    "rows with other keys": (
        [{"payload_bytes": 4, "latency_us": 48.7}, {"payload_bytes": 4}],
        "measurements: row 2 has payload_bytes, and row 1 has payload_bytes, latency_us",
    ),
    "rows of unlike length": ([(4, 48.7), (4, 48.7, "read")], "measurements:2:1: 3 values for 2 columns"),
    "another unit": ([{"payload_bytes": 4, "latency_ms": 0.05}], "give us in a column latency_us (multiply by 1000)"),
    "no number": ([(4, 48.7), (4, float("nan"))], "measurements:2:2: latency_us 'nan': expected a number"),
    "half a byte": ([(4.5, 48.7)], "measurements:1:1: payload_bytes '4.5': must be a whole number"),
    "text without a value": ("payload_bytes,latency_us\n4,x\n", "measurements:2:3: latency_us 'x': expected a number"),
}


def test_what_is_no_measurement_is_refused_with_its_place() -> None:
    for given, message in REFUSED.values():
        with pytest.raises(busplan.BusplanError, match=re.escape(message)):
            busplan.calibrate("paper-two-node", given)
