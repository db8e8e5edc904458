"""Change values in the text of a profile and keep all other bytes, comments and layout.

A value is replaced, or a line is added to or removed from a section. A layout that needs more is refused, with the
lines to change by hand. As a check, the new text is parsed and compared with the wanted data. A comment that grades a
value, as `# measured: by whom`, was about the old one: it becomes `# was measured: by whom`. A chosen value, however,
is known no better than the assumption that it replaces, and stays assumed.
"""

import json
import math
import re
import tomllib
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any, Final

import tomli_w

from busplan.english import printable
from busplan.errors import BusplanError, PlacedError
from busplan.profile.document import (
    GRADING,
    Document,
    LoadedProfile,
    comment_grade,
    decode,
    has_comment_grades,
    override,
    validate,
)
from busplan.profile.kinds import flat, holder, named_path, path_of
from busplan.profile.places import KeyPath, Place
from busplan.sections.profile import Profile


def value_text(value: object) -> str:
    r"""Write a value as TOML, in one line without control characters.

    A number that is not finite raises ValueError. A value that is no bool, number or str, nor a sequence or table of
    them, raises TypeError.

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
        # TOML has JSON's escapes; other characters that are not printable need \U.
        return printable(json.dumps(value, ensure_ascii=False), write=lambda character: f"\\U{ord(character):08x}")
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {value_text(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, Sequence):
        return f"[{', '.join(map(value_text, value))}]"
    raise TypeError(f"{value!r} is no value of a profile")


def whole(value: Any) -> Any:
    """A whole float as an integer, any other value as it is. Where the schema has a float, both mean the same."""
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
    """Write a profile as TOML, without keys that it does not set.

    Grades that comments gave are comments again; `profile.edit` keeps the other comments of a file, too.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> profile_text(load("paper-4ms").profile).splitlines()[0]
    'schema_version = 1'
    """
    # TOML has no null: leave out keys that are None.
    data = profile.model_dump(exclude_unset=True, exclude_none=True)
    return _graded(tomli_w.dumps(data, multiline_strings=True), profile)


def _graded(text: str, profile: Profile) -> str:
    """The text with a comment for each key that a comment of the profile's file grades."""
    if not has_comment_grades(profile):
        return text
    document = Document("", text)
    names: dict[int, Any] = {}
    lines = text.split("\n")
    for path, place in document.places.items():
        grade = comment_grade(profile, ".".join(map(str, named_path(document.data(), path, names))))
        # A string of several lines has no room beside its key, and no grade.
        if grade is not None and place.value_start > place.key_end and not text.startswith('"""', place.value_start):
            lines[document.lines.line_and_column(place.key_start)[0] - 1] += f"  # {grade}"
    return "\n".join(lines)


_ASSUMED: Final = "assumed"
_BEFORE_COMMENT: Final = re.compile(r"  +(?=#)")


class _LayoutError(Exception):
    """A change that the layout does not allow, with the reason."""


def edited_file(
    content: bytes,
    changes: Mapping[str, object],
    *,
    name: str,
    notes: Mapping[str, str] | None = None,
    are_choices: bool = False,
) -> bytes:
    r"""The file of a profile with new values; a byte order mark and CRLF line ends are kept.

    Changes are by dotted key, None to remove it: {"bus.nodes": 3, "bus.max_hops": None}. A value is a bool, an int, a
    float, a str, or a sequence of them; an equal value keeps its text. A new key follows the last one of its section; a
    new section stands at the end.

    Notes are one-line comments by section, for the line above it: {"node.execution": "busplan calibrate: ..."}. A note
    says where the section's values are from, and replaces a comment with the same beginning, up to the colon.
    `are_choices` says that the values are chosen, as by a plan, not measured or read: assumptions stay assumed, and the
    section's comment makes nothing measured.

    A new profile that is not valid raises BusplanError, and so does a layout that does not allow the changes, with the
    lines to change by hand. A value that TOML does not have raises TypeError.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> content = load("paper-4ms").document.text.encode()
    >>> new = edited_file(content, {"bus.nodes": 16, "limits.min_spare_nodes": 3}, name="paper-4ms").decode()
    >>> print(*(line for line in new.splitlines() if line.startswith(("nodes", "min_spare"))), sep="\n")
    nodes = 16                 # distributed nodes, host not counted
    min_spare_nodes = 3
    """
    document, notes = decode(content, name=name), notes or {}
    data = deepcopy(document.data())
    before = _texts(data)
    for key, value in changes.items():
        table, last = holder(data, key)
        if value is None:
            table.pop(last, None)
        else:
            table[last] = value
    try:
        validate(Document(name, tomli_w.dumps(data)))
    except PlacedError as error:
        raise BusplanError(*(f"{name}: with the changes, {problem.message}" for problem in error.placed)) from None
    after = _texts(data)
    # Set keys before removing keys: new lines must not follow the comment of a removed line.
    changed = {key: after.get(key) for key in {**after, **before} if after.get(key) != before.get(key)}
    # A note is about its whole section, equal values included.
    noted = {path_of(data, key) for key in (*notes, *changes) if key in notes or key.rpartition(".")[0] in notes}
    document = _with_old_grades(document, noted | {path_of(data, key) for key in changed}, are_choices=are_choices)
    try:
        result = _encoded(_edited(document, changed, notes, wanted=after, are_choices=are_choices), like=content)
    except _LayoutError as error:
        raise BusplanError(
            f"{name}: {error}, so that it stays as it is; change these lines by hand:", *_by_hand(changed, notes)
        ) from None
    decode(result, name=name)
    return result


