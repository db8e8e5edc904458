"""Limits of IEEE 1394, and the gate rules that only this bus has.

A gap count below the table fits, but is not safe.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from busplan.buses.ieee1394.broadcast import hub_block_bytes, write_block_bytes
from busplan.buses.ieee1394.constants import (
    MAX_GAP_COUNT,
    QUADLET_BYTES,
    c,
    padded_bytes,
)
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.figures import Ieee1394Figures
from busplan.buses.ieee1394.transactions import gap_count_of, has_gaps, hops_of, is_broadcast, safe_gap_count_of
from busplan.buses.limits import ExactLimit, NothingUnknown, WakeUp, nodes_limit
from busplan.buses.network import Network
from busplan.buses.rule import RuleProblem, RuleSubject, contradicts, margin, read_rules
from busplan.elementwise import Number
from busplan.english import plural, told_apart
from busplan.sections.base import TRANSACTION_KINDS

if TYPE_CHECKING:
    from busplan.buses.ieee1394.section import Ieee1394Bus


def _most_payload(network: Network) -> Number:
    return c.by_key("MAX_PAYLOAD_BYTES")[network.profile.bus.speed]


def _of_broadcast(value: Callable[[Network], Number]) -> Callable[[Network], Number]:
    """A limit's value under the broadcast schedule; 0 under the individual one."""
    return lambda network: value(network) if is_broadcast(network) else 0


def _cycle_start_us(network: Network) -> Number:
    is_sent = network.profile.bus.cycle_master
    return Ieee1394Cycle(network, "standard").cycle_start_us if is_sent else 0.0


def unsafe_words(network: Network) -> str:
    """Sentence that names the unsafe gap count, its hops and the smallest safe one; the network has plain numbers."""
    hops, nodes = hops_of(network), plural(int(network.nodes), "node")
    cables = "" if network.profile.bus.cable_is_standard else f" for cables of up to {c.REFERENCE_CABLE_M:g} m"
    return (
        f"gap count {gap_count_of(network)} is unsafe for {plural(int(hops), 'hop')} ({nodes}); "
        f"the smallest safe one is {safe_gap_count_of(network)}{cables}"
    )


class UnknownArbitration(NothingUnknown):
    """Limit of the arbitration above S400: its time is not published, so the cycle is a lower bound."""

    key = "arbitration"
    way_out = "up to S400 every time is known"

    def value(self, network: Network) -> Number:
        """1 above S400, else 0."""
        return int(not has_gaps(network))

    def words(self, network: Network) -> str:
        """Sentence that the cycle is a lower bound."""
        speed = network.profile.bus.speed
        return f"the arbitration of {speed} has no published time, so the cycle is a lower bound"


_ONE_BY_ONE: Final = 'cycle.schedule = "individual" has no such limit'

LIMITS: Final = (
    ExactLimit(
        "payload",
        "a payload of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        lambda network: network.largest_payload_bytes,
        _most_payload,
        way_out="a faster bus or use a smaller payload",
        has_rule=True,
    ),
    nodes_limit("nodes", lambda: c.MAX_NODES, "bus", of="of one", has_rule=True),
    ExactLimit(
        "hops",
        "{value:.0f} hops are over the {most:.0f} of one bus",
        hops_of,
        lambda _network: c.MAX_HOPS,
        way_out="a tree with bus.max_hops = {c.MAX_HOPS:g} or less has room for {c.MAX_NODES:g} nodes",
        has_rule=True,
    ),
    ExactLimit(
        "broadcasting nodes",
        "{value:.0f} nodes are over the {most:.0f} that a hub collects data of",
        _of_broadcast(lambda network: network.nodes),
        lambda _network: c.MAX_BROADCAST_NODES,
        way_out=_ONE_BY_ONE,
    ),
    ExactLimit(
        "hub block",
        "the hub's block of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        _of_broadcast(hub_block_bytes),
        _most_payload,
        way_out=f"read less from each node, or {_ONE_BY_ONE}",
    ),
    ExactLimit(
        "write block",
        "the write of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        _of_broadcast(write_block_bytes),
        _most_payload,
        way_out=f"write less to each node, or {_ONE_BY_ONE}",
    ),
    ExactLimit(
        "cycle starts",
        "a cycle start takes {value:.3f} us, over {most:.3f} us: no time is left for the nodes until the next one",
        _cycle_start_us,
        lambda _network: c.CYCLE_US - c.LEAST_ASYNCHRONOUS_US,
        way_out="reduce bus.isochronous_us, or stop the cycle master",
    ),
    UnknownArbitration(),
    WakeUp("bus.sync_jitter_us"),
    # The safe gap count is the value and that in force the bound: a smaller one than the safe one is unsafe.
    ExactLimit(
        "gap table",
        unsafe_words,
        safe_gap_count_of,
        gap_count_of,
        way_out="no gap count is known to be safe for cables over {c.REFERENCE_CABLE_M:g} m",
        role="safety",
    ),
)


