"""`--set KEY=VALUE`: how it is read, which two options exclude each other, and what a refusal names."""

import re
import subprocess
from functools import cache
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan import BusplanError, Profile
from busplan.buses import kind_names
from busplan.english import listed
from busplan.profile.changes import (
    NO_CHANGES,
    KeyChange,
    KeyChanges,
    change_options,
    parse_set,
    period_option,
    shell_word,
    without_units,
)

KINDS = listed([f'"{one}"' for one in kind_names()], "or")


def test_a_value_is_toml_and_a_word_is_text() -> None:
    for written, value in [
        ("4000", 4000),
        ("0.5", 0.5),
        ("-1", -1),
        ("1e3", 1000.0),
        ("1_000", 1000),
        ("true", True),
        ('"S200"', "S200"),
        ("'S200'", "S200"),
        ("S200", "S200"),
        ("iso230-4", "iso230-4"),
        ("optimal", "optimal"),
        ("True", "True"),
        ("[1, 2]", [1, 2]),
        ('{kind = "linear", base_us = 30}', {"kind": "linear", "base_us": 30}),
        ('"a=b"', "a=b"),
        ("4 # a comment of TOML", 4),
    ]:
        (change,) = parse_set([f" bus.key = {written} "])
        assert (change.key, change.value, change.typed) == ("bus.key", value, f"--set bus.key={written}")
        assert type(change.value) is type(value)


@pytest.mark.parametrize("written", ["S200 S400", "[1, 2", "{a = 1", "4\nbus.nodes = 3", "3\n[bus]", "-", "µ"])
def test_what_is_neither_toml_nor_a_word_is_refused(written: str) -> None:
    with pytest.raises(BusplanError) as caught:
        parse_set([f"bus.key={written}"])
    assert str(caught.value).startswith(f"--set bus.key={written}: {written} is not a TOML value; expected a number")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("cycle.period_us=250us", 250),
        ("cycle.period_us=0.0003s", 300),
        ("cycle.period_us = 0.1 ms", 100),
        ("delivery.jitter_us=.5us", 0.5),
        ("bus.bit_rate_kbit_s=1Mbit/s", 1000),
        ("servo.lever_mm=20um", 0.02),
        ("bus.cable_length_m=300mm", 0.3),
        ("bus.cable_length_m=2m", 2),
        ("servo.lever_mm=2mm", 2),
        ("servo.lever_mm=0.5m", 500),
        ("bus.bit_rate_kbit_s=125kbit/s", 125),
    ],
)
def test_a_number_may_have_its_unit(text: str, value: float) -> None:
    (change,) = parse_set([text])
    assert (change.value, type(change.value)) == (value, type(value))
    assert f"in {change.key.rpartition('_')[2] if 'kbit' not in text else 'kbit_s'} {value:g}" in change.note


def test_a_number_that_is_none_in_toml_is_told_what_is_meant() -> None:
    for written, meant in [
        ("1,5", "a number has a decimal point, not a comma: 1.5"),
        ("-2,25", "a number has a decimal point, not a comma: -2.25"),
        ("15%", "a share is a number without a sign: 0.15"),
        ("2.5 %", "a share is a number without a sign: 0.025"),
    ]:
        with pytest.raises(BusplanError) as caught:
            parse_set([f"cycle.slice_ratio={written}"])
        refused = f"--set cycle.slice_ratio={written}: {written} is not a TOML value; {meant}"
        assert caught.value.problems == (refused,)


def test_units_of_a_grid_are_those_of_its_key_and_others_stay() -> None:
    assert without_units("0.5ms,3mm:2s,S200,7", key="cycle.period_us") == "500,3mm:2000000,S200,7"


def test_a_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(BusplanError, match=r"--set cycle.period_us=3mm: expected a number in us, ms or s"):
        parse_set(["cycle.period_us=3mm"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("period=250us", "unknown key; did you mean cycle.period_us?"),
        ("kind=can", "unknown key; did you mean bus.kind?"),
        ("bus.period_us=250", "unknown key; did you mean cycle.period_us?"),
        ("bus.nods=3", "unknown key; did you mean nodes?"),
        # At the top a name is that of a key below; in a section a misspelt one of its own.
        ("nodes=3", "unknown key; did you mean bus.nodes?"),
        ("cycle.period=250", "unknown key; did you mean period_us?"),
        ("bus.gap_count=5us", "expected a whole number from 0 to 63"),
        ("node.execution.grade=MEASURED", 'or "assumed"; did you mean "measured"?'),
        ("node.execution.base_us=3", 'unknown key where kind is "table"; it is a key of kind = "linear"'),
        ("bus.bit_rate_kbit_s=500", 'unknown key on this bus; it is a key where bus.kind is "can" or "polled"'),
        ("bus.sync_shift=0.8", 'unknown key on this bus; it is a key where bus.kind is "ethercat"'),
        ("bus.pipelines=0", "unknown key; known here: kind, speed"),
    ],
)
def test_a_key_that_is_not_there_is_told_where_it_is(text: str, words: str) -> None:
    with pytest.raises(BusplanError, match=re.escape(words)):
        KeyChanges(parse_set([text])).applied(busplan.load_profile("paper-4ms"))


