"""Translation of pydantic's validation errors into problems of profile keys."""

import re
from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from math import inf
from operator import eq
from typing import Any, Final, NamedTuple, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from busplan.buses import kind_names
from busplan.english import did_you_mean, listed, printable
from busplan.errors import BusplanError, PlacedError, PlacedProblem, ProblemKind
from busplan.profile.document import Document
from busplan.profile.edit import value_text
from busplan.profile.kinds import kind_of, kinds_with, models_of, named_path, path_of, profile_model, value_keys
from busplan.profile.places import KeyPath
from busplan.sections.base import MISSING, Problem

_PERCENT: Final = 100
_LEAST_PERCENT: Final = 2
"""A share from here on is taken for a percentage."""
_TAG: Final = "kind"
"""The key that selects the member of a union of tables."""
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
    "too_long": "has {actual_length:,} entries, must have {max_length:,} or fewer",
    "string_pattern_mismatch": "must not be blank",
    "string_too_long": "must be no longer than {max_length} characters",
}


class KeyFinding(NamedTuple):
    """A problem of a key."""

    path: KeyPath
    message: str
    kind: ProblemKind
    shows_value: bool = True
    """Whether the message shows the value."""
    named: KeyPath = ()
    """The path with names of groups instead of indexes."""

    @property
    def key(self) -> str:
        """The path as a dotted key, indexes in brackets: node.execution.time_us[0]."""
        return "".join(
            f"[{part}]" if isinstance(part, int) else f"{'.' if index else ''}{_quoted(part)}"
            for index, part in enumerate(self.named or self.path)
        )


def _quoted(part: str) -> str:
    bare = part.isascii() and part.replace("-", "").replace("_", "").isalnum()
    return part if bare else value_text(part)


def findings(error: ValidationError | None, data: dict[str, Any]) -> Iterator[KeyFinding]:
    """Problems of a validation error, in pydantic's order; an error of None stands for an unknown kind of bus alone."""
    of_keys = () if error is None else (*_validated(error, data), *_of_nodes(data))
    names: dict[int, Any] = {}
    for finding in dict.fromkeys((*of_keys, *_unknown_kind(data))):
        yield finding._replace(named=named_path(data, finding.path, names))


def _of_nodes(data: dict[str, Any]) -> Iterator[KeyFinding]:
    """Problems of the keys that declare nodes: the model looks for them only where there are no others."""
    bus, model = data.get("bus"), profile_model(kind_of(data))
    present = {name for name in data if name in model.model_fields}
    if not isinstance(bus, dict) or "nodes" in bus or kind_of(data) is None:
        present.add("bus.nodes")  # Without a section of a known kind, nobody can tell.
    for problem in model.nodes_problems(present):
        if problem.key != "bus.nodes" or (isinstance(bus, dict) and kind_of(data) is not None):
            yield _of_problem(problem, (), model)


def _of_problem(problem: Problem, path: KeyPath, model: type[BaseModel]) -> KeyFinding:
    """Finding for a problem that one of our validators reports at a path."""
    if problem.key:
        path = (*path, *(int(part) if part.isdigit() else part for part in problem.key.split(".")))
    if problem.message != MISSING:
        return KeyFinding(path, problem.message, problem.kind, shows_value=problem.kind != "missing-key")
    return KeyFinding(path, _missing(*_path(path, model)), problem.kind, shows_value=False)


def _validated(error: ValidationError, data: dict[str, Any]) -> Iterator[KeyFinding]:
    model = profile_model(kind_of(data))
    for details in error.errors(include_url=False):
        path, section = _path(details["loc"], model)
        if details["type"] == "busplan":
            for problem in details["ctx"]["problems"]:
                yield _of_problem(problem, path, model)
        elif details["type"] == "missing":
            yield KeyFinding(path, _missing(path, section), "missing-key", shows_value=False)
        elif details["type"] == "extra_forbidden":
            if kind_of(data) is not None or not kinds_with(path):
                yield KeyFinding(path, _unknown(path, section, model), "unknown-key", shows_value=False)
        elif details["type"] == "union_tag_not_found":
            tags = [f"{_TAG} = {tag}" for tag in _tags(path, section)]
            yield KeyFinding(
                (*path, _TAG), f"missing key; expected {' or '.join(tags)}", "missing-key", shows_value=False
            )
        elif details["type"] == "union_tag_invalid":
            yield KeyFinding((*path, _TAG), f"expected {' or '.join(_tags(path, section))}", "out-of-range")
        else:
            kind: ProblemKind = "wrong-type" if details["type"] in _WRONG_TYPE else "out-of-range"
            yield KeyFinding(path, _expected(details), kind)


