"""Write values and whole profiles as TOML."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from busplan.printable import printable
from busplan.profile.document import Document
from busplan.profile.keys import named_path
from busplan.profile.toml import comment_grade, has_comment_grades
from busplan.sections.profile import Profile


def value_text(value: object) -> str:
    r"""Write a value as TOML, in one line without control characters.

    Raises
    ------
    TypeError
        Not a bool, a number, a str, or a sequence or table of them.
    ValueError
        A number is not finite.

    Examples
    --------
    >>> print(value_text([4, 2.5, "two\nlines"]))
    [4, 2.5, "two\nlines"]
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return repr(float(value))
    if isinstance(value, str):
        # TOML has JSON's escapes; for other characters that are not printable, it needs \U.
        return printable(json.dumps(value, ensure_ascii=False), write=lambda character: f"\\U{ord(character):08x}")
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {value_text(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, Sequence):
        return f"[{', '.join(map(value_text, value))}]"
    raise TypeError(f"{value!r} is no value of a profile")


def whole(value: Any) -> Any:
    """A whole float as an integer, and any other value as it is: where the schema has a float, both mean the same."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def short_text(value: object) -> str:
    """Write a value as TOML, a whole float without its fraction.

    Examples
    --------
    >>> short_text(1200.0), short_text(0.83), short_text("unified")
    ('1200', '0.83', '"unified"')
    """
    return value_text(whole(value))


def profile_text(profile: Profile) -> str:
    """Write a profile as TOML, without keys that it does not set; grades that comments gave are comments again.

    Parameters
    ----------
    profile
        Any profile.

    Returns
    -------
    str
        TOML that parses to the same profile, without other comments; `profile.edit` keeps those of a file.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> profile_text(load("paper-4ms").profile).splitlines()[0]
    'schema_version = 1'
    """
    import tomli_w  # noqa: PLC0415 - needed only here

    # TOML has no null: leave out keys that are None.
    data = profile.model_dump(exclude_unset=True, exclude_none=True)
    return _graded(tomli_w.dumps(data, multiline_strings=True), profile)


def _graded(text: str, profile: Profile) -> str:
    """The text with the grade of each key that a comment of the profile's file grades."""
    if not has_comment_grades(profile):
        return text
    document = Document("", text)
    known: dict[int, Any] = {}
    lines = text.split("\n")
    for path, place in document.places.items():
        grade = comment_grade(profile, ".".join(map(str, named_path(document.data(), path, known))))
        # A string of several lines has no room beside its key, and is no value that has a grade.
        if grade is not None and place.value_start > place.key_end and not text.startswith('"""', place.value_start):
            lines[document.lines.line_and_column(place.key_start)[0] - 1] += f"  # {grade}"
    return "\n".join(lines)
