"""All rules of the gate by code, and the answer of `busplan rule`. A dropped code is never used again."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Final

from busplan.buses import kind_named, kind_names
from busplan.buses.bus import Bus
from busplan.buses.rule import Rule
from busplan.errors import BusplanError, ProblemKind
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
from busplan.gate import bus
from busplan.nearest import did_you_mean
from busplan.questions.words.documents import document, fields


def _read() -> Iterator[Rule]:
    """Rules of the gate's own file; a line break in an explanation is a space."""
    text = (files("busplan.gate") / "rules.toml").read_text(encoding="utf-8")
    for code, rule in tomllib.loads(text).items():
        words = " ".join(rule.pop("explanation").split())
        yield Rule(code, **rule, explanation=words, check=bus.CHECKS.get(code))


OWN: Final[Mapping[str, Rule]] = MappingProxyType({rule.code: rule for rule in _read()})
"""Rules common to all kinds of bus, by code."""
_FILE_CODES: Final[Mapping[ProblemKind, str]] = {
    "syntax": "BP001",
    "unknown-key": "BP002",
    "missing-key": "BP003",
    "wrong-type": "BP004",
    "out-of-range": "BP005",
    "inconsistent": "BP006",
    "execution-unknown": "BP007",
}
BY_KIND: Final = {kind: OWN[code] for kind, code in _FILE_CODES.items()}
"""Rules of the file format, by what reading a profile finds."""
BASELINE, SUPPRESSION_WITHOUT_REASON, SUPPRESSION_WITHOUT_EFFECT = (OWN[code] for code in ("BP301", "BP901", "BP902"))
RECORDING = OUTSIDE_PLAN, NOT_RECORDED, NOTHING_RECORDED = tuple(OWN[code] for code in ("BP401", "BP402", "BP403"))
"""Rules of a recording of the machine."""
NEVER_SUPPRESSED: Final = frozenset((*_FILE_CODES.values(), "BP901", "BP902"))
"""Codes that cannot be suppressed: those of the file format and of suppressions."""


def all_rules() -> Mapping[str, Rule]:
    """Every rule by code, including those of every kind of bus, sorted by code."""
    return _by_code(tuple(map(kind_named, kind_names())))


@cache
def _by_code(kinds: tuple[Bus, ...]) -> Mapping[str, Rule]:
    rules = (*OWN.values(), *(rule for kind in kinds for rule in kind.rules))
    return MappingProxyType({rule.code: rule for rule in sorted(rules, key=lambda rule: rule.code)})


def cycle_rules(kind: str) -> tuple[Rule, ...]:
    """Rules for profiles of a kind of bus, sorted by code."""
    return tuple(sorted((*map(OWN.__getitem__, bus.CHECKS), *kind_named(kind).rules), key=lambda rule: rule.code))


_COLUMNS: Final = (
    *(TableColumn(heading, kind="words") for heading in ("code", "rule", "severity")),
    TableColumn("what is wrong", kind="words", wraps=True),
)


def rule_answer(code: str | None = None) -> Report:
    """Report of one rule, or of all.

    Parameters
    ----------
    code
        Code or name of a rule, in letters of any case; None for all.

    Raises
    ------
    BusplanError
        No such rule.
    """
    rules = all_rules()
    if code is None:
        return rules_report(list(rules.values()))
    named = {**rules, **{rule.name.upper(): rule for rule in rules.values()}}
    if code.upper() not in named:
        known = (*rules, *(rule.name for rule in rules.values()))
        hint = " ".join(filter(None, (did_you_mean(code, known), "`busplan rule` lists them")))
        raise BusplanError(f"{code}: no such rule; {hint}")
    return rule_report(named[code.upper()])


def rules_report(rules: Sequence[Rule]) -> Report:
    """Report of `rule` with one line for each rule.

    Parameters
    ----------
    rules
        The rules.
    """
    return Report(
        Sentence(("Rules of the gate",)),
        (_table(rules),),
        _rules_document(rules),
        _rules_records(rules),
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
        tuple(_rule_blocks(rule)),
        _rules_document([rule]),
        _rules_records([rule]),
    )


def _table(rules: Sequence[Rule]) -> Table:
    rows = (TableRow((Code(rule.code), rule.name, rule.severity, rule.summary)) for rule in rules)
    return Table(_COLUMNS, tuple(rows))


def _rule_blocks(rule: Rule) -> Iterator[Block]:
    yield Sentence((Code(rule.code), f" {rule.name} ({rule.severity}): {rule.summary}"))
    yield Sentence((rule.explanation,))
    if rule.code in NEVER_SUPPRESSED:
        yield Sentence(("It cannot be suppressed.",))
    else:
        yield Sentence(("Suppress it with a reason, on its line or alone on the line above:",))
        yield Snippet((f"# busplan: ignore[{rule.code}] reason",))


def _rules_document(rules: Sequence[Rule]) -> JsonDocument:
    return document("rule", rules=_rules_records(rules))


def _rules_records(rules: Sequence[Rule]) -> list[Record]:
    return [
        {"code": rule.code, "rule": rule.name, **fields(rule, "severity", "summary", "explanation")} for rule in rules
    ]
