"""Edits in place: the data is what was asked for and all else as it was, or a refusal that says what to do by hand."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan import BusplanError, Profile
from busplan.profile.edit import edited_file

FOLDER = Path(__file__).parents[2] / "profiles"

LINEAR = {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}
TABLE = {"kind": "table", "payload_bytes": [4, 64, 1024], "time_us": [30, 50.5, 400.0]}

times = st.one_of(st.integers(0, 10**6), st.floats(0, 1e6, allow_nan=False))
CHANGES: dict[str, st.SearchStrategy[Any]] = {
    "name": st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=20),
    "description": st.one_of(st.none(), st.text("ab \"'\\\n\t#=[]{}\u00e9", max_size=30)),
    "bus.nodes": st.integers(1, 62),
    "bus.gap_count": st.one_of(st.none(), st.integers(0, 63), st.just("optimal")),
    "bus.max_hops": st.one_of(st.none(), st.integers(1, 20)),
    "cycle.period_us": st.one_of(st.integers(1, 10**6), st.floats(1e-3, 1e6)),
    "cycle.sync.ping_us": st.one_of(st.none(), times),
    "cycle.sync.ping_per_node_us": st.one_of(st.none(), times),
    "servo.dac_bits": st.one_of(st.none(), st.integers(4, 24)),
    "tolerance.max_contour_error_mm": st.one_of(st.none(), st.floats(0.001, 5)),
    "node.execution.grade": st.one_of(st.none(), st.just("measured")),
}


@st.composite
def edits(draw: st.DrawFn) -> dict[str, Any]:
    keys = draw(st.lists(st.sampled_from(sorted(CHANGES)), unique=True, max_size=6))
    changes = {key: draw(CHANGES[key]) for key in keys}
    other = draw(st.sampled_from([None, LINEAR, TABLE]))
    if other is not None:
        changes |= {f"node.execution.{key}": None for key in (*LINEAR, *TABLE)}
        changes |= {f"node.execution.{key}": value for key, value in other.items()}
    return changes


Chunk = tuple[str, str]
"""Dotted key of a statement, or nothing for a header or comment; and its lines."""


@cache
def shipped(name: str) -> str:
    """Text of a shipped profile."""
    return (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def read(text: str) -> Profile:
    with TemporaryDirectory() as folder:
        path = Path(folder, "x.toml")
        path.write_text(text, encoding="utf-8")
        return busplan.load_profile(path)


def chunks_of(text: str) -> list[Chunk]:
    """Each line of a shipped profile: they are laid out in sections, one key a line but for the description."""
    section, chunks = "", []
    for line in text.splitlines(keepends=True):
        header = re.match(r"\[(.*)\]", line)
        section = f"{header[1]}." if header else section
        key = re.match(r"(\w+) = ", line)
        chunks.append((f"{section}{key[1]}" if key else "", line))
    return [
        (key or "description" * (number in range(4, 7)), line) for number, (key, line) in enumerate(chunks, start=1)
    ]


def expected(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    flat = dict(flattened(data)) | changes
    return {key: value for key, value in flat.items() if value is not None}


def flattened(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def makes_a_profile(data: dict[str, Any]) -> bool:
    nested: dict[str, Any] = {}
    for key, value in data.items():
        *tables, last = key.split(".")
        table = nested
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
    try:
        read(tomli_w.dumps(nested))
    except BusplanError:
        return False
    return True


def typed(data: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Data in which 1, 1.0 and true are three things."""
    return {key: (repr(value), value) for key, value in data.items()}


def check(chunks: list[Chunk], changes: dict[str, Any]) -> None:
    text = "".join(chunk for _, chunk in chunks)
    before, wanted = dict(flattened(tomllib.loads(text))), expected(tomllib.loads(text), changes)
    try:
        new = edited_file(text.encode(), changes, name="x.toml").decode()
    except BusplanError:
        assert not makes_a_profile(wanted)
        return
    assert typed(dict(flattened(tomllib.loads(new)))) == typed(wanted)
    check_lines(new, chunks, {key for key in changes if typed(before).get(key) != typed(wanted).get(key)})


