"""From bytes to a profile: every fault gives one clear message with its place, and nothing else ever happens."""

import os
import pickle
import re
import sys
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import busplan
from busplan import BusplanError, Profile
from busplan.buses import kind_names
from busplan.english import listed
from busplan.errors import PlacedError, PlacedProblem

MAX_FILE_BYTES: Final = 2_000_000

TEXT: Final = """\
schema_version = 1
name = "test"
[bus]
kind = "ieee1394"
speed = "S400"
gap_count = 63
nodes = 2
[cycle]
period_us = 4000
slice_ratio = 0.5
[cycle.sync]
ping_us = 0.3
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "table"
payload_bytes = [4, 16, 32]
time_us = [36.7, 36.3, 44.7]
"""


def edited(*changes: tuple[str, str]) -> str:
    """The text with some of it replaced; what is to be replaced must be there once."""
    text = TEXT
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@pytest.fixture(autouse=True)
def _work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def read(content: str | bytes) -> Any:
    Path("f.toml").write_bytes(content.encode() if isinstance(content, str) else content)
    return busplan.load_profile("f.toml")


def problems(content: str | bytes) -> tuple[str, ...]:
    """What is said of a file that must not load."""
    with pytest.raises(BusplanError) as caught:
        read(content)
    assert str(caught.value) == "\n".join(caught.value.problems)
    return caught.value.problems


def the_problem(content: str | bytes) -> str:
    """The only thing that is said of a file that must not load, on one line."""
    (problem,) = problems(content)
    assert "\n" not in problem
    assert problem.isprintable()
    return problem


def test_the_text_of_these_tests_is_a_profile() -> None:
    assert read(TEXT).name == "test"


# --- one fault, one message -------------------------------------------------------------------------------

