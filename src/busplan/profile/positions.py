"""Find the place of every key and value of a TOML text.

The standard library's parser gives values without places; this scanner gives places without values. It reads only text
that `tomllib` has accepted, so it needs no error handling. It has its own stack instead of recursion.
"""

import re
import tomllib
from dataclasses import dataclass
from typing import Final, NamedTuple

KeyPath = tuple[str | int, ...]
"""Keys from the top, and indexes into arrays: ("node", "execution", "time_us", 0)."""


class Place(NamedTuple):
    """Place of a key and of its value, as offsets into the text, ends excluded.

    An element of an array has no key: its key span is its value span. A table without a text of its own (`[a]`,
    `a.b = 1`) has its key span as value span.
    """

    key_start: int
    key_end: int
    value_start: int
    value_end: int


_SPACE: Final = re.compile(r"[ \t]*")
_SPACE_AND_LINES: Final = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_COMMENT: Final = re.compile(r"#[^\n]*")
_KEY_PART: Final = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*'""")
# A multi-line string may end in one or two quotes before the closing three. A date may contain a space.
_SCALAR: Final = re.compile(
    r'''"""(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'\'\'(?:[^']|'{1,2}(?!'))*'{3,5}|"(?:[^"\\]|\\.)*"|'[^']*\''''
    r"""|[^,\]}#\s](?:[^,\]}#\r\n]*[^,\]}#\s])?""",
    re.DOTALL,
)
_PLAIN_LINE: Final = re.compile(
    r"""[ \t]*+(?:
        (?P<key>[A-Za-z0-9_-]++) [ \t]*+ = [ \t]*+
        (?P<value> [^\s"'\[{\#]++ | "[^"\\\n]*+"(?!") | '[^'\n]*+'(?!') | (?P<array>\[[^\[\]{}"'\#:\n]*+\]) )
        [ \t]*+
        | \[ (?P<header>[A-Za-z0-9_-]++(?:\.[A-Za-z0-9_-]++)*+) \] [ \t]*+
    )?+(?P<comment>\#[^\n]*+)?+(?:\n|\Z)""",
    re.VERBOSE,
)
"""Most lines of a profile: a bare key with a scalar or a list of numbers, a header, a comment, or an empty line.

One match reads such a line, several times faster than the scanner.
"""
_ELEMENT: Final = re.compile(r"[^\s,\[\]]+")


