"""Baseline: recorded axes and margins of each profile, and losses of a profile against them."""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from pydantic import BaseModel, Field, ValidationError

from busplan.buses import kind_named, kind_names
from busplan.buses.figure import (
    MARGIN,
    MARGIN_CORRECTED,
    MAX_AXES,
    MAX_NODES,
    SAFE_AXES,
    SAFE_NODES,
    BusFigures,
    Figure,
    by_key,
)
from busplan.buses.rule import RuleProblem
from busplan.english import first_of, plural, to_json, told_apart
from busplan.errors import BusplanError
from busplan.gate.finding import Subject
from busplan.profile.document import LoadedProfile, override, read_bytes
from busplan.profile.edit import value_text
from busplan.profile.kinds import default_of, flat
from busplan.profile.sources import ProfileSource, claims, shipped_names
from busplan.questions.fit.figures import capacity_figures
from busplan.questions.fit.network import model_names
from busplan.sections.profile import Profile

_SCHEMA: Final = 1
MODELS: Final = 2
"""Version of the timing models behind the figures; figures of another version are not compared."""
MAX_BASELINE_BYTES: Final = 32_000_000
"""Size limit of a baseline [bytes]: enough for any repository at 200 bytes for each profile."""
_REMEDY: Final = "remove it, and record one with --update-baseline"
"""Remedy for a file that is no baseline, which is never overwritten."""

_TEXT_KEYS: Final = ("schema_version", "name", "description")
"""Text keys, which no figure depends on; they are not recorded."""


class Record(NamedTuple):
    """A baseline's entry for one profile."""

    figures: Mapping[str, float]
    """Figures by name, as "paper.max_axes"."""
    keys: Mapping[str, object] | None = None
    """Values in the file by dotted key; None in a baseline that does not record them."""
    findings: tuple[str, ...] = ()
    """Known findings in the form of `known_as`; they no longer count."""


def known_as(code: str, key: str) -> str:
    """Name of a finding in a baseline: its rule and its key, whatever the line."""
    return f"{code} {key}"


def figures_of(subject: Subject) -> dict[str, float]:
    """Figures of a profile to record, by name."""
    figures: dict[str, float | None] = {}
    for model in sorted(model_names(subject.network)):
        capacity = capacity_figures(subject.network, model=model)
        values, names = capacity.values(), ["max_axes", "margin_us", "safe_axes", "margin_corrected_us"]
        names += [
            f"group.{group.name}.{name}" for group in subject.profile.group for name in ("max_nodes", "safe_nodes")
        ]
        if not subject.profile.has_cycle:
            names += [figure.key for figure in _loads(capacity.bus_figures)]
        figures |= {f"{model}.{name}": values[name] for name in names}
    return {name: value for name, value in figures.items() if value is not None}


def keys_of(profile: Profile) -> dict[str, object]:
    """Values of a profile to record, by dotted key: those that its file sets."""
    values = flat(profile.model_dump(mode="json", exclude_unset=True))
    return {key: value for key, value in values if key not in _TEXT_KEYS}


def _loads(register: BusFigures) -> Iterable[Figure]:
    """Figures of a kind of bus that are worse when larger, as the load."""
    return (figure for figure in register.compared if figure.better == "less")


_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Scalar = bool | str | int | _Finite


class _File(BaseModel, strict=True):
    """File of a baseline: figures, values of keys and findings of each profile."""

    profiles: dict[str, dict[str, _Finite]]
    models: int = 1
    keys: dict[str, dict[str, _Scalar | list[_Scalar]]] = {}
    findings: dict[str, list[str]] = {}


class Baseline(NamedTuple):
    """A recorded baseline."""

    profiles: dict[str, Record]
    """Records by path of the profile, relative to the folder of the baseline's file. Shipped profiles are named."""
    models: int
    """Version of the timing models."""
    path: Path | None = None
    """File of the baseline; without one, paths are relative to the working folder."""

    @property
    def is_current(self) -> bool:
        """Whether the figures come from the present timing models, so that they can be compared."""
        return self.models == MODELS

    def __str__(self) -> str:
        return "baseline" if self.path is None else str(self.path)

    def name_of(self, source: ProfileSource) -> str:
        """Name of a profile's record, whatever the working folder."""
        if source.is_shipped:
            return Path(source.name).stem
        # Links to folders are resolved; a link that is the file itself is not. Standard input counts as the file that
        # it is named after.
        path = Path(source.name)
        return Path(os.path.relpath(os.path.realpath(path.parent) / Path(path.name), self._folder)).as_posix()

    @property
    def _folder(self) -> Path:
        return Path.cwd() if self.path is None else Path(os.path.realpath(self.path)).parent

    def without_profile(self, checked: Iterable[str]) -> list[str]:
        """Names of records without a profile, apart from those of checked profiles."""
        left = self.profiles.keys() - set(checked) - set(shipped_names())
        return sorted(name for name in left if not (self._folder / name).is_file() or not claims(self._folder / name))

    def unmatched(self, profiles: Sequence[str], *, checked: Iterable[str]) -> str:
        """Message on profiles without a record and records without a profile; empty where there are none.

        `profiles` are paths as the message names them; `checked` are the names of the checked profiles' records.
        """
        records = self.without_profile(checked)
        counts = (
            f"{plural(len(names), noun)} ha{'s' if len(names) == 1 else 've'} no {partner} "
            f"({first_of(names, _MOST_NAMED)})"
            for names, noun, partner in ((profiles, "profile", "record"), (records, "record", "profile"))
            if names
        )
        words = ", ".join(counts)
        cure = "use --update-baseline to add or drop these records, or --pass-on-unmatched to accept them"
        return f"{self}: {words}; {cure}" if words else ""