KINDS = listed([f'"{one}"' for one in kind_names()], "or")
FAULTS = {
    "wrong type, text": ("nodes = 2", 'nodes = "2"', '7:1: bus.nodes = "2": expected a whole number'),
    "wrong type, bool": ("nodes = 2", "nodes = true", "7:1: bus.nodes = true: expected a whole number"),
    "wrong type, float": ("nodes = 2", "nodes = 2.0", "7:1: bus.nodes = 2.0: expected a whole number"),
    "wrong type, date": (
        *("nodes = 2", "nodes = 1979-05-27 07:32:00"),
        "7:1: bus.nodes = 1979-05-27 07:32:00: expected a whole number",
    ),
    "wrong type, bool for a float": ("us = 4000", "us = false", "9:1: cycle.period_us = false: expected a number"),
    "wrong type, number for a text": ('"test"', "7", "2:1: name = 7: expected a text in quotes"),
    "unknown section": ("[bus]", "[buss]\n[bus]", "3:2: buss: unknown key; did you mean bus?"),
    "nan": ("4000", "nan", "9:1: cycle.period_us = nan: must be finite"),
    "inf": ("4000", "inf", "9:1: cycle.period_us = inf: must be finite"),
    "minus inf": ("4000", "-inf", "9:1: cycle.period_us = -inf: must be finite"),
    "nan, where zero is allowed": ("ping_us = 0.3", "ping_us = nan", "12:1: cycle.sync.ping_us = nan: must be finite"),
    "overflow": ("4000", "1e400", "9:1: cycle.period_us = 1e400: must be finite"),
    "negative": ("ping_us = 0.3", "ping_us = -0.3", "12:1: cycle.sync.ping_us = -0.3: must be 0 or more"),
    "zero period": ("4000", "0", "9:1: cycle.period_us = 0: must be 0.001 or more"),
    "zero nodes": ("nodes = 2", "nodes = 0", "7:1: bus.nodes = 0: must be 1 or more"),
    "too large": ("slice_ratio = 0.5", "slice_ratio = 1.5", "10:1: cycle.slice_ratio = 1.5: must be 1 or less"),
    "percentage": (
        *("slice_ratio = 0.5", "slice_ratio = 85"),
        "10:1: cycle.slice_ratio = 85: must be 1 or less; it is a share: 0.85 for 85 %",
    ),
    "as written": ("nodes = 2", "nodes   =  0x00", "7:1: bus.nodes = 0x00: must be 1 or more"),
    "unknown speed": (
        *('"S400"', '"S500"'),
        '5:1: bus.speed = "S500": expected "S100", "S200", "S400", "S800", "S1600" or "S3200"',
    ),
    "unknown grade of execution": (
        *('kind = "table"', 'kind = "table"\ngrade = "guessed"'),
        ('20:1: node.execution.grade = "guessed": expected "measured", "derived", "calibrated" or "assumed"'),
    ),
    "unknown kind of bus": (
        '"ieee1394"',
        '"lon"',
        f'4:1: bus.kind = "lon": expected {KINDS}',
    ),
    "gap count": (
        *("gap_count = 63", "gap_count = 64"),
        '6:1: bus.gap_count = 64: expected a whole number from 0 to 63, or "optimal"',
    ),
    "gap count in words": (
        *("gap_count = 63", 'gap_count = "best"'),
        '6:1: bus.gap_count = "best": expected a whole number from 0 to 63, or "optimal"',
    ),
    "unknown form of execution": (
        *('"table"', '"cubic"'),
        '19:1: node.execution.kind = "cubic": expected "linear" or "table"',
    ),
    "schema version": ("schema_version = 1", "schema_version = 2", "1:1: schema_version = 2: expected 1"),
    "schema version, true": ("schema_version = 1", "schema_version = true", "1:1: schema_version = true: expected 1"),
    "empty name": ('"test"', '""', '2:1: name = "": must not be empty'),
    "escapes in the name": (
        *('"test"', '"\\u001b[31m"'),
        '2:1: name = "\\u001b[31m": must not hold control characters',
    ),
    "lengths of the table": (
        *("[36.7, 36.3, 44.7]", "[36.7, 36.3]"),
        ("21:1: node.execution.time_us = [36.7, 36.3]: has 2 values and payload_bytes has 3: "
        "the two must be of one length"),
    ),
    "table does not ascend": (
        *("[4, 16, 32]", "[4, 32, 16]"),
        "20:25: node.execution.payload_bytes[2] = 16: payloads must ascend, and this follows 32",
    ),
    "empty table": (
        *("[4, 16, 32]", "[]"),
        "20:1: node.execution.payload_bytes = []: must not be empty",
    ),
    "element of the table": (
        *("36.3,", '"36.3",'),
        '21:18: node.execution.time_us[1] = "36.3": expected a number',
    ),
    "column of the table": (
        *("[4, 16, 32]", "4"),
        "20:1: node.execution.payload_bytes = 4: expected an array",
    ),
    "payload outside the table": (
        *("read_bytes = 12", "read_bytes = 33"),
        ("14:1: payload.read_bytes = 33: is outside the execution table, 4 to 32 bytes: measure it and add it to "
        'node.execution, or use kind = "linear"'),
    ),
    "unknown key": ("[payload]", "[payload]\nxyz = 1", ("14:1: payload.xyz: unknown key; known here: read_bytes, "
                    "write_bytes, read_bytes_per_axis, write_bytes_per_axis, overhead_bytes")),
    "unknown key, nearly right": (
        *("[node]", "[node]\nexes = 1"),
        "17:1: node.exes: unknown key; did you mean axes?",
    ),
    "unknown key of the table": (
        *('kind = "table"', 'kind = "table"\nbase_us = 1'),
        '20:1: node.execution.base_us: unknown key where kind is "table"; it is a key of kind = "linear"',
    ),
    "missing key": (
        *("nodes = 2\n", ""),
        "3:2: bus.nodes: missing key. Distributed nodes N, host not counted; for example nodes = 2",
    ),
    "missing key of the table": (
        *("time_us = [36.7, 36.3, 44.7]\n", ""),
        ("18:7: node.execution.time_us: missing key. Execution time T_exec at each payload [us]; "
        "for example time_us = [36.7, 36.3]"),
    ),
    "inline": (
        *("[cycle.sync]\nping_us = 0.3", "sync = { ping_us = -1 }"),
        "11:10: cycle.sync.ping_us = -1: must be 0 or more",
    ),
    "dotted": (
        *("[cycle.sync]\nping_us = 0.3", "sync.ping_us = -1"),
        "11:6: cycle.sync.ping_us = -1: must be 0 or more",
    ),
    "indented": ("nodes = 2", "\t  nodes = 0", "7:4: bus.nodes = 0: must be 1 or more"),
}  # fmt: skip


