"""Rules of the gate by code, and the answer of `busplan rule`. A dropped code is never used again."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any, Final

from busplan.buses import kind_named, kind_names
from busplan.buses.bus import Bus
from busplan.buses.limits import NODE, busy_words, slow_groups
from busplan.buses.rule import Check, Mending, Rule, RuleProblem, RuleSubject, margin, overrun, read_rules
from busplan.english import did_you_mean, told_apart
from busplan.errors import BusplanError, ProblemKind
from busplan.forms.blocks import (
    Block,
    Code,
    Report,
    Sentence,
    Snippet,
    Table,
    TableColumn,
    TableRow,
)
from busplan.questions.base.sentences import document, fields
from busplan.questions.fit.certainty import DOES_NOT_FIT, NOT_SHOWN, TIME
from busplan.questions.fit.figures import limits_behind
from busplan.questions.fit.graded import heavy_assumptions
from busplan.questions.fit.needs import missed_limits
from busplan.sections.cycle import TableExecution


def slice_overrun(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The cycle does not fit, whatever the uncertainty."""
    deciding = subject.deciding
    if deciding.verdict != DOES_NOT_FIT:
        return
    broken = limits_behind(deciding, subject.network)
    unreported = [limit for limit in broken if not limit.has_rule]
    for limit in unreported:
        yield RuleProblem(limit.place, limit.words(subject.network), limit.advice(subject.network))
    if not unreported and (TIME in deciding.exceeded or not broken):
        yield RuleProblem("cycle.period_us", f"the cycle {overrun(deciding)}", *subject.cure())