def check_lines(new: str, chunks: list[Chunk], changed: set[str]) -> None:
    """Check that what was not changed is there in its order, and that nothing new stands between but what was asked."""
    at, between = 0, ""
    for key, chunk in chunks:
        kept = [chunk]
        if any(change == key or change.startswith(f"{key}.") for change in changed):
            kept = [re.sub("^# (?=assumed|derived)", "# was ", one) for one in re.findall(r"# .*\S", chunk)]
        for one in kept:
            assert one in new[at:], f"{one!r} is not where it was"
            between += new[at : new.index(one, at)]
            at = new.index(one, at) + len(one)
    parts = {part for key in changed for part in key.split(".")}
    for line in f"{between}{new[at:]}".splitlines():
        name = re.match(r"""[ \t]*(?:["']?(\w+)["']?[ \t]*[.=]|\[([\w.]+)\]$|$)""", line)
        assert name, f"{line!r} is new"
        assert set((name[1] or name[2] or next(iter(parts))).split(".")) <= parts, f"{line!r} is new"


@given(
    st.sampled_from(["dvrk", "paper-1ms", "paper-4ms", "paper-dma", "paper-optimal-gap", "paper-two-node"]),
    edits(),
)
def test_shipped_profiles(name: str, changes: dict[str, Any]) -> None:
    check(chunks_of(shipped(name)), changes)


PLAIN = """\
schema_version = 1
name = "x"
cycle = { period_us = 4000, "sync" = { ping_us = 0.3 } } # the cycle
payload.read_bytes = 12
payload.write_bytes = 12 # both

# the bus
[bus]   # FireWire
kind = "ieee1394"
speed = "S400"
# busplan: ignore[BP110] because
  nodes = 2    # N
# [limits]
[node]
axes = 4
  [node.execution]
  kind = "table"
  payload_bytes = [
    4,    # the smallest
    0x10,
  ]
  time_us = [ 30.00, 31 ]     # by hand"""


def edited(text: str, changes: dict[str, Any], *, notes: dict[str, str] | None = None) -> str:
    return edited_file(text.encode(), changes, name="x.toml", notes=notes).decode()


def test_only_this_changes() -> None:
    cases: list[tuple[dict[str, Any], str, str]] = [
        ({"bus.nodes": 2}, "", ""),
        ({"bus.max_hops": None}, "", ""),
        ({"bus.nodes": 16}, "nodes = 2    # N", "nodes = 16   # N"),
        ({"bus.nodes": 62, "bus.max_hops": 3}, "nodes = 2    # N\n", "nodes = 62   # N\n  max_hops = 3\n"),
        ({"cycle.period_us": 1e-5 * 1e3}, "period_us = 4000", "period_us = 0.01"),
        ({"payload.write_bytes": 4}, "write_bytes = 12 #", "write_bytes = 4 #"),
        ({"node.execution.payload_bytes": [4, 16]}, "", ""),
        ({"node.execution.time_us": [30.0, 32.5]}, "[ 30.00, 31 ]     #", "[30.0, 32.5]      #"),
        ({"node.execution.grade": "measured"}, "# by hand", '# by hand\n  grade = "measured"\n'),
        ({"limits.max_utilisation": 0.5}, "# by hand", "# by hand\n\n[limits]\nmax_utilisation = 0.5\n"),
        ({"description": 'a "b"\n'}, "# the cycle\n", '# the cycle\ndescription = "a \\"b\\"\\n"\n'),
    ]
    for changes, old, new in cases:
        assert edited(PLAIN, changes) == PLAIN.replace(old, new, 1)
    lines = PLAIN.replace("[ 30.00, 31 ]     #", "[\n30.00,\n31 ]     #")
    shorter = PLAIN.replace("[ 30.00, 31 ]     #", "[30.0, 32.5]     #")
    assert edited(lines, {"node.execution.time_us": [30.0, 32.5]}) == shorter


def test_a_new_kind_takes_the_old_keys_away_and_keeps_their_comments() -> None:
    changes = {f"node.execution.{key}": None for key in TABLE} | {
        f"node.execution.{key}": value for key, value in LINEAR.items()
    }
    assert edited(PLAIN, changes) == PLAIN[: PLAIN.index('  kind = "table')] + (
        '  kind = "linear"\n  # the smallest\n  # by hand\n  base_us = 30.0\n  per_byte_us = 0.35\n'
    )


@pytest.mark.parametrize(
    ("changes", "reason", "lines"),
    [
        (
            {"cycle.slice_ratio": 0.25, "bus.nodes": 3, "name": "y"},
            "there is no line [cycle]",
            ['name = "y"', "[bus]", "nodes = 3", "[cycle]", "slice_ratio = 0.25"],
        ),
        ({"payload.overhead_bytes": 0}, "there is no line [payload]", ["[payload]", "overhead_bytes = 0"]),
        ({"cycle.sync.ping_us": None}, "ping_us does not begin a line", ["[cycle.sync]", "# remove ping_us"]),
        (
            {"node.execution.payload_bytes": [4, 8, 16], "node.execution.time_us": [30.0, 30.5, 31.0]},
            "there are comments among the values of payload_bytes",
            ["[node.execution]", "payload_bytes = [4, 8, 16]", "time_us = [30.0, 30.5, 31.0]"],
        ),
    ],
)
def test_a_layout_that_cannot_take_it_is_left_with_the_lines_to_change(
    changes: dict[str, Any], reason: str, lines: list[str]
) -> None:
    with pytest.raises(BusplanError) as raised:
        edited(PLAIN, changes)
    assert raised.value.problems == (
        f"x.toml: {reason}, so that it stays as it is; change these lines by hand:",
        *lines,
    )


