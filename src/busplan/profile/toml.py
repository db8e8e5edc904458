"""Profiles from TOML text: read, check, and say where every problem stands.

Reading has three steps, each with its own kind of error: bytes to text, text to TOML data, data to `Profile`.
Whatever fails, the message names file, line and column, the value, and what would be right.
"""

import sys
from pathlib import Path
from typing import Final, NamedTuple

from pydantic import ValidationError

from busplan.errors import BusplanError, PlacedError, PlacedProblem
from busplan.profile.document import Document, text_of
from busplan.profile.keys import holder
from busplan.profile.kinds import kind_of, profile_model
from busplan.sections.profile import Profile

MAX_FILE_BYTES: Final = 100_000
"""A profile is a page of text. More is some other file, and reading it whole would only delay saying so."""
_OPENED: Final = ("/dev/fd/", "/dev/stdin", "/proc/")
"""Where the pipes are that a shell has opened: <(command) is /dev/fd/N, and has a writer."""


class LoadedProfile(NamedTuple):
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
    PlacedError
        Too large, or not UTF-8; the latter with its place.
    """
    if len(content) > MAX_FILE_BYTES:
        raise too_large(name)
    text = text_of(content, name=name, wanted="a profile is TOML in UTF-8")
    # TOML's line ends are LF and CRLF; one kind inside keeps offsets the parser's and ours alike.
    return Document(name, text.replace("\r\n", "\n"))


def too_large(name: str) -> PlacedError:
    """Make the error for a file that is longer than a profile may be."""
    message = f"the file is larger than {MAX_FILE_BYTES:,} bytes; a profile is a page of TOML"
    return PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))


def read_bytes(path: Path, *, name: str, limit: int = MAX_FILE_BYTES) -> bytes:
    """Read a file, or standard input for the path "-", no further than it may be long and one byte more.

    Parameters
    ----------
    path
        The file, or "-".
    name
        What to call it in messages.
    limit
        How long it may be [bytes]; without it, as a profile.

    Raises
    ------
    BusplanError
        It is not there, is a directory, or cannot be read.
    """
    try:
        if str(path) == "-":
            if sys.stdin is None:
                raise BusplanError(f"{name}: standard input is closed")
            return sys.stdin.buffer.read(limit + 1)
        if path.is_fifo() and not str(path).startswith(_OPENED):
            # Opening it would wait for a writer, for ever.
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
    """Check a document against the profile's schema.

    Raises
    ------
    PlacedError
        No TOML, or no profile; one message for every problem of the file, in the order of their places.
    """
    data = document.data()
    kind, problem = kind_of(data), None
    try:
        found = profile_model(kind).model_validate(data)
    except ValidationError as error:
        problem = error
    if kind is not None and problem is None:
        return found
    from busplan.profile.problems import refusal  # only a faulty profile pays for its errors

    raise refusal(problem, data, document)


def override(profile: Profile, changes: dict[str, object], *, origin: dict[str, str] | None = None) -> Profile:
    """Make a profile with other values, checked like one that was read; what it leaves out it still leaves out.

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
    data = profile.model_dump(exclude_unset=True)
    for key, value in changes.items():
        table, last = holder(data, key)
        table[last] = value
    kind, problem = kind_of(data), None
    try:
        if kind is not None:
            return profile_model(kind).model_validate(data)
    except ValidationError as error:
        problem = error
    from busplan.profile.problems import refused_changes  # as above

    raise refused_changes(problem, data, changes, origin or {})
