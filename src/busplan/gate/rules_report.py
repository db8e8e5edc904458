"""Answer of `busplan rule`: the rules of the gate."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.buses.rule import Rule
from busplan.forms.blocks import (
    Block,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    Snippet,
    Table,
    TableColumn,
    TableRow,
)
from busplan.gate.registry import NEVER_SUPPRESSED
from busplan.questions.words.documents import document

_COLUMNS: Final = (
    *(TableColumn(heading, kind="words") for heading in ("code", "rule", "severity")),
    TableColumn("what is wrong", kind="words", wraps=True),
)


def rules_report(rules: Sequence[Rule]) -> Report:
    """Report of `rule` with one line for each rule.

    Parameters
    ----------
    rules
        The rules.
    """
    return Report(
        Sentence(("Rules of the gate",)),
        lambda: (_table(rules),),
        partial(_document, rules),
        lambda: _records(rules),
    )


def rule_report(rule: Rule) -> Report:
    """Report of `rule CODE` with the explanation of one rule.

    Parameters
    ----------
    rule
        The rule.
    """
    return Report(
        Sentence((Code(rule.code), f" {rule.name}")),
        lambda: tuple(_blocks(rule)),
        partial(_document, [rule]),
        lambda: _records([rule]),
    )


def _table(rules: Sequence[Rule]) -> Table:
    rows = (TableRow((Code(rule.code), rule.name, rule.severity, rule.summary)) for rule in rules)
    return Table(_COLUMNS, tuple(rows))


def _blocks(rule: Rule) -> Iterator[Block]:
    yield Sentence((Code(rule.code), f" {rule.name} ({rule.severity}): {rule.summary}"))
    yield Sentence((rule.explanation,))
    if rule.code in NEVER_SUPPRESSED:
        yield Sentence(("It cannot be suppressed.",))
    else:
        yield Sentence(("Suppress it with a reason, on its line or alone on the line above:",))
        yield Snippet((f"# busplan: ignore[{rule.code}] reason",))


def _document(rules: Sequence[Rule]) -> JsonDocument:
    return document("rule", rules=_records(rules))


def _records(rules: Sequence[Rule]) -> list[Record]:
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