def test_a_section_inside_an_inline_table_is_refused() -> None:
    text = PLAIN.replace(', "sync" = { ping_us = 0.3 }', "")
    with pytest.raises(BusplanError, match=r"unusual way.*\n\[cycle\.sync\]\nping_us = 1"):
        edited(text, {"cycle.sync.ping_us": 1})


def test_line_ends_of_two_kinds_are_refused() -> None:
    with pytest.raises(BusplanError, match=r"CRLF.*\n# a: b\n\[bus\]\nnodes = 3"):
        edited(PLAIN.replace("# the bus\n", "# the bus\r\n"), {"bus.nodes": 3}, notes={"bus": "a: b"})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bus": 3}, "x.toml: with the changes, bus = 3: expected a table"),
        ({"cycle": None}, "x.toml: with the changes, cycle: missing section [cycle]"),
        ({"bus.nodes.most": 3}, "bus.nodes.most: no such key; nodes is a value, not a section"),
        ({"bus.nodes": 0}, "x.toml: with the changes, bus.nodes = 0: must be 1 or more"),
        ({"bus.nodes": None}, "x.toml: with the changes, bus.nodes: missing key. Distributed nodes"),
        ({"bus.hops": 2}, "x.toml: with the changes, bus.hops: unknown key; did you mean max_hops?"),
        ({"cycle.period_us": float("nan")}, "x.toml: with the changes, cycle.period_us = nan: must be"),
    ],
)
def test_what_makes_no_profile_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BusplanError) as raised:
        edited(PLAIN, changes)
    assert str(raised.value).startswith(message)
    assert len(raised.value.problems) == 1


def test_what_is_no_value_never_reaches_the_text() -> None:
    with pytest.raises(TypeError):
        edited(PLAIN, {"cycle.period_us": object()})


def test_a_note_stands_above_and_takes_the_place_of_the_last_one() -> None:
    notes = {"bus": "plan: own", "node.execution": "plan: T_exec"}
    once = edited(PLAIN, {}, notes=notes)
    assert once == PLAIN.replace("# the bus", "# plan: own\n# the bus").replace(
        "  [node.e", "  # plan: T_exec\n  [node.e"
    )
    again = edited(once, {}, notes={"bus": "plan: again\nand\x1b"})
    assert again == once.replace("plan: own", "plan: again\\nand\\x1b")
    with pytest.raises(BusplanError, match=r"there is no line \[payload\], .*\n# a\n\[payload\]$"):
        edited(PLAIN, {}, notes={"payload": "a"})


def test_a_file_keeps_its_line_ends_and_its_byte_order_mark() -> None:
    content = b"\xef\xbb\xbf" + PLAIN.replace("\n", "\r\n").encode()
    result = edited_file(content, {"bus.nodes": 7, "limits.min_spare_nodes": 1}, name="x.toml", notes={"bus": "a: b"})
    assert (
        result
        == content.replace(b"nodes = 2 ", b"nodes = 7 ").replace(b"# the bus", b"# a: b\r\n# the bus")
        + b"\r\n\r\n[limits]\r\nmin_spare_nodes = 1\r\n"
    )


@pytest.mark.parametrize("name", ["\udc80", "\x9b2J", "\u202e"])
def test_a_text_that_is_no_text_is_refused(name: str) -> None:
    with pytest.raises(BusplanError):
        edited(PLAIN, {"name": name})


GRADED = """
[node]                     # assumed: no drive is chosen
axes = 1                   # given

# Measured on the bench, 2019;
# busplan ours: of old
# busplan: ignore[BP401] measured again in May
[node.execution]           # assumed, as all of it
grade = "derived"
kind = "linear"            # or "table": assumed
base_us = 20               #measured: by Li
per_byte_us = 0.1          # published
worst_extra_us = 3.1       # assumed: assumed
uncertainty_us = 1
"""


