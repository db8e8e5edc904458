"""A constant of the model with another value: it reaches every figure, and every answer names it."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import busplan

SOURCE = Path(__file__).resolve().parents[2] / "src"
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def test_the_paper_s_hold_time_is_changed_everywhere(run: Run) -> None:
    plain, changed = (
        json.loads(run("capacity", "paper-4ms", "--format", "json", *options).stdout)
        for options in ((), ("--set", "constants.arbitration_hold_us=2.63"))
    )
    assert changed["changes"] == {"constants.arbitration_hold_us": 2.63}
    before, after = (
        next(one for one in document["results"] if one["timing_model"] == "paper") for document in (plain, changed)
    )
    # Two nodes, a read and a write of each; a transaction has two arbitrations, each 1 us longer (equation (4)).
    assert after["cycle_arbitration_us"] - before["cycle_arbitration_us"] == pytest.approx(2 * 2 * 2 * 1.0)
    done = run("explain", "paper-4ms", "--set", "constants.ARBITRATION_HOLD_US=2.63", "--all")
    row = next(line for line in done.stdout.splitlines() if line.startswith("ARBITRATION_HOLD_US "))
    assert "assumed" in row
    assert done.stdout.startswith("With --set constants.ARBITRATION_HOLD_US=2.63.")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("constants.mailbox_bytes=100", "no constant of IEEE 1394, the bus of this profile"),
        ("constants.arbitration_hold=2", "no constant of this name; did you mean ARBITRATION_HOLD_US?"),
        ("constants.arbitration_hold_us=long", "expected a finite number"),
        ("constants.arbitration_hold_us=nan", "expected a finite number"),
        ("constants.base_rate_mbit_s=0", "expected a number above 0"),
        ("constants.arbitration_hold_us=-0.5", "expected a number above 0"),
        ("BASE_RATE_MBIT_S=1000", "no key of a profile; did you mean constants.BASE_RATE_MBIT_S?"),
        ("constants.EQ15_CONSTANT_US=3", "cannot be changed: equation (15) is tested as it is printed"),
    ],
)
def test_what_is_no_constant_is_refused(text: str, words: str, run: Run) -> None:
    done = run("capacity", "paper-4ms", "--set", text)
    assert (done.returncode, words in done.stderr) == (2, True), done.stderr


def test_compare_takes_a_constant_of_any_kind(run: Run) -> None:
    options = ("compare", "ethercat-servo-8", "--buses", "ieee1394", "--format", "json")
    plain, changed = (
        json.loads(run(*options, *more).stdout)["buses"][0]["required_us"]
        for more in ((), ("--set", "constants.arbitration_hold_us=2.63"))
    )
    assert changed > plain


def test_a_table_s_constant_is_named_by_its_key_and_csv_names_it(run: Run) -> None:
    typed = "constants.DATA_RATE_MBIT_S[s400]=200"
    done = run("capacity", "paper-4ms", "--format", "csv", "--set", typed)
    head, first, *_ = done.stdout.splitlines()
    assert head.endswith(",changed_constants")
    assert first.endswith("," + typed.replace("=200", "=200"))
    assert "changed_constants" not in run("capacity", "paper-4ms", "--format", "csv").stdout


def test_the_environment_changes_no_figure() -> None:
    """A variable changed figures once, of a process that began with it."""
    variables = {"PYTHONPATH": str(SOURCE), "BUSPLAN_CONSTANTS": "ARBITRATION_HOLD_US=99;GAPS_TICKS=abc"}
    command = [sys.executable, "-m", "busplan", "capacity", "paper-4ms", "--format", "json"]
    done = subprocess.run(command, capture_output=True, check=True, env=variables)
    assert json.loads(done.stdout) == busplan.capacity("paper-4ms").to_dict()
