"""Rules for every kind of bus: does the cycle fit, is there room, is the execution time known?"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from busplan.buses.limits import NODE, busy_words, slow_groups
from busplan.buses.rule import Mending, RuleProblem, RuleSubject, margin, overrun, told_apart
from busplan.questions.fit.assumed import heavy_assumptions
from busplan.questions.fit.certainty import DOES_NOT_FIT, NOT_SHOWN, TIME, fits_in, limits_behind
from busplan.sections.execution import TableExecution


def slice_overrun(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The cycle does not fit, whatever the uncertainty."""
    deciding, bus = subject.deciding, subject.network.bus
    if deciding.verdict != DOES_NOT_FIT:
        return
    broken = [limit for limit in map(bus.limit, deciding.exceeded) if limit is not None]
    alone = [limit for limit in broken if not limit.has_rule]
    for limit in alone:
        yield RuleProblem("cycle.period_us", limit.words(subject.network), limit.way_out)
    if not alone and (TIME in deciding.exceeded or not broken):
        yield RuleProblem("cycle.period_us", f"the cycle {overrun(deciding)}", *subject.cure())


def not_shown_to_fit(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The cycle may fit, but the uncertainty leaves that open."""
    deciding, reserve, bus = subject.deciding, subject.profile.limits.reserve, subject.network.bus
    if deciding.verdict != NOT_SHOWN:
        return
    for limit in map(bus.limit, limits_behind(deciding)):
        if limit is not None and not limit.has_rule:
            words = limit.words(subject.network)
            yield RuleProblem("cycle.period_us", f"not shown to fit: {words}", limit.way_out)
    if TIME in (deciding.not_shown or ()):
        asked = f"{margin(deciding)}, limits.reserve asks for {reserve * deciding.available_us:.1f} us"
        words = asked if reserve else overrun(deciding)
        yield RuleProblem("cycle.period_us", f"not shown to fit: {words}", *subject.cure())


def over_utilisation(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The slice is fuller than [limits] allows."""
    limit, deciding = subject.profile.limits.max_utilisation, subject.deciding
    if limit is not None and not (limit and fits_in(deciding.required_us / limit, available_us=deciding.available_us)):
        used, allowed = told_apart(100 * deciding.utilisation, 100 * limit)
        words = f"{used}% of the slice is used, {allowed}% allowed"
        yield RuleProblem("limits.max_utilisation", words, *subject.cure())


def too_few_spare_nodes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further nodes than [limits] requires."""
    limit = subject.profile.limits.min_spare_nodes
    if limit is None:
        return
    for counts in subject.counts():
        spare = (counts.safe_nodes or 0) - counts.nodes
        if spare < limit:
            yield RuleProblem("limits.min_spare_nodes", _spare(counts, spare, limit), *_room(subject, counts))


def too_few_spare_axes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further axes than [limits] requires."""
    limit = subject.profile.limits.min_spare_axes
    if limit is None:
        return
    for counts in subject.counts():
        spare = (counts.safe_axes or 0) - counts.axes
        if counts.axes and spare < limit:
            yield RuleProblem("limits.min_spare_axes", _spare(counts, spare, limit), *_room(subject, counts))


def _spare(counts: Any, spare: int, limit: int) -> str:
    """Number of nodes or axes to spare, and the limit that binds."""
    group = f"group {counts.name}: " if counts.name else ""
    words = f"{max(spare, 0)} to spare that are shown to fit, {limit} asked for"
    return f"{group}{words}; limited by {counts.safe_limited_by}"


def _room(subject: RuleSubject, counts: Any) -> Mending:
    """How to make room for more nodes."""
    limit = subject.network.bus.limit(counts.safe_limited_by)
    return subject.cure() if limit is None or limit.role == "safety" else Mending(limit.way_out)


def node_too_slow(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A node does not finish within the period, where the bus does not wait for it."""
    deciding, network = subject.deciding, subject.network
    is_broken = NODE in deciding.exceeded
    if is_broken or NODE in (deciding.not_shown or ()):
        for group in slow_groups(network):
            words = busy_words(group, network)
            name = "time_us" if isinstance(group.node.execution, TableExecution) else "base_us"
            said = words if is_broken else f"not shown: {words}"
            yield RuleProblem(group.key(f"execution.{name}"), said, *subject.cure())


def assumed_key(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Much of the required time, or of its uncertainty, is an assumption."""
    for assumption in heavy_assumptions(subject.deciding, subject.network):
        what = "an assumption" if len(assumption.keys) == 1 else "an assumption of several"
        for key in assumption.keys:
            at = f"{key}.grade" if assumption.is_execution else key
            yield RuleProblem(at, f"{what}, which {assumption.carries}", "measure it")


CHECKS: Final[Mapping[str, Callable[[RuleSubject], Iterator[RuleProblem]]]] = {
    "BP101": slice_overrun,
    "BP114": not_shown_to_fit,
    "BP103": over_utilisation,
    "BP104": too_few_spare_nodes,
    "BP105": too_few_spare_axes,
    "BP115": node_too_slow,
    "BP112": assumed_key,
}
"""The check of each rule, by its code in `rules.toml`."""
