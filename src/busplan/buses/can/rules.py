"""Limits of a CAN bus and of CANopen identifiers, and the rules that only CAN has."""

from collections.abc import Callable, Iterator
from functools import reduce
from math import inf
from typing import Final

from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.can.equations import MAX_IDENTIFIER, MOST_NODES, MOST_STEPS, SATURATED
from busplan.buses.can.frames import (
    Stream,
    Traffic,
    collisions,
    has_format,
    identifiers_twice,
    last_identifier,
    pdos_of,
    streams,
    traffic_of,
    traffic_of_profile,
)
from busplan.buses.can.waiting import message_responses
from busplan.buses.limits import NODE_LIMIT, Limit
from busplan.buses.network import Network
from busplan.buses.rule import Rule, RuleProblem, RuleSubject
from busplan.elementwise import Number, larger, plain, pointwise, total, within
from busplan.english import first_of
from busplan.sections.base import MAX_TIME_US


def late_messages(traffic: Traffic) -> Iterator[tuple[str, str]]:
    """Names of the messages of plain numbers that miss their deadline, each with by how much in words."""
    return ((stream.name, _late(stream, response_us, traffic)) for stream, response_us in _late_streams(traffic))


def _late_streams(traffic: Traffic) -> list[tuple[Stream, float]]:
    """Messages of plain numbers that miss their deadline, in the order of the profile, with their response [us]."""
    each = message_responses(traffic, is_stuffed=True, is_verdict=True)
    return [(own, worst.us) for own, worst in each if not within(worst.us, own.deadline_us)]


def _all_late(traffic: Traffic) -> str:
    """Say of all messages that miss their deadline in one clause, the worst first."""
    late = sorted(_late_streams(traffic), key=lambda pair: -pair[1] / pair[0].deadline_us)
    endless = [stream.name for stream, us in late if us == inf]
    if endless:
        return f"{first_of(endless, 1)} ha{'s' if len(endless) == 1 else 've'} no worst-case response time"
    return first_of(
        [
            f"the worst-case response time of {stream.name} is {us:g} us, over its {stream.deadline_us:g} us"
            for stream, us in late
        ],
        1,
    )


def _late(own: Stream, response_us: float, traffic: Traffic) -> str:
    if response_us < inf:
        return f"its worst-case response time is {response_us:g} us, over its {own.deadline_us:g} us"
    each = (stream for stream in streams(traffic, is_stuffed=True) if stream.block <= own.last_place)
    load = sum(stream.frames_us / stream.period_us for stream in each)
    steps = "" if load >= SATURATED else f", and its busy period takes over {MOST_STEPS:.0f} steps to find"
    return f"it has no worst-case response time, for with it the bus has a load of {load:.1%}{steps}"


def _slowest(traffic: Traffic) -> Number:
    """The largest response over deadline of any message [1]."""
    each = message_responses(traffic, is_stuffed=True, is_verdict=True)
    slowest: Number = reduce(larger, (worst.us / own.deadline_us for own, worst in each))
    return slowest


def _deadline(network: Network) -> Number:
    if not network.profile.message:
        return 0.0
    return traffic_of(network).ask(_slowest, words="busy periods of all messages")


def shared_identifiers(traffic: Traffic) -> tuple[tuple[str, str], ...]:
    """Messages that share identifiers, in words, once for each key that sets those of the second; of plain numbers."""
    clauses: dict[str, list[str]] = {}
    for key, words in _collisions_in_words(traffic):
        clauses.setdefault(key, []).append(words)
    return tuple((key, first_of(each, 1)) for key, each in clauses.items())


def _collisions_in_words(traffic: Traffic) -> Iterator[tuple[str, str]]:
    """Each pair of messages that shares identifiers, with the key of the second."""
    for early, late, first, shared in collisions(streams(traffic, is_stuffed=True)):
        pair = f"{early.label} and {late.label}" if early.label != late.label else f"frames of {early.label} PDOs"
        yield _identifier_key(late), f"{pair} share {_from(first, shared)}"


def _identifier_key(stream: Stream) -> str:
    if stream.is_message:
        return f"message.{stream.name}.identifier"
    return f"{f'group.{stream.group}' if stream.group else 'payload'}.{stream.name}_identifier"


def _from(first: int, shared: int) -> str:
    return f"{shared} identifiers from {first:#x}" if shared > 1 else f"the identifier {first:#x}"


def _collisions(network: Network) -> Number:
    return _of_identifiers(network, identifiers_twice, words="identifiers that stand twice")