def edited_copy(loaded: LoadedProfile, choices: Mapping[str, object]) -> bytes:
    """Copy of a profile with chosen values, for another file; choices are as the changes of `edited_file`.

    Comments with grades are kept. So are all other comments and the layout, unless the layout does not allow the
    changes.
    """
    try:
        return edited_file(loaded.document.text.encode(), choices, name=loaded.document.name, are_choices=True)
    except BusplanError:
        return profile_text(override(loaded.profile, dict(choices))).encode()


def _texts(data: Mapping[str, Any]) -> dict[str, str]:
    """Values as texts, so that equal texts have equal types."""
    return {key: value_text(value) for key, value in flat(data)}


def _reads_to(text: str, wanted: dict[str, str]) -> bool:
    try:
        return _texts(tomllib.loads(text)) == wanted
    except tomllib.TOMLDecodeError:
        return False


def _encoded(text: str, *, like: bytes) -> bytes:
    line_ends = like.count(b"\r\n")
    if line_ends not in (0, like.count(b"\n")):
        raise _LayoutError("some of its lines end in CRLF and some in LF")
    mark = BOM_UTF8 if like.startswith(BOM_UTF8) else b""
    return mark + (text.replace("\n", "\r\n") if line_ends else text).encode()


def _by_hand(changed: Mapping[str, str | None], notes: Mapping[str, str]) -> Iterator[str]:
    """Lines to copy for the changes, keys outside sections first."""
    sections = dict.fromkeys([*sorted(key.rpartition(".")[0] for key in changed), *notes])
    for section in sections:
        if section in notes:
            yield f"# {printable(notes[section])}"
        if section:
            yield _header_text(section)
        for key, text in changed.items():
            table, _, name = key.rpartition(".")
            if table == section:
                yield f"# remove {name}" if text is None else f"{name} = {text}"


def _header_text(section: str) -> str:
    """Header of a section; for a section of a group, with the group's name."""
    parts = section.split(".")
    if parts[0] != "group" or len(parts) == 1:
        return f"[{section}]"
    _, name, *inner = parts
    return f"[{'.'.join(('group', *inner))}]  # of {name}" if inner else f"[[group]]  # {name}"


def _edited(
    document: Document,
    changed: Mapping[str, str | None],
    notes: Mapping[str, str],
    *,
    wanted: dict[str, str],
    are_choices: bool,
) -> str:
    """Make the changes one after the other."""
    data = document.data()
    for key, text in changed.items():
        path = path_of(data, key)
        if text is None:
            new = _without(document, path)
        else:
            new = (_replaced if path in document.places else _with_line)(document, path, text)
        document = Document(document.name, new)
        if are_choices and text is not None:
            document = _without_grade_of_table(document, path)
    for section, note in notes.items():
        document = Document(document.name, _noted(document, path_of(data, section), note))
    if not _reads_to(document.text, wanted):
        raise _LayoutError("its sections are laid out in an unusual way")
    return document.text