def load_baseline(path: Path) -> Baseline:
    """Read the file of a baseline.

    A file that is missing or unreadable, or no baseline of this version, raises BusplanError.
    """
    if not path.exists():
        raise BusplanError(f"{path}: no such file; record it with --update-baseline")
    # Absolute, because "-" would mean standard input.
    content = read_bytes(path.absolute(), name=str(path), limit=MAX_BASELINE_BYTES)
    if len(content) > MAX_BASELINE_BYTES:
        raise BusplanError(
            f"{path}: is larger than {MAX_BASELINE_BYTES:,} bytes, so it is not a baseline; give another"
        )
    try:
        text = content.decode()
    except UnicodeDecodeError:
        raise BusplanError(f"{path}: is not UTF-8, so it is not a baseline; give another") from None
    return read_baseline(text, name=str(path))._replace(path=path)


def read_baseline(text: str, *, name: str) -> Baseline:
    """Read a recorded baseline; text that is none of this version raises BusplanError."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise BusplanError(f"{name}: not JSON, so not a baseline; {_REMEDY}") from None
    if not isinstance(document, dict) or document.get("command") != "baseline" or document.get("schema") != _SCHEMA:
        raise BusplanError(f"{name}: no baseline of this version; {_REMEDY}")
    try:
        file = _File.model_validate(document)
    except ValidationError:
        raise BusplanError(f"{name}: a damaged baseline; {_REMEDY}") from None
    records = {
        path: Record(figures, file.keys.get(path), tuple(file.findings.get(path, ())))
        for path, figures in file.profiles.items()
    }
    return Baseline(records, file.models)


def write_baseline(recorded: Mapping[str, Record]) -> str:
    """Write a baseline, sorted by path so that diffs are small."""
    by_path = {path: recorded[path] for path in sorted(recorded)}
    document = {
        "schema": _SCHEMA,
        "command": "baseline",
        "models": MODELS,
        "profiles": {path: dict(record.figures) for path, record in by_path.items()},
        "keys": {path: dict(record.keys) for path, record in by_path.items() if record.keys is not None},
        "findings": {path: list(record.findings) for path, record in by_path.items() if record.findings},
    }
    return to_json(document)


_ROUNDING: Final = 1e-9
"""Relative tolerance for rounding by JSON or by another machine."""
_MOST_NAMED: Final = 3
"""Keys that a finding names, and files that a message names, at most."""
_LONGEST: Final = 30
"""Length up to which a finding repeats a value in full [characters]."""
_MOST_FIGURES: Final = 3
"""Figures that a finding names, at most; the diff of a new record shows all."""


class ChangedValue(NamedTuple):
    """A recorded value, and the present one."""

    before: object
    now: object


def regression(subject: Subject, recorded: Record) -> Iterator[RuleProblem]:
    """Losses of a profile against its record, at the first changed key that explains them, or at its name.

    Without recorded keys, no change can explain them.
    """
    lost = worse(figures_of(subject), recorded.figures)
    if not lost:
        return
    figures = _words(lost, deciding=subject.deciding.timing_model)
    changes = {} if recorded.keys is None else _causes(subject, recorded.keys, lost)
    if changes:
        key, words = next(iter(changes)), f"{_keys(changes)}: {figures}"
    else:
        key, words = "name", figures
    yield RuleProblem(key, words, "if that is meant, record it with --update-baseline, whose diff shows every figure")


def worse(now: Mapping[str, float], before: Mapping[str, float]) -> dict[str, tuple[float, float | None]]:
    """Recorded figures that have become worse, with the recorded and the present value, None if it no longer exists."""
    return {
        name: (value, now.get(name)) for name, value in before.items() if _is_worse(name, now.get(name), than=value)
    }


def _is_worse(name: str, value: float | None, *, than: float | None) -> bool:
    if value is None or than is None:
        return value is None and than is not None
    loss = value - than if _figure(name).better == "less" else than - value
    return loss > _ROUNDING * max(abs(than), 1.0)


def _figure(name: str) -> Figure:
    """Figure of a recorded name; one that no bus has any more is labelled by its key."""
    key = name.rpartition(".")[2]
    return _figures().get(key) or Figure(key, "", "", "", key.replace("_", " "))


@cache
def _figures() -> Mapping[str, Figure]:
    """Figures of a baseline by key, in the order in which a finding names them."""
    margins = (MARGIN_CORRECTED, SAFE_NODES, SAFE_AXES, MARGIN, MAX_NODES, MAX_AXES)
    return by_key((*margins, *chain.from_iterable(_loads(kind_named(kind).figures) for kind in kind_names())))


def _causes(subject: Subject, before: Mapping[str, object], lost: Mapping[str, object]) -> dict[str, ChangedValue]:
    """Changed keys whose recorded value alone would win back some of the loss; all changed keys if none would."""
    changed = _changed(subject, before)
    causes = {key: change for key, change in changed.items() if _wins_back(subject, key, change.before, lost)}
    return causes or changed


def _changed(subject: Subject, before: Mapping[str, object]) -> dict[str, ChangedValue]:
    """Keys with another value than recorded; a key that a file leaves out has its default."""
    profile = subject.profile
    values = dict(flat(profile.model_dump(mode="json")))
    changed: dict[str, ChangedValue] = {}
    for key in dict.fromkeys((*keys_of(profile), *before)):
        change = ChangedValue(before[key] if key in before else default_of(profile, key), values.get(key))
        if change.before != change.now:
            changed[key] = change
    return changed


def _wins_back(subject: Subject, key: str, value: object, lost: Mapping[str, object]) -> bool:
    """Whether the recorded value of one key wins back some of the loss."""
    try:
        profile = override(subject.profile, {key: value})
    except BusplanError:  # The value depends on others, or its group is gone.
        return False
    now, then = figures_of(subject), figures_of(Subject(LoadedProfile(profile, subject.document)))
    return any(_is_worse(name, now.get(name), than=then.get(name)) for name in lost)


def _keys(changes: Mapping[str, ChangedValue]) -> str:
    """Words on changed keys; the first one has no name, because the finding begins with it."""
    first, *rest = (f"{_shown(value.now)}, was {_shown(value.before)}" for value in changes.values())
    named = [f"{key} = {words}" for key, words in zip(list(changes)[1:], rest, strict=True)][: _MOST_NAMED - 1]
    more = len(changes) - 1 - len(named)
    return "; ".join((first, *named, *([f"and {more} more"] if more else ())))


def _shown(value: object) -> str:
    if value is None:
        return "not set"
    text = f"{value:.12g}" if isinstance(value, float) else value_text(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _words(lost: Mapping[str, tuple[float, float | None]], *, deciding: str) -> str:
    """Words on worse figures: the margin first, and the deciding timing model before others."""
    order = list(_figures())

    def place(name: str) -> tuple[bool, int]:
        key = _figure(name).key
        return not name.startswith(f"{deciding}."), order.index(key) if key in order else len(order)

    phrases, verb = [], ""
    for name in sorted(lost, key=place)[:_MOST_FIGURES]:
        model, _, path = name.partition(".")
        figure, before = _figure(name), verb
        verb = " rose" if figure.better == "less" else " fell"
        by_model = "" if model == deciding else f" by the {model} timing"
        # Figures in a row that share a verb have it once.
        phrases.append(
            f"{_label(path, figure)}{verb if verb != before else ''} {_change(figure, *lost[name])}{by_model}"
        )
    more = len(lost) - len(phrases)
    words = ", ".join(phrases)
    return f"{words}, and {more} more" if more else words


def _label(path: str, figure: Figure) -> str:
    """Name of a figure and of its group."""
    section = path.rpartition(".")[0]
    return f"{figure.label} of {section.partition('.')[2]}" if section else figure.label


def _change(figure: Figure, before: float, now: float | None) -> str:
    unit, factor = (" %", 100) if figure.column == "%" else (f" {figure.unit}" if figure.unit else "", 1)
    if now is None:
        return f"from {factor * before:.6g}{unit} to none"
    if not unit:
        return f"from {before:g} to {now:g}"
    was, is_ = told_apart(factor * before, factor * now)
    return f"from {was} to {is_}{unit}"
