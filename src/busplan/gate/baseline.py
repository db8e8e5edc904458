"""The baseline: recorded axes and margins of each profile by path and figure, and the keys they came from."""

import json
from collections.abc import Mapping
from math import isfinite
from sys import float_info
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.gate.finding import Subject
from busplan.printable import json_text
from busplan.profile.keys import flat
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
    """What a baseline holds of one profile."""

    figures: Mapping[str, float]
    """By name: "paper.max_axes"."""
    keys: Mapping[str, object] | None = None
    """What the file said, by dotted key; None in a baseline that does not record it."""


def figures_of(subject: Subject) -> dict[str, float]:
    """Figures of a profile to record, by name."""
    found: dict[str, float | None] = {}
    for one in sorted((subject.deciding, *subject.others), key=lambda one: one.timing_model):
        for name in ("max_axes", "margin_us", "safe_axes", "margin_corrected_us"):
            found[f"{one.timing_model}.{name}"] = getattr(one, name)
        for group in one.groups:
            for name in ("max_nodes", "safe_nodes"):
                found[f"{one.timing_model}.group.{group.name}.{name}"] = getattr(group, name)
    return {name: value for name, value in found.items() if value is not None}


def keys_of(profile: Profile) -> dict[str, object]:
    """Keys of a profile to record: those that its file says."""
    said = flat(profile.model_dump(mode="json", exclude_unset=True))
    return {key: value for key, value in said if key not in _WORDS}


class Baseline(NamedTuple):
    """A recorded baseline."""

    profiles: dict[str, Record]
    models: int
    """Version of the timing models."""

    @property
    def is_current(self) -> bool:
        """Whether its figures may be compared with those of today."""
        return self.models == MODELS


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
        isinstance(one, bool | str | int) or (isinstance(one, float) and isfinite(one))
        for one in (value if isinstance(value, list) else [value])
    )


def _are_figures(value: object) -> bool:
    return isinstance(value, dict) and all(
        isinstance(one, int | float) and not isinstance(one, bool) and abs(one) <= float_info.max
        for one in value.values()
    )


def write_baseline(recorded: Mapping[str, Record]) -> str:
    """Write a baseline, sorted by path so that diffs are small."""
    each = {path: recorded[path] for path in sorted(recorded)}
    document = {
        "schema": _SCHEMA,
        "command": "baseline",
        "models": MODELS,
        "profiles": {path: dict(one.figures) for path, one in each.items()},
        "keys": {path: dict(one.keys) for path, one in each.items() if one.keys is not None},
    }
    return json_text(document, indent=2) + "\n"
