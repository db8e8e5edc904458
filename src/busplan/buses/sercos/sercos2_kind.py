"""SERCOS I and II as a kind of bus."""

from collections.abc import Mapping
from typing import ClassVar, Final

from busplan.buses.limits import NODE_LIMIT, ExactLimit, nodes_limit, period_limit
from busplan.buses.network import Network
from busplan.buses.parts import Key, PayloadRange, Perturbation, TimingModel
from busplan.buses.sercos.sercos2 import (
    EVENTS,
    FIGURES,
    NONE,
    PERIODS,
    STRETCHES,
    WORST,
    Sercos2Cycle,
    c,
)
from busplan.buses.sercos.shared import KEYS, RULES, SercosBus, starter

_FASTEST: Final = 16

LIMITS: Final = (
    period_limit(PERIODS),
    NODE_LIMIT,
    nodes_limit("drives", lambda: c.MOST_DRIVES, "ring"),
    ExactLimit(
        "payload",
        "the MDT has {value:.0f} bytes of data, over {most:.0f}",
        lambda network: Sercos2Cycle(network, NONE).mdt_bytes,
        lambda _network: c.MOST_MDT_BYTES,
        way_out="use a smaller payload or a second ring",
    ),
)


class Sercos2(SercosBus):
    """SERCOS I and II, whose drives answer in turn and get their commands in a single telegram."""

    kind = "sercos2"
    title = "SERCOS I and II"
    also_called = ("SERCOS II", "SERCOS I", "SERCOS 1")
    timing_models = (
        TimingModel(WORST, "a stuff bit after every five bits, the worst case"),
        TimingModel(NONE, "no stuff bits"),
    )
    figures = FIGURES
    limits = LIMITS
    rules = (RULES["BP151"],)
    periods = PERIODS
    starter = starter(
        """\
[bus]
kind = "sercos2"
data_rate_mbit_s = 16      # assumed: 2 or 4, and with SERCOS II 8 or 16
at_gap_us = 5              # assumed: no public figure says it; the master's time slots do"""
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.nodes": Key(meaning="move the other drives to a second ring"),
        "bus.data_rate_mbit_s": Key("f"),
        "bus.at_gap_us": Key("t_gap", grade="assumed"),
        "bus.at_start_us": Key("t_1"),
        "bus.turnaround_us": Key("t_ATMT", "TURNAROUND_US"),
        "bus.recovery_us": Key("t_MTSY"),
        **KEYS,
    }
    evidence_data = ("sercos2",)

    def cycle(self, network: Network, *, model: str) -> Sercos2Cycle:
        """Cycle of a network under a timing model."""
        return Sercos2Cycle(network, model)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """Perturbations: a longer gap, and the fastest ring."""
        bus = network.profile.bus
        fastest = "it is the fastest already" if bus.data_rate_mbit_s == _FASTEST else ""
        return (
            Perturbation("gap between two drives +1 us", {"bus.at_gap_us": bus.at_gap_us + 1}),
            Perturbation(f"{_FASTEST} Mbit/s", {"bus.data_rate_mbit_s": _FASTEST}, why_not=fastest),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Payloads in whole words, up to what a drive can be told to send for each of its axes."""
        axes = min(int(group.axes) for group in network.groups)
        return PayloadRange(int(c.WORD_BYTES), int(c.MOST_DRIVE_BYTES) * max(axes, 1), carrier="a drive's telegram")

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Words for the data rate and the gap."""
        bus = network.profile.bus
        return (f"{bus.data_rate_mbit_s} Mbit/s", f"gap of {bus.at_gap_us:g} us between two drives (assumed)")


BUS: Final = Sercos2()
