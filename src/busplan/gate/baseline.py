"""The baseline: recorded axes and margins of each profile, and what a profile has lost since."""

import json
from collections.abc import Iterator, Mapping
from math import isfinite
from pathlib import Path
from sys import float_info
from typing import Final, NamedTuple

from busplan.buses.figure import MARGIN, MARGIN_CORRECTED, MAX_AXES, MAX_NODES, SAFE_AXES, SAFE_NODES, by_key
from busplan.buses.rule import RuleProblem, told_apart
from busplan.errors import BusplanError
from busplan.gate.finding import Subject
from busplan.printable import to_json
from busplan.profile.keys import default_of, flat
from busplan.profile.toml import LoadedProfile, override, read_bytes
from busplan.profile.write import value_text
from busplan.questions.fit.figures import capacity_figures
from busplan.questions.fit.network import model_names
from busplan.sections.profile import Profile

_SCHEMA: Final = 1
MODELS: Final = 2
"""Version of the timing models that the figures come from; figures of another version are not compared."""
MAX_BASELINE_BYTES: Final = 32_000_000
"""At 200 bytes for each profile, enough for any repository; a larger file is something else."""
_CURE: Final = "remove it, and record one with --update-baseline"
"""A file that is not a baseline is never overwritten."""

_WORDS: Final = ("schema_version", "name", "description")
"""Keys that no figure depends on; they are not recorded."""


class Record(NamedTuple):
    """A baseline's entry for one profile."""

    figures: Mapping[str, float]
    """By name: "paper.max_axes"."""
    keys: Mapping[str, object] | None = None
    """Values in the file, by dotted key; None in a baseline that does not record them."""


def figures_of(subject: Subject) -> dict[str, float]:
    """Figures of a profile to record, by name."""
    figures: dict[str, float | None] = {}
    for model in sorted(model_names(subject.network)):
        capacity = capacity_figures(subject.network, model=model)
        for name in ("max_axes", "margin_us", "safe_axes", "margin_corrected_us"):
            figures[f"{capacity.timing_model}.{name}"] = getattr(capacity, name)
        for group in capacity.groups:
            for name in ("max_nodes", "safe_nodes"):
                figures[f"{capacity.timing_model}.group.{group.name}.{name}"] = getattr(group, name)
    return {name: value for name, value in figures.items() if value is not None}


def keys_of(profile: Profile) -> dict[str, object]:
    """Values of a profile to record, by dotted key: those that its file sets."""
    said = flat(profile.model_dump(mode="json", exclude_unset=True))
    return {key: value for key, value in said if key not in _WORDS}


def record_of(name: str, recorded: Mapping[str, Record] | None) -> Record | None:
    """Record of a file in a baseline: an empty one where it has none; None without a baseline."""
    return None if recorded is None else recorded.get(name, Record({}))


class Baseline(NamedTuple):
    """A recorded baseline."""

    profiles: dict[str, Record]
    models: int
    """Version of the timing models."""

    @property
    def is_current(self) -> bool:
        """Whether its figures may be compared with those of today."""
        return self.models == MODELS


def load_baseline(path: Path) -> Baseline:
    """Read the file of a baseline.

    Raises
    ------
    BusplanError
        The file does not exist or cannot be read, or is no baseline of this version.
    """
    if not path.exists():
        raise BusplanError(f"{path}: no such file; record it with --update-baseline")
    # Absolute, because "-" would mean standard input.
    content = read_bytes(path.absolute(), name=str(path), limit=MAX_BASELINE_BYTES)
    if len(content) > MAX_BASELINE_BYTES:
        raise BusplanError(f"{path}: is larger than {MAX_BASELINE_BYTES:,} bytes, so it is no baseline; give another")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        raise BusplanError(f"{path}: is not UTF-8, so it is no baseline; give another") from None
    return read_baseline(text, name=str(path))


