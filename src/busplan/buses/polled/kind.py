"""Polled buses as a kind of bus."""

from collections.abc import Callable, Mapping
from functools import reduce
from itertools import chain
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.limits import NODE_LIMIT, ExactLimit, WakeUp
from busplan.buses.network import Network
from busplan.buses.parts import (
    Cost,
    Key,
    PayloadRange,
    Perturbation,
    Setting,
    Starter,
    TimingModel,
    Value,
)
from busplan.buses.polled.cycle import EVENTS, FIGURES, STANDARD, STRETCHES, TYPICAL, PolledCycle
from busplan.buses.polled.protocols import FASTEST_FIRST, NO_ADAPTER, adapter_of, c, protocol_of
from busplan.elementwise import Number, larger

if TYPE_CHECKING:
    from busplan.buses.polled.section import PolledBus

_LONGER_TIMER_US: Final = 1000.0
"""Step of the adapter's timer in sensitivities [us]."""


def _largest_bytes(network: Network) -> Number:
    """Most data of a telegram for one node [bytes]."""
    bus, protocol = network.profile.bus, protocol_of(network.profile.bus)
    reads, writes = (1, 1) if PolledCycle(network, STANDARD).way == "exchange" else (bus.reads, bus.writes)
    sizes = (
        (protocol.most_data_bytes(group.read_bytes, reads), protocol.most_data_bytes(group.write_bytes, writes))
        for group in network.groups
    )
    return reduce(larger, chain.from_iterable(sizes))


LIMITS: Final = (
    NODE_LIMIT,
    ExactLimit(
        "nodes",
        "{value:.0f} nodes are over the {most:.0f} of a bus",
        lambda network: network.nodes,
        lambda network: protocol_of(network.profile.bus).max_nodes,
        way_out="a second bus has room for more",
    ),
    ExactLimit(
        "payload",
        "a telegram has {value:.0f} bytes of data, over {most:.0f}",
        _largest_bytes,
        lambda network: protocol_of(network.profile.bus).max_bytes,
        way_out="use a smaller payload",
    ),
    ExactLimit(
        "range",
        "{value:g} kbit/s are over the {most:g} of the protocol",
        lambda network: network.profile.bus.bit_rate_kbit_s,
        lambda network: protocol_of(network.profile.bus).max_bit_rate_kbit_s,
        way_out="use a lower bit rate",
    ),
    WakeUp("bus.master_jitter_us"),
)


_SECTIONS: Final = {
    table.lower(): f'[bus]\nkind = "polled"\nprotocol = "{words["name"]}"\n{words["start"]}'
    for table, words in c.beside.items()
}
"""Section [bus] of a new profile, by the name of its variant in `init`."""


def _longer_timer(bus: "PolledBus") -> Perturbation:
    """The adapter's timer 1 ms longer; for an adapter by its name, that with the next longer timer."""
    if bus.adapter is not None and not isinstance(bus.adapter, str):
        longer_us = bus.adapter.timer_us + _LONGER_TIMER_US
        return Perturbation(f"timer of the adapter +{_LONGER_TIMER_US:g} us", {"bus.adapter.timer_us": longer_us})
    timers, now_us = c.by_key("ADAPTER_TIMER_US"), adapter_of(bus).timer_us
    longer = sorted((timer_us, name) for name, timer_us in timers.items() if timer_us > now_us)
    if not longer:
        return Perturbation("a longer timer of the adapter", {}, why_not="no usual adapter has one")
    timer_us, name = longer[0]
    return Perturbation(f"timer of the adapter {timer_us:g} us", {"bus.adapter": name})


