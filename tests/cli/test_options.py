"""How the values of options are read."""

import csv
import json
from collections.abc import Callable
from fractions import Fraction
from io import StringIO
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

Run = Callable[..., Any]
Refused = Callable[..., str]


def periods_us(run: Run, *texts: str) -> list[float]:
    """What some --period mean."""
    given = [word for text in texts for word in ("--period", text)]
    done = run("capacity", "paper-4ms", "--timing-model", "standard", *given, "--format", "json")
    assert done.returncode == 0, done
    return [one["period_us"] for one in json.loads(done.stdout)["results"]]


@pytest.mark.parametrize(
    ("text", "value_us"),
    [
        ("4ms", 4000.0),
        ("0.001s", 1000.0),
        (".5ms", 500.0),
        ("5.ms", 5000.0),
        ("2.5E-1ms", 250.0),
        (" 4 ms ", 4000.0),
        ("0.0003s", 300.0),
        ("0.0001234s", 123.4),
        ("004ms", 4000.0),
        ("0.001us", 0.001),
        ("1000s", 1e9),
    ],
)
def test_a_time_is_a_number_with_its_unit(run: Run, text: str, value_us: float) -> None:
    assert periods_us(run, text) == [value_us]


def test_periods_keep_their_order_and_none_means_the_profiles(run: Run) -> None:
    assert periods_us(run, "4ms,250us", "4ms") == [4000, 250, 4000]
    assert periods_us(run) == [4000]


@given(
    digits=st.integers(1, 10**12),
    places=st.integers(0, 12),
    unit=st.sampled_from([("us", 1), ("ms", 1000), ("s", 1_000_000)]),
)
def test_a_time_is_the_float_nearest_to_what_is_written(
    run: Run, refused: Refused, digits: int, places: int, unit: tuple[str, int]
) -> None:
    text = str(digits).rjust(places + 1, "0")
    written = f"{text[: len(text) - places]}.{text[len(text) - places :]}{unit[0]}"
    exact_us = Fraction(digits * unit[1], 10**places)
    if Fraction(1, 1000) <= exact_us <= 10**9:
        assert periods_us(run, written) == [float(exact_us)]
    else:
        assert refused("capacity", "paper-4ms", "--period", written).startswith(f"--period {written}, in us ")


@given(text=st.text(alphabet="0123456789.eE+-umns ", max_size=8))
def test_any_text_is_a_time_or_refused(run: Run, text: str) -> None:
    done = run("capacity", "paper-4ms", f"--period={text}", "--format", "csv")
    assert done.returncode == 0 or (done.returncode, done.stderr.startswith(f"--period {text}")) == (2, True)


@pytest.mark.parametrize(
    "text",
    [
        *("4", "ms", "", "4MS", "4 m s", "-4ms", "+4ms", "4ms4", "1_000us", "0x4ms", "nanus", "infms", "4ns", "4µs"),
        *("1e1000us", "1e99999999999999999999ms", "1e us", "e3us", ".us", "1..5ms", "4msec"),
    ],
)
def test_what_is_no_time_is_refused_with_an_example(refused: Refused, text: str) -> None:
    said = f"--period {text}: expected a time with its unit, as 4ms, 250us or 0.001s"
    assert refused("capacity", "paper-4ms", f"--period={text}") == said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("capacity", "--period", "4ms,"),
            "--period 4ms,: expected times with their unit between commas, as 500us,1ms",
        ),
        (("capacity", "--period", "0.000s"), "--period 0.000s, in us 0.0: must be 0.001 or more"),
        (("capacity", "--period", "1001s"), "--period 1001s, in us 1001000000: must be 1,000,000,000 or less"),
        (("capacity", "--period", "1e-400us"), "--period 1e-400us, in us 0.0: must be 0.001 or more"),
        (("timeline", "--from", "1e308s"), "--from 1e308s: is too long; expected a time with its unit, as 4ms, "),
        (("timeline", "--period", "4"), "--period 4: expected a time with its unit"),
        (("plan", "--nodes", "0"), "--nodes 0: must be 1 or more"),
        (("latency", "--set", "bus.nodes=-3"), "--set bus.nodes=-3: must be 1 or more"),
        (("latency", "--set", "bus.gap_count=best"), "--set bus.gap_count=best: expected a whole number from"),
        (("latency", "--payload", "1025"), "payload 1025 bytes: outside the execution table of paper-4ms"),
        *(
            (("latency", f"--payload={text}"), f"--payload {text}: expected payloads of 1 to 1,000,000 bytes between ")
            for text in ("", "4,", "4,,5", "0", "-4", "4.0", "4 5", "x", "1e3", "1000001", "9" * 5000, "0" * 5000)
        ),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, tuple) else None,
)
def test_a_wrong_value_is_named_with_its_option(refused: Refused, arguments: tuple[str, ...], said: str) -> None:
    command, *options = arguments
    message = refused(command, "paper-4ms", *options)
    assert message.startswith(said[:400])
    assert "\n" not in message