def _unknown_kind(data: dict[str, Any]) -> Iterator[KeyFinding]:
    """Problem of an unknown kind of bus, which the common model does not find."""
    bus = data.get("bus")
    if kind_of(data) is None and isinstance(bus, dict) and isinstance(bus.get("kind"), str):
        near = did_you_mean(bus["kind"], kind_names(), write=value_text)
        expected = f"expected {listed([*map(value_text, kind_names())], 'or')}{near and f'; {near}'}"
        yield KeyFinding(("bus", "kind"), expected, "out-of-range")


def _path(location: tuple[int | str, ...], model: type[BaseModel]) -> tuple[KeyPath, type[BaseModel]]:
    """Key path of a pydantic location, without the tags of unions, and the section of its last key."""
    path: list[int | str] = []
    members, section = [model], model
    for part in location:
        if len(members) > 1 and any(part in _tag(member) for member in members):
            members = [member for member in members if part in _tag(member)]
            continue
        if isinstance(part, str) and part.startswith("("):
            continue  # the tag of a union without a key `kind`
        path.append(part)
        if isinstance(part, int):
            continue  # one of the tables of a key
        if members:
            section = members[0]
        field = section.model_fields.get(str(part)) if members else None
        members = models_of(field.annotation) if field is not None else []
    return tuple(path), section


def _tag(model: type[BaseModel]) -> tuple[Any, ...]:
    """Values of the key `kind` that select a member of a union."""
    return get_args(model.model_fields[_TAG].annotation) if _TAG in model.model_fields else ()


def _tags(path: KeyPath, section: type[BaseModel]) -> list[str]:
    """All values of the key `kind` of a union, as TOML."""
    return [
        value_text(tag) for member in models_of(section.model_fields[str(path[-1])].annotation) for tag in _tag(member)
    ]


def _expected(details: ErrorDetails) -> str:
    """Message for an error of one value."""
    kind, context = details["type"], details.get("ctx", {})
    if kind == "float_type" and type(details["input"]) is int:
        return "is a number too large for any quantity"
    if kind == "tuple_type" and isinstance(details["input"], dict):
        return f"expected an array of tables, each below [[{details['loc'][-1]}]]"
    if kind in _WRONG_TYPE:
        return f"expected {_WRONG_TYPE[kind]}"
    if kind == "literal_error":
        expected, words = (
            f"expected {context['expected']}".replace("'", '"'),
            re.findall("'([^']*)'", context["expected"]),
        )
        meant = [word for word in words if word.casefold() == str(details["input"]).casefold()]
        return f"{expected}; did you mean {value_text(meant[0])}?" if meant else expected
    if kind in _OUT_OF_RANGE:
        return f"{_OUT_OF_RANGE[kind].format(**context)}{_as_share(details['input'], context.get('le', inf))}"
    return details["msg"]


def _as_share(value: Any, most: float) -> str:
    """Advice on the share that a percentage means; empty for other values."""
    if most > 1 or not isinstance(value, int | float) or not _LEAST_PERCENT <= value <= _PERCENT * most:
        return ""
    return f"; it is a share: {value / _PERCENT:g} for {value:g} %"


def _missing(path: KeyPath, section: type[BaseModel]) -> str:
    field = section.model_fields[str(path[-1])]
    if field.examples:
        return f"missing key. {field.description}; for example {path[-1]} = {value_text(field.examples[0])}"
    # Below the header of a group, [group.execution] belongs to that group.
    *parents, key = path
    header = ".".join(part for part in path if isinstance(part, str))
    place = f"in its [[{parents[0]}]]" if parents[1:] else f"in [{parents[0]}]" if parents else "above all sections"
    model = models_of(field.annotation)[0]
    return f"missing section [{header}]; as one line, {place}: {key} = {_example(model)}"


def _example(model: type[BaseModel]) -> str:
    """Keys that a section needs, or its first two, as an inline table."""
    needed = [name for name, field in model.model_fields.items() if field.is_required()]
    fields = {name: model.model_fields[name] for name in needed or list(model.model_fields)[:2]}
    keys = (
        f"{name} = {value_text(field.examples[0]) if field.examples else _example(models_of(field.annotation)[0])}"
        for name, field in fields.items()
    )
    return f"{{{', '.join(keys)}}}"


_REMOVED: Final[dict[tuple[str, ...], str]] = {
    ("bus", "timing_model"): "no longer a key: the model that decides always comes first; delete the line, and use "
    "--timing-model to show another",
}
"""Keys of earlier profiles, with advice."""


