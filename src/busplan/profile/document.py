"""Text of a profile and the validated profile in it, with changes and with the grades in its comments."""

import re
import sys
import tomllib
from codecs import BOM_UTF8
from collections.abc import KeysView
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias, cast, get_args

from pydantic import ValidationError

from busplan.errors import BusplanError, PlacedError, PlacedProblem
from busplan.files import is_unwritten_pipe
from busplan.profile.constants import constants_of, is_constant
from busplan.profile.kinds import holder, kind_of, named_path, profile_model
from busplan.profile.machine_files import matching
from busplan.profile.places import KeyPath, Lines, Place, comments, places
from busplan.sections.base import Section
from busplan.sections.profile import Profile
from busplan.sourced import Grade, constants_changed

GRADING: Final = re.compile(rf"#\s*({'|'.join(get_args(Grade))})\b")
"""A comment that grades the key beside it: `master_us = 30  # measured: on the line's own host`."""
TomlTable: TypeAlias = dict[str, Any]
"""A TOML table as Python data."""
_TOMLLIB_MESSAGE: Final = r"(?s)(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)\Z"
_LONG_INTEGER: Final = r"[0-9_]{4000,}"
_MAX_NESTING: Final = 100
_MAX_KEY_PARTS: Final = 20
_LONG_KEY: Final = (
    r"""(?m)(?:^|[\[{,])[ \t]*+((?:(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    f"{{{_MAX_KEY_PARTS}}})"
)
"""A dotted key of many parts, for which the standard library's parser takes quadratic time."""


def text_of(content: bytes, *, name: str, wanted: str) -> str:
    """Decode a file, without its byte order mark.

    A file that is not UTF-8 raises PlacedError, with the place and the `wanted` content.
    """
    # Remove the mark first, because utf-8-sig would report offsets without it.
    content = content.removeprefix(BOM_UTF8)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        before = content[: error.start].decode()
        line, column = Lines(before + "?").line_and_column(len(before))
        message = f"not a text file: byte 0x{content[error.start]:02x} is not UTF-8; {wanted}"
        raise PlacedError(name, (PlacedProblem(line, column, "syntax", message),)) from None


class Spot(NamedTuple):
    """Line and column of a key, and the columns to mark on that line, from 1."""

    line: int
    column: int
    marked_column: int
    marked_end_column: int
    """Column after the last marked one."""


@dataclass(frozen=True)
class Document:
    """A TOML text with lines that end in LF, and its name in messages."""

    name: str
    text: str

    @cached_property
    def lines(self) -> Lines:
        """Lines of the text."""
        return Lines(self.text)

    @cached_property
    def places(self) -> dict[KeyPath, Place]:
        """Places of all keys; only for text that tomllib accepts."""
        return places(self.text)

    @cached_property
    def comments(self) -> list[int]:
        """Offsets of all comments, each at its hash; only for text that tomllib accepts."""
        return comments(self.text)

    @cached_property
    def comments_beside(self) -> dict[KeyPath, int]:
        """Offset of the comment on the line of each key, where there is one. A table's comment is beside its header."""
        line_of = self.lines.line_and_column
        of_line = {line_of(offset)[0]: offset for offset in self.comments}
        lines = {path: line_of(place.key_start)[0] for path, place in self.places.items()}
        return {path: of_line[line] for path, line in lines.items() if line in of_line}

    @cached_property
    def grades(self) -> dict[str, Grade]:
        """Grades in comments by dotted key; that of a table is for all its keys."""
        grades: dict[str, Grade] = {}
        names: dict[int, Any] = {}
        for path in self.places:
            offset = self.comments_beside.get(path, self.comments_beside.get(path[:-1]))
            match = None if offset is None else GRADING.match(self.text, offset)
            if match is not None:
                grades[".".join(map(str, named_path(self.data(), path, names)))] = cast("Grade", match[1])
        return grades

    def nearest(self, path: KeyPath) -> KeyPath:
        """Path of a key, or of the nearest table around a missing one; () at the top."""
        while path and path not in self.places:
            path = path[:-1]
        return path

    def spot(self, path: KeyPath, *, marks_key: bool = False) -> Spot:
        """Place of a key, with its value or the key itself marked.

        A missing key gets the place of the nearest table around it.
        """
        marked_path = self.nearest(path)
        if not marked_path:
            return Spot(1, 1, 1, 2)
        place = self.places[marked_path]
        marks_key = marks_key or marked_path != path
        start, end = (place.key_start, place.key_end) if marks_key else (place.value_start, place.value_end)
        line, column = self.lines.line_and_column(place.key_start)
        # A value starts on the line of its key, and only its first line is marked.
        marked = column + start - place.key_start
        return Spot(line, column, marked, marked + len(self.text[start:end].partition("\n")[0]))

    def syntax_error(self, offset: int, message: str) -> PlacedError:
        """Error for invalid TOML at an offset."""
        line, column = self.lines.line_and_column(offset)
        return PlacedError(self.name, (PlacedProblem(line, column, "syntax", message),))

    def data(self) -> TomlTable:
        """The parsed text, read once: copy it before a change.

        Invalid TOML raises PlacedError.
        """
        return self._data

    @cached_property
    def _data(self) -> TomlTable:
        # A key is on one line, so dots are counted first: much faster than the search.
        may_be_long = any(line.count(".") >= _MAX_KEY_PARTS for line in self.text.split("\n"))
        if may_be_long and (long_key := re.search(_LONG_KEY, self.text)):
            raise self.syntax_error(long_key.start(1), f"too many parts in a key (limit {_MAX_KEY_PARTS})")
        # Lines end in LF here. What is left of CR CR LF is no line end, but tomllib would take it for one.
        if "\r\n" in self.text:
            raise self.syntax_error(self.text.index("\r\n"), "not valid TOML: illegal character '\\r'")
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            message = "nested too deeply; a profile needs no more than two brackets inside each other"
            raise self.syntax_error(_first_deep_bracket(self.text), message) from None
        except ValueError as error:
            raise _machine_file(self.text.encode("utf-8", "ignore"), self.name) or self._refusal(error) from None

    def _refusal(self, error: ValueError) -> PlacedError:
        match = re.match(_TOMLLIB_MESSAGE, str(error))
        if match is None:  # Python's limit of digits is the only error without a place.
            long_integer = re.search(_LONG_INTEGER, self.text)
            offset = long_integer.start() if long_integer else 0
            return self.syntax_error(offset, "not valid TOML: a number with too many digits")
        what = f"not valid TOML: {match['what'][:1].lower()}{match['what'][1:]}"
        if not match["line"]:
            return self.syntax_error(len(self.text), f"{what}, and the file ends")
        line = self.text.split("\n")[int(match["line"]) - 1].partition("=")[2]
        meant = number_meant(line.partition("#")[0].strip())
        return self.syntax_error(self.lines.offset(int(match["line"]), int(match["column"])), f"{what}{meant}")


def number_meant(written: str) -> str:
    """Advice for a number with a decimal comma or a percent sign, after a semicolon; empty for other text."""
    match = re.fullmatch(r"(-?[0-9]{1,20})(?:[.,]([0-9]{1,20}))?\s*(%?)", written)
    if match is None or not (match[3] or "," in written):
        return ""
    number = f"{match[1]}.{match[2]}" if match[2] else match[1]
    if match[3]:
        return f"; a share is a number without a sign: {float(number) / 100:g}"
    return f"; a number has a decimal point, not a comma: {number}"


def _first_deep_bracket(text: str) -> int:
    """Offset of the first bracket that is nested too deeply."""
    depth = 0
    for match in re.finditer(r"[\[\]{}\n]", text):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1, "\n": 0}[match.group()]
        if depth > _MAX_NESTING:
            return match.start()
    return 0


