"""Limits of a CAN bus and of CANopen identifiers, and the rules of CAN alone."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import chain, combinations, product
from math import inf
from typing import Final

from busplan.buses.can.cycle import WORST_STUFFING, CanCycle, can_cycle
from busplan.buses.can.equations import MAX_IDENTIFIER, MOST_STEPS, SATURATED, SECOND_US, c
from busplan.buses.can.streams import Points, Stream, last_identifier, repeated, streams
from busplan.buses.can.traffic import NOT_BY_PRIORITY, Traffic, of_node, traffic_of
from busplan.buses.can.waiting import message_responses
from busplan.buses.limits import NODE_LIMIT, ExactLimit, Limit, NothingUnknown, WakeUp
from busplan.buses.network import Network
from busplan.buses.rule import RuleProblem, RuleSubject, read_rules
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, pointwise, smaller, total, within
from busplan.english import first_of, told_apart
from busplan.sections.base import MAX_TIME_US


def _late_messages(traffic: Traffic) -> list[tuple[Stream, float]]:
    """Messages of plain numbers that miss their deadline, in the order of the profile, with their response [us]."""
    answers = message_responses(traffic, is_verdict=True)
    return [(message, worst.us) for message, worst in answers if not within(worst.us, message.deadline_us)]


def _slowest(traffic: Traffic) -> Number:
    """The largest response over deadline of any message, `_ENDLESS` at most; 0 without messages [1]."""

    def slowest(traffic: Traffic) -> Number:
        answers = message_responses(traffic, is_verdict=True)
        share: Number = reduce(larger, (worst.us / message.deadline_us for message, worst in answers))
        return smaller(share, _ENDLESS)

    if not traffic.messages:
        return 0.0
    return traffic.ask(slowest, words="busy periods of all messages")


_ENDLESS: Final = 1e6
"""Response over deadline from which on it is infinite [1]."""


def _own_share(traffic: Traffic) -> Number:
    """The largest J + C over deadline of any message, whatever it waits for [1]."""
    messages = [stream for stream in streams(traffic) if stream.is_message]
    share: Number = reduce(larger, ((one.jitter_us + one.frame_us) / one.deadline_us for one in messages))
    return share


def _unknown_senders(network: Network) -> list[str]:
    """Messages without a sender on a bus where some queue is not by priority: what they wait for is not known."""
    profile = network.profile
    orders = [profile.bus.queue, *(group.node.queue for group in network.groups)]
    if not any(order in NOT_BY_PRIORITY for order in orders):
        return []
    return [message.name for message in profile.message if message.sender is None and not message.per_node]


def _kept_from_us(network: Network) -> float:
    """Shortest period that keeps all deadlines; infinite where none does, or without a cycle [us]."""

    def is_kept(period_us: float) -> bool:
        traffic = traffic_of(network._replace(period_us=period_us))
        return bool(within(_slowest(traffic.longest), 1))

    if not traffic_of(network).has_cycle:
        return inf
    broken_us = kept_us = network.period_us
    while not is_kept(kept_us):
        broken_us, kept_us = kept_us, 2 * kept_us
        if kept_us > MAX_TIME_US:
            return inf
    for _ in range(_HALVINGS):
        middle_us = (broken_us + kept_us) / 2
        broken_us, kept_us = (broken_us, middle_us) if is_kept(middle_us) else (middle_us, kept_us)
    return kept_us


_HALVINGS: Final = 44
"""Halvings of a doubled period: to the rounding of floats."""


def _collisions(sent: Sequence[Stream]) -> Iterator[tuple[Stream, Stream, int, int]]:
    """Pairs of streams of plain numbers that share identifiers, with the first shared one and their number."""
    ordered = sorted((int(stream.first), place) for place, stream in enumerate(sent))
    pairs = [
        sorted((place, behind))
        for number, (_, place) in enumerate(ordered)
        for _, behind in ordered[number + 1 : bisect_right(ordered, (sent[place].last, inf), number)]
    ]
    for early, late in sorted(pairs):
        if _has_format(sent[early], sent[late].identifier_bits):
            first = max(sent[early].first, sent[late].first)
            yield sent[early], sent[late], first, min(sent[early].last, sent[late].last) - first + 1


def _has_format(stream: Stream, identifier_bits: Points) -> bool:
    """Whether a stream has identifiers of a length; lengths that vary from point to point are those of all streams."""
    bits = stream.identifier_bits, identifier_bits
    return bits[0] is bits[1] or not all(isinstance(length, int | float) for length in bits) or bits[0] == bits[1]


def _identifiers_twice(network: Network) -> Number:
    """Number of identifiers that stand twice or more often [1]."""

    def twice(traffic: Traffic) -> Points:
        sent = streams(traffic)
        fixed = [stream for stream in sent if isinstance(stream.last, int)]
        varied = [stream for stream in sent if not isinstance(stream.last, int)]
        number: Points = sum(shared for *_, shared in _collisions(fixed))
        for early, late in chain(combinations(varied, 2), product(varied, fixed)):
            if _has_format(early, late.identifier_bits):
                number = number + larger(smaller(early.last, late.last) - larger(early.first, late.first) + 1, 0)
        return number

    return traffic_of(network).ask(twice, words="identifiers that stand twice")


def _collision_words(network: Network) -> Iterator[tuple[str, str]]:
    """Each pair of streams that shares identifiers, in words, with the key of the second."""
    for early, late, first, shared in _collisions(streams(traffic_of(network))):
        pair = f"{early.label} and {late.label}" if early.label != late.label else f"frames of {early.label} PDOs"
        section = f"group.{late.group}" if late.group else "payload"
        key = f"message.{late.name}.identifier" if late.is_message else f"{section}.{late.name}_identifier"
        yield key, f"{pair} share {f'{shared} identifiers from' if shared > 1 else 'the identifier'} {first:#x}"


def _largest_identifier(network: Network) -> Number:
    """The largest identifier of the bus's own length; the section checks messages of the other one [1]."""

    def largest(traffic: Traffic) -> Number:
        sent = streams(traffic)
        last: Number = last_identifier(stream for stream in sent if _has_format(stream, traffic.identifier_bits))
        return last

    return traffic_of(network).ask(largest, words="the largest identifier")