def test_a_fault_gives_one_message_with_place_key_value_and_what_would_be_right() -> None:
    for old, new, message in FAULTS.values():
        assert the_problem(edited((old, new))) == f"f.toml:{message}"


def test_places_and_words_are_the_same_under_windows() -> None:
    for old, new, message in FAULTS.values():
        content = b"\xef\xbb\xbf" + edited((old, new)).replace("\n", "\r\n").encode()
        assert the_problem(content) == f"f.toml:{message}"


EXECUTION = 'execution = {kind = "linear", base_us = 30, per_byte_us = 0.35}'


@pytest.mark.parametrize(
    ("section", "line"),
    [
        ("bus", 'bus = {kind = "ieee1394"}'),
        ("cycle", "cycle = {period_us = 4000}"),
        ("payload", "payload = {read_bytes = 12, write_bytes = 12}"),
        ("node", f"node = {{axes = 4, {EXECUTION}}}"),
    ],
)
def test_a_missing_section_is_named_with_its_brackets_and_a_line_that_stands_for_it(section: str, line: str) -> None:
    text = re.sub(rf"(?s)\[{section}.*?(?=\n\[(?!{section})|\Z)\n?", "", TEXT)
    message = f"f.toml:1:1: {section}: missing section [{section}]; as one line, above all sections: {line}"
    assert the_problem(text) == message
    if section != "bus":  # which has further keys, by its kind
        assert read(f"{line}\n{text}").name == "test"


def test_a_missing_section_inside_another_stands_at_that_other() -> None:
    text = TEXT.partition("[node.execution]")[0]
    missing = f"node.execution: missing section [node.execution]; as one line, in [node]: {EXECUTION}"
    assert the_problem(text) == f"f.toml:16:2: {missing}"


def test_a_missing_section_of_a_group_has_the_header_that_the_file_needs() -> None:
    group = '[[group]]\nname = "io"\nnodes = 1\naxes = 0\nread_bytes = 8\nwrite_bytes = 8\n'
    text = re.sub(r"nodes = \d+.*\n", "", TEXT.partition("[payload]")[0]) + group
    assert the_problem(text).endswith(
        f"group.io.execution: missing section [group.execution]; as one line, in its [[group]]: {EXECUTION}"
    )
    assert read(text + EXECUTION).name == "test"
    linear = '[group.execution]\nkind = "linear"\nbase_us = -1\n'
    assert [problem.partition(": ")[2] for problem in problems(text + linear)] == [
        (
            "group.io.execution.per_byte_us: missing key. Execution time per byte of payload [us/byte]; "
            "for example per_byte_us = 0.35"
        ),
        "group.io.execution.base_us = -1: must be 0 or more",
    ]
    assert the_problem(text.replace("[[group]]", "[group]") + EXECUTION).endswith(
        "group: expected an array of tables, each below [[group]]"
    )


@pytest.mark.parametrize("value", ["1", '"x"', "[]", "true"])
def test_what_should_be_a_section_and_is_a_value_is_shown(value: str) -> None:
    without = re.sub(r"(?s)\[bus\].*(?=\[cycle\])", "", TEXT)
    assert the_problem(f"bus = {value}\n{without}") == f"f.toml:1:1: bus = {value}: expected a table"


@pytest.mark.parametrize(("old", "subject"), [("[bus]", "3:3: bus"), ("[node.execution]", "18:8: node.execution")])
def test_an_array_of_tables_is_no_section_and_has_no_value_to_show(old: str, subject: str) -> None:
    assert the_problem(edited((old, f"[{old}]"))) == f"f.toml:{subject}: expected a table"


