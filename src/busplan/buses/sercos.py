"""What SERCOS I, II and III share: how long feedback and a command are on their way."""

from collections.abc import Callable
from functools import reduce
from typing import Final, TypeAlias

from busplan.buses.bus import Bus
from busplan.buses.cycle import BusLatency
from busplan.buses.figure import NODES, TIMING_MODEL, TRANSACTION, Figure
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, larger, total

_CYCLE: Final = "cycle"
DELAYS: Final = (
    Figure(
        "node_us",
        "t_node",
        "profile",
        "slowest node: from its sample to its telegram, or from its command to the effect",
        "in the node",
    ),
    Figure("before_us", "t_before", _CYCLE, "what the master and the cycle do before it", "before it in the cycle"),
    Figure("telegrams_us", "t_tel", _CYCLE, "telegrams that carry it", "its telegrams"),
    Figure("ring_us", "t_ring", _CYCLE, "delay of the ring", "ring"),
    Figure("delay_us", "t", _CYCLE, "from sample to host, or from the start of the cycle to the effect", "delay"),
)
"""In the order in which they add up."""
Sent: TypeAlias = tuple[Number, Number]
WHOLE_PERIOD: Final = (
    "1            # assumed: the host computes in the next cycle with what it has received in this one"
)
MEASURE: Final = "it runs beside the telegrams; take it from the drives' data, S-0-0005 (SERCOS III: S-0-1005)"
BASE: Final = "from a sample to the telegram that carries it, and from a command to its effect"
"""What a new profile says of the slice and of the execution times."""
LATENCY: Final = (TIMING_MODEL, TRANSACTION, NODES, *DELAYS)


def delays(network: Network, *, feedback_us: Sent, command_us: Sent, ring_us: Number = 0.0) -> tuple[BusLatency, ...]:
    """How old feedback is when the host has it, and how late a command takes effect.

    Parameters
    ----------
    network
        The network; its nodes sample at once, and take their commands over at once.
    feedback_us, command_us
        What the cycle sends before them, and the telegrams that carry them [us].
    ring_us
        Delay of the ring [us].
    """
    return (
        _delay("feedback", _slowest(network, lambda one: one.read_execution_us), *feedback_us, ring_us),
        _delay("command", _slowest(network, lambda one: one.write_execution_us), *command_us, ring_us),
    )


def _slowest(network: Network, execution_us: Callable[[Group], Number]) -> Number:
    return reduce(larger, (execution_us(one) + one.worst_extra_us for one in network.groups))


def _delay(name: str, *parts_us: Number) -> BusLatency:
    *parts, whole = DELAYS
    phases = dict(zip((one.key for one in parts), parts_us, strict=True))
    return BusLatency(name, None, {**phases, whole.key: total(parts_us)})


class SercosBus(Bus):
    """A ring of SERCOS: its drives work beside the telegrams."""

    @property
    def latency_figures(self) -> tuple[Figure, ...]:
        """Of `latency`, in the order of its document."""
        return LATENCY

    def latency_subject(self, network: Network) -> str:
        """Say whose delay it is, and how the bus is set."""
        return ", ".join(("feedback and commands of all nodes", *self.setup_words(network)))

    def has_execution(self, network: Network) -> bool:  # noqa: ARG002 - none has
        """It runs beside the telegrams: drives sample before their telegram, and act behind the last MDT."""
        return False

    def latency_has_execution(self, network: Network) -> bool:  # noqa: ARG002 - always
        """The nodes' time is in every latency."""
        return True