def test_a_key_of_a_group_is_told_where_it_is() -> None:
    with pytest.raises(BusplanError) as caught:
        KeyChanges(parse_set(["group.io.every=2"])).applied(busplan.load_profile("gantry-24"))
    words = 'unknown key on this bus; it is a key where bus.kind is "can" or "ethercat"'
    assert caught.value.problems == (f"--set group.io.every=2: {words}",)


@pytest.mark.parametrize(
    "text", ["", "bus.nodes", "=3", "bus.nodes=", " = ", "bus..nodes=3", ".nodes=3", "bus nodes=3"]
)
def test_what_is_not_key_and_value_is_refused(text: str) -> None:
    with pytest.raises(BusplanError) as caught:
        parse_set([text])
    assert str(caught.value).startswith(f"--set {text}: expected KEY=VALUE")


@given(text=st.text(max_size=30), key=st.sampled_from(["bus.nodes", "name", "node.execution", "cycle.period_us"]))
def test_anything_typed_is_a_valid_change_or_refused_by_its_option(text: str, key: str) -> None:
    try:
        KeyChanges(parse_set([f"{key}={text}"])).applied(shipped())
    except BusplanError as error:
        unnamed = [problem for problem in error.problems or [""] if "--set" not in problem]
        assert unnamed == []


def test_values_that_no_parser_should_be_given_are_refused_in_time() -> None:
    for written in ("[" * 100_000, "9" * 10_000, "{a" + ".a" * 30_000 + " = 1}"):
        with pytest.raises(BusplanError, match="is not a TOML value"):
            parse_set([f"bus.nodes={written}"])


@cache
def shipped() -> Profile:
    return busplan.load_profile("paper-1ms")


def changes(*texts: str) -> KeyChanges:
    return KeyChanges(parse_set(texts))


def test_a_key_is_set_once() -> None:
    with pytest.raises(BusplanError, match=r"\A--set a\.b=1 and --set a\.b=2: both set a\.b; give one of them\Z"):
        changes("a.b=1", "c=3", "a.b=2")
    with pytest.raises(BusplanError, match=r"\A--nodes 4 and --set bus\.nodes=3: both set bus\.nodes; give one"):
        KeyChanges((KeyChange("bus.nodes", 4, "--nodes", "4"), *parse_set(["bus.nodes=3"])))


@pytest.mark.parametrize("texts", [("a.b={c=1}", "a.b.c=1"), ("a.b.c=1", "a.b={c=1}")])
def test_a_key_inside_a_table_that_is_set_is_refused_in_either_order(texts: tuple[str, str]) -> None:
    with pytest.raises(BusplanError, match=r": a\.b\.c is inside a\.b; give one of them\Z"):
        changes(*texts)


def test_keys_that_only_go_together_do_so_in_any_order() -> None:
    texts = ("node.execution.payload_bytes=[4, 64]", "node.execution.time_us=[30, 50]")
    for one in texts:
        with pytest.raises(BusplanError):
            changes(one).applied(shipped())
    both: Any = changes(*texts).applied(shipped())
    assert both == changes(*reversed(texts)).applied(shipped())
    assert (both.node.execution.payload_bytes, both.node.execution.time_us) == ((4, 64), (30.0, 50.0))


def test_a_table_replaces_its_section_and_may_be_of_another_kind() -> None:
    found: Any = changes("node.execution={kind='linear', base_us=30, per_byte_us=0.1}").applied(shipped())
    execution = found.node.execution
    assert (execution.kind, execution.base_us, execution.per_byte_us, execution.grade) == ("linear", 30.0, 0.1, None)


@pytest.mark.parametrize(
    ("texts", "problems"),
    [
        (["cycle.period_us=-1"], ["--set cycle.period_us=-1: must be 0.001 or more"]),
        (["cycle.perod_us=1"], ["--set cycle.perod_us=1: unknown key; did you mean period_us?"]),
        (["cycel.period_us=1"], ["--set cycel.period_us=1: cycel: unknown key; did you mean cycle?"]),
        (["bus=3"], ["--set bus=3: expected a table"]),
        (
            ["bus.kind=lon"],
            [f"--set bus.kind=lon: expected {KINDS}"],
        ),
        (["bus.nodes.x=3"], ["--set bus.nodes.x=3: no such key; nodes is a value, not a section"]),
        (
            ["node.execution.time_us=[1, -2, 3]"],
            ["--set node.execution.time_us=[1, -2, 3]: node.execution.time_us[1]: must"],
        ),
        (
            ["bus.nodes=0", "name=3"],
            ["--set name=3: expected a text in quotes", "--set bus.nodes=0: must be 1 or more"],
        ),
        (
            ["node.execution={kind='linear', base_us=1}"],
            ["--set node.execution={kind='linear', base_us=1}: node.execution.per_byte_us: missing key. Execution"],
        ),
    ],
)
def test_a_refusal_names_the_option(texts: list[str], problems: list[str]) -> None:
    with pytest.raises(BusplanError) as caught:
        changes(*texts).applied(shipped())
    assert len(caught.value.problems) == len(problems)
    assert all(map(str.startswith, caught.value.problems, problems))