@pytest.mark.parametrize(
    ("adapter", "words"),
    [
        ('"x"', 'bus.adapter = "x": expected "ftdi", "ftdi-low-latency" or "none"'),
        ("3", 'bus.adapter = 3: expected "ftdi", "ftdi-low-latency" or "none"'),
        ("{timer_us = -1}", "bus.adapter.timer_us = -1: must be 0 or more"),
        (
            "{timer_us = 0, nothing = 1}",
            "bus.adapter.nothing: unknown key; known here: timer_us, packet_bytes, frame_us",
        ),
        ("{}", "bus.adapter.timer_us: missing key. Latency timer; 0 where the adapter sends each answer at once"),
    ],
)
def test_a_key_that_is_a_name_or_a_table_is_refused_as_what_it_is(adapter: str, words: str) -> None:
    shipped = (Path(__file__).parents[2] / "profiles" / "dynamixel-arm-14.toml").read_text(encoding="utf-8")
    text = shipped.replace("adapter = { timer_us = 2000 }", f"adapter = {adapter}")
    (message,) = problems(text)
    assert message.partition(": ")[2].startswith(words)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        pytest.param(edited(('kind = "table"\n', "")), "18:7", id="header"),
        pytest.param(TEXT.partition("[node.exec")[0] + "execution = {base_us = 1}", "18:1", id="inline"),
    ],
)
def test_a_missing_kind_shows_no_value(text: str, place: str) -> None:
    message = 'missing key; expected kind = "linear" or kind = "table"'
    assert the_problem(text) == f"f.toml:{place}: node.execution.kind: {message}"


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("'a b'", '"a b"'),
        ("'a.b'", '"a.b"'),
        ("''", '""'),
        ("12", "12"),
        ("a-b_c", "a-b_c"),
        ('"größe"', '"größe"'),
        ("'\"'", '"\\""'),
    ],
)
def test_an_unknown_key_is_shown_so_that_it_can_be_found(written: str, shown: str) -> None:
    assert the_problem(f"{written} = 1\n{TEXT}").startswith(f"f.toml:1:1: {shown}: unknown key; ")


def test_an_unknown_key_brings_no_control_characters_into_the_message() -> None:
    assert the_problem(f'"\\u001b[31m\\n\\u2028\\u009b" = 1\n{TEXT}').isascii()


def test_unknown_keys_inside_an_unknown_table_are_not_counted_up() -> None:
    assert the_problem(f"{TEXT}\n[xyz]\na = 1\nb = 2\n[xyz.c]\n").startswith(
        "f.toml:23:2: xyz: unknown key; known here"
    )


# --- the value as written ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        pytest.param('"' + "x" * 38 + '"', '"' + "x" * 38 + '"', id="forty characters are shown whole"),
        pytest.param('"' + "x" * 39 + '"', '"' + "x" * 39 + "...", id="more are cut"),
        pytest.param('"""a\nb\tc"""', '"""a b c"""', id="lines become spaces"),
        pytest.param("'\u202e\u2028x'", "'  x'", id="what turns text around is not obeyed"),
        pytest.param('"\\u0041\\n"', '"\\u0041\\n"', id="escapes stay escapes"),
        pytest.param("{ a = 1,  b = [ 2 ] }", "{ a = 1,  b = [ 2 ] }", id="inline tables stay as they are"),
        pytest.param("[ # x\n 1,\n]", "[ # x  1, ]", id="arrays over lines become one line"),
        pytest.param("1_000.5", "1_000.5", id="numbers keep their underscores"),
    ],
)
def test_a_value_is_shown_as_written_on_one_line(written: str, shown: str) -> None:
    assert the_problem(edited(("nodes = 2", f"nodes = {written} # comment"))) == (
        f"f.toml:7:1: bus.nodes = {shown}: expected a whole number"
    )