MAX_FILE_BYTES: Final = 2_000_000
"""Size of the largest profile: some 10,000 messages of a CAN network, with their comments."""
_MOST_VALUES: Final = 50_000
"""Most equals signs of a profile, twice those of 2,048 messages with every key: each problem costs time and memory."""
_KINDS: Final = ("bus", "bus.kind")
"""Keys whose change may require tables of another kind of bus."""
_SOURCE: Final = "_source"
"""Attribute of a profile for its document and the keys changed since. It is no field, so no part of the profile's
value.
"""


class LoadedProfile(NamedTuple):
    """A profile and its text."""

    profile: Profile
    document: Document


def decode(content: bytes, *, name: str) -> Document:
    """Decode the file of a profile.

    A file that is too large, has too many values or is not UTF-8 raises PlacedError.
    """
    if len(content) > MAX_FILE_BYTES:
        raise _machine_file(content, name) or too_large(name)
    try:
        text = text_of(content, name=name, wanted="a profile is TOML in UTF-8")
    except PlacedError as error:
        raise _machine_file(content, name) or error from None
    if (count := text.count("=")) > _MOST_VALUES:
        message = f"the file has {count:,} equals signs; a profile has {_MOST_VALUES:,} values at most"
        raise PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))
    # With LF alone, offsets of the parser and the scanner agree.
    return Document(name, text.replace("\r\n", "\n"))


def _machine_file(content: bytes, name: str) -> PlacedError | None:
    """Error for a file that is no profile but that `import` converts; None for any other file."""
    formats = matching(content)
    if len(formats) != 1:
        return None
    message = f"is {formats[0].short}, not a profile; convert it with `busplan import {name}`"
    return PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))


def too_large(name: str) -> PlacedError:
    """Error for a file that is too large for a profile."""
    message = f"the file is over {MAX_FILE_BYTES:,} bytes, the limit of a profile"
    return PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))


