"""Edits in place: the data is what was asked for, and everything else is as it was, byte by byte."""

import re
import tomllib
from collections.abc import Iterator
from itertools import count
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.profile.document import Document
from busplan.profile.edit import edited, edited_file
from busplan.profile.shipped import load, shipped_names

LINEAR = {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}
TABLE = {"kind": "table", "payload_bytes": [4, 64, 1024], "time_us": [30, 50.5, 400.0]}

times = st.one_of(st.integers(0, 10**6), st.floats(0, 1e6, allow_nan=False))
CHANGES: dict[str, st.SearchStrategy[Any]] = {
    "name": st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=20),
    "description": st.one_of(st.none(), st.text('ab "\'\\\n\t#=[]{}\u00e9', max_size=30)),
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


class Writer:
    """Writes data as TOML in any of its layouts, with a numbered comment wherever one may stand."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.number = count()

    def comment(self) -> str:
        return f"{self.draw(st.sampled_from([' ', '     ', '']))}# c{next(self.number)};" if self.flip() else ""

    def flip(self) -> bool:
        return self.draw(st.booleans())

    def key(self, name: str) -> str:
        return self.draw(st.sampled_from([name, f'"{name}"', f"'{name}'"]))

    def scalar(self, value: object) -> str:
        if isinstance(value, list):
            if self.flip():
                return f"[{', '.join(map(str, value))}]"
            return "[\n" + "".join(f"  {one},{' # of ' + str(one) if self.flip() else ''}\n" for one in value) + "]"
        if isinstance(value, str):
            escaped = value.encode("unicode_escape").decode().replace('"', '\\"')
            return f'"{escaped}"' if self.flip() else f'"""\n{escaped}"""'
        return str(value)

    def inline(self, table: dict[str, Any]) -> str:
        members = []
        for name, value in table.items():
            if isinstance(value, dict):
                if self.flip():
                    members.append(f"{self.key(name)} = {self.inline(value)}")
                else:
                    members += [f"{self.key(name)} . {one}" for one in self.members(value)]
            else:
                members += self.members({name: value})
        return "{" + self.draw(st.sampled_from([", ", ","])).join(members) + "}"

    def members(self, table: dict[str, Any]) -> list[str]:
        flat = {name: str(value) if isinstance(value, list) else self.scalar(value) for name, value in table.items()}
        return [f"{self.key(name)} = {value}" for name, value in flat.items()]

    def table(self, path: tuple[str, ...], table: dict[str, Any], prefix: str = "") -> Iterator[str]:
        """Lines of one table's section, then of the sections below it."""
        below = []
        for name, value in table.items():
            yield from (f"{self.comment().strip()}\n",) * self.flip()
            if not isinstance(value, dict):
                yield f"{prefix}{self.key(name)} = {self.scalar(value)}{self.comment()}\n"
                continue
            form = self.draw(st.sampled_from(["inline", "dotted", "section"]))
            if form == "inline":
                yield f"{prefix}{self.key(name)} = {self.inline(value)}{self.comment()}\n"
            elif form == "dotted" or prefix:
                yield from self.table((*path, name), value, f"{prefix}{self.key(name)}.")
            else:
                below.append((name, value))
        for name, value in self.draw(st.permutations(below)):
            section = (*path, name)
            yield f"\n[{'.'.join(map(self.key, section))}]{self.comment()}\n"
            yield from self.table(section, value)


@st.composite
def layouts(draw: st.DrawFn) -> str:
    data = load(draw(st.sampled_from(shipped_names()))).document.data()
    if draw(st.booleans()):
        data["node"]["execution"] = LINEAR
    text = "".join(Writer(draw).table((), data))
    return draw(st.sampled_from([text, text.rstrip("\n")]))


def expected(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    flat = dict(flattened(data))
    for key, value in changes.items():
        flat[key] = value
    return {key: value for key, value in flat.items() if value is not None}


def flattened(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def is_subsequence(few: list[str], many: list[str]) -> bool:
    rest = iter(many)
    return all(one in rest for one in few)


def untouched(text: str, changes: dict[str, Any]) -> list[str]:
    """Lines that hold no changed key, no inline table that may hold it, and no end of an array or text."""
    names = "|".join({key.split(".")[-1] for key in changes}) or "$^"
    values = re.compile(rf"""^[^#\n]*?({names})["']?[ ]*=[ ]*(\[[^\]]*\]|\"{{3}}.*?\"{{3}})?.*$""", re.MULTILINE | re.DOTALL)
    return [line for line in values.sub("", text).splitlines() if line and "{" not in line]


def check(text: str, changes: dict[str, Any]) -> None:
    try:
        new = edited(Document("x.toml", text), changes)
    except BusplanError as error:
        # Only two things may be refused: what makes no profile, and comments that have nowhere to go.
        assert "with the changes" in str(error) or "comments among its old values" in str(error), str(error)  # noqa: PT017
        return
    assert dict(flattened(tomllib.loads(new))) == expected(tomllib.loads(text), changes)
    types = {key: type(value) for key, value in flattened(tomllib.loads(new))}
    assert types == {key: type(value) for key, value in expected(tomllib.loads(text), changes).items()}
    old_lines, new_lines = text.splitlines(), new.splitlines()
    names = {key.split(".")[-1] for key in changes}
    plain = [line for line in old_lines if "{" not in line and not any(name in line for name in names)]
    if not any("[\n" in text[at:] or '"""' in text[at:] for at in (0,)):
        assert is_subsequence(plain, new_lines)
    removed = {key.split(".")[-1] for key, value in changes.items() if value is None}
    for found in re.finditer(r"# c\d+;", text):
        (line,) = (line for line in old_lines if found.group() in line)
        own = line.partition("#")[0]
        if not any(name in own for name in removed) and not own.strip().startswith(("]", '"""')):
            assert new.count(found.group()) == 1


@given(st.sampled_from(shipped_names()), edits())
def test_shipped_profiles(name: str, changes: dict[str, Any]) -> None:
    check(load(name).document.text, changes)


@given(layouts(), edits())
def test_any_layout(text: str, changes: dict[str, Any]) -> None:
    check(text, changes)
