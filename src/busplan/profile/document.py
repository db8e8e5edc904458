"""One TOML text: its data, and the line and column of what stands in it."""

import re
import tomllib
from bisect import bisect_right
from codecs import BOM_UTF8
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from busplan.errors import PlacedError, PlacedProblem

if TYPE_CHECKING:
    from busplan.profile.positions import KeyPath, Place

TomlTable: TypeAlias = dict[str, Any]
"""A table of a TOML document as Python reads it."""
_TOMLLIB_MESSAGE: Final = r"(?s)(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)\Z"
_LONG_INTEGER: Final = r"[0-9_]{4000,}"
_MAX_NESTING: Final = 100
_MAX_KEY_PARTS: Final = 20
_LONG_KEY: Final = (
    r"""(?m)(?:^|[\[{,])[ \t]*+((?:(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    f"{{{_MAX_KEY_PARTS}}})"
)
"""A dotted key of very many parts, which costs the standard library's parser the square of their number."""


class Lines:
    """From offsets in a text to line and column, both counted from 1, columns in characters."""

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
    """Turn a file's bytes into text, a byte order mark left out.

    Raises
    ------
    PlacedError
        Not UTF-8: where, and what is wanted.
    """
    # The mark goes first: what the codec that knows it says of places, it says of the bytes behind.
    content = content.removeprefix(BOM_UTF8)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        before = content[: error.start].decode()
        line, column = Lines(before + "?").line_and_column(len(before))
        message = f"not a text file: byte 0x{content[error.start]:02x} is not UTF-8; {wanted}"
        raise PlacedError(name, (PlacedProblem(line, column, "syntax", message),)) from None


@dataclass(frozen=True)
class Document:
    """One TOML text with the name it is called by in messages."""

    name: str
    text: str

    @cached_property
    def lines(self) -> Lines:
        """Line and column of every offset."""
        return Lines(self.text)

    @property
    def places(self) -> "dict[KeyPath, Place]":
        """Place of every key; the text must be one that tomllib accepts."""
        return self._scanned[0]

    @property
    def comments(self) -> list[int]:
        """Offset of every comment, its hash included; the text must be one that tomllib accepts."""
        return self._scanned[1]

    @cached_property
    def _scanned(self) -> "tuple[dict[KeyPath, Place], list[int]]":
        from busplan.profile.positions import scan  # only who asks for places pays for the scanner

        return scan(self.text)

    def nearest(self, path: "KeyPath") -> int:
        """Offset of a key, or of the nearest table around one that is not there; the start of the text at last."""
        while path and path not in self.places:
            path = path[:-1]
        return self.places[path].key_start if path else 0

    def syntax_error(self, offset: int, message: str) -> PlacedError:
        """Make the error for a text that is no TOML, at an offset."""
        line, column = self.lines.line_and_column(offset)
        return PlacedError(self.name, (PlacedProblem(line, column, "syntax", message),))

    def data(self) -> TomlTable:
        """Parse the text.

        Raises
        ------
        PlacedError
            The text is no TOML; with the place where it stops being so.
        """
        long_key = self._long_key()
        if long_key:
            raise self.syntax_error(long_key.start(1), f"a key of more than {_MAX_KEY_PARTS} parts is no profile's")
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            message = "nested too deeply; a profile needs no more than two brackets inside each other"
            raise self.syntax_error(_first_deep_bracket(self.text), message) from None
        except ValueError as error:
            raise self._refusal(error) from None

    def _long_key(self) -> re.Match[str] | None:
        # A key stands on one line, so that its points can be counted first: that is much faster than looking for keys.
        if all(line.count(".") < _MAX_KEY_PARTS for line in self.text.split("\n")):
            return None
        return re.search(_LONG_KEY, self.text)

    def _refusal(self, error: ValueError) -> PlacedError:
        match = re.match(_TOMLLIB_MESSAGE, str(error))
        if match is None:  # the one error that is Python's own and not TOML's
            long_integer = re.search(_LONG_INTEGER, self.text)
            offset = long_integer.start() if long_integer else 0
            return self.syntax_error(offset, "not valid TOML: a number with too many digits")
        what = f"not valid TOML: {match['what'][:1].lower()}{match['what'][1:]}"
        if not match["line"]:
            return self.syntax_error(len(self.text), f"{what}, and the file ends")
        return self.syntax_error(self.lines.offset(int(match["line"]), int(match["column"])), what)


def _first_deep_bracket(text: str) -> int:
    """Offset of the first bracket that is nested deeper than any profile."""
    depth = 0
    for match in re.finditer(r"[\[\]{}\n]", text):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1, "\n": 0}[match.group()]
        if depth > _MAX_NESTING:
            return match.start()
    return 0
