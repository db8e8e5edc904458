"""Edits in place: the data is what was asked for, and everything else is as it was, byte by byte."""

import re
import tomllib
from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from busplan.errors import BusplanError
from busplan.profile.document import Document
from busplan.profile.edit import edited, edited_file
from busplan.profile.shipped import load, shipped_names
from busplan.sections.profile import Profile

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


class Writer:
    """Writes data as TOML in any of its layouts, with comments wherever they may stand."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.number = count()

    def flip(self) -> bool:
        return self.draw(st.booleans())

    def comment(self) -> str:
        return f"# c{next(self.number)};" if self.flip() else ""

    def key(self, name: str) -> str:
        return self.draw(st.sampled_from([name, name, f'"{name}"', f"'{name}'"]))

    def value(self, value: object) -> str:
        if isinstance(value, list):
            if self.flip():
                return str(value)
            return "[\n" + "".join(f"  {one},{' # of ' + str(one) if self.flip() else ''}\n" for one in value) + "]"
        return self.short(value)

    def short(self, value: object) -> str:
        if not isinstance(value, str):
            return str(value)
        escaped = value.encode("unicode_escape").decode().replace('"', '\\"')
        return f'"{escaped}"' if self.flip() else f'"""\n{escaped}"""'

    def inline(self, table: dict[str, Any]) -> str:
        return "{" + self.draw(st.sampled_from([", ", ","])).join(self.members(table)) + "}"

    def members(self, table: dict[str, Any]) -> Iterator[str]:
        for name, value in table.items():
            if not isinstance(value, dict):
                yield f"{self.key(name)} = {self.short(value)}"
            elif self.flip():
                yield f"{self.key(name)} = {self.inline(value)}"
            else:
                yield from (f"{self.key(name)} . {member}" for member in self.members(value))

    def table(self, path: tuple[str, ...], table: dict[str, Any], prefix: str = "") -> Iterator[Chunk]:
        """One table's section, then the sections below it."""
        below = []
        for name, value in table.items():
            key = ".".join((*path, name))
            if self.flip():
                yield "", f"{self.comment()}\n"
            form = self.draw(st.sampled_from(["inline", "dotted", "section"])) if isinstance(value, dict) else ""
            if form == "dotted" or (form == "section" and prefix):
                yield from self.table((*path, name), value, f"{prefix}{self.key(name)}.")
            elif form == "section":
                below.append((name, value))
            else:
                written = self.inline(value) if form else self.value(value)
                space = self.draw(st.sampled_from(["", " ", "     "]))
                yield key, f"{prefix}{self.key(name)} = {written}{space}{self.comment()}\n"
        for name, value in self.draw(st.permutations(below)):
            section = (*path, name)
            yield "", f"[{'.'.join(map(self.key, section))}] {self.comment()}\n"
            yield from self.table(section, value)


@st.composite
def layouts(draw: st.DrawFn) -> list[Chunk]:
    data = load("paper-two-node").document.data()
    if draw(st.booleans()):
        data["node"]["execution"] = LINEAR
    return list(Writer(draw).table((), data))


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


def makes_a_profile(text: str, changes: dict[str, Any]) -> bool:
    data: dict[str, Any] = {}
    for key, value in expected(tomllib.loads(text), changes).items():
        *tables, last = key.split(".")
        table = data
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
    try:
        Profile.model_validate(data)
    except ValidationError:
        return False
    return True