def _most_identifier(network: Network) -> Number:
    bits = network.profile.bus.identifier_bits
    return pointwise(lambda length: MAX_IDENTIFIER[int(length)], bits, words="the largest identifier of the format")


def _largest_pdo(network: Network) -> Number:
    """Largest PDO, or one that is as much over the least room of any as one is over its own [bytes]."""
    largest: Number = 0
    least_room = _least_room(network)
    for pdos in traffic_of(network).pdos:
        largest = larger(largest, pdos.payload_bytes - (pdos.most_bytes - least_room))
    return largest


def _least_room(network: Network) -> int:
    """Least room of the frames of any PDO [bytes]."""
    return min((pdos.most_bytes for pdos in traffic_of(network).pdos), default=0)


def _payload_words(network: Network) -> str:
    over = next(pdos for pdos in traffic_of(network).pdos if pdos.payload_bytes > pdos.most_bytes)
    frames = (
        f"{over.name}_pdos" if len(over.frame_bytes) > 1 or over.most_bytes == over.frame_bytes[0] else "four frames"
    )
    return f"a PDO of {over.payload_bytes:.0f} bytes is over the {over.most_bytes} bytes of {frames}"


def _longest(network: Network) -> CanCycle:
    """The cycle with FD frames and bits as long as they may be."""
    return can_cycle(network, WORST_STUFFING, traffic=traffic_of(network).longest)


def _when_full(load: float) -> str:
    """Clause on what a load of 1 or more leads to; empty below."""
    return "; from 100% on messages of low priority have no worst-case response time" if load >= 1 else ""


def _pdos(network: Network) -> Number:
    """PDOs of all nodes in one direction [1]."""
    return total(group.nodes * of_node(group) for group in network.groups)


_LOAD: Final = "the bus load with the longest bits"


class Load(Limit):
    """All messages together must not take more of the bus than the plan allows."""

    key = "load"
    way_out = "a longer period, fewer bytes or a faster bus takes load off"
    has_rule = True
    has_period = True

    def value(self, network: Network) -> Number:
        """The load with FD frames and bits as long as they may be [1]."""
        return _longest(network).load

    def most(self, network: Network) -> Number:
        """limits.max_load [1]."""
        return network.profile.most_load

    def perhaps(self, network: Network) -> Number:
        """Load of the bits that FD frames may take in addition [1]."""
        return self.value(network) - can_cycle(network, WORST_STUFFING).load

    def shortest_period_us(self, network: Network, *, is_shown: bool) -> Number:  # noqa: ARG002 - the longest bits count
        """The period at which the load is the largest allowed [us]."""
        return _longest(network).load_period_us

    def words(self, network: Network) -> str:
        """The load, the most, and what comes of a full bus."""
        load, most = self.value(network), network.profile.most_load
        over = f"limits.max_load, {most:.1%}" if most < 1 else "that of a bus"
        return f"{_LOAD} is {load:.1%}, over {over}{_when_full(load)}"


