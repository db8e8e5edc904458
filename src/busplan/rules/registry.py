"""All rules of the gate by code. Codes are stable: one that is dropped is never used again."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from busplan.rules import bus, circle
from busplan.rules.file import BY_KIND
from busplan.rules.finding import Rule

BASELINE: Final = Rule(
    "BP301",
    "baseline-regression",
    "error",
    "the profile lost axes or margin against the baseline",
    "`--baseline FILE` holds what each profile could carry when it was recorded: axes and margin under both "
    "timing models. A change that costs some of it must be meant: record it with `--update-baseline`, so that the "
    "review sees it.",
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
"""Codes of what must be mended: a file that cannot be read further, and suppressions themselves."""

RULES: Final[Mapping[str, Rule]] = MappingProxyType(
    {
        rule.code: rule
        for rule in (
            *BY_KIND.values(),
            *bus.RULES,
            *circle.RULES,
            BASELINE,
            SUPPRESSION_WITHOUT_REASON,
            SUPPRESSION_WITHOUT_EFFECT,
        )
    }
)