def check(chunks: list[Chunk], changes: dict[str, Any], line_end: str = "\n") -> None:
    text = "".join(chunk for _, chunk in chunks).replace("\n", line_end)
    try:
        new = edited(Document("x.toml", text), changes)
    except BusplanError as error:
        # Only two things may be refused: what makes no profile, and comments that have nowhere to go.
        assert "comments among its old values" in str(error) or not makes_a_profile(text, changes)  # noqa: PT017
        return
    wanted = expected(tomllib.loads(text), changes)
    got = dict(flattened(tomllib.loads(new)))
    assert got == wanted
    assert {key: type(value) for key, value in got.items()} == {key: type(value) for key, value in wanted.items()}
    at = 0
    for key, chunk in chunks:
        if not any(change == key or change.startswith(f"{key}.") for change in changes):
            kept = chunk.replace("\n", line_end)
        elif changes.get(key, "") is None:
            # Gone, and its comments are there, each on a line of its own.
            for comment in re.findall(r"# (?:c[0-9]+;|of [0-9.]+)", chunk):
                alone = re.search(rf"^[ \t]*{re.escape(comment)}\r?$", new[at:], re.MULTILINE)
                assert alone, f"{comment!r} has no line"
                at += alone.end()
            continue
        else:
            comment = re.search(r"# c[0-9]+;", chunk)
            kept = comment.group() if comment else ""
        assert kept in new[at:], f"{kept!r} is not where it was"
        at = new.index(kept, at) + len(kept)
    assert new.count("\n") == new.count(line_end)


@given(st.sampled_from(shipped_names()), edits())
def test_shipped_profiles(name: str, changes: dict[str, Any]) -> None:
    check(chunks_of(load(name).document.text), changes)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(layouts(), edits(), st.sampled_from(["\n", "\r\n"]))
def test_any_layout(chunks: list[Chunk], changes: dict[str, Any], line_end: str) -> None:
    check(chunks, changes, line_end)


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


@pytest.mark.parametrize(
    ("changes", "old", "new"),
    [
        ({"bus.nodes": 2}, "", ""),
        ({"bus.nodes": 16}, "nodes = 2    # N", "nodes = 16   # N"),
        ({"bus.nodes": 10000}, "nodes = 2    # N", "nodes = 10000 # N"),
        ({"bus.max_hops": 3}, "# N\n", "# N\n  max_hops = 3\n"),
        ({"cycle.period_us": 1e-5 * 1e3}, "period_us = 4000", "period_us = 0.01"),
        ({"cycle.slice_ratio": 0.25}, "ping_us = 0.3 } }", "ping_us = 0.3 }, slice_ratio = 0.25 }"),
        ({"cycle.sync.ping_per_node_us": 1}, "ping_us = 0.3 }", "ping_us = 0.3, ping_per_node_us = 1 }"),
        ({"cycle.sync.ping_us": None}, "{ ping_us = 0.3 }", "{ }"),
        ({"payload.overhead_bytes": 0}, "# both\n", "# both\npayload.overhead_bytes = 0\n"),
        ({"payload.write_bytes": 4}, "write_bytes = 12 #", "write_bytes = 4 #"),
        ({"node.execution.payload_bytes": [4, 17]}, "0x10", "17"),
        ({"node.execution.payload_bytes": [5, 16]}, "4,    # the", "5,    # the"),
        ({"node.execution.time_us": [30.0, 32.5]}, "30.00, 31 ]     #", "30.00, 32.5 ]   #"),
        ({"node.execution.grade": "measured"}, "# by hand", '# by hand\n  grade = "measured"\n'),
        ({"limits.max_utilisation": 0.5}, "# by hand", "# by hand\n\n[limits]\nmax_utilisation = 0.5\n"),
        ({"description": 'a "b"\n'}, "# both\n", '# both\ndescription = "a \\"b\\"\\n"\n'),
    ],
)
def test_only_this_changes(changes: dict[str, Any], old: str, new: str) -> None:
    result = edited(Document("x.toml", PLAIN), changes)
    assert result == PLAIN.replace(old, new, 1)


def test_a_table_that_is_not_there_yet_gets_a_section_at_the_end_where_its_parent_has_one() -> None:
    text = PLAIN.replace('cycle = { period_us = 4000, "sync" = { ping_us = 0.3 } } # the cycle\n', "")
    text = text.replace("[node]", "[cycle]\nperiod_us = 4000\n[node]")
    result = edited(Document("x.toml", text), {"cycle.sync.ping_us": 1, "cycle.sync.ping_per_node_us": 2})
    assert result == f"{text}\n\n[cycle.sync]\nping_us = 1\nping_per_node_us = 2\n"


