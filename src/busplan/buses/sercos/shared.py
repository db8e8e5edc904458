"""Parts that SERCOS I, II and III share: whole words, the master's pipeline, the age of feedback and commands."""

from abc import abstractmethod
from collections.abc import Mapping
from functools import reduce
from math import ceil
from typing import Final, TypeAlias

from busplan.buses.bus import Bus
from busplan.buses.cycle import BusCycle, BusLatency
from busplan.buses.figure import Figure
from busplan.buses.limits import unknown_period
from busplan.buses.network import Network
from busplan.buses.parts import Key, Starter
from busplan.buses.rule import read_rules
from busplan.elementwise import Number, larger, rounded_up, total
from busplan.sections.base import TRANSACTION_KINDS
from busplan.sourced import Constants

c: Final = Constants("busplan.buses.sercos", "shared.toml")
"""Constants of all SERCOS with a source, by their names."""

RULES: Final = {
    rule.code: rule for rule in read_rules("busplan.buses.sercos", {"BP141": unknown_period, "BP151": unknown_period})
}
"""Rules of both kinds, by code."""
MOST_PIPELINE: Final = 1000
"""Largest number of cycles that a profile may give a pipeline."""


def word_bytes(payload_bytes: Number) -> Number:
    """Cyclic data of a device in whole words [bytes].

    Examples
    --------
    >>> word_bytes(5), word_bytes(6)
    (6.0, 6.0)
    """
    return rounded_up(payload_bytes / c.WORD_BYTES) * c.WORD_BYTES


_CYCLE: Final = "cycle"
DELAYS: Final = (
    Figure(
        "node_us",
        "t_node",
        "profile",
        "slowest node: from its sample to its telegram, or from its command to the effect",
        "in the node",
    ),
    Figure("before_us", "t_before", _CYCLE, "time of the master and of the cycle before it", "before it in the cycle"),
    Figure("telegrams_us", "t_tel", _CYCLE, "telegrams that carry it", "its telegrams"),
    Figure("ring_us", "t_ring", _CYCLE, "delay of the ring", "ring"),
    Figure("delay_us", "t", _CYCLE, "from sample to host, or from the start of the cycle to the effect", "delay"),
)
"""Parts of a delay in the order in which they add up, then the delay."""
Sent: TypeAlias = tuple[Number, Number]
"""Time that the cycle takes before feedback or a command, and time of the telegrams that carry it [us]."""
KEYS: Final[Mapping[str, Key]] = {
    "bus.pipeline_cycles": Key("n", "PIPELINE_CYCLES", role="pipeline"),
    "node.execution.worst_extra_us": Key("T_extra"),
}


def starter(bus: str) -> Starter:
    """Defaults of a new profile with the given section [bus]."""
    return Starter(
        bus,
        slice_ratio="1            # assumed: the master computes beside the telegrams, within bus.pipeline_cycles",
        measure="it runs beside the telegrams; take it from the drives' data, S-0-0005 (SERCOS III: S-0-1005)",
        base="from a sample to the telegram that carries it, and from a command to its effect",
    )


def delays(
    network: Network, *, feedback_us: Sent, command_us: Sent, ring_us: Number = 0.0
) -> tuple[BusLatency, BusLatency]:
    """Age of feedback when the host has it, and delay of a command up to its effect.

    All nodes sample at once, and take their commands over at once.
    """
    write_us = (group.slowest_us("write") for group in network.groups)
    return (
        _delay("feedback", _slowest_read_us(network), *feedback_us, ring_us),
        _delay("command", reduce(larger, write_us), *command_us, ring_us),
    )


def _slowest_read_us(network: Network) -> Number:
    return reduce(larger, (group.slowest_us("read") for group in network.groups))


def _delay(name: str, *parts_us: Number) -> BusLatency:
    *parts, whole = DELAYS
    phases = dict(zip((figure.key for figure in parts), parts_us, strict=True))
    return BusLatency(name, None, {**phases, whole.key: total(parts_us)})


class SercosCycle(BusCycle):
    """A cycle of SERCOS I, II or III."""

    @abstractmethod
    def both_delays(self) -> tuple[BusLatency, BusLatency]:
        """Age of feedback when the host has it, and delay of a command up to its effect."""

    def latencies(self) -> tuple[BusLatency, ...]:
        """Age of feedback and delay of commands, as far as nodes have them."""
        groups, both = self.network.groups, zip(TRANSACTION_KINDS, self.both_delays(), strict=True)
        return tuple(latency for kind, latency in both if any(group.has(kind) for group in groups))

    @property
    @abstractmethod
    def feedback_due_us(self) -> Number:
        """Time from the start of the cycle by which all nodes must have their feedback ready [us]."""

    def arrival_us(self, node: int) -> float:  # noqa: ARG002 - all at once
        """Time at which the last byte of the MDT has passed the ring, so that all nodes have their commands [us]."""
        _, command = self.both_delays()
        return command.phases["delay_us"] - command.phases["node_us"]

    def sampled_us(self) -> float:
        """Time at which all nodes sample at once, early enough for the slowest [us]."""
        return self.feedback_due_us - _slowest_read_us(self.network)

    def loop_periods(self, *, at_sync: bool) -> int:
        """Periods inside a loop [1]: the pipeline; `at_sync` also the cycles until drives act, at their next sample."""
        pipeline = int(self.network.profile.bus.pipeline_cycles)
        if not at_sync:
            return pipeline
        _, command = self.both_delays()
        late_us = command.phases["delay_us"] - self.sampled_us()
        return pipeline + ceil(late_us / self.network.period_us)


class SercosBus(Bus):
    """A ring of SERCOS, whose drives work beside the telegrams."""

    def latency_subject(self, network: Network) -> str:
        """Words for the way that the delays cover, and for the settings of the bus."""
        return ", ".join(("feedback and commands of all nodes", *self.setup_words(network)))

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - of every network
        """Whether execution counts: in latencies only, since drives sample before their telegram."""
        return of_latency