def test_a_comment_that_grades_the_old_value_says_so_and_every_other_stays() -> None:
    text = PLAIN[: PLAIN.index("[node")].rstrip(" ") + GRADED
    alone = edited(text, {"node.execution.base_us": 30, "node.execution.per_byte_us": 0.1})
    assert alone == text.replace("20               #measured", "30               # was measured")
    note = {"node.execution": "busplan ours: new"}
    changes = {"node.execution.base_us": 30, "node.execution.per_byte_us": 0.1, "node.execution.worst_extra_us": None}
    noted = edited(text, changes, notes=note)
    expected = text.replace("20               #measured", "30               # was measured").replace("of old", "new")
    expected = expected.replace("# assumed, as", "# was assumed, as").replace("# published", "# was published")
    assert noted == expected.replace("worst_extra_us = 3.1       # assumed", "# was assumed")
    assert edited(noted, changes, notes=note) == noted


def test_keys_of_groups_are_edited_where_they_stand() -> None:
    text = shipped("gantry-24")
    changes = {
        "group.drives.nodes": 5,
        "group.tool.execution.time_us": [20, 25, 30, 40, 60],
        "group.io.execution.uncertainty_us": 0.5,
        "group.tool.read_bytes": None,
    }
    notes = {"group.tool.execution": "busplan calibrate: here"}
    new = edited_file(text.encode(), changes, name="x", notes=notes).decode()
    before, after = text.splitlines(), new.splitlines()
    assert [line for line in before if line not in after and "# assumed" not in line] == ["nodes = 4"]
    assert new.count("# busplan calibrate: here\n[group.execution]") == 1
    assert new.index("calibrate: here") > new.index('name = "tool"')
    profile = read(new)
    assert [(one.nodes, one.execution.uncertainty_us) for one in profile.group] == [(5, None), (1, None), (1, 0.5)]
    tool: Any = profile.group[1]
    assert (tool.read_bytes, tool.execution.time_us) == (None, (20, 25, 30, 40, 60))


def test_an_inline_group_is_left_with_its_lines() -> None:
    text = shipped("gantry-24")
    head, rest = text.split("[[group]]", 1)
    tail = rest[rest.index("[limits]") :]
    inline = (
        '[[group]]\nname = "a"\nnodes = 1\naxes = 1\nread_bytes = 4\nwrite_bytes = 4\n'
        'execution = {kind = "linear", base_us = 1, per_byte_us = 0}\n'
    )
    with pytest.raises(BusplanError) as caught:
        edited_file(f"{head}{inline}{tail}".encode(), {"group.a.execution.grade": "measured"}, name="x")
    assert caught.value.problems[0].startswith("x: there is no line [group.execution], so that it stays as it is")
    assert caught.value.problems[1:] == ("[group.execution]  # of a", 'grade = "measured"')
    table = inline.removeprefix("[[group]]\n").strip().replace("\n", ", ")
    first, others = head.split("[bus]", 1)
    text = f"{first}group = [{{{table}}}]\n[bus]{others}{tail}"
    with pytest.raises(BusplanError) as caught:
        edited_file(text.encode(), {"group.a.read_bytes_per_axis": 2}, name="x")
    assert caught.value.problems[1:] == ("[[group]]  # a", "read_bytes_per_axis = 2")


def test_a_group_without_the_section_is_left_with_its_lines() -> None:
    group = '[[group]]\nname = "io"\nnodes = 2\naxes = 0\nread_bytes = 4\nwrite_bytes = 4\n'
    text = f'schema_version = 1\nname = "x"\n[bus]\nkind = "ethercat"\n[cycle]\nperiod_us = 1000\n{group}'
    changes = {"kind": "linear", "base_us": 1, "per_byte_us": 0, "grade": "measured"}
    with pytest.raises(BusplanError) as caught:
        edited(text, {f"group.io.execution.{key}": value for key, value in changes.items()})
    assert caught.value.problems[0].startswith("x.toml: there is no section of a group to write to, ")
    assert caught.value.problems[1] == "[group.execution]  # of io"


@pytest.mark.parametrize(
    ("of_table", "beside"), [("  # measured: by Li", "  # not measured"), ("  # assumed: a guess", ""), ("", "")]
)
def test_a_choice_is_not_measured_because_its_table_is(of_table: str, beside: str) -> None:
    table = f'[node.execution]{of_table}\nkind = "linear"\nbase_us = 20\nper_byte_us = 0.1\n'
    text = PLAIN[: PLAIN.index("  [node.execution]")] + table
    new = edited_file(text.encode(), {"node.execution.base_us": 30}, name="x.toml", are_choices=True).decode()
    assert new == text.replace("base_us = 20", f"base_us = 30{beside}")
