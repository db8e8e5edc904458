"""What a profile lost against its baseline, and the keys that changed since: one finding."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from busplan.buses.figure import (
    MARGIN,
    MARGIN_CORRECTED,
    MAX_AXES,
    MAX_NODES,
    SAFE_AXES,
    SAFE_NODES,
    by_key,
)
from busplan.buses.rule import RuleProblem, told_apart
from busplan.errors import BusplanError
from busplan.gate.baseline import Record, figures_of, keys_of
from busplan.gate.finding import Subject
from busplan.profile.keys import default_of, flat
from busplan.profile.toml import LoadedProfile, override
from busplan.profile.write import value_text

_ROUNDING: Final = 1e-9
"""Relative tolerance for rounding by JSON or by another machine."""
_MOST_NAMED: Final = 3
"""Most keys that a finding names."""
_LONGEST: Final = 30
"""Longest value that a finding repeats in full."""
_NAMES: Final = by_key((SAFE_NODES, SAFE_AXES, MARGIN_CORRECTED, MAX_NODES, MAX_AXES, MARGIN))
"""Figures of a baseline, in the order in which a finding says them."""


class ChangedValue(NamedTuple):
    """A value that was recorded, and that of today."""

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
    yield RuleProblem(key, words, "if that is meant, record it with --update-baseline")


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
    found = {key: one for key, one in changed.items() if _wins_back(subject, key, one.before, lost)}
    return found or changed


def _changed(subject: Subject, before: Mapping[str, object]) -> dict[str, ChangedValue]:
    """Keys with another value than recorded; one that a file does not say has its default."""
    profile = subject.profile
    values, said = dict(flat(profile.model_dump(mode="json"))), keys_of(profile)
    found: dict[str, ChangedValue] = {}
    for key in dict.fromkeys((*said, *before)):
        one = ChangedValue(before[key] if key in before else default_of(profile, key), values.get(key))
        if one.before != one.now:
            found[key] = one
    return found


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
    first, *others = (f"{_shown(one.now)}, was {_shown(one.before)}" for one in changes.values())
    named = [f"{key} = {words}" for key, words in zip(list(changes)[1:], others, strict=True)][: _MOST_NAMED - 1]
    more = len(changes) - 1 - len(named)
    return "; ".join((first, *named, *([f"and {more} more"] if more else ())))


def _shown(value: object) -> str:
    if value is None:
        return "not set"
    text = f"{value:.12g}" if isinstance(value, float) else value_text(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _figures(lost: Mapping[str, tuple[float, float]], *, deciding: str) -> str:
    """Say what fell: first by the timing model that decides, then by the others."""
    by_model: dict[str, list[str]] = {deciding: []}
    for name in sorted(lost, key=_order):
        model, _, figure = name.partition(".")
        by_model.setdefault(model, []).append(_fell(figure, *lost[name]))
    said = (
        f"{'' if model == deciding else f'by the {model} timing '}{', '.join(words)}"
        for model, words in by_model.items()
        if words
    )
    # The first says the verb for all of them.
    return "; ".join(said).replace(" from ", " fell from ", 1)


def _order(name: str) -> int:
    return list(_NAMES).index(name.rpartition(".")[2])


def _fell(figure: str, before: float, now: float) -> str:
    section, _, last = figure.rpartition(".")
    one = _NAMES[last]
    of_group = f" of {section.partition('.')[2]}" if section else ""
    if not one.unit:
        return f"{one.label}{of_group} from {before:g} to {now:g}"
    was, is_ = told_apart(before, now)
    return f"{one.label}{of_group} from {was} to {is_} {one.unit}"
