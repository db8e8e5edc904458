"""Grades that comments of a file give its keys: `master_us = 30  # measured: on the line's own host`."""

import re
from collections.abc import Iterator
from typing import Final, cast, get_args

from busplan.profile.document import Document
from busplan.profile.keys import named_path
from busplan.sections.profile import Profile
from busplan.sourced import Grade

_GRADE: Final = re.compile(rf"#\s*({'|'.join(get_args(Grade))})\b")
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
    data, at = document.data(), document.lines.line_and_column
    words = {at(offset)[0]: document.text[offset:].partition("\n")[0] for offset in document.comments}
    said = {path: words.get(at(place.key_start)[0], "") for path, place in document.places.items()}
    for path, comment in said.items():
        match = _GRADE.match(comment or said.get(path[:-1], ""))
        if match is not None:
            yield ".".join(map(str, named_path(data, path))), cast("Grade", match[1])