class AdapterCeiling(Limit):
    """All frames of the bus together, on average, must be no more than the host's adapter sends and receives."""

    key = "adapter"
    label = "the adapter's frames a second"
    way_out = "a longer period, fewer frames or an adapter that carries more has room"
    place = "bus.max_frames_s"
    has_period = True

    def value(self, network: Network) -> Number:
        """Frames a second over the ceiling; 0 without a ceiling [1]."""
        most = network.profile.bus.of_adapter("max_frames_s")
        return 0.0 if most is None else _frames_s(network) / most

    def most(self, _network: Network) -> Number:
        """1."""
        return 1

    def shortest_period_us(self, network: Network, *, is_shown: bool) -> Number:  # noqa: ARG002 - nothing is in doubt
        """The period at which the cycle has the frames that messages leave; infinite where these are too many [us]."""
        most = network.profile.bus.of_adapter("max_frames_s")
        if most is None:
            return 0.0
        of_messages = _frames_s(network, of_messages=True)
        of_cycle = (_frames_s(network) - of_messages) * network.period_us
        return choose(most > of_messages, of_cycle / larger(most - of_messages, FIT_ROUNDING), inf)

    def words(self, network: Network) -> str:
        """The frames a second, and the most."""
        most = network.profile.bus.of_adapter("max_frames_s")
        sent, carried = told_apart(_frames_s(network), most)
        return f"the bus has {sent} frames a second, over the {carried} of the host's adapter"


def _frames_s(network: Network, *, of_messages: bool = False) -> Number:
    """Mean number of frames a second, of all that is sent, or of messages alone [1/s]."""

    def each_us(traffic: Traffic) -> Number:
        sent = (one for one in streams(traffic) if one.is_message or not of_messages)
        return total(one.identifiers / one.period_us for one in sent)

    return SECOND_US * traffic_of(network).ask(each_us, words="identifiers over their periods, of all frames")


class KnownPeriods(NothingUnknown):
    """Deadlines are shown to be kept only where no period of a message is assumed."""

    key = "periods"
    way_out = "give message.NAME.period_us as it is known"
    place = "message"
    of_deadlines = True

    def value(self, network: Network) -> Number:
        """Messages whose period is assumed [1]."""
        return sum(message.period_grade == "assumed" for message in network.profile.message)

    def words(self, network: Network) -> str:
        """Names of the messages whose period is assumed."""
        names = [message.name for message in network.profile.message if message.period_grade == "assumed"]
        return f"the period of {first_of(names, 3)} is assumed: give what their specification or a log says"


class KnownSenders(NothingUnknown):
    """Deadlines are shown to be kept only where the sender of each message is known, if queues are not by priority."""

    key = "senders"
    way_out = "give message.NAME.sender"
    place = "bus.queue"
    of_deadlines = True

    def value(self, network: Network) -> Number:
        """Messages without a sender [1]."""
        return len(_unknown_senders(network))

    def words(self, network: Network) -> str:
        """Names of the messages without a sender."""
        names = first_of(_unknown_senders(network), 3)
        return f"{names}: who sends it is not known, so neither what waits in its queue"