class Polled(Bus):
    """Serial buses whose master asks its nodes one by one: PROFIBUS, Modbus, serial servos, WorldFIP."""

    kind = "polled"
    title = "polled bus"
    also_called = tuple(name for words in c.beside.values() for name in words["called"])
    timing_models = (
        TimingModel(STANDARD, "answers midway between typical and longest; U reaches to both"),
        TimingModel(TYPICAL, "answers as typical nodes give them, as vendors' rules count"),
    )
    figures = FIGURES
    limits = LIMITS
    starter = Starter(
        _SECTIONS["profibus"],
        variants=_SECTIONS,
        tables={table.lower(): words["execution"] for table, words in c.beside.items() if "execution" in words},
        servos={table.lower(): words["nodes"] for table, words in c.beside.items() if "nodes" in words},
        bases_us={table.lower(): words["base_us"] for table, words in c.beside.items() if "base_us" in words},
        period="10ms",
        measure="from the end of a request to the answer, less bus.return_delay_us",
        base="time of a node before it answers",
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    rate_keys = ("bus.bit_rate_kbit_s",)
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.protocol": Key(chooses=True),
        "bus.nodes": Key(meaning="move the other nodes to a second bus"),
        "bus.bit_rate_kbit_s": Key("f", meaning="in every node"),
        "bus.requests": Key(chooses=True, meaning="if the host's software and the nodes can"),
        "bus.return_delay_us": Key("t_delay", meaning="in every node"),
        "bus.clock_tolerance": Key("df"),
        "bus.adapter": Key(grade="assumed"),
        "bus.adapter.timer_us": Key("T_L", grade="assumed"),
        "bus.adapter.packet_bytes": Key("P", default="ADAPTER_PACKET_BYTES[ftdi]"),
        "bus.adapter.frame_us": Key("t_frame", default="ADAPTER_FRAME_US[ftdi]"),
        "bus.host_us": Key("t_host", role="host"),
        "bus.master_jitter_us": Key("J", role="wake-up"),
        "node.execution.worst_extra_us": Key("T_extra"),
    }
    term_removals: ClassVar[tuple[Mapping[str, Value], ...]] = (
        {"bus.adapter": NO_ADAPTER},
        {"bus.master_jitter_us": 0.0},
    )
    evidence_data = ("polled", "mesa")

    def evidence_functions(self) -> Mapping[str, Callable[..., Any]]:
        """The time of the reads, or the writes, of a cycle."""
        return {"part_us": PolledCycle.part_us}

    def title_of(self, network: Network) -> str:
        """Name of the protocol; for a protocol of the user's own, the name of the kind."""
        return next(iter(protocol_of(network.profile.bus).called), self.title)

    def evidence_for(self, network: Network) -> tuple[str, ...]:
        """Evidence data for the network: the measured rates are of servos of one protocol."""
        return tuple(protocol_of(network.profile.bus).evidence)

    def cycle(self, network: Network, *, model: str) -> PolledCycle:
        """Cycle of a network under a timing model."""
        return PolledCycle(network, model)

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - as the cycle
        """Whether the cycle contains execution: nodes that answer from a buffer execute beside the telegrams."""
        return not protocol_of(network.profile.bus).is_buffered

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """Settings to try: the return delay, another bit rate, and another way to ask."""
        bus, protocol = network.profile.bus, protocol_of(network.profile.bus)
        delay_us = protocol.return_delay_us if bus.return_delay_us is None else bus.return_delay_us
        way = PolledCycle(network, STANDARD).way
        no_delay = ({"bus.return_delay_us": 0.0},) if delay_us else ()
        higher = tuple(
            {"bus.bit_rate_kbit_s": float(rate)} for rate in protocol.rates["kbit_s"] if rate > bus.bit_rate_kbit_s
        )
        ways = [other for other in FASTEST_FIRST if other in protocol.requests]
        faster = tuple({"bus.requests": other} for other in ways[: ways.index(way)][::-1])
        return (
            Setting("return_delay", "return delay", Cost.REGISTER, ("bus.return_delay_us",), no_delay),
            Setting("bit_rate", "bit rate", Cost.REGISTER, ("bus.bit_rate_kbit_s",), higher),
            Setting("requests", "way to ask", Cost.SCHEDULE, ("bus.requests",), faster),
        )

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """Perturbations: a longer timer of the adapter, a later wake-up, and one more repeated request."""
        bus = network.profile.bus
        no_timeout = "" if protocol_of(bus).has_token or bus.timeout_us is not None else "bus.timeout_us is not given"
        return (
            _longer_timer(bus),
            Perturbation("master's jitter +10 us", {"bus.master_jitter_us": bus.master_jitter_us + 10}),
            Perturbation("one more retry", {"bus.retries": bus.retries + 1}, why_not=no_timeout),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Payloads in whole bytes, up to what a telegram holds."""
        return PayloadRange(1, int(protocol_of(network.profile.bus).max_bytes), carrier="a telegram")

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Words for the protocol, the bit rate, and the way that nodes are asked."""
        bus, way = network.profile.bus, PolledCycle(network, STANDARD).way
        name = bus.protocol if isinstance(bus.protocol, str) else "a protocol of its own"
        asked = {"exchange": "an exchange with each node", "fast-sync": "fast sync requests"}.get(
            way, f"{way} requests"
        )
        words = f"adapter {bus.adapter}" if bus.adapter != NO_ADAPTER else "no adapter"
        if bus.adapter is not None and not isinstance(bus.adapter, str):
            words = f"adapter with a timer of {bus.adapter.timer_us:g} us"
        adapter = () if bus.adapter is None else (words,)
        return (name, f"{bus.bit_rate_kbit_s:g} kbit/s", asked, *adapter)


BUS: Final = Polled()
