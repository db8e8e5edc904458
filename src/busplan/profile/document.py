"""A TOML text: its data, and the line and column of its parts."""

import re
import tomllib
from bisect import bisect_right
from codecs import BOM_UTF8
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias, cast, get_args

from busplan.errors import PlacedError, PlacedProblem
from busplan.sourced import Grade

if TYPE_CHECKING:
    from busplan.profile.positions import KeyPath, Place

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


class Lines:
    """Convert between offsets in a text and lines and columns, both counted from 1, columns in characters."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._starts = [0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1])]

    def offset(self, line: int, column: int) -> int:
        """Offset of a line and column."""
        return self._starts[line - 1] + column - 1

    def line_and_column(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset; one past the end belongs to the last line that has text."""
        if offset >= len(self._text):
            offset = len(self._text.rstrip("\r\n"))
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1


def text_of(content: bytes, *, name: str, wanted: str) -> str:
    """Decode a file, without its byte order mark.

    Raises
    ------
    PlacedError
        Not UTF-8, with the place and the expected content.
    """
    # Remove the mark first: utf-8-sig would report offsets without it.
    content = content.removeprefix(BOM_UTF8)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        before = content[: error.start].decode()
        line, column = Lines(before + "?").line_and_column(len(before))
        message = f"not a text file: byte 0x{content[error.start]:02x} is not UTF-8; {wanted}"
        raise PlacedError(name, (PlacedProblem(line, column, "syntax", message),)) from None


class Spot(NamedTuple):
    """The line and column of a key, and the columns on that line of what is to be marked, all counted from 1."""

    line: int
    column: int
    marked_column: int
    marked_end_column: int
    """The column after the last."""


@dataclass(frozen=True)
class Document:
    """A TOML text, whose lines end in LF, with its name in messages."""

    name: str
    text: str

    @cached_property
    def lines(self) -> Lines:
        """Lines of the text."""
        return Lines(self.text)

    @cached_property
    def places(self) -> "dict[KeyPath, Place]":
        """Place of every key; only for text that tomllib accepts."""
        from busplan.profile.positions import places  # loaded only if places are needed

        return places(self.text)

    @cached_property
    def comments(self) -> list[int]:
        """Offset of the hash of every comment; only for text that tomllib accepts."""
        from busplan.profile.positions import comments  # as above

        return comments(self.text)

    @cached_property
    def comments_beside(self) -> "dict[KeyPath, int]":
        """Offset of the comment on the line of each key that has one there; that of a table is beside its header."""
        line_of = self.lines.line_and_column
        of_line = {line_of(offset)[0]: offset for offset in self.comments}
        lines = {path: line_of(place.key_start)[0] for path, place in self.places.items()}
        return {path: of_line[line] for path, line in lines.items() if line in of_line}

    @cached_property
    def grades(self) -> dict[str, Grade]:
        """Grades that comments give values, by dotted key: that of a table is for all its keys."""
        from busplan.profile.keys import named_path  # loads pydantic

        grades: dict[str, Grade] = {}
        known: dict[int, Any] = {}
        for path in self.places:
            offset = self.comments_beside.get(path, self.comments_beside.get(path[:-1]))
            match = None if offset is None else GRADING.match(self.text, offset)
            if match is not None:
                grades[".".join(map(str, named_path(self.data(), path, known)))] = cast("Grade", match[1])
        return grades

    def nearest(self, path: "KeyPath") -> "KeyPath":
        """Path of a key; if it is missing, of the nearest table around it, () at the top."""
        while path and path not in self.places:
            path = path[:-1]
        return path

    def spot(self, path: "KeyPath", *, marks_key: bool = False) -> Spot:
        """Place of a key with its value marked; if the key is missing, of the nearest table around it.

        Parameters
        ----------
        path
            Path of the key.
        marks_key
            If True, mark the key instead of its value.
        """
        marked_path = self.nearest(path)
        if not marked_path:
            return Spot(1, 1, 1, 2)
        place = self.places[marked_path]
        marks_key = marks_key or marked_path != path
        start, end = (place.key_start, place.key_end) if marks_key else (place.value_start, place.value_end)
        line, column = self.lines.line_and_column(place.key_start)
        # A value starts on the line of its key; one of several lines is marked on the first.
        marked = column + start - place.key_start
        return Spot(line, column, marked, marked + len(self.text[start:end].partition("\n")[0]))

    def syntax_error(self, offset: int, message: str) -> PlacedError:
        """Make the error for invalid TOML at an offset."""
        line, column = self.lines.line_and_column(offset)
        return PlacedError(self.name, (PlacedProblem(line, column, "syntax", message),))

    def data(self) -> TomlTable:
        """The parsed text, read once: copy it before a change.

        Raises
        ------
        PlacedError
            The text is not valid TOML, with the place of the error.
        """
        return self._data

    @cached_property
    def _data(self) -> TomlTable:
        long_key = self._long_key()
        if long_key:
            raise self.syntax_error(long_key.start(1), f"a key of more than {_MAX_KEY_PARTS} parts is no profile's")
        # Lines end in LF here: what is left of CR CR LF is no line end, and tomllib would take it for one.
        if "\r\n" in self.text:
            raise self.syntax_error(self.text.index("\r\n"), "not valid TOML: illegal character '\\r'")
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            message = "nested too deeply; a profile needs no more than two brackets inside each other"
            raise self.syntax_error(_first_deep_bracket(self.text), message) from None
        except ValueError as error:
            raise self._refusal(error) from None

    def _long_key(self) -> re.Match[str] | None:
        # A key is on one line, so count dots first: that is much faster than the search.
        if all(line.count(".") < _MAX_KEY_PARTS for line in self.text.split("\n")):
            return None
        return re.search(_LONG_KEY, self.text)

    def _refusal(self, error: ValueError) -> PlacedError:
        match = re.match(_TOMLLIB_MESSAGE, str(error))
        if match is None:  # the only error without a place: Python's limit of digits
            long_integer = re.search(_LONG_INTEGER, self.text)
            offset = long_integer.start() if long_integer else 0
            return self.syntax_error(offset, "not valid TOML: a number with too many digits")
        what = f"not valid TOML: {match['what'][:1].lower()}{match['what'][1:]}"
        if not match["line"]:
            return self.syntax_error(len(self.text), f"{what}, and the file ends")
        return self.syntax_error(self.lines.offset(int(match["line"]), int(match["column"])), what)


def _first_deep_bracket(text: str) -> int:
    """Offset of the first bracket that is nested too deeply."""
    depth = 0
    for match in re.finditer(r"[\[\]{}\n]", text):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1, "\n": 0}[match.group()]
        if depth > _MAX_NESTING:
            return match.start()
    return 0
