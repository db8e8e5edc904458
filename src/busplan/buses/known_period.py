"""The limit and the rule of a bus that knows some periods alone: one that it does not know loads, and does not fit."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.parts import Limit
from busplan.buses.periods import Periods
from busplan.buses.rule import Rule, RuleProblem, RuleSubject
from busplan.elementwise import choose, plain

PERIOD_LIMIT: Final = "period"
"""Key of the limit."""


def period_limit(periods: Periods) -> Limit:
    """The limit that the period is one that the bus knows.

    Parameters
    ----------
    periods
        Those that it knows.
    """
    return Limit(
        PERIOD_LIMIT,
        "the bus knows no such period",
        lambda network: choose(periods.from_us(network.period_us) > network.period_us, 1, 0),
        lambda _network: 0,
        way_out="a period that the bus knows will do",
        has_rule=True,
        is_of_period=True,
        says=lambda network: periods.refusal(plain(network.period_us)),
    )


def period_rule(code: str, periods: Periods, *, kind: str, source: str) -> Rule:
    """The rule that reports a period that the bus does not know, with its neighbours.

    Parameters
    ----------
    code
        Its code.
    periods
        Those that it knows.
    kind
        Name of the kind of bus.
    source
        Which these are, and who says so.
    """

    def unknown_period(subject: RuleSubject) -> Iterator[RuleProblem]:
        period_us = subject.profile.cycle.period_us
        if not periods.knows(period_us):
            yield RuleProblem("cycle.period_us", periods.refusal(period_us), *subject.cure())

    return Rule(
        code,
        f"{kind}-unknown-period",
        "error",
        "the bus knows no such period",
        f"The bus runs at some communication periods alone: {source}. A profile with another one loads, and capacity "
        "gives its figures, but it does not fit. The message names the next shorter and the next longer one.",
        unknown_period,
    )