@dataclass(slots=True)
class _Container:
    """An array or inline table that the scanner is inside of."""

    path: KeyPath
    start: int
    index: int = 0
    is_array: bool = True


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.places: dict[KeyPath, Place] = {}
        self.comments: list[int] = []
        self.last_element: dict[KeyPath, int] = {}
        """Index of the newest table of each array of tables."""

    def skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.at)
        if match:
            self.at = match.end()

    def skip_lines(self) -> None:
        """Skip space, line ends and comments, and record the comments."""
        start = self.at
        self.skip(_SPACE_AND_LINES)
        if self.text.find("#", start, self.at) >= 0:
            self.comments.extend(match.start() for match in _COMMENT.finditer(self.text, start, self.at))

    def document(self) -> dict[KeyPath, Place]:
        table: KeyPath = ()
        while self.at < len(self.text):
            match = _PLAIN_LINE.match(self.text, self.at)
            if match is not None:
                table = self.plain_line(match, table)
                continue
            self.skip_lines()
            if self.at == len(self.text):
                break
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.key_and_value(table)
        return self.places

    def plain_line(self, match: re.Match[str], table: KeyPath) -> KeyPath:
        """Record a line that one match has read; return the table of the next line."""
        key, _, array, header, comment = match.groups()
        self.at = match.end()
        if comment is not None:
            self.comments.append(match.start("comment"))
        if header is not None:
            return self.enter([(one[0], *one.span()) for one in _KEY_PART.finditer(self.text, *match.span("header"))])
        if key is not None:
            path = (*table, key)
            self.places[path] = Place(*match.span("key"), *match.span("value"))
            if array is not None:
                for index, one in enumerate(_ELEMENT.finditer(self.text, *match.span("array"))):
                    self.places[*path, index] = Place(*one.span(), *one.span())
        return table

    def header(self) -> KeyPath:
        """Read [a.b] or [[a.b]]; return the table of the next line."""
        is_array = self.text.startswith("[[", self.at)
        self.at += 1 + is_array
        parts = self.dotted_key()
        self.at += 1 + is_array
        return self.enter(parts, is_array=is_array)

    def enter(self, parts: list[tuple[str, int, int]], *, is_array: bool = False) -> KeyPath:
        """Record the name of a header; return the table of the next line."""
        path: KeyPath = ()
        for number, (part, start, end) in enumerate(parts, start=1):
            path = (*path, part)
            self.places.setdefault(path, Place(start, end, start, end))
            if is_array and number == len(parts):
                index = self.last_element[path] = self.last_element.get(path, -1) + 1
                self.places[*path, index] = Place(start, end, start, end)
            if path in self.last_element:
                path = (*path, self.last_element[path])
        if not is_array:
            # A table's own header replaces the place of an earlier [a.b] that implied it.
            _, start, end = parts[-1]
            self.places[path] = Place(start, end, start, end)
        return path

    def dotted_key(self) -> list[tuple[str, int, int]]:
        """Read a, "b" or a.b.c: each part with its span."""
        parts = []
        while True:
            self.skip(_SPACE)
            match = _KEY_PART.match(self.text, self.at)
            if match is None:  # impossible for text that tomllib has accepted
                raise ValueError(f"no key at offset {self.at}")
            parts.append((_key_value(match.group()), match.start(), match.end()))
            self.at = match.end()
            self.skip(_SPACE)
            if not self.text.startswith(".", self.at):
                return parts
            self.at += 1

    def key(self, table: KeyPath) -> KeyPath:
        """Read a key and its equals sign; the value follows."""
        path = table
        for part, start, end in self.dotted_key():
            path = (*path, part)
            self.places.setdefault(path, Place(start, end, start, end))
        self.at += 1
        self.skip(_SPACE)
        return path

    def close(self, path: KeyPath, start: int) -> None:
        """Set the value span of a key or of an element of an array."""
        key_start, key_end = self.places.get(path, (start, self.at))[:2]
        self.places[path] = Place(key_start, key_end, start, self.at)

    def key_and_value(self, table: KeyPath) -> None:
        """Read one key = value, with everything inside the value."""
        open_containers: list[_Container] = []
        path = self.key(table)
        while True:
            # A value begins at `at`: open a container, or skip a scalar.
            start = self.at
            if self.text[start] in "[{":
                self.at += 1
                open_containers.append(_Container(path, start, is_array=self.text[start] == "["))
            else:
                self.skip(_SCALAR)
                self.close(path, start)
            following = self.next_in(open_containers)
            if following is None:
                return
            path = following

    def next_in(self, open_containers: list[_Container]) -> KeyPath | None:
        """Close containers that end here; return the path of the next value, None after the last one."""
        while open_containers:
            container = open_containers[-1]
            self.skip_lines()
            if self.text[self.at] == ",":
                self.at += 1
                self.skip_lines()
            if self.text[self.at] in "]}":
                self.at += 1
                self.close(container.path, container.start)
                open_containers.pop()
                continue
            if container.is_array:
                container.index += 1
                return (*container.path, container.index - 1)
            return self.key(container.path)
        return None


def _key_value(written: str) -> str:
    """Key without quotes and escapes, decoded by the standard library."""
    if written[0] in "\"'":
        return next(iter(tomllib.loads(f"{written} = 0")))
    return written


def scan(text: str) -> tuple[dict[KeyPath, Place], list[int]]:
    r"""Find the place of every key and array element, and of every comment.

    Parameters
    ----------
    text
        TOML that `tomllib.loads` has accepted.

    Returns
    -------
    places
        Place by key path, in order of first appearance.
    comments
        Offset of the hash of every comment.

    References
    ----------
    TOML 1.0.0.

    Examples
    --------
    >>> text = "[bus]\nnodes = 2  # two\n"
    >>> places, comments = scan(text)
    >>> place = places["bus", "nodes"]
    >>> text[place.key_start : place.key_end], text[place.value_start : place.value_end]
    ('nodes', '2')
    >>> [text[at:] for at in comments]
    ['# two\n']
    """
    scanner = _Scanner(text)
    return scanner.document(), scanner.comments