class Deadlines(Limit):
    """No message may take longer than its deadline."""

    key = "deadline"
    way_out = "a smaller identifier, or less traffic before it, makes a message earlier"
    has_rule = True
    has_period = True
    is_slow = True
    of_deadlines = True

    def value(self, network: Network) -> Number:
        """The largest response over deadline of any message; infinite where it is without end [1]."""
        share = _slowest(traffic_of(network).longest)
        return choose(share < _ENDLESS, share, inf)

    def most(self, _network: Network) -> Number:
        """1."""
        return 1

    def perhaps(self, network: Network) -> Number:
        """Part of that which FD frames may take in addition, and of all that queues add to J + C [1]."""
        traffic = traffic_of(network)
        if not traffic.queues and traffic.longest is traffic:
            return 0.0
        most, surely = _slowest(traffic.longest), _slowest(traffic)
        if traffic.queues:
            surely = traffic.ask(_own_share, words="J + C over D of all messages")
        return choose(most < _ENDLESS, most - surely, choose(surely < _ENDLESS, inf, 0.0))

    def shortest_period_us(self, network: Network, *, is_shown: bool) -> Number:  # noqa: ARG002 - the longest bits count
        """The period from which on deadlines are kept [us]."""
        return _kept_from_us(network)

    def words(self, network: Network) -> str:
        """All messages that miss their deadline in one clause, the worst first."""
        late = sorted(_late_messages(traffic_of(network).longest), key=lambda pair: -pair[1] / pair[0].deadline_us)
        endless = [message.name for message, us in late if us == inf]
        if endless:
            return f"{first_of(endless, 1)} ha{'s' if len(endless) == 1 else 've'} no worst-case response time"
        each = (
            f"the worst-case response time of {message.name} is {us:g} us, over its {message.deadline_us:g} us"
            for message, us in late
        )
        return first_of([*each], 1)


LIMITS: Final = (
    NODE_LIMIT,
    ExactLimit(
        "nodes",
        "{value:.0f} PDOs in one direction are over the {most:.0f} node-IDs of a bus",
        _pdos,
        lambda _network: c.MOST_NODES,
        way_out="a second bus has room for {most:g} more",
    ),
    ExactLimit("payload", _payload_words, _largest_pdo, _least_room, way_out="use a smaller payload"),
    ExactLimit(
        "range",
        "identifier {value:.0f} is over {most:.0f}, the largest of {bus.identifier_bits} bits",
        _largest_identifier,
        _most_identifier,
        way_out="smaller identifiers, or those of 29 bits, have room",
        is_slow=True,
    ),
    ExactLimit(
        "identifiers",
        lambda network: first_of([words for _, words in _collision_words(network)], 1),
        _identifiers_twice,
        lambda _network: 0,
        way_out="identifiers further apart have room",
        has_rule=True,
        is_slow=True,
    ),
    Load(),
    AdapterCeiling(),
    KnownPeriods(),
    KnownSenders(),
    Deadlines(),
    WakeUp("bus.sync_jitter_us"),
)


def load_over_limit(subject: RuleSubject) -> Iterator[RuleProblem]:
    """All messages together take more of the bus than the plan allows."""
    if "load" in (*subject.deciding.exceeded, *(subject.deciding.not_shown or ())):
        load, most = _longest(subject.network).load, subject.network.profile.most_load
        yield RuleProblem(
            "limits.max_load", f"{_LOAD} is {load:.1%}, {most:.1%} allowed{_when_full(load)}", *subject.cure()
        )


def identifiers_collide(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Two senders use one identifier: a problem at each key that sets the identifiers of the second."""
    # Groups that the network joins have keys of their own.
    groups = [
        group._replace(nodes=nodes.nodes, members=(nodes,))
        for group in subject.network.groups
        for nodes in group.members
    ]
    clauses: dict[str, list[str]] = {}
    for key, words in _collision_words(subject.network._replace(groups=tuple(groups))):
        clauses.setdefault(key, []).append(words)
    yield from (RuleProblem(key, first_of(words, 1)) for key, words in clauses.items())


def deadline_missed(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A message may arrive behind its deadline."""
    traffic = traffic_of(subject.network).longest
    for message, us in _late_messages(traffic):
        if us < inf:
            why = f"its worst-case response time is {us:g} us, over its {message.deadline_us:g} us"
        else:
            before = [stream for stream in streams(traffic) if stream.block <= message.end_place]
            errors = [repeated(before, traffic)] if traffic.error_burst else []
            load = sum(stream.frames_us / stream.period_us for stream in (*before, *errors))
            these = "it and repeated frames" if errors else "it"
            why = f"it has no worst-case response time, for with {these} the bus has a load of {load:.1%}"
            if load < SATURATED:
                why += f", and its busy period takes over {MOST_STEPS:.0f} steps to find"
        yield RuleProblem(f"message.{message.name}.deadline_us", why, *subject.cure())


RULES: Final = read_rules(
    "busplan.buses.can", {"BP121": load_over_limit, "BP122": identifiers_collide, "BP123": deadline_missed}
)