@pytest.mark.parametrize(
    ("arguments", "typed"),
    [
        (("measured", ""), ""),
        (("measured", "can-servo-8", ""), ""),
        (("timeline", "can-servo-8", "--recording", ""), "--recording "),
        (("check", "can-servo-8", "--recording="), "--recording "),
        (("check", "can-servo-8", "--baseline", "", "--update-baseline"), "--baseline "),
        (("circle-test", "paper-4ms", "--trace", ""), "--trace "),
        (("capacity", "paper-4ms", "-o", ""), "--output "),
        (("plan", "paper-4ms", "-o", ""), "--output "),
        (("import", ""), ""),
        (("calibrate", "paper-4ms", ""), ""),
        (("diff", "paper-4ms", ""), ""),
    ],
)
def test_an_empty_path_is_called_so(refused: Refused, arguments: tuple[str, ...], typed: str) -> None:
    assert refused(*arguments).startswith(f"{typed}'': the path is empty; give the name of a file")


def test_sizes_stand_between_commas(run: Run) -> None:
    done = run("latency", "paper-dma", "--payload", f"{' ' * 20}4 , 000016,4", "--format", "json")
    sizes = [one["payload_bytes"] for one in json.loads(done.stdout)["transactions"]]
    assert [*dict.fromkeys(sizes)] == [4, 16]
    assert len(sizes) == 3 * 2 * 2


# --- values that vary -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("1:5", "1 2 3 4 5"),
        ("250, 500 ,1000", "250 500 1000"),
        ("0.1:0.5:0.1", "0.1 0.2 0.3 0.4 0.5"),
        ("1:6:2", "1 3 5"),
        ("5:1:-2", "5 3 1"),
        ("0.5:2.4", "0.5 1.5"),
        ("125:1000:*2", "125 250 500 1000"),
        ("1000:100:*0.5", "1000 500 250 125"),
        ("0.1:0.2:*1.5", "0.1 0.15"),
        ("0:1:#5", "0.0 0.25 0.5 0.75 1.0"),
        ("50:10:#3", "50 30 10"),
        ("1e3:3e3:1e3", "1000 2000 3000"),
        ("4.0", "4"),
        ("7:7:0.5", "7"),
    ],
)
def test_values_that_vary(run: Run, spec: str, expected: str) -> None:
    vary = f"cycle.nonperiodic_us={spec}"
    done = run("sweep", "paper-1ms", "--vary", vary, "--timing-model", "standard", "--format", "csv")
    _, *rows = csv.reader(StringIO(done.stdout))
    assert [row[0] for row in rows] == expected.split()


def test_a_word_that_the_key_takes_is_a_value(run: Run) -> None:
    done = run("sweep", "paper-1ms", "--vary", "bus.gap_count=63,optimal", "--format", "csv")
    assert [row["bus.gap_count"] for row in csv.DictReader(StringIO(done.stdout))][::2] == ["63", "optimal"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("bus.nodes", "--vary bus.nodes: expected KEY=VALUES"),
        ("=1", "expected KEY=VALUES"),
        ("bus.nodes=", "expected KEY=VALUES"),
        ("bus.gap_count=63,best", "'best' is not a number"),
        ("bus.nodes=optimal", "'optimal' is not a number"),
        ("bus.nodes=nan", "'nan' is not a number"),
        ("bus.nodes=1e999", "'1e999' is not a number"),
        ("bus.nodes=1,,2", "'' is not a number"),
        ("bus.nodes=1:2:3:4", "A:B:STEP"),
        ("bus.nodes=2:1", "steps of 1 never lead from 2 to 1"),
        ("bus.nodes=1:2:0", "steps of 0 never lead"),
        ("bus.nodes=1:2:*0.5", "multiplying by 0.5 never leads"),
        ("bus.nodes=0:2:*2", "multiplying by 2 never leads from 0"),
        ("bus.nodes=1:2:*1.00000001", "take a larger factor"),
        ("bus.nodes=1:2:#1", "a count of 2 or more"),
        ("bus.nodes=1:1:#3", "are one"),
        ("bus.nodes=5,6,5.0", "5 is given twice"),
        ("bus.nodes=0:1:0.0000000000000000000001", "more digits than a number here can hold"),
        ("bus.nodes=1:1000001", "1:1000001: 1,000,001 values are more than the 1,000,000 points a sweep takes"),
        ("bus.nodes=0:1:#1000001", "1,000,001 values are more than"),
        ("bus.nodes=0:9", "bus.nodes 0: must be 1 or more"),
        ("bus.nodes=99999999999999999999999", "bus.nodes 99999999999999999999999: must be 1,000,000 or less"),
        ("payload.read_bytes=4:1004:#50", "payload.read_bytes 24.408163265306122: expected a whole number"),
    ],
)
def test_values_that_cannot_vary_are_refused(refused: Refused, text: str, said: str) -> None:
    message = refused("sweep", "paper-1ms", "--vary", text)
    assert said in message
    assert "\n" not in message


def test_a_key_varies_once_and_one_does(refused: Refused) -> None:
    assert "k is varied already" in refused("sweep", "paper-1ms", "--vary", "k=1", "--vary", "k=2")
    assert refused("sweep", "paper-1ms").startswith("--vary: nothing to vary")
