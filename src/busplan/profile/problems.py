"""From pydantic's validation errors to findings in the profile's own words."""

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any, Final, NamedTuple, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from busplan.buses import kind_names
from busplan.errors import BusplanError, PlacedError, PlacedProblem, ProblemKind
from busplan.printable import printable
from busplan.profile.document import Document, TomlTable
from busplan.profile.kinds import is_of_a_kind, kind_of, models_of, profile_model
from busplan.profile.positions import KeyPath, Place

_TAG: Final = "kind"
"""The key that chooses the member of every union of tables."""
_MOST_SHOWN: Final = 50
_WRONG_TYPE: Final = {
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "a text in quotes",
    "tuple_type": "an array",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "dict_attributes_type": "a table",
}

_OUT_OF_RANGE: Final = {
    "greater_than": "must be greater than {gt:,.12g}",
    "greater_than_equal": "must be {ge:,.12g} or more",
    "less_than_equal": "must be {le:,.12g} or less",
    "finite_number": "must be finite",
    "string_too_short": "must not be empty",
    "too_short": "must not be empty",
    "string_pattern_mismatch": "must not be blank",
    "string_too_long": "must be no longer than {max_length} characters",
}


class KeyFinding(NamedTuple):
    """One problem: where in the data, and what."""

    path: KeyPath
    message: str
    kind: ProblemKind
    shows_value: bool = True
    """Whether the value as written belongs into the message."""

    @property
    def key(self) -> str:
        """The path as a dotted key, indexes in brackets: node.execution.time_us[0]."""
        return "".join(
            f"[{part}]" if isinstance(part, int) else f"{'.' if index else ''}{_quoted(part)}"
            for index, part in enumerate(self.path)
        )


def _quoted(part: str) -> str:
    bare = part.isascii() and part.replace("-", "").replace("_", "").isalnum()
    if bare:
        return part
    escaped = part.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + printable(escaped, write=lambda one: f"\\U{ord(one):08x}") + '"'


def findings(error: ValidationError, data: TomlTable) -> Iterator[KeyFinding]:
    """Translate a validation error.

    Parameters
    ----------
    error
        What pydantic raised for `data`.
    data
        The data that was checked.

    Yields
    ------
    KeyFinding
        One for each problem, in pydantic's order.
    """
    model = profile_model(kind_of(data))
    for details in error.errors(include_url=False):
        path = _path(details["loc"], model)
        if details["type"] == "busplan":
            for problem in details["ctx"]["problems"]:
                yield KeyFinding(_parsed(problem.key) if problem.key else path, problem.message, problem.kind)
        elif details["type"] == "missing":
            yield KeyFinding(path, _missing(path, data), "missing-key", shows_value=False)
        elif details["type"] == "extra_forbidden":
            if kind_of(data) is not None or not is_of_a_kind(path):
                yield KeyFinding(path, _unknown(path, data), "unknown-key", shows_value=False)
        elif details["type"] == "union_tag_not_found":
            key, tags = _tags(path, data)
            message = f"missing key; expected {' or '.join(f'{key} = {_text(tag)}' for tag in tags)}"
            yield KeyFinding((*path, key), message, "missing-key", shows_value=False)
        elif details["type"] == "union_tag_invalid":
            key, tags = _tags(path, data)
            yield KeyFinding((*path, key), f"expected {' or '.join(map(_text, tags))}", "out-of-range")
        else:
            kind: ProblemKind = "wrong-type" if details["type"] in _WRONG_TYPE else "out-of-range"
            yield KeyFinding(path, _expected(details), kind)
    yield from _unknown_kind(data)


def _unknown_kind(data: TomlTable) -> Iterator[KeyFinding]:
    """The kind of bus, where it is a text and none that is known: it says which other keys there are."""
    bus = data.get("bus")
    if kind_of(data) is None and isinstance(bus, dict) and isinstance(bus.get("kind"), str):
        yield KeyFinding(("bus", "kind"), f"expected {' or '.join(map(_text, kind_names()))}", "out-of-range")


def _text(word: str) -> str:
    return f'"{word}"'


def _path(location: tuple[int | str, ...], model: type[BaseModel]) -> KeyPath:
    """The keys of a location of pydantic's, which has the tag of each union among them."""
    path: list[int | str] = []
    members = [model]
    for part in location:
        if len(members) > 1 and any(part in _tag(one) for one in members):
            members = [one for one in members if part in _tag(one)]
            continue
        path.append(part)
        field = members[0].model_fields.get(str(part)) if members else None
        members = models_of(field.annotation) if field is not None else []
    return tuple(path)


def _tag(model: type[BaseModel]) -> tuple[Any, ...]:
    """What the key of a union's member says that it is this one."""
    return get_args(model.model_fields[_TAG].annotation) if _TAG in model.model_fields else ()


