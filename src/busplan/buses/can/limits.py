"""Limits of a CAN bus and of the CANopen identifiers, the load of the bus, and deadlines."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import inf
from typing import Any, Final

from busplan.buses.can.constants import MAX_IDENTIFIER, MOST_NODES, MOST_STEPS, SATURATED
from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.can.response import TooManyStepsError
from busplan.buses.can.streams import (
    Stream,
    collisions,
    has_format,
    identifiers_twice,
    last_identifier,
    remembered,
    streams,
)
from busplan.buses.can.traffic import Sent, Traffic, pdos_of, traffic_of, without_times
from busplan.buses.can.waiting import Messages, messages
from busplan.buses.limits import NODE_LIMIT
from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.elementwise import Number, is_everywhere, larger, plain, pointwise, total
from busplan.sections.base import MAX_TIME_US


def late_messages(traffic: Traffic) -> Iterator[tuple[str, str]]:
    """Names of the messages of plain numbers that miss their deadline, each with by how much in words."""
    return ((stream.name, _late(stream, share, traffic)) for stream, share in _late_streams(traffic))


def _late_streams(traffic: Traffic) -> tuple[tuple[Stream, float], ...]:
    """Messages of plain numbers that miss their deadline, in the order of the profile, with response over deadline."""
    return _known_late(traffic, is_stuffed=True)


@remembered(maxsize=16)
def _known_late(traffic: Traffic, *, is_stuffed: bool) -> tuple[tuple[Stream, float], ...]:
    each = messages(traffic, is_stuffed=is_stuffed).deadline_shares()
    late = {stream.name: (stream, plain(share)) for stream, share in each if share > 1}
    return tuple(late[message.name] for message in traffic.messages if message.name in late)


def _all_late(traffic: Traffic) -> str:
    """Say of all messages that miss their deadline in one clause, the worst first."""
    late = sorted(_late_streams(traffic), key=lambda pair: -pair[1])
    endless = [stream.name for stream, share in late if share == inf]
    if endless:
        more = len(endless) - 1
        rest = f" and {more} more message{'s' * (more > 1)} have" if more else " has"
        return f"{endless[0]}{rest} no worst-case response time"
    return _and_more(
        [
            f"the worst-case response time of {stream.name} is {share * stream.deadline_us:g} us, "
            f"over its {stream.deadline_us:g} us"
            for stream, share in late
        ]
    )


def _late(stream: Stream, share: float, traffic: Traffic) -> str:
    if share < inf:
        us = share * stream.deadline_us
        return f"its worst-case response time is {us:g} us, over its {stream.deadline_us:g} us"
    load = _messages(traffic).load(stream)
    steps = "" if load >= SATURATED else f", and its busy period takes over {MOST_STEPS:.0f} steps to find"
    return f"it has no worst-case response time, for with it the bus has a load of {load:.1%}{steps}"


def _slowest(traffic: Traffic) -> float:
    """The largest response over deadline of any message of plain numbers [1]."""
    largest = 0.0
    # The lowest priorities first: where they all have a response time, every message has.
    for _, share in _messages(traffic).deadline_shares():
        largest = max(largest, plain(share))
        if largest == inf:
            break
    return largest


def _deadline(network: Network) -> Number:
    if not network.profile.message:
        return 0.0
    return Sent(traffic_of(network)).of_points(_slowest, words=_DEADLINE_WORDS)


def _messages(traffic: Traffic) -> Messages:
    return messages(traffic, is_stuffed=True)


def _is_late(network: Network) -> Number:
    """Whether any message misses its deadline: exact response times only where bounds do not tell."""
    if not network.profile.message:
        return False
    sent = Sent(traffic_of(network))
    least = sent.of(lambda traffic: _messages(traffic).largest_least(), words=_DEADLINE_WORDS)
    most = sent.of(lambda traffic: _messages(traffic).largest_bound(), words=_DEADLINE_WORDS)

    def is_late(at: float, least: float, most: float) -> bool:
        return bool(_has_late(sent.at(at))) if least <= 1 < most else least > 1

    if sent.is_ordered and not isinstance(least + most, float):
        return _late_points(sent.traffic, least, most)
    return pointwise(is_late, sent.place, least, most, words=_DEADLINE_WORDS)


def _late_points(traffic: Traffic, least: Any, most: Any) -> Number:
    """Whether any message misses its deadline at each point of arrays, of which bounds of it are known."""
    import numpy as np

    numbers: tuple[Any, ...] = traffic.numbers()
    shape = np.broadcast_shapes(np.shape(least), np.shape(most), *map(np.shape, numbers))
    least, most = (np.broadcast_to(share, shape).ravel() for share in (least, most))
    columns = [
        number if isinstance(number, int | float) else np.broadcast_to(number, shape).ravel() for number in numbers
    ]
    late = least > 1
    asked = np.flatnonzero((least <= 1) & (most > 1))
    # Points of like loads take like numbers of steps.
    asked = asked[np.argsort(most[asked])]
    # Few points of many messages are quicker one by one: then arrays are of messages.
    size = 1 if len(asked) < len(traffic.messages) else _POINTS_AT_ONCE
    waiting = [asked[first : first + size] for first in range(0, len(asked), size)]
    while waiting:
        some = waiting.pop()
        at = some if len(some) > 1 else some[0]
        row = (column if isinstance(column, int | float) else column[at] for column in columns)
        try:
            late[some] = _has_late(traffic.with_numbers(*map(_as_plain, row)))
        except TooManyStepsError:
            waiting += np.array_split(some, 2)
    is_late: Number = late.reshape(shape)
    return is_late


def _as_plain(number: Any) -> Any:
    """A single point of an array as a plain number."""
    return number.item() if getattr(number, "shape", None) == () else number


_POINTS_AT_ONCE: Final = 4096
"""Points whose response times are computed together."""


def _has_late(traffic: Traffic) -> Number:
    each, late = _messages(traffic), False
    if traffic.is_plain:
        worst = each.responses(own for own, _ in each.may_be_late())
        return any(response is None or response.us / own.deadline_us > 1 for own, response in worst)
    for _, share in each.deadline_shares():
        late = late | (share > 1)
        if is_everywhere(late):
            break
    return late


_DEADLINE_WORDS: Final = "busy periods of all messages"


def shared_identifiers(traffic: Traffic) -> tuple[tuple[str, str], ...]:
    """Messages that share identifiers, in words, once for each key that sets those of the second; of plain numbers."""
    clauses: dict[str, list[str]] = {}
    for key, words in _collisions_in_words(traffic):
        clauses.setdefault(key, []).append(words)
    return tuple((key, _and_more(each)) for key, each in clauses.items())


def _collisions_in_words(traffic: Traffic) -> Iterator[tuple[str, str]]:
    """Each pair of messages that shares identifiers, with the key of the second."""
    for early, late, first, shared in collisions(streams(traffic, is_stuffed=True)):
        pair = f"{early.label} and {late.label}" if early.label != late.label else f"frames of {early.label} PDOs"
        yield _identifier_key(late), f"{pair} share {_from(first, shared)}"


def _and_more(clauses: Sequence[str]) -> str:
    return f"{clauses[0]}, and {len(clauses) - 1} more" if len(clauses) > 1 else clauses[0]


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
    return Sent(without_times(traffic_of(network))).of(function, words=words)


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


def _kept_from_us(is_broken: Callable[[Network], Number], network: Network) -> float:
    """The period from which on a limit holds; infinite where none is long enough, or messages have no cycle [us]."""
    if not traffic_of(network).has_cycle:
        return inf
    broken_us = kept_us = plain(network.period_us)
    while is_broken(network._replace(period_us=kept_us)):
        broken_us, kept_us = kept_us, 2 * kept_us
        if kept_us > MAX_TIME_US:
            return inf
    for _ in range(_HALVINGS):
        middle_us = (broken_us + kept_us) / 2
        if is_broken(network._replace(period_us=middle_us)):
            broken_us = middle_us
        else:
            kept_us = middle_us
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
        "a PDO of {value:.0f} bytes is over the {most:.0f} bytes of its frames",
        _largest_pdo,
        _most_bytes,
        says=_payload_words,
        way_out="a smaller payload would do",
        failure="payload_bytes",
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
        "{value:.0f} identifiers stand twice",
        _collisions,
        lambda _network: 0,
        way_out="identifiers further apart have room",
        has_rule=True,
        is_slow=True,
        says=lambda network: _and_more([words for _, words in _collisions_in_words(traffic_of(network))]),
    ),
    Limit(
        "load",
        "the bus load is {value:.1%}, over the {most:.1%} of limits.max_load",
        _load,
        lambda network: network.profile.limits.max_load,
        way_out="a longer period, fewer bytes or a faster bus takes load off",
        has_rule=True,
        says=_load_words,
        period=lambda _limit, network: CanCycle(network, WORST).load_period_us,
        kept_from_us=lambda network: plain(CanCycle(network, WORST).load_period_us),
    ),
    Limit(
        "deadline",
        "a message takes {value:.3f} of its deadline",
        _deadline,
        lambda _network: 1,
        way_out="a smaller identifier, or less traffic before it, makes a message earlier",
        has_rule=True,
        is_slow=True,
        says=lambda network: _all_late(traffic_of(network)),
        breaks=_is_late,
        kept_from_us=partial(_kept_from_us, _is_late),
    ),
)
