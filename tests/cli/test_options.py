"""How the values of options are read: without a process, because they are many."""

import re
from fractions import Fraction
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.cli.changes import periods_us
from busplan.cli.options import complete_profile, parse_sizes, time_us, timing_models
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.sections.profile import Profile


@cache
def plan() -> Profile:
    return load("paper-4ms").profile


def period_us(text: str) -> float:
    """What one --period means."""
    found = periods_us([text], plan())
    assert found is not None
    (value_us,) = found
    return value_us


@pytest.mark.parametrize(
    ("text", "value_us"),
    [
        ("4ms", 4000.0),
        ("250us", 250.0),
        ("0.001s", 1000.0),
        ("1s", 1e6),
        ("0.5ms", 500.0),
        (".5ms", 500.0),
        ("5.ms", 5000.0),
        ("1e3us", 1000.0),
        ("2.5E-1ms", 250.0),
        ("4 ms", 4000.0),
        (" 4ms ", 4000.0),
        ("0.0003s", 300.0),
        ("0.0001234s", 123.4),
        ("004ms", 4000.0),
    ],
)
def test_a_time_is_a_number_with_its_unit(text: str, value_us: float) -> None:
    assert period_us(text) == value_us


@given(
    digits=st.integers(1, 10**12),
    places=st.integers(0, 12),
    unit=st.sampled_from([("us", 1), ("ms", 1000), ("s", 1_000_000)]),
)
def test_a_time_is_the_float_nearest_to_what_is_written(digits: int, places: int, unit: tuple[str, int]) -> None:
    text = str(digits).rjust(places + 1, "0")
    written = f"{text[: len(text) - places]}.{text[len(text) - places :]}{unit[0]}"
    exact_us = Fraction(digits * unit[1], 10**places)
    if Fraction(1, 1000) <= exact_us <= 10**9:
        assert period_us(written) == float(exact_us)
    else:
        with pytest.raises(BusplanError, match=f"--period {re.escape(written)}, in us "):
            period_us(written)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "4",
            "ms",
            "",
            " ",
            "4MS",
            "4 m s",
            "-4ms",
            "+4ms",
            "4ms4",
            "1_000us",
            "0x4ms",
            "nan",
            "infms",
        ),
        *(
            "nanus",
            "4ns",
            "4µs",
            "4min",
            "four ms",
            "1e1000us",
            "1e999999999ms",
            "1e99999999999999999999ms",
            "1e us",
            "e3us",
            ".us",
            "1..5ms",
            "4ms\n5ms",
            "4msec",
        ),
    ],
)
def test_what_is_no_time_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(BusplanError) as caught:
        period_us(text)
    assert str(caught.value) == f"--period {text}: expected a time with its unit, as 4ms, 250us or 0.001s"


@pytest.mark.parametrize("text", ["4ms,", "4,5ms", "4ms,1"])
def test_several_times_of_which_one_is_none_are_refused_as_they_were_typed(text: str) -> None:
    with pytest.raises(BusplanError) as caught:
        period_us(text)
    assert str(caught.value) == f"--period {text}: expected times with their unit between commas, as 500us,1ms"


@pytest.mark.parametrize(
    ("text", "value_us", "wrong"),
    [
        ("0ms", "0.0", "must be 0.001 or more"),
        ("0.000s", "0.0", "must be 0.001 or more"),
        ("0e9us", "0.0", "must be 0.001 or more"),
        ("1e-400us", "0.0", "must be 0.001 or more"),
        ("0.0009us", "0.0009", "must be 0.001 or more"),
        ("1001s", "1001000000.0", "must be 1,000,000,000 or less"),
        ("1e9s", "1000000000000000.0", "must be 1,000,000,000 or less"),
    ],
)
def test_a_time_out_of_the_profiles_range_is_shown_as_written_and_in_us(text: str, value_us: str, wrong: str) -> None:
    with pytest.raises(BusplanError) as caught:
        period_us(text)
    assert str(caught.value) == f"--period {text}, in us {value_us}: {wrong}"


def test_the_ends_of_the_range_are_periods() -> None:
    assert (period_us("0.001us"), period_us("1000s")) == (1e-3, 1e9)


def test_periods_keep_their_order_and_none_means_the_profiles() -> None:
    assert periods_us(["4ms", "250us", "4ms"], plan()) == [4000.0, 250.0, 4000.0]
    assert periods_us(["4ms,250us", "4ms"], plan()) == [4000.0, 250.0, 4000.0]
    assert periods_us(None, plan()) is None
    assert periods_us([], plan()) is None


@given(text=st.text(alphabet="0123456789.eE+-umns ", max_size=8))
def test_any_text_is_a_time_or_refused(text: str) -> None:
    try:
        value_us = period_us(text)
    except BusplanError:
        return
    assert 1e-3 <= value_us <= 1e9


def test_sizes_stand_between_commas() -> None:
    assert parse_sizes("4,16,32", option="--payload") == [4, 16, 32]
    assert parse_sizes(" 4 , 16 ", option="--payload") == [4, 16]
    assert parse_sizes("1,1", option="--payload") == [1, 1]
    assert parse_sizes("1000000", option="--payload") == [1_000_000]
    assert parse_sizes(f"{' ' * 20}4,000004", option="--payload") == [4, 4]


@pytest.mark.parametrize(
    "text",
    [
        "",
        ",",
        "4,",
        ",4",
        "4,,5",
        "0",
        "4,0",
        "-4",
        "+4",
        "4.0",
        "4 5",
        "x",
        "1e3",
        "1000001",
        "0000000000019999999",
        "9" * 5000,
        "0" * 5000,
    ],
)
def test_what_are_no_sizes_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(BusplanError) as caught:
        parse_sizes(text, option="--payload")
    assert (
        str(caught.value) == f"--payload {text}: expected payloads of 1 to 1,000,000 bytes between commas, as 4,16,32"
    )


def test_both_models_are_paper_first() -> None:
    profile = load("paper-4ms").profile
    assert timing_models("both", profile) == ("paper", "standard")
    assert timing_models("paper", profile) == ("paper",)
    assert timing_models("standard", profile) == ("standard",)


def test_completion_offers_the_shipped_names_that_begin_so() -> None:
    assert complete_profile("paper-o") == ["paper-optimal-gap"]
    assert complete_profile("x") == []
    assert "paper-4ms" in complete_profile("")


@pytest.mark.parametrize("text", ["1e308s", "1e306ms", "1e309us", "1e999s", f"{'9' * 400}us"])
def test_a_time_that_no_number_holds_is_refused(text: str) -> None:
    with pytest.raises(BusplanError) as caught:
        time_us(text, option="--from")
    assert str(caught.value) == f"--from {text}: is too long; expected a time with its unit, as 4ms, 250us or 0.001s"
