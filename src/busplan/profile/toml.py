"""Profiles from TOML text: read, check, and say where every problem stands.

Reading has three steps, each with its own kind of error: bytes to text, text to TOML data, data to `Profile`.
Whatever fails, the message names file, line and column, the value, and what would be right.
"""

import re
import sys
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NoReturn

from pydantic import ValidationError

from busplan.errors import BusplanError
from busplan.profile.model import Profile
from busplan.profile.positions import KeyPath, Lines, Place, scan
from busplan.profile.problems import Finding, findings

MAX_FILE_BYTES: Final = 1_000_000
"""A profile is a page of text. More is some other file, and reading it whole would only delay saying so."""

_TOMLLIB_MESSAGE: Final = re.compile(
    r"(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)\Z", re.DOTALL
)
_LONG_INTEGER: Final = re.compile(r"[0-9_]{4000,}")
_MAX_NESTING: Final = 100


@dataclass(frozen=True)
class Document:
    """One TOML text with the name it is called by in messages."""

    name: str
    text: str

    @cached_property
    def lines(self) -> Lines:
        """Line and column of every offset."""
        return Lines(self.text)

    @cached_property
    def places(self) -> dict[KeyPath, Place]:
        """Place of every key; the text must be one that tomllib accepts."""
        return scan(self.text)

    def at(self, offset: int) -> str:
        """Make file:line:column of an offset."""
        line, column = self.lines.line_and_column(offset)
        return f"{self.name}:{line}:{column}"

    def place(self, path: KeyPath) -> Place:
        """Place of a key, or of the nearest table around one that is not there; the start of the file at last."""
        while path:
            if path in self.places:
                return self.places[path]
            path = path[:-1]
        return Place(0, 0, 0, 0)

    def data(self) -> dict[str, Any]:
        """Parse the text.

        Raises
        ------
        BusplanError
            The text is no TOML; with the place where it stops being so.
        """
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            raise BusplanError(
                f"{self.at(_first_deep_bracket(self.text))}: nested too deeply; "
                "a profile needs no more than two brackets inside each other"
            ) from None
        except ValueError as error:
            self._refuse(error)

    def _refuse(self, error: ValueError) -> NoReturn:
        match = _TOMLLIB_MESSAGE.match(str(error))
        if match is None:  # the one error that is Python's own and not TOML's
            long_integer = _LONG_INTEGER.search(self.text)
            place = self.at(long_integer.start() if long_integer else 0)
            raise BusplanError(f"{place}: not valid TOML: a number with too many digits") from None
        what = match["what"][:1].lower() + match["what"][1:]
        if match["line"]:
            place = f"{self.name}:{match['line']}:{match['column']}"
        else:
            place = self.at(len(self.text))
            what += ", and the file ends"
        raise BusplanError(f"{place}: not valid TOML: {what}") from None


def _first_deep_bracket(text: str) -> int:
    """Offset of the first bracket that is nested deeper than any profile."""
    depth = 0
    for match in re.finditer(r"[\[\]{}\n]", text):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1, "\n": 0}[match.group()]
        if depth > _MAX_NESTING:
            return match.start()
    return 0


@dataclass(frozen=True)
class LoadedProfile:
    """A profile together with the text it was read from."""

    profile: Profile
    document: Document


def decode(content: bytes, *, name: str) -> Document:
    """Turn a file's bytes into text.

    Parameters
    ----------
    content
        The bytes; a byte order mark is stepped over.
    name
        What to call the file in messages.

    Raises
    ------
    BusplanError
        Too large, or not UTF-8; the latter with its place.
    """
    if len(content) > MAX_FILE_BYTES:
        raise BusplanError(f"{name}:1:1: the file is larger than {MAX_FILE_BYTES:,} bytes; a profile is a page of TOML")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start].decode("utf-8-sig")
        line, column = Lines(before + "?").line_and_column(len(before))
        raise BusplanError(
            f"{name}:{line}:{column}: not a text file: byte 0x{content[error.start]:02x} is not UTF-8; "
            "a profile is TOML in UTF-8"
        ) from None
    # TOML's line ends are LF and CRLF; one kind inside keeps offsets the parser's and ours alike.
    return Document(name, text.replace("\r\n", "\n"))


def read_bytes(path: Path, *, name: str) -> bytes:
    """Read a file, or standard input for the path "-", no further than a profile can be long.

    Raises
    ------
    BusplanError
        It is not there, is a directory, or cannot be read.
    """
    try:
        if str(path) == "-":
            return sys.stdin.buffer.read(MAX_FILE_BYTES + 1)
        with path.open("rb") as file:
            return file.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise BusplanError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise BusplanError(f"{name}: is a directory; give a profile file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BusplanError(f"{name}: cannot be read: {reason}") from None


def validate(document: Document) -> Profile:
    """Check a document against the profile's schema.

    Raises
    ------
    BusplanError
        No TOML, or no profile; one message for every problem of the file, in the order of their places.
    """
    data = document.data()
    try:
        return Profile.model_validate(data)
    except ValidationError as error:
        placed = [(document.place(found.path), found) for found in findings(error, data)]
        placed.sort(key=lambda pair: pair[0].key_start)
        raise BusplanError(*(_message(document, place, found) for place, found in placed)) from None


def _message(document: Document, place: Place, found: Finding) -> str:
    written = document.text[place.value_start : place.value_end] if found.shows_value else ""
    subject = f"{found.key} = {_shortened(written)}" if written else found.key
    return f"{document.at(place.key_start)}: {subject}: {found.message}"


def _shortened(written: str, limit: int = 40) -> str:
    line = "".join(character if character.isprintable() else " " for character in written)
    return line if len(line) <= limit else f"{line[:limit]}..."


def override(profile: Profile, changes: dict[str, object], *, origin: dict[str, str] | None = None) -> Profile:
    """Make a profile with other values, checked like one that was read.

    Parameters
    ----------
    profile
        Where to start.
    changes
        New value by dotted key: {"bus.nodes": 3}.
    origin
        What to call a key in messages, where not by itself: {"bus.nodes": "--nodes"}.

    Raises
    ------
    BusplanError
        A value that the profile's schema refuses.
    """
    if not changes:
        return profile
    data = profile.model_dump()
    for key, value in changes.items():
        *tables, last = key.split(".")
        table = data
        for name in tables:
            table = table[name]
        table[last] = value
    try:
        return Profile.model_validate(data)
    except ValidationError as error:
        names = origin or {}
        raise BusplanError(
            *(
                f"{names.get(found.key, found.key)}{f' {changes[found.key]}' if found.key in changes else ''}: "
                f"{found.message}"
                for found in findings(error, data)
            )
        ) from None
