"""Latencies of a command to a drive, of feedback to the master, and of a loop over both.

The master's task starts each cycle. SYNC0 of the distributed clocks lies at a share of the period after it: there
drives sample, and commands that have arrived take effect. Without distributed clocks drives act when their frame has
passed.
"""

from functools import reduce

from busplan.buses.cycle import BusLatency
from busplan.buses.ethercat.equations import BYTE_BIAS_UNCERTAINTY_US
from busplan.buses.ethercat.figures import LATENCY_TABLE
from busplan.buses.ethercat.traffic import (
    arrival_us,
    cables_us,
    devices,
    devices_doubts,
    devices_us,
    mailbox_us,
    process_us,
)
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, choose, larger, named, plain, rounded_up, square_root, total

_SUM = LATENCY_TABLE[-1].key


def sync0_us(network: Network) -> Number:
    """The first SYNC0 after the master's task; 0 without distributed clocks [us]."""
    return sync0_share(network) * network.period_us if network.profile.bus.distributed_clocks else 0.0


def sync0_share(network: Network) -> Number:
    """The first SYNC0 as a share of the period: at the task itself it is the next SYNC0 that its frames meet [1]."""
    shift = network.profile.bus.sync_shift
    return choose(shift > 0, shift, 1)


def latencies(network: Network) -> tuple[BusLatency, ...]:
    """The worst case of a command, of feedback, and of a loop over both, for each group.

    Parameters
    ----------
    network
        The network; its numbers may be of any sort.
    """
    sent_us, way_us = process_us(network), _way_us(network)
    each = []
    for group in network.groups:
        there, back = _command(group, network, sent_us, way_us), _feedback(group, network, sent_us, way_us)
        # The master's pipeline begins with the cycle that brings the feedback.
        both = {**there, "drive_us": back["drive_us"] + there["drive_us"], "frame_wait_us": back["frame_wait_us"]}
        for name, phases in (("command", there), ("feedback", back), ("loop", both)):
            each.append(BusLatency(name, None, phases | {_SUM: total(phases.values())}, group.name))
    return tuple(each)


def last_command_us(network: Network) -> Number:
    """When the last device has taken its command at the latest, from the master's task [us]."""
    sent_us, way_us = process_us(network), _way_us(network)
    return reduce(larger, (_taken_us(group, network, sent_us, way_us) for group in network.groups))


def command_doubt_us(network: Network) -> Number:
    """Standard uncertainty of the last command: master, devices one way, bytes and slowest execution [us]."""
    execution_us = reduce(larger, (group.write_uncertainty_us for group in network.groups))
    process_bytes = total(own.number * own.data_bytes for own in devices(network))
    parts = (
        network.profile.bus.master_doubt_us,
        *(doubt.one_way_us for doubt in devices_doubts(network)),
        process_bytes * BYTE_BIAS_UNCERTAINTY_US,
        execution_us,
    )
    return square_root(total(part * part for part in parts))


def _period_us(group: Group, network: Network) -> Number:
    """From a cycle with the group's data to the next [us]."""
    return group.every * network.period_us if group.is_slower else network.period_us


def _way_us(network: Network) -> Number:
    """Delay of devices and cables to the last device and back [us]."""
    return named(devices_us(network) + cables_us(network), "way_us", "way")


def _taken_us(group: Group, network: Network, sent_us: Number, way_us: Number) -> Number:
    """When the last device of a group may have taken its command, from the start of the cycle [us]."""
    bus = network.profile.bus
    on_wire_us = bus.master_us + bus.master_jitter_us + sent_us + way_us / 2
    taken_us = on_wire_us + group.write_execution_us + group.worst_extra_us
    return named(taken_us, "command_us", "t_cmd")


def _command(group: Group, network: Network, sent_us: Number, way_us: Number) -> dict[str, Number]:
    """From the cycle whose feedback it rests on to its effect."""
    bus = network.profile.bus
    taken_us = _taken_us(group, network, sent_us, way_us)
    wait_us: Number = 0.0
    if bus.distributed_clocks:
        late = larger(rounded_up((taken_us - sync0_us(network)) / network.period_us), 0)
        wait_us = sync0_us(network) + late * network.period_us - taken_us
    return {
        "drive_us": group.write_execution_us + group.worst_extra_us,
        "frame_wait_us": 0.0,
        "pipeline_us": named(bus.pipeline_cycles * _period_us(group, network), "pipeline_us", "n T_s"),
        "master_us": bus.master_us,
        "jitter_us": bus.master_jitter_us,
        "sending_us": sent_us,
        "path_us": way_us / 2,
        "sync_wait_us": wait_us,
    }


def _feedback(group: Group, network: Network, sent_us: Number, way_us: Number) -> dict[str, Number]:
    """From the sample to the start of the cycle whose frame takes it, and until the master has all frames."""
    ready_us = group.read_execution_us + group.worst_extra_us
    behind_us = sync0_us(network) + ready_us
    period_us = _period_us(group, network)
    wait_us = _cycles(behind_us / period_us) * period_us - behind_us
    return {
        "drive_us": ready_us,
        "frame_wait_us": wait_us,
        "pipeline_us": 0.0,
        "master_us": network.profile.bus.master_us,
        "jitter_us": network.profile.bus.master_jitter_us,
        "sending_us": sent_us + mailbox_us(network),
        "path_us": way_us,
        "sync_wait_us": 0.0,
    }


def _cycles(share: Number) -> Number:
    """Periods until the frame that takes a sample: none takes one that it triggers, however fast the drive."""
    return larger(rounded_up(share), 1)


def loop_periods(network: Network, *, at_sync: bool) -> int:
    """Whole periods between a sample and the start of the cycle, or the SYNC0, that its command takes effect in.

    Parameters
    ----------
    network
        The network, of plain numbers.
    at_sync
        Whether commands take effect at SYNC0; otherwise when they arrive.

    Returns
    -------
    int
        Of the slowest group, those at slower rates left out [1].
    """
    bus, period_us = network.profile.bus, plain(network.period_us)
    shift_us = plain(sync0_us(network)) if at_sync else 0.0
    last_us = arrival_us(network, int(plain(network.nodes)))

    def of(group: Group) -> float:
        extra_us = plain(group.worst_extra_us)
        sampled = _cycles((shift_us + plain(group.read_execution_us) + extra_us) / period_us)
        late_us = last_us + plain(group.write_execution_us) + extra_us - shift_us
        return plain(sampled) + (max(plain(rounded_up(late_us / period_us)), 0) if at_sync else 0)

    groups = [group for group in network.groups if not group.is_slower] or network.groups
    return int(max(map(of, groups)) + plain(bus.pipeline_cycles))
