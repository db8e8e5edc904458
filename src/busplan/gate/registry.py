"""All rules of the gate by code. Codes are stable: a dropped code is never used again."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Final

from busplan.buses import kind_named, kind_names
from busplan.buses.bus import Bus
from busplan.buses.rule import Rule
from busplan.gate import bus, circle
from busplan.gate.file import BY_KIND

BASELINE: Final = Rule(
    "BP301",
    "baseline-regression",
    "error",
    "the profile lost axes or margin against the baseline",
    "`--baseline FILE` holds what each profile could carry when it was recorded, axes and margin under every timing "
    "model, and the keys that its file said. The finding is at the changed key that costs some of it; a baseline "
    "without keys has it at the name. A change that costs must be meant: record it with `--update-baseline`, so that "
    "the review sees it.",
)
SUPPRESSION_WITHOUT_REASON: Final = Rule(
    "BP901",
    "suppression-without-reason",
    "warning",
    "a suppression says no reason",
    "`# busplan: ignore[CODE] reason` needs its reason: the next reader must be able to judge whether it still holds.",
)
SUPPRESSION_WITHOUT_EFFECT: Final = Rule(
    "BP902",
    "suppression-without-effect",
    "warning",
    "a suppression suppresses nothing",
    "No finding of that code stands on its line, or on the line below when the comment stands alone. What it was "
    "for has been mended or has moved: remove it, so that it hides nothing new. A code that does not exist has no "
    "effect either.",
)

NEVER_SUPPRESSED: Final = frozenset(
    rule.code for rule in (*BY_KIND.values(), SUPPRESSION_WITHOUT_REASON, SUPPRESSION_WITHOUT_EFFECT)
)
"""Rules that cannot be suppressed: those of the file format and of suppressions."""


def all_rules() -> Mapping[str, Rule]:
    """Every rule by code, including those of every kind of bus, sorted by code."""
    return _by_code(tuple(map(kind_named, kind_names())))


@cache
def _by_code(kinds: tuple[Bus, ...]) -> Mapping[str, Rule]:
    own = (rule for kind in kinds for rule in kind.rules)
    others = (*BY_KIND.values(), BASELINE, SUPPRESSION_WITHOUT_REASON, SUPPRESSION_WITHOUT_EFFECT)
    found = (*bus.RULES, *own, *circle.RULES, *others)
    return MappingProxyType({rule.code: rule for rule in sorted(found, key=lambda rule: rule.code)})


def cycle_rules(kind: str) -> tuple[Rule, ...]:
    """Rules for profiles of a kind of bus, sorted by code."""
    return tuple(sorted((*bus.RULES, *kind_named(kind).rules), key=lambda rule: rule.code))