def not_shown_to_fit(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The cycle may fit, but the uncertainty leaves that open."""
    deciding, reserve = subject.deciding, subject.profile.limits.reserve
    if deciding.verdict != NOT_SHOWN:
        return
    for limit in limits_behind(deciding, subject.network):
        if not limit.has_rule:
            words = limit.words(subject.network)
            yield RuleProblem(limit.place, f"not shown to fit: {words}", limit.advice(subject.network))
    if TIME in (deciding.not_shown or ()):
        words = overrun(deciding)
        if reserve:
            words = f"{margin(deciding)}, limits.reserve asks for {reserve * deciding.available_us:.1f} us"
        yield RuleProblem("cycle.period_us", f"not shown to fit: {words}", *subject.cure())


def over_utilisation(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The slice is fuller than [limits] allows."""
    limit, deciding, key = subject.profile.limits.max_utilisation, subject.deciding, "limits.max_utilisation"
    if limit is not None and any(missed.key == key for missed in missed_limits(subject.network)):
        used, allowed = told_apart(100 * deciding.utilisation, 100 * limit)
        words = f"{used}% of the slice is used, {allowed}% allowed"
        yield RuleProblem(key, words, *subject.cure())


def too_few_spare_nodes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further nodes than [limits] requires."""
    yield from _too_little_room(subject, "nodes")


def too_few_spare_axes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further axes than [limits] requires."""
    yield from _too_little_room(subject, "axes")


def _too_little_room(subject: RuleSubject, what: str) -> Iterator[RuleProblem]:
    """Groups with less room than [limits] asks for, in nodes or axes."""
    key = f"limits.min_spare_{what}"
    least = getattr(subject.profile.limits, f"min_spare_{what}")
    if least is None:
        return
    groups = {missed.group for missed in missed_limits(subject.network) if missed.key == key}
    for counts in subject.counts() if groups else ():
        if counts.name in groups:
            spare = (getattr(counts, f"safe_{what}") or 0) - getattr(counts, what)
            yield RuleProblem(key, _spare(counts, spare, least), *_room(subject, counts))


def _spare(counts: Any, spare: int, least: int) -> str:
    """Number of nodes or axes to spare, and the limit that binds."""
    group = f"group {counts.name}: " if counts.name else ""
    words = f"room for {max(spare, 0)} more is shown, {least} required"
    return f"{group}{words}; limited by {counts.safe_limited_by}"


def _room(subject: RuleSubject, counts: Any) -> Mending:
    """Way to make room for more nodes: the cure, or where there is none what the limit advises."""
    limit, cure = subject.network.bus.limit(counts.safe_limited_by), subject.cure()
    if cure.cure or limit is None or limit.role == "safety":
        return cure
    return Mending(limit.advice(subject.network))


def node_too_slow(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A node does not finish within the period, on a bus that does not wait for it."""
    deciding, network = subject.deciding, subject.network
    is_broken = NODE in deciding.exceeded
    if is_broken or NODE in (deciding.not_shown or ()):
        for group in slow_groups(network):
            words = busy_words(group, network)
            name = "time_us" if isinstance(group.node.execution, TableExecution) else "base_us"
            problem = words if is_broken else f"not shown: {words}"
            yield RuleProblem(group.key(f"execution.{name}"), problem, *subject.cure())


def assumed_key(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A large share of the required time, or of its variance, rests on an assumption."""
    for assumption in heavy_assumptions(subject.deciding, subject.network):
        noun = "an assumption" if len(assumption.keys) == 1 else "one of several assumptions"
        for key in assumption.keys:
            place = f"{key}.grade" if assumption.is_execution else key
            yield RuleProblem(place, f"{noun}, which {assumption.carries}", "measure it", weight=assumption.share)


CHECKS: Final[Mapping[str, Check]] = {
    "BP101": slice_overrun,
    "BP114": not_shown_to_fit,
    "BP103": over_utilisation,
    "BP104": too_few_spare_nodes,
    "BP105": too_few_spare_axes,
    "BP115": node_too_slow,
    "BP112": assumed_key,
}
"""Check of each rule, by its code in `rules.toml`."""


COMMON: Final[Mapping[str, Rule]] = MappingProxyType({rule.code: rule for rule in read_rules("busplan.gate", CHECKS)})
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
BY_PROBLEM: Final = {kind: COMMON[code] for kind, code in _FILE_CODES.items()}
"""Rules of the file format, by the kind of problem in a profile."""
BASELINE, SUPPRESSION_WITHOUT_REASON, SUPPRESSION_WITHOUT_EFFECT = map(COMMON.__getitem__, ("BP301", "BP901", "BP902"))
CIRCLE = OF_CIRCLE, OF_STABILITY, IMPOSSIBLE_CIRCLE, LONG_CIRCLE = tuple(
    COMMON[code] for code in ("BP201", "BP202", "BP203", "BP204")
)
"""Rules on the circle test."""
RECORDING = OUTSIDE_PLAN, NOT_RECORDED, NOTHING_RECORDED = tuple(COMMON[code] for code in ("BP401", "BP402", "BP403"))
"""Rules on a recording of the machine."""
NEVER_SUPPRESSED: Final = frozenset((*_FILE_CODES.values(), "BP901", "BP902"))
"""Codes that cannot be suppressed: those of the file format and of suppressions."""


def all_rules() -> Mapping[str, Rule]:
    """All rules by code, sorted, with those of every kind of bus."""
    return _by_code(tuple(map(kind_named, kind_names())))


@cache
def _by_code(kinds: tuple[Bus, ...]) -> Mapping[str, Rule]:
    rules = (*COMMON.values(), *(rule for kind in kinds for rule in kind.rules))
    return MappingProxyType({rule.code: rule for rule in sorted(rules, key=lambda rule: rule.code)})


def cycle_rules(kind: str) -> tuple[Rule, ...]:
    """Rules on the cycle of a kind of bus, sorted by code."""
    return tuple(sorted((*map(COMMON.__getitem__, CHECKS), *kind_named(kind).rules), key=lambda rule: rule.code))


_COLUMNS: Final = (
    *(TableColumn(heading, kind="words") for heading in ("code", "rule", "severity")),
    TableColumn("problem", kind="words", wraps=True),
)


def rule_answer(code: str | None = None) -> Report:
    """Report of one rule, by its code or its name in any case, or of all.

    An unknown rule raises BusplanError.
    """
    rules = all_rules()
    if code is None:
        return rules_report(list(rules.values()))
    named = {**rules, **{rule.name.upper(): rule for rule in rules.values()}}
    if code.upper() not in named:
        names = (*rules, *(rule.name for rule in rules.values()))
        hint = " ".join(filter(None, (did_you_mean(code, names), "`busplan rule` lists them")))
        raise BusplanError(f"{code or repr(code)}: no such rule; {hint}")
    return rule_report(named[code.upper()])


def rules_report(rules: Sequence[Rule]) -> Report:
    """Report of `rule`, with one line for each rule."""
    rows = (TableRow((Code(rule.code), rule.name, rule.severity, rule.summary)) for rule in rules)
    return _report(Sentence(("Rules of the gate",)), [Table(_COLUMNS, tuple(rows))], rules)


def rule_report(rule: Rule) -> Report:
    """Report of `rule CODE`, with the explanation of one rule."""
    blocks: list[Block] = [
        Sentence((Code(rule.code), f" {rule.name} ({rule.severity}): {rule.summary}")),
        Sentence((rule.explanation,)),
    ]
    if rule.code in NEVER_SUPPRESSED:
        blocks.append(Sentence(("It cannot be suppressed.",)))
    else:
        blocks.append(Sentence(("Suppress it with a reason, on its line or alone on the line above:",)))
        blocks.append(Snippet((f"# busplan: ignore[{rule.code}] reason",)))
    return _report(Sentence((Code(rule.code), f" {rule.name}")), blocks, [rule])


def _report(title: Sentence, blocks: Sequence[Block], rules: Sequence[Rule]) -> Report:
    records = [
        {"code": rule.code, "rule": rule.name, **fields(rule, "severity", "summary", "explanation")} for rule in rules
    ]
    return Report(title, tuple(blocks), document("rule", rules=records), records)