@pytest.mark.parametrize(
    ("written", "shown", "wrong"),
    [
        ("9" * 400, "9" * 40 + "...", "must be 1,000,000 or less"),
        ("0x" + "f" * 5000, "0x" + "f" * 38 + "...", "must be 1,000,000 or less"),
        ("-" + "9" * 400, "-" + "9" * 39 + "...", "must be 1 or more"),
    ],
)
def test_a_huge_integer_is_out_of_range_and_shown_short(written: str, shown: str, wrong: str) -> None:
    assert the_problem(edited(("nodes = 2", f"nodes = {written}"))) == f"f.toml:7:1: bus.nodes = {shown}: {wrong}"


def test_an_integer_that_python_does_not_convert_is_refused_at_its_place() -> None:
    text = edited(("nodes = 2", f"nodes = {'9' * (sys.get_int_max_str_digits() + 1)}"))
    assert the_problem(text) == "f.toml:7:9: not valid TOML: a number with too many digits"


def test_a_huge_integer_for_a_float_is_out_of_range() -> None:
    assert the_problem(edited(("4000", "9" * 400))) == (
        f"f.toml:9:1: cycle.period_us = {'9' * 40}...: is a number too large for any quantity"
    )


# --- all faults of a file ---------------------------------------------------------------------------------


def test_all_faults_of_a_file_come_at_once_and_in_the_order_of_their_places() -> None:
    text = edited(
        ('name = "test"', 'nme = "test"'),
        ("nodes = 2", 'nodes = "2"'),
        ("4000", "0"),
        ("[payload]", "[paylod]"),
        ("36.3", "-1"),
        ("slice_ratio = 0.5", "slice_ratio = nan"),
        ("axes = 4", "axes = 0"),
    )
    assert [re.sub(r"^f\.toml:(\d+:\d+: [^ :]+).*", r"\1", problem) for problem in problems(text)] == [
        "1:1: name",
        "1:1: payload",
        "2:1: nme",
        "7:1: bus.nodes",
        "9:1: cycle.period_us",
        "10:1: cycle.slice_ratio",
        "13:2: paylod",
        "17:1: node.axes",
        "21:18: node.execution.time_us[1]",
    ]


@pytest.mark.parametrize(("count", "more"), [(50, []), (51, ["f.toml: and 1 more problems"])])
def test_no_more_than_fifty_faults_are_listed(count: int, more: list[str]) -> None:
    unknown = "".join(f"x{number} = 1\n" for number in range(count))
    said = problems(unknown + TEXT)
    assert [problem.partition(": ")[0] for problem in said[:50]] == [f"f.toml:{line}:1" for line in range(1, 51)]
    assert list(said[50:]) == more


def test_a_table_that_is_wrong_in_two_ways_says_both() -> None:
    text = edited(("[4, 16, 32]", "[16, 4, 4, 64]"))
    assert [problem.partition(": ")[0] for problem in problems(text)] == ["f.toml:20:22", "f.toml:20:25", "f.toml:21:1"]


def test_both_payloads_outside_the_table_are_said() -> None:
    text = edited(("read_bytes = 12", "read_bytes = 1"), ("write_bytes = 12", "write_bytes = 1024"))
    assert [problem.partition(": ")[0] for problem in problems(text)] == ["f.toml:14:1", "f.toml:15:1"]


@pytest.mark.parametrize("text", ["", "\n", "# a comment", "\ufeff", " \r\n\t"], ids=repr)
def test_an_empty_file_is_told_all_that_is_missing(text: str) -> None:
    assert [problem.split(": ")[:2] for problem in problems(text)] == [
        ["f.toml:1:1", key] for key in ("schema_version", "name", "bus", "cycle", "payload", "node")
    ]


# --- what is no TOML --------------------------------------------------------------------------------------


