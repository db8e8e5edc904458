"""Grades that comments of a file give its keys: `master_us = 30  # measured: on the line's own host`."""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, cast, get_args

from busplan.profile.document import Document
from busplan.profile.keys import named_path
from busplan.sections.profile import Profile
from busplan.sourced import Grade

if TYPE_CHECKING:
    from busplan.profile.positions import KeyPath

GRADING: Final = re.compile(rf"#\s*({'|'.join(get_args(Grade))})\b")
"""A comment that grades the key beside it."""
_SOURCE: Final = "_source"
"""Where a profile keeps its document and the keys that are no longer as there: no field, so no part of its value."""


def remember(profile: Profile, document: Document, changed: frozenset[str] = frozenset()) -> None:
    """Keep the document that a profile was read from.

    Parameters
    ----------
    profile
        The profile.
    document
        Its document.
    changed
        Dotted keys whose values are no longer those of the document.
    """
    profile.__dict__[_SOURCE] = document, changed


def inherit(profile: Profile, before: Profile, changed: frozenset[str]) -> None:
    """Keep the document of another profile, from which some keys were changed."""
    if _SOURCE in before.__dict__:
        document, earlier = before.__dict__[_SOURCE]
        remember(profile, document, earlier | changed)


def comment_grade(profile: Profile, key: str) -> Grade | None:
    """The grade that a comment of its file, at the key or at its table, gives the value of a key.

    Parameters
    ----------
    profile
        The profile; one that was read from no file has no comments.
    key
        Dotted key.
    """
    document, changed = profile.__dict__.get(_SOURCE, (None, ()))
    if document is None or any(key == one or key.startswith(f"{one}.") for one in changed):
        return None
    if "_grades" not in document.__dict__:
        document.__dict__["_grades"] = dict(_grades(document))
    grades: dict[str, Grade] = document.__dict__["_grades"]
    return grades.get(key)


def _grades(document: Document) -> Iterator[tuple[str, Grade]]:
    """Dotted keys with the grades of their comments; those of a group have its name."""
    data, comments = document.data(), comments_beside(document)
    for path in document.places:
        offset = comments.get(path, comments.get(path[:-1]))
        match = None if offset is None else GRADING.match(document.text, offset)
        if match is not None:
            yield ".".join(map(str, named_path(data, path))), cast("Grade", match[1])


def comments_beside(document: Document) -> "dict[KeyPath, int]":
    """Offset of the comment on the line of each key that has one there; that of a table is beside its header."""
    line_of = document.lines.line_and_column
    of_line = {line_of(offset)[0]: offset for offset in document.comments}
    lines = {path: line_of(place.key_start)[0] for path, place in document.places.items()}
    return {path: of_line[line] for path, line in lines.items() if line in of_line}
