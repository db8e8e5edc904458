"""Selection of the gate's rules for each file, and settings of the nearest busplan.toml or pyproject.toml."""

import os
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path, PurePath
from typing import Annotated, Any, Final, Literal, NamedTuple, NoReturn

from pydantic import BaseModel, Field, ValidationError

from busplan.english import did_you_mean
from busplan.errors import BusplanError
from busplan.gate.rules import NEVER_SUPPRESSED, all_rules
from busplan.profile.document import Document, decode, read_bytes
from busplan.profile.sources import SETTINGS_FILE

_PYPROJECT: Final = "pyproject.toml"


class Selection(NamedTuple):
    """Rules that count. The longest beginning of a code that fits decides; in a tie, `ignore` does."""

    select: tuple[str, ...] = ()
    """Beginnings of codes that count; empty for all rules."""
    ignore: tuple[str, ...] = ()
    per_file_ignores: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """Beginnings of codes that do not count, by pattern of the path."""

    def reason(self, code: str, path: str) -> str:
        """Reason why a finding of a rule does not count for a profile; empty where it does."""
        if code in NEVER_SUPPRESSED:
            return ""
        chosen, ignored = (
            max((len(start) for start in starts if code.startswith(start)), default=-1)
            for starts in (self.select, self.ignore)
        )
        if self.select and chosen < 0:
            return f"not selected by {', '.join(self.select)}"
        if ignored >= 0 and ignored >= chosen:
            return f"ignored by {', '.join(self.ignore)}"
        for pattern, starts in self.per_file_ignores:
            if any(map(code.startswith, starts)) and _matches(path, pattern):
                return f"ignored for {pattern}"
        return ""


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _matches(path: str, pattern: str) -> bool:
    """Whether a pattern fits a path, or its name alone, as in ruff."""
    return fnmatch(_relative(Path(path), Path.cwd()), pattern) or fnmatch(PurePath(path).name, pattern)


EVERY_RULE: Final = Selection()


def checked_codes(starts: Iterable[str], *, name: str) -> tuple[str, ...]:
    """Beginnings of codes. Each must fit a rule that can be suppressed, or BusplanError is raised."""
    codes = tuple(starts)
    for start in codes:
        rules = [code for code in all_rules() if code.startswith(start)] if start else []
        if not rules:
            hint = "; ".join(filter(None, (did_you_mean(start, all_rules()), "`busplan rule` lists them")))
            raise BusplanError(f"{name} {start or repr(start)}: no rule has a code that begins so; {hint}")
        if all(code in NEVER_SUPPRESSED for code in rules):
            raise BusplanError(f"{name} {start}: {', '.join(rules)} cannot be ignored; correct what they find")
    return codes


class Settings(NamedTuple):
    """Settings of a file by name of their option."""

    values: Mapping[str, Any]
    folder: Path
    """Folder of the file."""

    def option(self, name: str, given: Any, default: Any) -> Any:
        """Value of an option as given, else from the settings, else the default. A path is made relative."""
        if given is not None or name not in self.values:
            return default if given is None else given
        value = self.values[name]
        if name == "baseline":
            return Path(self._path(value))
        if name == "per-file-ignores":
            # A name alone stands for files in any folder.
            return {self._path(pattern) if "/" in pattern else pattern: codes for pattern, codes in value.items()}
        return value

    def _path(self, written: str) -> str:
        return _relative(self.folder / written, Path.cwd())


_Codes = Annotated[list[str], Field(description='a list of rule codes or their beginnings, as ["BP112", "BP3"]')]


class _Table(BaseModel, strict=True, extra="forbid", alias_generator=lambda name: name.replace("_", "-")):
    """Settings of a file by name of their option; a description says which value is expected."""

    select: _Codes = []
    ignore: _Codes = []
    per_file_ignores: Annotated[
        dict[str, list[str]],
        Field(description='lists of rule codes by pattern of the path, as {"old/*.toml" = ["BP112"]}'),
    ] = {}
    fail_on: Annotated[Literal["error", "warning"], Field(description='"error" or "warning"')] = "error"
    baseline: Annotated[str, Field(description="a path")] = ""
    circle: Annotated[bool, Field(description="true or false")] = True
    circle_steps: Annotated[int, Field(description="a whole number")] = 0
    skip_others: Annotated[bool, Field(description="true or false")] = False
    jobs: Annotated[int, Field(description="a whole number")] = 0


_EXPECTED: Final = {str(field.alias): field.description for field in _Table.model_fields.values()}
"""Expected value of each key, in words."""


def nearest_settings(folder: Path) -> Settings:
    """Settings of a folder or the nearest one above it: of busplan.toml, or else of pyproject.toml.

    A file that is not TOML, an unknown key or a wrong value raises BusplanError, with its place.
    """
    for place in (folder, *folder.parents):
        for name, sections in ((SETTINGS_FILE, ()), (_PYPROJECT, ("tool", "busplan"))):
            path = place / name
            if not path.is_file():
                continue
            shown = _relative(path, folder)
            document = decode(read_bytes(path, name=shown), name=shown)
            table: Any = document.data()
            for section in sections:
                table = table.get(section, {}) if isinstance(table, dict) else {}
            if table or not sections:
                return Settings(_checked(table, sections, document), place)
    return Settings({}, folder)


def _checked(table: Any, sections: Sequence[str], document: Document) -> dict[str, Any]:
    def refuse(key: str, words: str) -> NoReturn:
        spot = document.spot((*sections, key))
        raise BusplanError(f"{document.name}:{spot.line}:{spot.column}: {key}: {words}")

    if not isinstance(table, dict):
        *sections, last = sections
        refuse(last, "expected a table")
    try:
        values = _Table.model_validate(table).model_dump(by_alias=True, exclude_unset=True)
    except ValidationError as error:
        key = str(error.errors()[0]["loc"][0])
        hint = did_you_mean(key, _EXPECTED) or f"known here: {', '.join(_EXPECTED)}"
        refuse(key, f"expected {_EXPECTED[key]}" if key in _EXPECTED else f"unknown key; {hint}")
    codes_of: list[tuple[str, Any]] = [(key, values.get(key, ())) for key in ("select", "ignore")]
    codes_of += [("per-file-ignores", codes) for codes in values.get("per-file-ignores", {}).values()]
    for key, codes in codes_of:
        try:
            checked_codes(codes, name=key)
        except BusplanError as error:
            refuse(key, error.problems[0].removeprefix(f"{key} "))
    return values