def _unknown(path: KeyPath, section: type[BaseModel], model: type[BaseModel]) -> str:
    name, names = str(path[-1]), list(section.model_fields)
    if removed := _REMOVED.get(tuple(map(str, path))):
        return removed
    for kind, table in _kinds_beside(model, section).items():
        if name in table.model_fields:
            own = _word_of_kind(section)
            return f'unknown key where kind is "{own}"; it is a key of kind = "{kind}"'
    if kinds := kinds_with(path):
        words = listed([value_text(kind) for kind in kinds], "or")
        return f"unknown key on this bus; it is a key where bus.kind is {words}"
    elsewhere = [key for key, part in _parts_of_keys(model).items() if part == name or part.startswith(f"{name}_")]
    close = get_close_matches(name, names, n=1)
    # A name at the top is more likely that of a section than a misspelt other.
    meant = [*elsewhere, *close] if len(path) == 1 else [*close, *elsewhere]
    return f"unknown key; did you mean {meant[0]}?" if meant else f"unknown key; known here: {', '.join(names)}"


@cache
def _parts_of_keys(model: type[BaseModel]) -> dict[str, str]:
    """Last part of each key below a section, and of each section below another."""
    keys = (key.split(".") for key in value_keys(model, {}))
    return {".".join(parts[:end]): parts[end - 1] for parts in keys for end in range(2, len(parts) + 1)}


def _kinds_beside(model: type[BaseModel], section: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """Other models that a table may have instead of this one, by their word of `kind`."""
    for field in model.model_fields.values():
        models = models_of(field.annotation)
        if section in models:
            return {_word_of_kind(each): each for each in models if each is not section and "kind" in each.model_fields}
        for inner in models:
            if found := _kinds_beside(inner, section):
                return found
    return {}


def _word_of_kind(section: type[BaseModel]) -> str:
    return str(get_args(section.model_fields["kind"].annotation)[0]) if "kind" in section.model_fields else ""


def refusal(error: ValidationError | None, data: dict[str, Any], document: Document) -> PlacedError:
    """Error for a document, with all problems in the order of their places."""
    problems = (_problem(document, finding) for finding in findings(error, data))
    placed = sorted(problems, key=lambda problem: (problem.line, problem.column))
    return PlacedError(document.name, tuple(placed))


def _problem(document: Document, finding: KeyFinding) -> PlacedProblem:
    key = _shortened(finding.key, limit=100)
    written = _shortened(_written(document, finding)) if finding.shows_value else ""
    subject = f"{key} = {written}" if written else key
    line, column, *marked = document.spot(finding.path, marks_key=finding.kind == "unknown-key")
    return PlacedProblem(
        line, column, finding.kind, f"{subject}: {finding.message}", finding.key, (marked[0], marked[1])
    )


def _written(document: Document, finding: KeyFinding) -> str:
    """Source text of the value; empty for a table without a text of its own."""
    place = document.places.get(finding.path)
    if place is None or (place.value_start == place.key_start and isinstance(finding.path[-1], str)):
        return ""
    return document.text[place.value_start : place.value_end]


def _shortened(written: str, limit: int = 40) -> str:
    line = printable(written, write=lambda _: " ")
    return line if len(line) <= limit else f"{line[:limit]}..."


def refused_data(error: ValidationError | None, data: dict[str, Any]) -> BusplanError:
    """Error for data that stand in no file; each problem names its key."""
    return BusplanError(*(f"{finding.key}: {finding.message}" for finding in findings(error, data)))


def refused_changes(
    error: ValidationError | None, data: dict[str, Any], changes: dict[str, object], origin: dict[str, str]
) -> BusplanError:
    """Error for changes of a profile; each problem names what set its key."""
    sources: dict[KeyPath, str] = {
        path_of(data, key): origin.get(key, f"{key} {value}") for key, value in changes.items()
    }
    return BusplanError(*(_of_changes(finding, sources) for finding in findings(error, data)))


def _of_changes(finding: KeyFinding, sources: dict[KeyPath, str]) -> str:
    """Message for a problem after changes, at a changed key, a key around or inside it, or any other."""
    if finding.path in sources:
        return f"{sources[finding.path]}: {finding.message}"
    near = [source for path, source in sources.items() if all(map(eq, path, finding.path))]
    if near:
        return f"{' and '.join(near)}: {finding.key}: {finding.message}"
    return f"with {' and '.join(sources.values())}, {finding.key}: {finding.message}"