def test_a_problem_of_another_key_names_all_that_was_set() -> None:
    with pytest.raises(BusplanError) as caught:
        changes("node.execution.kind=linear", "node.axes=2").applied(shipped())
    start = "with --set node.execution.kind=linear and --set node.axes=2, node.execution.base_us: missing key."
    assert caught.value.problems[0].startswith(start)


def test_a_long_value_is_shortened_in_messages() -> None:
    long = changes(f"name={'x' * 300}")
    with pytest.raises(BusplanError) as caught:
        long.applied(shipped())
    assert str(caught.value) == f"--set name={'x' * 95}...: must be no longer than 100 characters"


def test_no_change_gives_the_profile_itself() -> None:
    profile = shipped()
    assert KeyChanges().applied(profile) is profile


WORDS = {
    "line.toml": "line.toml",
    "line 1.toml": "'line 1.toml'",
    "-": "-",
    "-x.toml": "./-x.toml",
    "it's": """'it'"'"'s'""",
    "$HOME;`x`": "'$HOME;`x`'",
    "": "''",
    "\u00fc": "'\u00fc'",
    "two\nlines '\\": "$'two\\x0alines \\x27\\x5c'",
    "-\x1b[31m\u00fc": "$'./-\\x1b\\x5b31m\\xc3\\xbc'",
}


def test_a_word_of_a_shell_is_the_text_again() -> None:
    assert {text: shell_word(text) for text in WORDS} == WORDS
    printed = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {' '.join(WORDS.values())}"],
        check=True,
        capture_output=True,
        env={"LC_ALL": "C.UTF-8"},
    )
    read = printed.stdout.decode().split("\0")[:-1]
    # What begins with a dash is no option where the word is a path.
    assert read == [f"./{text}" if text.startswith("-") and text != "-" else text for text in WORDS]


def test_options_give_the_changes_and_the_period_again() -> None:
    given = KeyChanges(
        (
            KeyChange("cycle.period_us", 812.5, "--period", "0.8125ms"),
            *parse_set(["node.execution={kind='linear', base_us=30, per_byte_us=0.1}", "bus.nodes = 3"]),
            *parse_set(["constants.ARBITRATION_HOLD_US=2"]),
        )
    )
    table = """'node.execution={kind='"'"'linear'"'"', base_us=30, per_byte_us=0.1}'"""
    words = [*change_options(given, period_us=812.5)]
    assert words == [
        *("--period", "812.5us", "--set", table, "--set", "bus.nodes=3", "--set", "constants.ARBITRATION_HOLD_US=2"),
    ]
    assert [period_option(us)[1] for us in (500.0, 0.1, 1e-3, 1e9)] == ["500us", "0.1us", "0.001us", "1000000000us"]
    assert given.words == " and ".join(f"--set {change.text}" for change in given.entries[1:])
    assert [change.key for change in given.constants] == ["constants.ARBITRATION_HOLD_US"]
    assert [*given.of_profile.values] == ["cycle.period_us", "node.execution", "bus.nodes"]
    assert [*given.without(key="node.execution").values] == ["cycle.period_us", "bus.nodes"]
    assert dict(given.changed_constants) == {**dict(NO_CHANGES.changed_constants), "ARBITRATION_HOLD_US": 2.0}
    profile = given.applied(shipped())
    assert (profile.cycle.period_us, profile.bus.nodes) == (812.5, 3)
    assert dict(profile.constants)["ARBITRATION_HOLD_US"] == 2.0


def test_a_constant_changes_the_defaults_of_sections_that_nothing_else_touches() -> None:
    before: Any = shipped()
    after: Any = changes("constants.ARBITRATION_HOLD_US=2.5", "constants.PACKET_OVERHEAD_BYTES=30").applied(before)
    assert (before.node.response_us, before.payload.overhead_bytes) == (1.63, 20)
    # The overhead is in the file.
    assert (after.node.response_us, after.payload.overhead_bytes) == (2.5, 20)


def test_changes_stay_as_they_are_where_one_goes_into_another() -> None:
    execution = {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.0}
    for _ in range(2):
        one: Any = busplan.load_profile("paper-4ms", changes={"node.execution": execution, "node.execution.base_us": 9})
        assert (one.node.execution.base_us, execution["base_us"]) == (9, 30)