def _tags(path: KeyPath, data: TomlTable) -> tuple[str, list[str]]:
    """The key that chooses the member of a union, and its words."""
    field = _section(path, data).model_fields[str(path[-1])]
    return _TAG, [str(tag) for one in models_of(field.annotation) for tag in _tag(one)]


def _parsed(key: str) -> KeyPath:
    return tuple(int(part) if part.isdigit() else part for part in key.split("."))


def _expected(details: ErrorDetails) -> str:
    """Say what would be right for an error of one value."""
    kind, context = details["type"], details.get("ctx", {})
    if kind == "float_type" and type(details["input"]) is int:
        return "is a number too large for any quantity"
    if kind in _WRONG_TYPE:
        return f"expected {_WRONG_TYPE[kind]}"
    if kind == "literal_error":
        return f"expected {context['expected']}".replace("'", '"')
    if kind in _OUT_OF_RANGE:
        return _OUT_OF_RANGE[kind].format(**context)
    return details["msg"]


def _section(path: KeyPath, data: TomlTable) -> type[BaseModel]:
    """The model of the table that holds `path`."""
    section: type[BaseModel] = profile_model(kind_of(data))
    table: Any = data
    for part in path[:-1]:
        table = table.get(part, {}) if isinstance(table, dict) else {}
        members = models_of(section.model_fields[str(part)].annotation)
        wanted = table.get(_TAG) if isinstance(table, dict) else None
        section = next((one for one in members if len(members) > 1 and wanted in _tag(one)), members[-1])
    return section


def _missing(path: KeyPath, data: TomlTable) -> str:
    field = _section(path, data).model_fields[str(path[-1])]
    if not field.examples:
        needed = [name for name, one in _section((*path, ""), data).model_fields.items() if one.is_required()]
        return f"missing section [{'.'.join(map(str, path))}]; it needs {', '.join(needed)}"
    example = str(field.examples[0]) if not isinstance(field.examples[0], str) else f'"{field.examples[0]}"'
    return f"missing key. {field.description}; for example {path[-1]} = {example}"


def _unknown(path: KeyPath, data: TomlTable) -> str:
    known = list(_section(path, data).model_fields)
    close = get_close_matches(str(path[-1]), known, n=1)
    if close:
        return f"unknown key; did you mean {close[0]}?"
    return f"unknown key; known here: {', '.join(known)}"


def refusal(error: ValidationError | None, data: TomlTable, document: Document) -> PlacedError:
    """Make the error for a document: every problem at its place, in the order of places.

    Parameters
    ----------
    error
        What pydantic raised for `data`; None where all is well but for the kind of bus.
    data
        The data that was checked.
    document
        Where it stands.
    """
    found = _unknown_kind(data) if error is None else findings(error, data)
    placed = sorted(((_place(document, one.path), one) for one in found), key=lambda pair: pair[0].key_start)
    problems = tuple(_problem(document, place, one) for place, one in placed[:_MOST_SHOWN])
    return PlacedError(document.name, problems, hidden=max(0, len(placed) - _MOST_SHOWN))


def _place(document: Document, path: KeyPath) -> Place:
    """Place of a key, or of the nearest table around one that is not there; the start of the file at last."""
    while path:
        if path in document.places:
            return document.places[path]
        path = path[:-1]
    return Place(0, 0, 0, 0)


def _problem(document: Document, place: Place, found: KeyFinding) -> PlacedProblem:
    # A table that is spread over the file has no value to show.
    has_value = found.shows_value and place.value_start != place.key_start
    written = document.text[place.value_start : place.value_end] if has_value or _is_element(found) else ""
    key = _shortened(found.key, limit=100)
    subject = f"{key} = {_shortened(written)}" if written else key
    line, column = document.lines.line_and_column(place.key_start)
    return PlacedProblem(line, column, found.kind, f"{subject}: {found.message}", found.key)


def _is_element(found: KeyFinding) -> bool:
    return found.shows_value and isinstance(found.path[-1], int)


def _shortened(written: str, limit: int = 40) -> str:
    line = printable(written, write=lambda _: " ")
    return line if len(line) <= limit else f"{line[:limit]}..."


def refused_changes(
    error: ValidationError | None, data: TomlTable, changes: dict[str, object], origin: dict[str, str]
) -> BusplanError:
    """Make the error for changes of a profile: each problem with the option or key that asked for it."""
    messages = []
    for found in _unknown_kind(data) if error is None else findings(error, data):
        value = f" {changes[found.key]}" if found.key in changes else ""
        messages.append(f"{origin.get(found.key, found.key)}{value}: {found.message}")
    return BusplanError(*messages)
