"""XML of machines' files: elements with their lines, without entities, bounded in number and depth."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any, Final
from xml.parsers import expat

from busplan.errors import BusplanError

_MOST_DEPTH: Final = 64
_MOST_ELEMENTS: Final = 1_000_000
_MOST_KEPT: Final = 500_000
"""Most elements that are not left out: they bound the memory."""
_MOST_TAG_BYTES: Final = 1_000_000
_PIECE_BYTES: Final = 100_000
_FAR: Final = 300
"""Columns that a person counts, at most; some tools write all in one line."""


@dataclass(slots=True)
class Element:
    """An element of an XML file."""

    tag: str
    """Tag without its namespace."""
    line: int | str
    """Line of the element, with the column if the line is long."""
    attributes: dict[str, str]
    children: list["Element"] = field(default_factory=list)
    text: str = ""
    """Text after the last child."""

    def all(self, path: str) -> Iterator["Element"]:
        """Elements at a path of tags below this one, as "Config/Slave"."""
        tag, _, rest = path.partition("/")
        for child in self.children:
            if child.tag == tag:
                yield from child.all(rest) if rest else (child,)

    def first(self, path: str) -> "Element | None":
        """First element at a path; None without one."""
        return next(self.all(path), None)


def parsed(content: bytes, *, name: str, skipped: Collection[str] = ()) -> Element:
    """Read an XML file; elements of skipped tags are left out, with all below them.

    BusplanError, with its line: the file is no XML, has a document type (which declares entities), or has too many
    elements, or too many inside each other.
    """
    reader = _Reader(name, frozenset(skipped))
    reader.read(content)
    return next(iter(reader.root.children), reader.root)


class _Reader:
    def __init__(self, name: str, skipped: frozenset[str]) -> None:
        self.name, self.skipped = name, skipped
        self.root = Element("", 0, {})
        self.open = [self.root]
        self.texts: list[str] = []
        self.depth = self.elements = self.kept = self.skips = 0
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text

    def read(self, content: bytes) -> None:
        """Read the file."""
        try:
            for start in range(0, len(content), _PIECE_BYTES):
                self.parser.Parse(content[start : start + _PIECE_BYTES], False)
                # The text between two tags comes in pieces, a tag or comment as a whole.
                if start - self.parser.CurrentByteIndex > _MOST_TAG_BYTES:
                    raise self._refuse(f"a tag of over {_MOST_TAG_BYTES:,} bytes; no such file is a machine's")
            self.parser.Parse(b"", True)
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise BusplanError(f"{self.name}:{error.lineno}:{error.offset + 1}: not valid XML: {what}") from None
        except (ValueError, LookupError) as error:  # Python does not know the encoding.
            raise BusplanError(f"{self.name}:1: not valid XML: {error}") from None

    def _refuse(self, message: str) -> BusplanError:
        return BusplanError(f"{self.name}:{self.parser.CurrentLineNumber}: {message}")

    def _doctype(self, *_: Any) -> None:
        raise self._refuse("a document type (<!DOCTYPE>) is not read: it can declare entities; remove it")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self.depth += 1
        self.elements += 1
        if self.depth > _MOST_DEPTH:
            raise self._refuse(f"elements inside each other more than {_MOST_DEPTH} deep; no such file is a machine's")
        if self.elements > _MOST_ELEMENTS:
            raise self._refuse(f"more than {_MOST_ELEMENTS:,} elements; no such file is a machine's")
        tag = tag.rpartition(":")[2]
        if self.skips or tag in self.skipped:
            self.skips += 1
            return
        self.kept += 1
        if self.kept > _MOST_KEPT:
            raise self._refuse(f"more than {_MOST_KEPT:,} elements to read; no such file is a machine's")
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber
        element = Element(tag, f"{line}:{column + 1}" if column > _FAR else line, attributes)
        self.open[-1].children.append(element)
        self.texts.clear()
        self.open.append(element)

    def _end(self, _tag: str) -> None:
        self.depth -= 1
        if self.skips:
            self.skips -= 1
        else:
            self.open.pop().text = "".join(self.texts)
            self.texts.clear()

    def _text(self, text: str) -> None:
        if not self.skips:
            self.texts.append(text)