def test_a_syntax_error_gives_one_message_with_its_place() -> None:
    for text, place in [
        ("a = ", "1:5"),  # no value
        ("a = 1\nb = \nc = 1", "2:5"),  # no value, further down
        ("a = 1\r\nb = \r\nc = 1", "2:5"),  # no value, Windows
        ("a", "1:2"),  # no equals sign
        ("a = 1\na = 2", "2:6"),  # twice
        ("[a]\n[b]\n[a]\n", "3:3"),  # table twice
        ("a = [1,\n2,\n", "2:3"),  # open array
        ("a = [1,\r\n2,\r\n\r\n", "2:3"),  # open array, Windows
        ('a = """\nx\n', "2:2"),  # open text
        ('a = "x\nb = 1', "1:7"),  # text over a line end
        ('a = "\\q"', "1:8"),  # no such escape
        ("a = 1 b = 2", "1:7"),  # two on a line
        ("a = 1\rb = 2", "1:6"),  # line ends of old Macs
        ("\ufeffa = ", "1:5"),  # after a byte order mark
        ("é = 1", "1:1"),  # a key that wants quotes
        ('"é😀" = x', "1:8"),  # columns count characters
        ("\x00", "1:1"),  # NUL
        ("\ufeff\ufeff", "1:1"),  # a second byte order mark
    ]:
        problem = the_problem(text)
        line, column = map(int, place.split(":"))
        match = re.match(r"f\.toml:(\d+):(\d+): not valid TOML: [a-z]", problem)
        assert match, problem
        assert int(match[1]) == line, problem
        # Where exactly on the line is the standard library's affair.
        assert abs(int(match[2]) - column) <= 2, problem


def test_a_number_with_a_comma_or_a_sign_is_told_what_is_meant() -> None:
    meant = {
        "a = 1,5 # of 2": "; a number has a decimal point, not a comma: 1.5",
        "a = 85 %": "; a share is a number without a sign: 0.85",
        "a = 1 5": "",
    }
    for text, words in meant.items():
        assert the_problem(f"b = 2\n{text}\n").partition("not valid TOML: ")[2].partition(";")[2] == words[1:]


@pytest.mark.parametrize("text", ["a = [", "a = 1\nb = {x = 1", 'a = """', "a = [\n\n\n"])
def test_a_file_that_ends_too_early_is_told_so(text: str) -> None:
    assert the_problem(text).endswith(", and the file ends")


@pytest.mark.parametrize(
    ("content", "place", "byte"),
    [
        (b"\xff", "1:1", "0xff"),
        (b"a = 1\nb = '\xe9'\n", "2:6", "0xe9"),
        (b"a = 1\r\nb = '\xe9'\r\n", "2:6", "0xe9"),
        ("é😀 = ".encode() + b"\x80", "1:6", "0x80"),
        (b"a = 1\n\xc3", "2:1", "0xc3"),
        (b"\xed\xa0\x80", "1:1", "0xed"),
        ("a = 1".encode("utf-16"), "1:1", "0xff"),
        (b"\x89PNG\r\n\x1a\n\x00", "1:1", "0x89"),
    ],
    ids=repr,
)
def test_a_file_that_is_no_utf8_is_told_where(content: bytes, place: str, byte: str) -> None:
    assert the_problem(content) == (
        f"f.toml:{place}: not a text file: byte {byte} is not UTF-8; a profile is TOML in UTF-8"
    )


@pytest.mark.parametrize(
    ("content", "place"),
    [(b"\xef\xbb\xbf\xff", "1:1"), (b"\xef\xbb\xbfa\n\xff", "2:1"), ("\ufeffé = '".encode() + b"\xff", "1:6")],
    ids=repr,
)
def test_a_byte_order_mark_moves_no_place_of_a_wrong_byte(content: bytes, place: str) -> None:
    assert the_problem(content).startswith(f"f.toml:{place}: not a text file: byte 0xff")


def test_a_byte_order_mark_is_stepped_over() -> None:
    assert read(b"\xef\xbb\xbf" + TEXT.encode()) == read(TEXT)


def test_a_file_of_more_values_than_a_profile_has_is_refused_before_they_are_judged() -> None:
    words = "f.toml:1:1: the file has 50,001 equals signs; a profile has 50,000 values at most"
    assert the_problem("[[group]]\nx=1\n" * 50_001) == words


