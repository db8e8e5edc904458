"""Places of keys, values and comments in a TOML text, which the standard library's parser does not report."""

import re
import tomllib
from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate
from typing import Final, NamedTuple

KeyPath = tuple[str | int, ...]
"""Keys from the top, and indexes into arrays: ("node", "execution", "time_us", 0)."""


class Place(NamedTuple):
    """Offsets of a key and of its value in the text, ends excluded.

    An element of an array has no key: its key span is its value span. A table without a text of its own (`[a]`, `a.b =
    1`) has its key span as value span.
    """

    key_start: int
    key_end: int
    value_start: int
    value_end: int


_GAP: Final = re.compile(r"[ \t\n,]*(?:#[^\n]*[ \t\n,]*)*")
"""Text between two statements, or between two values of an array or inline table."""
_KEY: Final = re.compile(r"""[ \t]*([A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')[ \t]*([.=\]]?)[ \t]*""")
"""Part of a key, and the sign after it."""
# A multi-line string may end in one or two quotes before the closing three.
_STRING: Final = (
    r'''"""(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'\'\'(?:[^']|'{1,2}(?!'))*'{3,5}|"(?:[^"\\]|\\.)*"|'[^']*\''''
)
# A date may contain a space.
_SCALAR: Final = re.compile(_STRING + r"|[^,\]}#\s](?:[^,\]}#\n]*[^,\]}#\s])?", re.DOTALL)
_STRING_OR_COMMENT: Final = re.compile(_STRING + r"|(#)[^\n]*", re.DOTALL)


@dataclass(slots=True)
class _Container:
    """An array or inline table around the scanner's position."""

    path: KeyPath
    start: int
    is_array: bool
    length: int = 0
    """Elements of an array read so far."""


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.places: dict[KeyPath, Place] = {}
        self.newest: dict[KeyPath, int] = {}
        """Index of the newest table of each array of tables."""

    def document(self) -> dict[KeyPath, Place]:
        text = self.text
        table: KeyPath = ()
        inside: list[_Container] = []
        while (gap := _GAP.match(text, self.at)) and (start := gap.end()) < len(text):
            self.at = start
            container = inside[-1] if inside else None
            if container is None and text[start] == "[":
                table = self.header()
                continue
            if container is not None and text[start] in "]}":
                self.at += 1
                self.value(inside.pop().path, container.start)
                continue
            if container is not None and container.is_array:
                path = (*container.path, container.length)
                container.length += 1
            else:
                path, _ = self.key(table if container is None else container.path)
            start = self.at
            if text[start] in "[{":
                inside.append(_Container(path, start, is_array=text[start] == "["))
                self.at += 1
            elif scalar := _SCALAR.match(text, start):
                self.at = scalar.end()
                self.value(path, start)
        return self.places

    def value(self, path: KeyPath, start: int) -> None:
        """Record a value that ends here."""
        key_start, key_end, *_ = self.places.get(path, (start, self.at))
        self.places[path] = Place(key_start, key_end, start, self.at)

    def key(self, path: KeyPath) -> tuple[KeyPath, Place]:
        """Read a, "b" or a.b.c inside a table, and the sign after it.

        Returns the path, and the place of its last part.
        """
        while match := _KEY.match(self.text, self.at):
            if path in self.newest:
                path = (*path, self.newest[path])
            path = (*path, _key_value(match[1]))
            place = Place(*match.span(1), *match.span(1))
            self.places.setdefault(path, place)
            self.at = match.end()
            if match[2] != ".":
                return path, place
        raise ValueError(f"no key at offset {self.at}")  # Text that tomllib has accepted does not come here.

    def header(self) -> KeyPath:
        """Read [a.b] or [[a.b]]; return the table of the next line."""
        several = self.text.startswith("[[", self.at)
        self.at += 1 + several
        path, place = self.key(())
        self.at += several
        if several:
            self.newest[path] = self.newest.get(path, -1) + 1
            path = (*path, self.newest[path])
        # A table's own header replaces the place of an earlier [a.b] that implied it.
        self.places[path] = place
        return path


def _key_value(written: str) -> str:
    """Key without quotes and escapes, decoded by the standard library."""
    if written[0] in "\"'":
        return next(iter(tomllib.loads(f"{written} = 0")))
    return written


def places(text: str) -> dict[KeyPath, Place]:
    r"""Places of all keys and array elements of a text that `tomllib.loads` has accepted, with LF as line end.

    References
    ----------
    TOML 1.0.0.

    Examples
    --------
    >>> text = "[bus]\nnodes = 2  # two\n"
    >>> place = places(text)["bus", "nodes"]
    >>> text[place.key_start : place.key_end], text[place.value_start : place.value_end]
    ('nodes', '2')
    """
    return _Scanner(text).document()


def comments(text: str) -> list[int]:
    r"""Offsets of all comments of such a text, each at its hash.

    Examples
    --------
    >>> text = 'name = "# no comment"  # two\n'
    >>> [text[at:] for at in comments(text)]
    ['# two\n']
    """
    return [match.start() for match in _STRING_OR_COMMENT.finditer(text) if match[1]]


class Lines:
    """Conversion between offsets in a text and lines and columns, which count characters; both from 1."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._starts = [0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1])]

    def offset(self, line: int, column: int) -> int:
        """Offset of a line and column."""
        return self._starts[line - 1] + column - 1

    def line_and_column(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset; one past the end belongs to the last line with text."""
        if offset >= len(self._text):
            offset = len(self._text.rstrip("\r\n"))
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1
