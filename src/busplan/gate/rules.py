"""All rules of the gate by code, and the answer of `busplan rule`. A dropped code is never used again."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
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
from busplan.gate import bus, circle
from busplan.nearest import did_you_mean
from busplan.questions.words.documents import document, fields

BY_KIND: Final[Mapping[ProblemKind, Rule]] = {
    "syntax": Rule(
        "BP001",
        "syntax",
        "error",
        "the file is no TOML",
        "A profile is TOML 1.0 in UTF-8, at most 100,000 bytes long. Nothing else of the file can be checked "
        "before it is.",
    ),
    "unknown-key": Rule(
        "BP002",
        "unknown-key",
        "error",
        "the profile has no such key",
        "A key that busplan does not know is most often a typing error, and the value it should have set "
        "is then missing or a default. `busplan schema` lists all keys for editors that complete and check while "
        "you type.",
    ),
    "missing-key": Rule(
        "BP003",
        "missing-key",
        "error",
        "a key without a default is not there",
        "The bus, its speed and nodes, the period, the payloads, the axes and the execution time have no default: "
        "no plan can be made without them. `busplan init` writes a profile that has them all.",
    ),
    "wrong-type": Rule(
        "BP004",
        "wrong-type",
        "error",
        "the value is of the wrong type",
        "Types are strict: no text stands for a number, no fraction for a count, no true for 1. Times and lengths "
        "may be whole numbers or fractions.",
    ),
    "out-of-range": Rule(
        "BP005",
        "out-of-range",
        "error",
        "the value is outside its range",
        "Every quantity has a range in which it means something; `busplan manual profile` and `busplan schema` list "
        "them. What only the bus standard forbids has rules of its own.",
    ),
    "inconsistent": Rule(
        "BP006",
        "inconsistent",
        "error",
        "two values do not go together",
        "The lists of an execution table must be of one length and its payloads must ascend; a value "
        "that busplan finds for you needs a bus that it can be found for.",
    ),
    "execution-unknown": Rule(
        "BP007",
        "execution-extrapolated",
        "error",
        "the execution time of the payload is not known",
        "The payload lies outside the measured table, and busplan extrapolates nothing in silence. Measure the "
        'payload and add it to node.execution, or state an assumption with kind = "linear" and grade = "assumed".',
    ),
}

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
        lambda: (_table(rules),),
        partial(_rules_document, rules),
        lambda: _rules_records(rules),
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
        lambda: tuple(_rule_blocks(rule)),
        partial(_rules_document, [rule]),
        lambda: _rules_records([rule]),
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