def _largest_identifier(network: Network) -> Number:
    def largest(traffic: Traffic) -> Number:
        # The section checks messages of the other format.
        each = streams(traffic, is_stuffed=True)
        last: Number = last_identifier(stream for stream in each if has_format(stream, traffic.identifier_bits))
        return last

    return _of_identifiers(network, largest, words="the largest identifier")


def _of_identifiers(network: Network, function: Callable[[Traffic], Number], *, words: str) -> Number:
    return traffic_of(network).without_times().ask(function, words=words)


def _most_identifier(network: Network) -> Number:
    bits = network.profile.bus.identifier_bits
    return pointwise(lambda length: MAX_IDENTIFIER[int(length)], bits, words="the largest identifier of the format")


def _largest_pdo(network: Network) -> Number:
    """The largest PDO, or one as much over the least limit as one is over its own [bytes]."""
    largest: Number = 0
    for pdos in traffic_of(network).pdos:
        largest = larger(largest, pdos.payload_bytes - (pdos.most_bytes - _most_bytes(network)))
    return largest


def _most_bytes(network: Network) -> int:
    """The most that any PDO may carry [bytes]."""
    return min((pdos.most_bytes for pdos in traffic_of(network).pdos), default=0)


def _payload_words(network: Network) -> str:
    over = next(pdos for pdos in traffic_of(network).pdos if pdos.payload_bytes > pdos.most_bytes)
    frames = (
        f"{over.name}_pdos" if len(over.frame_bytes) > 1 or over.most_bytes == over.frame_bytes[0] else "four frames"
    )
    return f"a PDO of {plain(over.payload_bytes):.0f} bytes is over the {over.most_bytes} bytes of {frames}"


def _kept_from_us(network: Network) -> float:
    """The period from which on deadlines are kept; infinite where none is long enough, or without a cycle [us]."""
    if not traffic_of(network).has_cycle:
        return inf
    broken_us = kept_us = plain(network.period_us)
    while not within(_deadline(network._replace(period_us=kept_us)), 1):
        broken_us, kept_us = kept_us, 2 * kept_us
        if kept_us > MAX_TIME_US:
            return inf
    for _ in range(_HALVINGS):
        middle_us = (broken_us + kept_us) / 2
        if within(_deadline(network._replace(period_us=middle_us)), 1):
            kept_us = middle_us
        else:
            broken_us = middle_us
    return kept_us


_HALVINGS: Final = 44
"""Halvings of a doubled period: to the rounding of floats."""


def _load(network: Network) -> Number:
    return CanCycle(network, WORST).load


def when_full(load: float) -> str:
    """Say of a load what comes of it, where it is 1 or more."""
    return "; from 100% on messages of low priority have no worst-case response time" if load >= 1 else ""


def _load_words(network: Network) -> str:
    load, most = plain(_load(network)), network.profile.limits.max_load
    return f"the bus load is {load:.1%}, over limits.max_load, {most:.1%}{when_full(load)}"


LIMITS: Final = (
    NODE_LIMIT,
    Limit(
        "nodes",
        "{value:.0f} PDOs in one direction are over the {most:.0f} node-IDs of a bus",
        lambda network: total(pdos_of(group) for group in network.groups),
        lambda _network: MOST_NODES,
        way_out=f"a second bus has {MOST_NODES:g} more",
    ),
    Limit(
        "payload",
        _payload_words,
        _largest_pdo,
        _most_bytes,
        way_out="a smaller payload would do",
    ),
    Limit(
        "range",
        "identifier {value:.0f} is over {most:.0f}, the largest of {bus.identifier_bits} bits",
        _largest_identifier,
        _most_identifier,
        way_out="smaller identifiers, or those of 29 bits, have room",
        is_slow=True,
    ),
    Limit(
        "identifiers",
        lambda network: first_of([words for _, words in _collisions_in_words(traffic_of(network))], 1),
        _collisions,
        lambda _network: 0,
        way_out="identifiers further apart have room",
        has_rule=True,
        is_slow=True,
    ),
    Limit(
        "load",
        _load_words,
        _load,
        lambda network: network.profile.limits.max_load,
        way_out="a longer period, fewer bytes or a faster bus takes load off",
        period=lambda _bound, network: CanCycle(network, WORST).load_period_us,
        has_rule=True,
    ),
    Limit(
        "deadline",
        lambda network: _all_late(traffic_of(network)),
        _deadline,
        lambda _network: 1,
        way_out="a smaller identifier, or less traffic before it, makes a message earlier",
        period=lambda _limit, network: _kept_from_us(network),
        has_rule=True,
        is_slow=True,
    ),
)


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