def test_a_new_kind_takes_the_old_keys_away_and_keeps_their_comments() -> None:
    changes = {
        "node.execution.kind": "linear",
        "node.execution.base_us": 30.0,
        "node.execution.per_byte_us": 0.35,
        "node.execution.payload_bytes": None,
        "node.execution.time_us": None,
    }
    result = edited(Document("x.toml", PLAIN), changes)
    assert result == PLAIN[: PLAIN.index('  kind = "table')] + (
        '  kind = "linear"\n  # the smallest\n  # by hand\n  base_us = 30.0\n  per_byte_us = 0.35\n'
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bus": 3}, "x.toml: bus cannot be changed in place: it is a table; name its keys"),
        ({"cycle.sync": None}, "x.toml: cycle.sync cannot be changed in place: it is a table; name its keys"),
        ({"bus.nodes.most": 3}, "x.toml: bus.nodes.most cannot be changed in place: bus.nodes is no table"),
        (
            {"node.execution.payload_bytes": [4], "node.execution.time_us": [3]},
            "x.toml: node.execution.payload_bytes cannot be changed in place: there are comments among its old values",
        ),
        ({"bus.nodes": 0}, "x.toml: with the changes, bus.nodes = 0: must be 1 or more"),
        ({"bus.nodes": None}, "x.toml: with the changes, bus.nodes: missing key. Distributed nodes"),
        ({"bus.hops": 2}, "x.toml: with the changes, bus.hops: unknown key; did you mean max_hops?"),
    ],
)
def test_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BusplanError) as raised:
        edited(Document("x.toml", PLAIN), changes)
    assert str(raised.value).startswith(message)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object()])
def test_what_is_no_value_never_reaches_the_text(value: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        edited(Document("x.toml", PLAIN), {"cycle.period_us": value})


def test_a_note_stands_above_and_takes_the_place_of_the_last_one() -> None:
    notes = {"bus": "plan: by hand", "cycle.sync": "plan: ping", "node.execution": "plan: T_exec"}
    once = edited(Document("x.toml", PLAIN), {}, notes=notes)
    assert once == PLAIN.replace("# the bus", "# plan: by hand\n# the bus").replace(
        "cycle =", "# plan: ping\ncycle ="
    ).replace("  [node.e", "  # plan: T_exec\n  [node.e")
    again = edited(Document("x.toml", once), {}, notes={"bus": "plan: again\nand\x1b"})
    assert again == once.replace("plan: by hand", "plan: again\\nand\\x1b")
    assert edited(Document("x.toml", PLAIN), {}, notes={"payload": "a"}).count("# a\npayload.read") == 1


def test_a_file_keeps_its_line_ends_and_its_byte_order_mark() -> None:
    content = b"\xef\xbb\xbf" + PLAIN.replace("\n", "\r\n").encode()
    result = edited_file(content, {"bus.nodes": 7, "limits.min_spare_nodes": 1}, name="x.toml", notes={"bus": "a: b"})
    assert (
        result
        == content.replace(b"nodes = 2 ", b"nodes = 7 ").replace(b"# the bus", b"# a: b\r\n# the bus")
        + b"\r\n\r\n[limits]\r\nmin_spare_nodes = 1\r\n"
    )


def test_a_file_never_grows_beyond_what_is_read() -> None:
    sizes = list(range(1, 30_000))
    changes = {"node.execution.payload_bytes": sizes, "node.execution.time_us": sizes}
    content = PLAIN.replace("# the smallest", "").encode()
    with pytest.raises(BusplanError, match="larger than 100,000 bytes"):
        edited_file(content, changes, name="x.toml")


def test_a_text_that_utf_8_cannot_hold_is_refused() -> None:
    with pytest.raises(BusplanError):
        edited_file(PLAIN.encode(), {"name": "\udc80"}, name="x.toml")