def read_bytes(path: Path, *, name: str, limit: int = MAX_FILE_BYTES) -> bytes:
    """Read a file, or standard input for the path "-", up to one byte more than the limit [bytes].

    A file that is missing, a directory or unreadable raises BusplanError.
    """
    try:
        if str(path) == "-":
            if sys.stdin is None:
                raise BusplanError(f"{name}: standard input is closed")
            return sys.stdin.buffer.read(limit + 1)
        if is_unwritten_pipe(path):
            raise BusplanError(f"{name}: is a named pipe; give a regular file")
        with path.open("rb") as file:
            return file.read(limit + 1)
    except FileNotFoundError:
        raise BusplanError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise BusplanError(f"{name}: is a directory; give a file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BusplanError(f"{name}: cannot be read: {reason}") from None


def validate(document: Document) -> Profile:
    """Validate a document against the profile's schema.

    Text that is no TOML or no profile raises PlacedError: one message for each problem, in the order of their places.
    """
    data = document.data()
    result = _checked(data)
    if isinstance(result, Profile):
        result.__dict__[_SOURCE] = document, frozenset()
        return result
    from busplan.profile.problems import refusal  # Loaded only for an invalid profile.

    raise refusal(result, data, document)


def profile_of(data: TomlTable) -> Profile:
    """Validate data that stand in no file; their kind of bus must be known.

    Data of no profile raise BusplanError; each problem names its key.
    """
    result = _checked(data)
    if isinstance(result, Profile):
        return result
    from busplan.profile.problems import refused_data  # as above

    raise refused_data(result, data)


def _checked(data: TomlTable) -> Profile | ValidationError | None:
    """Profile of some data, or pydantic's error; None if only the kind of bus is unknown."""
    kind = kind_of(data)
    try:
        valid = profile_model(kind).model_validate(data)
    except ValidationError as error:
        return error
    return None if kind is None else valid


def override(profile: Profile, changes: dict[str, object], *, origin: dict[str, str] | None = None) -> Profile:
    """The profile with new values, validated; keys that it does not set stay unset.

    Changes are by dotted key, {"bus.nodes": 3}, or by `constants.NAME` for a constant of its bus. `origin` says for
    messages what set a key, if that is not key and value: {"bus.nodes": "--nodes 3"}. A value that the schema refuses
    raises BusplanError.
    """
    if not changes:
        return profile
    origin = origin or {}
    constants = constants_of(changes, profile.bus.kind, origin)
    changes = {key: value for key, value in changes.items() if not is_constant(key)}
    # Defaults may be constants.
    kept = {} if constants else _unchanged(profile, changes.keys())
    data = profile.model_dump(exclude_unset=True, exclude=set(kept))
    arrays: dict[int, Any] = {}
    for key, value in changes.items():
        table, last = holder(data, key, name=origin.get(key), arrays=arrays)
        table[last] = deepcopy(value)  # A later change may go into a table among the changes, which is the caller's.
    with constants_changed(tuple(sorted((dict(profile.constants) | constants).items()))):
        result = _checked(data | kept)
    if isinstance(result, Profile):
        if _SOURCE in profile.__dict__:
            document, before = profile.__dict__[_SOURCE]
            result.__dict__[_SOURCE] = document, before | set(changes)
        return result
    from busplan.profile.problems import refused_changes  # as above

    data |= profile.model_dump(exclude_unset=True, include=set(kept))
    raise refused_changes(result, data, changes, origin)


def _unchanged(profile: Profile, changes: KeysView[str]) -> dict[str, object]:
    """Sections and arrays of tables that no change touches, but for [bus] with the kind: they are valid as they are."""
    if not changes.isdisjoint(_KINDS):
        return {}
    changed = {key.partition(".")[0] for key in ("bus", *changes)}
    values = {name: getattr(profile, name) for name in profile.model_fields_set - changed}
    return {name: value for name, value in values.items() if isinstance(value, tuple | Section)}


def has_comment_grades(profile: Profile) -> bool:
    """Whether comments of the profile's file may grade keys; False for one that was not read from a file."""
    document, _ = profile.__dict__.get(_SOURCE, (None, ()))
    return document is not None and GRADING.search(document.text) is not None


def comment_grade(profile: Profile, key: str) -> Grade | None:
    """Grade that a comment of the file, at the key or at its table, gives the value of a dotted key.

    A changed value is not measured because the old one was, but a changed assumption is still one. A profile that was
    not read from a file has no comments.
    """
    document, changed = profile.__dict__.get(_SOURCE, (None, ()))
    if document is None:
        return None
    grades: dict[str, Grade] = document.grades
    grade = grades.get(key)
    is_changed = any(key == changed_key or key.startswith(f"{changed_key}.") for changed_key in changed)
    return None if is_changed and grade != "assumed" else grade