def _replaced(document: Document, path: KeyPath, new: str) -> str:
    """Replace a value; a comment after it stays in its column."""
    text, (_, _, start, end) = document.text, document.places[path]
    if any(start <= comment < end for comment in document.comments):
        raise _LayoutError(f"there are comments among the values of {path[-1]}")
    space = _BEFORE_COMMENT.match(text, end)
    if space and "\n" not in text[start:end]:
        new, end = f"{new} ".ljust(space.end() - start), space.end()
    return text[:start] + new + text[end:]


def _with_line(document: Document, path: KeyPath, value: str) -> str:
    """Add a line to a section, or a new section at the end."""
    text, table, line = document.text, path[:-1], f"{path[-1]} = {value}\n"
    if table and table not in document.places:
        if any(isinstance(part, int) for part in table):
            raise _LayoutError("there is no section of a group to write to")
        return f"{_whole_lines(text)}\n[{'.'.join(map(str, table))}]\n{line}"
    lines = [place for key, place in document.places.items() if key[:-1] == table and place.value_start > place.key_end]
    header = [_header(document, table)] if table else []  # Every profile has keys above its sections.
    last = max(header + lines, key=lambda place: place.value_end)
    start, end = _line_start(text, last.key_start), _line_end(text, last.value_end)
    return f"{_whole_lines(text[:end])}{_indent(text, start)}{line}{text[end:]}"


def _without(document: Document, path: KeyPath) -> str:
    """Remove the lines of a key; comments on them get lines of their own."""
    text, place = document.text, document.places[path]
    start, end = _line_start(text, place.key_start), _line_end(text, place.value_end)
    if text[start : place.key_start].strip():
        raise _LayoutError(f"{path[-1]} does not begin a line")
    comments = (text[at : _line_end(text, at)].rstrip() for at in document.comments if start <= at < end)
    return text[:start] + "".join(f"{_indent(text, start)}{comment}\n" for comment in comments) + text[end:]


def _with_old_grades(document: Document, paths: set[KeyPath], *, are_choices: bool) -> Document:
    """The document with "was" in the comments that grade some keys. For choices, comments that say assumed stay."""
    text, beside = document.text, document.comments_beside
    for at in sorted({beside[path] for path in paths & set(beside)}, reverse=True):
        match = GRADING.match(text, at)
        if match and not (are_choices and match[1] == _ASSUMED):
            text = f"{text[:at]}# was {text[match.start(1) :]}"
    return Document(document.name, text)


def _without_grade_of_table(document: Document, path: KeyPath) -> Document:
    """The document with a comment beside a chosen key whose table's comment would call it measured or published."""
    text, beside = document.text, document.comments_beside
    at = None if path in beside else beside.get(path[:-1])
    match = None if at is None else GRADING.match(text, at)
    if match is None or match[1] == _ASSUMED:
        return document
    end = document.places[path].value_end
    return Document(document.name, f"{text[:end]}  # not {match[1]}{text[end:]}")


def _noted(document: Document, table: KeyPath, note: str) -> str:
    """Add a comment above the other comments of a section. A suppression stays next to its line."""
    text = document.text
    top = _line_start(text, _header(document, table).key_start)
    line = f"{_indent(text, top)}# {printable(note)}\n"
    mark = line.lstrip().partition(":")[0] + ":"
    while top:
        above = _line_start(text, top - 1)
        comment = text[above:top].lstrip(" \t")
        if not comment.startswith("#"):
            break
        if comment.startswith(mark):
            return text[:above] + line + text[top:]
        top = above
    return text[:top] + line + text[top:]


def _header(document: Document, table: KeyPath) -> Place:
    """Place of a table's name in its line [a.b]."""
    text, place = document.text, document.places.get(table)
    if place is not None:
        before = text[_line_start(text, place.key_start) : place.key_start]
        if before.lstrip().startswith("["):
            return place
    section = ".".join(part for part in table if isinstance(part, str))
    raise _LayoutError(f"there is no line [{section}]")


def _line_start(text: str, offset: int) -> int:
    return text.rfind("\n", 0, offset) + 1


def _line_end(text: str, offset: int) -> int:
    """Start of the next line, or the end of the text."""
    return text.find("\n", offset) + 1 or len(text)


def _indent(text: str, line_start: int) -> str:
    return text[line_start : len(text) - len(text[line_start:].lstrip(" \t"))]


def _whole_lines(text: str) -> str:
    return text if text.endswith("\n") else f"{text}\n"
