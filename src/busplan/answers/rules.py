"""`busplan rule`: the rules of the gate as data and as text."""

import textwrap
from collections.abc import Sequence
from typing import Any, Final

from busplan.buses.rule import Rule
from busplan.forms.lines import plain_text, table
from busplan.rules.registry import NEVER_SUPPRESSED

_WIDTH: Final = 88


def rule_rows(rules: Sequence[Rule]) -> list[dict[str, Any]]:
    """Rules as data."""
    return [
        {
            "code": rule.code,
            "rule": rule.name,
            "severity": rule.severity,
            "summary": rule.summary,
            "explanation": rule.explanation,
        }
        for rule in rules
    ]


def rule_table(rules: Sequence[Rule]) -> str:
    """One line a rule."""
    rows = ([rule.code, rule.name, rule.severity, rule.summary] for rule in rules)
    return plain_text(table(["code", "rule", "severity", "what is wrong"], rows, left=4))


def rule_page(rule: Rule) -> str:
    """All that is to say of one rule."""
    explanation = textwrap.fill(rule.explanation, _WIDTH)
    suppression = (
        "It cannot be suppressed."
        if rule.code in NEVER_SUPPRESSED
        else "Suppress it with a reason, on its line or alone on the line above:\n\n"
        f"  # busplan: ignore[{rule.code}] reason"
    )
    return f"{rule.code} {rule.name} ({rule.severity}): {rule.summary}\n\n{explanation}\n\n{suppression}\n"