def test_a_file_may_be_as_long_as_the_limit_and_no_longer() -> None:
    comment = "#" * (MAX_FILE_BYTES - len(TEXT))
    assert read(TEXT + comment).name == "test"
    assert the_problem(f"{TEXT}{comment}#") == ("f.toml:1:1: the file is over 2,000,000 bytes, the limit of a profile")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        pytest.param("a = " + "[" * 90_000, "1:105", id="arrays"),
        pytest.param("a = " + "[" * 2000 + "]" * 2000, "1:105", id="closed arrays"),
        pytest.param("a = " + "{a=" * 2000, "1:305", id="inline tables"),
        pytest.param("a = 1\nb = " + "[\n" * 2000, "102:1", id="arrays over lines"),
        pytest.param("a = 1\nb = " + "[{a=" * 2000, None, id="both"),
        pytest.param(f"a = [{'[{}],' * 200}]\nb = {'[' * 2000}", "2:105", id="after brackets that were closed"),
    ],
)
def test_deep_nesting_is_refused_at_its_place(text: str, place: str | None) -> None:
    problem = the_problem(text)
    assert problem.endswith(": nested too deeply; a profile needs no more than two brackets inside each other")
    if place is not None:
        assert problem.startswith(f"f.toml:{place}: ")


def test_nesting_that_the_standard_library_reads_is_an_unknown_key_like_any_other() -> None:
    assert the_problem(f"a = {'[' * 200}{']' * 200}\n{TEXT}").startswith("f.toml:1:1: a: unknown key; ")


def test_a_dotted_key_of_some_parts_is_an_unknown_key_like_any_other() -> None:
    assert the_problem(f"{'.'.join('a' * 20)} = 1\n{TEXT}").startswith("f.toml:1:1: a: unknown key; ")


def test_a_dotted_key_of_many_parts_is_refused_before_it_costs_their_square() -> None:
    for part in ["a", "'a'", '"a"', '""', r'"\""', r'"\\"']:
        for dot in [".", " . "]:
            for parts in [21, min(10_000, 90_000 // len(part + dot))]:
                written = dot.join([part] * parts)
                message = "too many parts in a key (limit 20)"
                assert the_problem(f"{TEXT}[t]\n{written} = 1\n") == f"f.toml:23:1: {message}"
                assert the_problem(f"{TEXT}[{written}]\n") == f"f.toml:22:2: {message}"


def test_what_is_wrong_with_a_file_comes_placed() -> None:
    with pytest.raises(PlacedError) as caught:
        read(edited(("nodes = 2", "nodes = 0")))
    assert caught.value.placed == (
        PlacedProblem(7, 1, "out-of-range", "bus.nodes = 0: must be 1 or more", "bus.nodes", (9, 10)),
    )
    # What is missing marks the table around it, at the top the first character; an unknown key marks itself.
    with pytest.raises(PlacedError) as caught:
        read(edited(('name = "test"', 'nme = "test"'), ("period_us = 4000\n", "")))
    places = [(one.kind, one.key, one.line, one.column, one.marked) for one in caught.value.placed]
    assert places == [
        ("missing-key", "name", 1, 1, (1, 2)),
        ("unknown-key", "nme", 2, 1, (1, 4)),
        ("missing-key", "cycle.period_us", 8, 2, (2, 7)),
    ]
    for content in (b"\xff", b"#" * (MAX_FILE_BYTES + 1), b"a", b"a = " + b"[" * 2000, b"a." * 21 + b"a = 1"):
        with pytest.raises(PlacedError) as caught:
            read(content)
        assert [problem.kind for problem in caught.value.placed] == ["syntax"]


# --- reading files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (".", ".: is a directory; give a file"),
        ("pipe", "pipe: is a named pipe; give a regular file"),
        ("loop", "loop: cannot be read: Too many levels of symbolic links"),
        ("large", "large:1:1: the file is over 2,000,000 bytes, the limit of a profile"),
    ],
)
def test_what_cannot_be_read_says_why(path: str, message: str) -> None:
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    with Path("large").open("wb") as file:
        file.truncate(1 << 40)  # which nobody reads to its end
    with pytest.raises(BusplanError) as caught:
        busplan.load_profile(path)
    assert str(caught.value) == message


# --- changes of a profile ---------------------------------------------------------------------------------


