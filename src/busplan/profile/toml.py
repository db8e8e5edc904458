"""Read and validate profiles; every problem is reported with its place.

Reading has three steps, each with its own kind of error: bytes to text, text to TOML data, data to `Profile`. A message
names file, line, column and value, and says what would be right.
"""

import sys
from collections.abc import KeysView, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from pydantic import ValidationError

from busplan.errors import BusplanError, PlacedError, PlacedProblem
from busplan.files import is_unwritten_pipe
from busplan.profile.document import GRADING, Document, TomlTable, text_of
from busplan.profile.keys import holder
from busplan.profile.kinds import kind_of, profile_model
from busplan.sections.profile import Profile
from busplan.sourced import Grade

MAX_FILE_BYTES: Final = 2_000_000
"""Some 10,000 messages of a CAN network with their comments; a larger file is something else."""
PERIOD_KEY: Final = "cycle.period_us"
_KINDS: Final = ("bus", "bus.kind")
"""Keys whose change may ask for tables of another kind of bus."""
_SOURCE: Final = "_source"
"""Attribute of a profile that holds its document and the keys changed since; no field, so no part of its value."""


class LoadedProfile(NamedTuple):
    """A profile and its text."""

    profile: Profile
    document: Document


def decode(content: bytes, *, name: str) -> Document:
    """Decode a file.

    Parameters
    ----------
    content
        The bytes; a byte order mark is skipped.
    name
        Name of the file in messages.

    Raises
    ------
    PlacedError
        Too large, or not UTF-8.
    """
    if len(content) > MAX_FILE_BYTES:
        raise too_large(name)
    text = text_of(content, name=name, wanted="a profile is TOML in UTF-8")
    # With LF only, offsets of the parser and the scanner agree.
    return Document(name, text.replace("\r\n", "\n"))


def too_large(name: str) -> PlacedError:
    """Make the error for a file that is too large for a profile."""
    message = f"the file is larger than {MAX_FILE_BYTES:,} bytes; no profile is"
    return PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))


def read_bytes(path: Path, *, name: str, limit: int = MAX_FILE_BYTES) -> bytes:
    """Read a file, or standard input for the path "-", up to one byte more than the limit.

    Parameters
    ----------
    path
        The file, or "-".
    name
        Name of the file in messages.
    limit
        Largest size [bytes]; by default that of a profile.

    Raises
    ------
    BusplanError
        It does not exist, is a directory, or cannot be read.
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

    Raises
    ------
    PlacedError
        Not TOML or not a profile; one message for each problem, in the order of their places.
    """
    data = document.data()
    result = _checked(data)
    if isinstance(result, Profile):
        result.__dict__[_SOURCE] = document, frozenset()
        return result
    from busplan.profile.problems import refusal  # loaded only for an invalid profile

    raise refusal(result, data, document)


def profile_of(data: TomlTable) -> Profile:
    """Validate plain data that stands in no file.

    Parameters
    ----------
    data
        What a file would hold, with a kind of bus that is known.

    Raises
    ------
    BusplanError
        No profile of its kind; each problem names its key.
    """
    result = _checked(data)
    if isinstance(result, Profile):
        return result
    from busplan.profile.problems import refused_data  # as above

    raise refused_data(result, data)


def _checked(data: TomlTable) -> Profile | ValidationError | None:
    """The profile of some data, or its error from pydantic; None if only the kind of bus is unknown."""
    kind = kind_of(data)
    try:
        valid = profile_model(kind).model_validate(data)
    except ValidationError as error:
        return error
    return None if kind is None else valid


def override(profile: Profile, changes: dict[str, object], *, origin: dict[str, str] | None = None) -> Profile:
    """Return a profile with new values, validated; keys that it does not set stay unset.

    Parameters
    ----------
    profile
        The profile.
    changes
        New value by dotted key: {"bus.nodes": 3}.
    origin
        What set a key, for messages, if it is not key and value: {"bus.nodes": "--nodes 3"}.

    Raises
    ------
    BusplanError
        A value that the profile's schema refuses.
    """
    if not changes:
        return profile
    origin = origin or {}
    kept = _unchanged_tables(profile, changes.keys())
    data = profile.model_dump(exclude_unset=True, exclude=set(kept))
    for key, value in changes.items():
        table, last = holder(data, key, name=origin.get(key))
        table[last] = value
    result = _checked(data | kept)
    if isinstance(result, Profile):
        if _SOURCE in profile.__dict__:
            document, before = profile.__dict__[_SOURCE]
            result.__dict__[_SOURCE] = document, before | set(changes)
        return result
    from busplan.profile.problems import refused_changes  # as above

    data |= profile.model_dump(exclude_unset=True, include=set(kept))
    raise refused_changes(result, data, changes, origin)


def _unchanged_tables(profile: Profile, changes: KeysView[str]) -> dict[str, object]:
    """Arrays of tables that no change touches: there may be thousands of tables, which are valid as they are."""
    if not changes.isdisjoint(_KINDS):
        return {}
    changed = {key.partition(".")[0] for key in changes}
    values = {name: getattr(profile, name) for name in profile.model_fields_set - changed}
    return {name: value for name, value in values.items() if isinstance(value, tuple)}


def at_periods(profile: Profile, periods_us: Sequence[float] | None) -> list[Profile]:
    """Return a profile at each of some communication periods [us]; without them, as it is.

    Raises
    ------
    BusplanError
        A period that the profile's schema refuses.
    """
    if periods_us is None:
        return [profile]
    return [
        override(profile, {PERIOD_KEY: period_us}, origin={PERIOD_KEY: f"period {period_us}"})
        for period_us in periods_us
    ]


def has_comment_grades(profile: Profile) -> bool:
    """Whether comments of its file may grade keys; one that was read from no file has no comments."""
    document, _ = profile.__dict__.get(_SOURCE, (None, ()))
    return document is not None and GRADING.search(document.text) is not None


def comment_grade(profile: Profile, key: str) -> Grade | None:
    """The grade that a comment of its file, at the key or at its table, gives the value of a key.

    Another value is not measured because the old one was; but an assumption that is made otherwise is still one.

    Parameters
    ----------
    profile
        The profile; one that was read from no file has no comments.
    key
        Dotted key.
    """
    document, changed = profile.__dict__.get(_SOURCE, (None, ()))
    if document is None:
        return None
    grades: dict[str, Grade] = document.grades
    grade = grades.get(key)
    is_changed = any(key == changed_key or key.startswith(f"{changed_key}.") for changed_key in changed)
    return None if is_changed and grade != "assumed" else grade
