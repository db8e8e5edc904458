"""Where every key and value of a TOML text stands.

The standard library's parser gives values without places. This scanner gives places without values, and trusts
the parser: it reads only text that `tomllib` has accepted, so it needs to find the ends of things and no errors.
It keeps its own stack, so that depth of nesting costs no recursion.
"""

import re
import tomllib
from dataclasses import dataclass
from typing import Final, NamedTuple

KeyPath = tuple[str | int, ...]
"""Keys from the top, and indexes into arrays: ("node", "execution", "time_us", 0)."""


class Place(NamedTuple):
    """Where a key stands, and where its value does: offsets into the text, ends excluded.

    An element of an array has no key; its key span is its value span. A table has no value text of its own when it
    is spread over the file (`[a]`, `a.b = 1`); its value span is its key span.
    """

    key_start: int
    key_end: int
    value_start: int
    value_end: int


_SPACE: Final = re.compile(r"[ \t]*")
_SPACE_AND_LINES: Final = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_COMMENT: Final = re.compile(r"#[^\n]*")
_KEY_PART: Final = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*'""")
# A multi-line string may end in one or two quotes of its own before the closing three. A date may have a space inside.
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
"""What most lines of a profile are: a bare key with a scalar or a list of numbers, a header, a comment, nothing.

They are read at one go, which is several times faster than the scanner.
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
        """Skip space, line ends and comments, and remember where the comments begin."""
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
        """Take in a line that was read at one go, and give the path that the next one's keys belong to."""
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
        """Read [a.b] or [[a.b]] and give the path its keys belong to."""
        is_array = self.text.startswith("[[", self.at)
        self.at += 1 + is_array
        parts = self.dotted_key()
        self.at += 1 + is_array
        return self.enter(parts, is_array=is_array)

    def enter(self, parts: list[tuple[str, int, int]], *, is_array: bool = False) -> KeyPath:
        """Take in the name of a header, and give the path its keys belong to."""
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
            # A table's own header says more than the [a.b] that first implied it.
            _, start, end = parts[-1]
            self.places[path] = Place(start, end, start, end)
        return path

    def dotted_key(self) -> list[tuple[str, int, int]]:
        """Read a, "b" or a.b.c: each part with its span."""
        parts = []
        while True:
            self.skip(_SPACE)
            match = _KEY_PART.match(self.text, self.at)
            if match is None:  # only for text that tomllib has not accepted
                raise ValueError(f"no key at offset {self.at}")
            parts.append((_key_value(match.group()), match.start(), match.end()))
            self.at = match.end()
            self.skip(_SPACE)
            if not self.text.startswith(".", self.at):
                return parts
            self.at += 1

    def key(self, table: KeyPath) -> KeyPath:
        """Read a key and its equals sign; its value's end is not known yet."""
        path = table
        for part, start, end in self.dotted_key():
            path = (*path, part)
            self.places.setdefault(path, Place(start, end, start, end))
        self.at += 1
        self.skip(_SPACE)
        return path

    def close(self, path: KeyPath, start: int) -> None:
        """Set the value span of a key that has one; an element of an array is its own key."""
        key_start, key_end = self.places.get(path, (start, self.at))[:2]
        self.places[path] = Place(key_start, key_end, start, self.at)

    def key_and_value(self, table: KeyPath) -> None:
        """Read one key = value, with everything inside the value."""
        open_containers: list[_Container] = []
        path = self.key(table)
        while True:
            # One value stands at `at`: open it if it is a container, otherwise step over it.
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
        """Close what ends here; the path of the next value, or None after the last."""
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
    """The key behind its quotes and escapes, as the standard library reads it."""
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
        Key paths in the order they first stand, with their places as offsets into `text`.
    comments
        Offsets of the hashes that begin a comment.

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
