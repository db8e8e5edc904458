"""Rules of the gate that only a CAN bus has: its load, its identifiers, its deadlines."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.can.limits import late_messages, shared_identifiers, when_full
from busplan.buses.can.traffic import traffic_of_profile
from busplan.buses.rule import Rule, RuleProblem, RuleSubject


def load_over_limit(subject: RuleSubject) -> Iterator[RuleProblem]:
    """All messages together take more of the bus than the plan allows."""
    if "load" in subject.deciding.exceeded:
        most: float = getattr(subject.profile.limits, "max_load")  # noqa: B009 - a key of this kind alone
        load = subject.deciding.own["bus_load"]
        yield RuleProblem(
            "limits.max_load", f"the bus load is {load:.1%}, {most:.1%} allowed{when_full(load)}", *subject.cure()
        )


def identifiers_collide(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Two senders use one identifier."""
    for key, words in shared_identifiers(traffic_of_profile(subject.profile)):
        yield RuleProblem(key, words)


def deadline_missed(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A message may arrive behind its deadline."""
    for name, why in late_messages(traffic_of_profile(subject.profile)):
        yield RuleProblem(f"message.{name}.deadline_us", why, *subject.cure())


RULES: Final = (
    Rule(
        "BP121",
        "bus-load-over-limit",
        "error",
        "the bus load is over limits.max_load",
        "All messages of the bus, with the stuff bits of the worst case, take a larger share of it than "
        "limits.max_load allows, 0.8 unless the profile says otherwise. Errors on the wire cause repetitions, which "
        "need room. From a load of 1 on, queues grow without end and no response time exists.",
        load_over_limit,
    ),
    Rule(
        "BP122",
        "identifiers-collide",
        "error",
        "two messages have one identifier",
        "Arbitration tells messages apart by their identifiers alone. Two nodes that send one identifier at the same "
        "time with different data destroy each other's frames. Each PDO takes the identifier behind that of the one "
        "before, and each further frame of a PDO 256 more.",
        identifiers_collide,
    ),
    Rule(
        "BP123",
        "deadline-missed",
        "error",
        "a message may arrive behind its deadline",
        "The worst-case response time of the message, with its jitter, the longest frame of a lower priority, and all "
        "frames of higher priorities, in its worst instance, is longer than message.deadline_us. `busplan latency` "
        "shows the parts.",
        deadline_missed,
    ),
)
