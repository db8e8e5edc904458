"""The baseline: recorded axes and margins of each profile, by path and figure."""

import json
from collections.abc import Iterator, Mapping
from sys import float_info
from typing import Final, NamedTuple

from busplan.buses.rule import RuleProblem
from busplan.errors import BusplanError
from busplan.printable import json_text
from busplan.rules.finding import Subject

_SCHEMA: Final = 1
MODELS: Final = 2
"""Version of the timing models that the figures come from; figures of another version are not compared."""
MAX_BASELINE_BYTES: Final = 32_000_000
"""At 200 bytes for each profile, enough for any repository; a larger file is something else."""
_ROUNDING: Final = 1e-9
"""Relative tolerance for rounding by JSON or by another machine."""

_CURE: Final = "remove it, and record one with --update-baseline"
"""A file that is not a baseline is never overwritten."""

Recorded = Mapping[str, float]
"""Figures of one profile by name: "paper.max_axes"."""


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


def regressions(now: Recorded, before: Recorded) -> Iterator[RuleProblem]:
    """Figures that have become smaller than recorded."""
    for name, value in now.items():
        if name not in before:
            continue
        lost = before[name] - value
        if lost > _ROUNDING * max(abs(before[name]), 1.0):
            model, _, figure = name.partition(".")
            section, _, last = figure.rpartition(".")
            key = f"{section}.nodes" if section else "bus.nodes" if last.endswith("_axes") else "cycle.period_us"
            yield RuleProblem(
                key,
                f"{figure} under the {model} timing fell to {value:.12g} from the {before[name]:.12g} of the baseline",
            )


class Baseline(NamedTuple):
    """A recorded baseline."""

    profiles: dict[str, dict[str, float]]
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
    models = document.get("models", 1)
    if not isinstance(models, int) or isinstance(models, bool):
        raise BusplanError(f"{name}: a damaged baseline; {_CURE}")
    return Baseline(profiles, models)


def _are_figures(value: object) -> bool:
    return isinstance(value, dict) and all(
        isinstance(one, int | float) and not isinstance(one, bool) and abs(one) <= float_info.max
        for one in value.values()
    )


def write_baseline(recorded: Mapping[str, Recorded]) -> str:
    """Write a baseline, sorted by path so that diffs are small."""
    document = {
        "schema": _SCHEMA,
        "command": "baseline",
        "models": MODELS,
        "profiles": {path: dict(recorded[path]) for path in sorted(recorded)},
    }
    return json_text(document, indent=2) + "\n"