def read_baseline(text: str, *, name: str) -> Baseline:
    """Read a recorded baseline.

    Raises
    ------
    BusplanError
        It is not a baseline of this version.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise BusplanError(f"{name}: no JSON, so no baseline; {_CURE}") from None
    if not isinstance(document, dict) or document.get("command") != "baseline" or document.get("schema") != _SCHEMA:
        raise BusplanError(f"{name}: no baseline of this version; {_CURE}")
    profiles = document.get("profiles")
    if not isinstance(profiles, dict) or not all(map(_are_figures, profiles.values())):
        raise BusplanError(f"{name}: a damaged baseline; {_CURE}")
    models, keys = document.get("models", 1), document.get("keys", {})
    if not isinstance(models, int) or isinstance(models, bool) or not _are_keys(keys):
        raise BusplanError(f"{name}: a damaged baseline; {_CURE}")
    return Baseline({path: Record(figures, keys.get(path)) for path, figures in profiles.items()}, models)


def _are_keys(value: object) -> bool:
    return isinstance(value, dict) and all(
        isinstance(table, dict) and all(map(_is_value, table.values())) for table in value.values()
    )


def _is_value(value: object) -> bool:
    """Whether a value may be that of a key: a scalar or an array of scalars."""
    return all(
        isinstance(scalar, bool | str | int) or (isinstance(scalar, float) and isfinite(scalar))
        for scalar in (value if isinstance(value, list) else [value])
    )


def _are_figures(value: object) -> bool:
    return isinstance(value, dict) and all(
        isinstance(figure, int | float) and not isinstance(figure, bool) and abs(figure) <= float_info.max
        for figure in value.values()
    )


def write_baseline(recorded: Mapping[str, Record]) -> str:
    """Write a baseline, sorted by path so that diffs are small."""
    by_path = {path: recorded[path] for path in sorted(recorded)}
    document = {
        "schema": _SCHEMA,
        "command": "baseline",
        "models": MODELS,
        "profiles": {path: dict(record.figures) for path, record in by_path.items()},
        "keys": {path: dict(record.keys) for path, record in by_path.items() if record.keys is not None},
    }
    return to_json(document)


_ROUNDING: Final = 1e-9
"""Relative tolerance for rounding by JSON or by another machine."""
_MOST_NAMED: Final = 3
"""Most keys that a finding names."""
_LONGEST: Final = 30
"""Longest value that a finding repeats in full."""
_NAMES: Final = by_key((MARGIN_CORRECTED, SAFE_NODES, SAFE_AXES, MARGIN, MAX_NODES, MAX_AXES))
"""Figures of a baseline, in the order in which a finding says them."""
_MOST_FIGURES: Final = 3
"""Most figures that a finding says; the diff of a new record shows all."""


class ChangedValue(NamedTuple):
    """A recorded value, and the present one."""

    before: object
    now: object


def regression(subject: Subject, recorded: Record) -> Iterator[RuleProblem]:
    """Say what a profile lost against its record, at the first key that costs it, or at its name.

    Parameters
    ----------
    subject
        The profile.
    recorded
        Its record. One without keys cannot say which of them changed.
    """
    lost = fallen(figures_of(subject), recorded.figures)
    if not lost:
        return
    figures = _figures(lost, deciding=subject.deciding.timing_model)
    changes = {} if recorded.keys is None else _causes(subject, recorded.keys, lost)
    if changes:
        key, words = next(iter(changes)), f"{_keys(changes)}: {figures}"
    else:
        key, words = "name", figures
    yield RuleProblem(key, words, "if that is meant, record it with --update-baseline, whose diff shows every figure")


def fallen(now: Mapping[str, float], before: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Figures that have become smaller, each as it was and as it is."""
    return {
        name: (before[name], value) for name, value in now.items() if name in before and _is_less(value, before[name])
    }


def _is_less(value: float, before: float) -> bool:
    return before - value > _ROUNDING * max(abs(before), 1.0)


def _causes(subject: Subject, before: Mapping[str, object], lost: Mapping[str, object]) -> dict[str, ChangedValue]:
    """Changed keys whose recorded value alone would win back some of what was lost; all of them if none would."""
    changed = _changed(subject, before)
    causes = {key: change for key, change in changed.items() if _wins_back(subject, key, change.before, lost)}
    return causes or changed


def _changed(subject: Subject, before: Mapping[str, object]) -> dict[str, ChangedValue]:
    """Keys whose value differs from the recorded one; a key that a file leaves out has its default."""
    profile = subject.profile
    values, said = dict(flat(profile.model_dump(mode="json"))), keys_of(profile)
    changed: dict[str, ChangedValue] = {}
    for key in dict.fromkeys((*said, *before)):
        change = ChangedValue(before[key] if key in before else default_of(profile, key), values.get(key))
        if change.before != change.now:
            changed[key] = change
    return changed


def _wins_back(subject: Subject, key: str, value: object, lost: Mapping[str, object]) -> bool:
    """Whether a profile with the recorded value of one key has more of what was lost."""
    try:
        profile = override(subject.profile, {key: value})
    except BusplanError:  # a value that goes with others, or a group that is gone
        return False
    now, then = figures_of(subject), figures_of(Subject(LoadedProfile(profile, subject.document)))
    return any(name in then and _is_less(now[name], then[name]) for name in lost)


def _keys(changes: Mapping[str, ChangedValue]) -> str:
    """Say how keys changed; the finding begins with the first of them."""
    first, *others = (f"{_shown(value.now)}, was {_shown(value.before)}" for value in changes.values())
    named = [f"{key} = {words}" for key, words in zip(list(changes)[1:], others, strict=True)][: _MOST_NAMED - 1]
    more = len(changes) - 1 - len(named)
    return "; ".join((first, *named, *([f"and {more} more"] if more else ())))


def _shown(value: object) -> str:
    if value is None:
        return "not set"
    text = f"{value:.12g}" if isinstance(value, float) else value_text(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _figures(lost: Mapping[str, tuple[float, float]], *, deciding: str) -> str:
    """Say what fell: the margin first, and the figures of the deciding timing model before those of the others."""
    names = sorted(lost, key=lambda name: (not name.startswith(f"{deciding}."), _order(name)))
    said = []
    for name in names[:_MOST_FIGURES]:
        model, _, figure = name.partition(".")
        by_model = "" if model == deciding else f" by the {model} timing"
        said.append(f"{_fell(figure, *lost[name])}{by_model}")
    more = len(lost) - len(said)
    words = ", ".join(said).replace(" from ", " fell from ", 1)  # the first says the verb for all of them
    return f"{words}, and {more} more" if more else words


def _order(name: str) -> int:
    return list(_NAMES).index(name.rpartition(".")[2])


def _fell(figure: str, before: float, now: float) -> str:
    section, _, last = figure.rpartition(".")
    described = _NAMES[last]
    of_group = f" of {section.partition('.')[2]}" if section else ""
    if not described.unit:
        return f"{described.label}{of_group} from {before:g} to {now:g}"
    was, is_ = told_apart(before, now)
    return f"{described.label}{of_group} from {was} to {is_} {described.unit}"