def changed(profile: Any, **changes: object) -> Any:
    """The profile with other values by key, two underscores for the dot."""
    return busplan.load_profile(profile, changes={key.replace("__", "."): to for key, to in changes.items()})


def test_a_change_makes_a_new_profile_and_leaves_the_old() -> None:
    before = read(TEXT)
    after = changed(before, bus__nodes=5, cycle__sync__ping_us=1, node__execution__time_us=(1, 2, 3))
    assert (after.bus.nodes, after.cycle.sync.ping_us, after.node.axes) == (5, 1.0, 4)
    assert after.node.execution.time_us == (1.0, 2.0, 3.0)
    assert before == read(TEXT)


def test_no_change_gives_the_profile_itself_and_an_equal_value_an_equal_profile() -> None:
    before = read(TEXT)
    assert changed(before) is before
    assert changed(before, bus__nodes=2) == before


def test_changes_that_are_refused_are_called_by_their_keys() -> None:
    with pytest.raises(BusplanError) as caught:
        changed(read(TEXT), bus__nodes=0, bus__gap_count="best", payload__read_bytes=12)
    assert sorted(caught.value.problems) == [
        'bus.gap_count best: expected a whole number from 0 to 63, or "optimal"',
        "bus.nodes 0: must be 1 or more",
    ]
    with pytest.raises(
        BusplanError, match=r"\Apayload\.read_bytes 64: is outside the execution table, 4 to 32 bytes: "
    ):
        changed(read(TEXT), payload__read_bytes=64)
    with pytest.raises(BusplanError, match=r"\Abus\.nodes\.x\.y: no such key; nodes is a value, not a section\Z"):
        changed(read(TEXT), bus__nodes__x__y=0)
    with pytest.raises(BusplanError, match=r"\Abus\.bit_rate 5: unknown key; known here: "):
        changed(read(TEXT), bus__bit_rate=5)


def test_a_change_that_breaks_a_rule_of_another_key_names_that_key() -> None:
    optimal = read(edited(("gap_count = 63", 'gap_count = "optimal"')))
    with pytest.raises(BusplanError, match=r"\Awith bus\.cable_length_m 9\.0, bus\.gap_count: the table behind"):
        changed(optimal, bus__cable_length_m=9.0)


# --- anything at all --------------------------------------------------------------------------------------


def check_outcome(content: bytes) -> None:
    """A profile, or messages whose places lie inside the file; anything else fails the test."""
    said: tuple[str, ...] = ()
    try:
        loaded: Profile | None = read(content)
    except BusplanError as error:
        loaded = None
        said = error.problems
    assert isinstance(loaded, Profile) or said
    lines = content.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").split("\n")
    for problem in said:
        match = re.match(r"f\.toml:([1-9]\d*):([1-9]\d*): \S", problem)
        assert match, problem
        line, column = int(match[1]), int(match[2])
        assert line <= len(lines), problem
        assert column <= len(lines[line - 1]) + 1, problem
        assert problem.isprintable(), ascii(problem)


@given(content=st.one_of(st.binary(max_size=60), st.text(max_size=60).map(str.encode)))
@example(content=b"\xef\xbb\xbf\xff")
@example(content=b"\r\r\n")
@example(content=b"a = [\r\r\n")
@example(content=b"# a\r\r\nb = 1")
@example(content=b"a = '\r\r\n'")
@example(content=b"a = '''\r\n\r\n")
@example(content=b"\n\n\n[")
@example(content=b"a=1\n\r\n\r\n x")
def test_any_bytes_load_or_are_refused_with_places_inside_them(content: bytes) -> None:
    check_outcome(content)


def test_an_error_travels_between_processes_as_what_it_is() -> None:
    problem = PlacedProblem(3, 1, "syntax", "no TOML")
    error = pickle.loads(pickle.dumps(PlacedError("x.toml", (problem,), hidden=2)))
    assert (type(error), error.placed, error.hidden) == (PlacedError, (problem,), 2)
    assert error.problems == ("x.toml:3:1: no TOML", "x.toml: and 2 more problems")
