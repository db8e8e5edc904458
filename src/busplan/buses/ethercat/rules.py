"""Limits of EtherCAT, and the rules of the gate that only this bus has."""

from collections.abc import Iterator
from functools import reduce
from math import ceil
from typing import Final

from busplan.buses.ethercat.equations import BYTE_BIAS_US, MOST_CABLE_M, MOST_DEVICES, room_bytes
from busplan.buses.ethercat.latency import command_doubt_us, last_command_us, sync0_share
from busplan.buses.ethercat.traffic import data_bytes, datagrams, devices
from busplan.buses.limits import NODE_LIMIT
from busplan.buses.network import Network
from busplan.buses.parts import NOT_SHOWN_KEPT, Bound, Limit, share_of_period
from busplan.buses.rule import Rule, RuleProblem, RuleSubject
from busplan.elementwise import Number, larger, plain, total
from busplan.english import plural


def _largest_device(network: Network) -> Number:
    return reduce(larger, (data_bytes(group, network) for group in network.groups))


def _longest_cable(network: Network) -> Number:
    lengths_m: list[Number] = [group.node.cable_m for group in network.groups]
    return reduce(larger, lengths_m)


def _late_command_us(network: Network) -> Number:
    """When the last device has taken its command, with what bytes take beyond the wire; 0 without clocks [us]."""
    if not network.profile.bus.distributed_clocks:
        return 0.0
    process_bytes = total(device.number * device.data_bytes for device in devices(network))
    return last_command_us(network) + process_bytes * BYTE_BIAS_US


def _words(network: Network) -> str:
    """Say when the last command comes, and whether it is late only if all of the master's time is before the wire."""
    value_us, doubt_us, most_us = (
        plain(us) for us in (_late_command_us(network), SYNC0.bound.uncertainty(network), SYNC0.bound.most(network))
    )
    is_split = SYNC0.bound.verdict_code(network) == NOT_SHOWN_KEPT and value_us - doubt_us > most_us
    where = ", all of bus.master_us before the wire" if is_split else ""
    return f"the last command comes at {value_us:.1f} +/- {doubt_us:.1f} us{where}, SYNC0 at {most_us:.1f} us"


SYNC0: Final = Limit(
    "sync0",
    _words,
    *share_of_period(
        _late_command_us,
        share=sync0_share,
        doubt=lambda network: command_doubt_us(network) if network.profile.bus.distributed_clocks else 0.0,
        perhaps=lambda network: network.profile.bus.master_us if network.profile.bus.distributed_clocks else 0.0,
    ),
    way_out="a larger bus.sync_shift moves SYNC0 back",
    has_rule=True,
)
"""A command must be in every device before SYNC0."""
LIMITS: Final = (
    NODE_LIMIT,
    Limit(
        "nodes",
        "{value:.0f} devices are over the {most:.0f} addresses of a segment",
        Bound(lambda network: network.nodes, lambda _network: MOST_DEVICES),
        way_out=f"a second segment has {MOST_DEVICES:g} more",
    ),
    Limit(
        "payload",
        "a device of {value:.0f} bytes is over the {most:.0f} bytes of a frame, and no device is split",
        Bound(_largest_device, lambda network: room_bytes(datagrams(network))),
        way_out="a smaller payload would do",
    ),
    Limit(
        "cable",
        "a cable of {value:g} m is over the {most:g} m of 100BASE-TX",
        Bound(_longest_cable, lambda _network: MOST_CABLE_M),
        way_out="a device between would do",
    ),
    SYNC0,
)


def no_common_clock(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A circle is to be tested, and no clock makes its axes act at the same time."""
    profile = subject.profile
    if profile.asks_for_circle and not profile.bus.distributed_clocks:
        yield RuleProblem(
            "bus.distributed_clocks",
            "without them each drive acts when its frame passes, one after the other",
            "set bus.distributed_clocks = true if the drives have them",
            ("bus.distributed_clocks = true",),
        )


def command_behind_sync(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The last command is not shown to be taken before SYNC0, and may take effect cycles later."""
    figures = subject.deciding
    if SYNC0.key not in (*figures.exceeded, *(figures.not_shown or ())):
        return
    late = max(ceil((figures.own["command_us"] - figures.own["sync0_us"]) / figures.period_us), 1)
    maybe = "" if SYNC0.key in figures.exceeded else "maybe "
    yield RuleProblem(
        "bus.sync_shift",
        f"{subject.limit_words(SYNC0.key)}: {maybe}{plural(late, 'cycle')} late",
        SYNC0.way_out,
        subject.cure().cure,
    )


RULES: Final = (
    Rule(
        "BP131",
        "no-common-clock",
        "warning",
        "the axes of a circle have no distributed clocks",
        "A frame passes one drive after the other, and several frames take longer still. With distributed clocks all "
        "drives take their set-points at SYNC0; without them each takes its own when its frame has passed, and a "
        "circle has that difference between its axes.",
        no_common_clock,
    ),
    Rule(
        "BP132",
        "command-behind-sync",
        "error",
        "commands are not shown to be taken before SYNC0",
        "Drives with distributed clocks act at SYNC0, which lies at bus.sync_shift of the period after the master's "
        "task. A command that has not arrived by then, with the master's jitter and the drive's own time, waits for "
        "the next one: a cycle more of dead time, and where only some drives are late their axes are a cycle apart. It "
        "is a limit, judged with its doubt as time is. With bus.sync_shift = 0, SYNC0 at the task itself, the SYNC0 "
        "of the next cycle counts.",
        command_behind_sync,
    ),
)