def _bus(subject: RuleSubject) -> "Ieee1394Bus":
    bus: Any = subject.profile.bus
    return bus  # type: ignore[no-any-return]


def paper_disagrees(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the paper's equations contradict the verdict."""
    for model, fits in subject.others_fit:
        if contradicts(fits, subject.deciding):
            story = "that it fits" if fits else "that it does not fit"
            verdict = subject.deciding.verdict
            yield RuleProblem("cycle.period_us", f"the {model}'s equations say {story}; the verdict is: {verdict}")


def fits_only_until_bus_reset(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the plan needs a gap count that a bus reset undoes."""
    figures = subject.deciding
    own = Ieee1394Figures.of(figures)
    if figures.verdict == "fits" and own.gap_count < MAX_GAP_COUNT:
        after = subject.after({"bus.gap_count": MAX_GAP_COUNT})
        if after.verdict != "fits":
            yield RuleProblem(
                "bus.gap_count",
                f"fits at {own.gap_count}, {after.verdict} at {MAX_GAP_COUNT} after a bus reset: {margin(after)}",
                "have the bus manager write the gap count after each reset",
            )


def too_many_nodes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where one bus has too few addresses for the nodes."""
    if "nodes" in subject.deciding.exceeded:
        key = subject.profile.node_groups[-1].nodes_key
        yield RuleProblem(key, subject.limit_words("nodes"), "move the other nodes to a second bus")


def too_many_hops(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the bus has more cable hops than the standard allows."""
    if "hops" in subject.deciding.exceeded:
        is_chain = _bus(subject).max_hops is None
        key = subject.profile.node_groups[-1].nodes_key if is_chain else "bus.max_hops"
        way_out = f"use a tree with bus.max_hops = {c.MAX_HOPS:g} or less" if is_chain else "rewire the tree"
        yield RuleProblem(key, subject.limit_words("hops"), way_out)


def payload_over_limit(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where a payload exceeds an asynchronous packet of the speed."""
    speed = _bus(subject).speed
    most = int(c.by_key("MAX_PAYLOAD_BYTES")[speed])
    for key, size in _payloads(subject):
        if size > most:
            faster = [speed for speed, limit in c.by_key("MAX_PAYLOAD_BYTES").items() if size <= limit]
            way_out = f'use bus.speed = "{faster[0]}"' if faster else "divide it among several transactions"
            yield RuleProblem(key, f"{size} bytes are over the {most} bytes of a packet at {speed}", way_out)


def payload_not_quadlets(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the wire pads a payload to whole quadlets."""
    for key, size in _payloads(subject):
        if size % QUADLET_BYTES:
            padded = padded_bytes(size)
            yield RuleProblem(
                key,
                f"{size} bytes are not whole quadlets; {padded} bytes travel on the wire",
                f"set the payload to {padded}",
            )


def _payloads(subject: RuleSubject) -> Iterator[tuple[str, int]]:
    for nodes, kind in product(subject.profile.node_groups, TRANSACTION_KINDS):
        yield nodes.payload_key(kind), int(nodes.bytes_of(kind))


def gap_count_unsafe(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the gap count is below the table."""
    if not Ieee1394Figures.of(subject.deciding).gap_count_safe:
        yield RuleProblem("bus.gap_count", subject.limit_words("gap table"), *subject.cure())


def gap_count_wasteful(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the gap count is above the table."""
    figures = subject.deciding
    if "cycle starts" in figures.exceeded:
        return  # No time is left, so none can be saved.
    own = Ieee1394Figures.of(figures)
    if own.gap_count > own.safe_gap_count and _bus(subject).cable_is_standard:
        yield RuleProblem("bus.gap_count", partial(_wasted, subject))


def _wasted(subject: RuleSubject) -> str:
    """Words for the time that a gap count above the table costs."""
    changes = {"bus.gap_count": "optimal"}
    figures, after = subject.deciding, subject.after(changes)
    saved, _ = told_apart(figures.required_us - after.required_us, 0.0)
    own = Ieee1394Figures.of(figures)
    safe = own.safe_gap_count
    above = f"gap count {own.gap_count} is above the {safe} that {own.hops} hops need"
    words = f"{above}; {safe} saves {saved} us a cycle"
    if subject.profile.group:
        return words
    (now,), (then,) = subject.counts(), subject.counts(changes)
    won = then.safe_nodes - now.safe_nodes
    return f"{words} and wins {plural(won, 'node')}"


RULES: Final = read_rules(
    "busplan.buses.ieee1394",
    {
        "BP102": paper_disagrees,
        "BP106": too_many_nodes,
        "BP107": too_many_hops,
        "BP108": payload_over_limit,
        "BP109": gap_count_unsafe,
        "BP110": gap_count_wasteful,
        "BP111": payload_not_quadlets,
        "BP113": fits_only_until_bus_reset,
    },
)
