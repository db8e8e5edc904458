"""SERCOS III as a kind of bus."""

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import ClassVar, Final

from busplan.buses.limits import NODE_LIMIT, ExactLimit, WakeUp, nodes_limit, period_limit
from busplan.buses.network import Network
from busplan.buses.parts import Cost, Key, PayloadRange, Perturbation, Setting, TimingModel
from busplan.buses.sercos.sercos3 import (
    FIGURES,
    PERIODS,
    SORTS,
    c,
    data_bytes,
    telegrams_of,
)
from busplan.buses.sercos.sercos3_cycle import EVENTS, STRETCHES, TELEGRAMS, WINDOW, Sercos3Cycle
from busplan.buses.sercos.shared import KEYS, RULES, SercosBus, starter
from busplan.elementwise import Number, larger

_METHOD: Final = "bus.timing_method"
_JITTER_STEP_US: Final = 1.0
_METHODS: Final = ("mdt-at-ucc", "mdt-ucc-at", "at-last")


def _most_telegrams(network: Network) -> Number:
    return reduce(larger, (telegrams_of(network, kind).filling.telegrams for kind in SORTS))


def _largest_telegram(network: Network) -> Number:
    return data_bytes(network, network.largest_payload_bytes) + telegrams_of(network, "write").next_bytes


LIMITS: Final = (
    period_limit(PERIODS),
    NODE_LIMIT,
    nodes_limit("devices", lambda: c.MOST_DEVICES, "network"),
    ExactLimit(
        "payload",
        "a device's data make a telegram of {value:.0f} bytes, over {most:.0f}",
        _largest_telegram,
        lambda _network: c.MOST_BYTES,
        way_out="use a smaller payload",
    ),
    ExactLimit(
        "telegrams",
        "{value:.0f} telegrams in one direction are over the {most:.0f} of a cycle",
        _most_telegrams,
        lambda _network: c.MOST_TELEGRAMS,
        way_out="use a smaller payload or a second network",
    ),
    WakeUp("bus.master_jitter_us"),
)


class Sercos3(SercosBus):
    """SERCOS III, whose devices take their data from the MDT and put theirs into the AT while these pass."""

    kind = "sercos3"
    title = "SERCOS III"
    also_called = ("SERCOS",)  # A user who names no version means the newest.
    timing_models = (
        TimingModel(WINDOW, "telegrams, jitter, master and devices, and the ring delay where the method has it"),
        TimingModel(TELEGRAMS, "telegrams and their gaps alone, as performance tables count"),
    )
    figures = FIGURES
    limits = LIMITS
    rules = (RULES["BP141"],)
    periods = PERIODS
    starter = starter(
        """\
[bus]
kind = "sercos3"
version = "V1.1"           # assumed: from V1.1 on each device's data carry 2 bytes of connection control
gap_bytes = 37             # what every device takes; S-0-1036 of the network says what it runs at"""
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.nodes": Key(meaning="move the other devices to a second network"),
        "bus.gap_bytes": Key("gap", "DEFAULT_GAP_BYTES"),
        "bus.device_delay_us": Key("t_dev", "DEVICE_DELAY_US"),
        "bus.master_jitter_us": Key("J_master", "MASTER_JITTER_US", role="wake-up"),
        "bus.master_delay_us": Key("t_master", "MASTER_DELAY_US"),
        "bus.component_delay_us": Key("t_comp", "COMPONENT_DELAY_US"),
        "bus.at_start_us": Key("t_1,min"),
        _METHOD: Key(meaning="a setting of the master"),
        **KEYS,
    }
    evidence_data = ("sercos3",)

    def cycle(self, network: Network, *, model: str) -> Sercos3Cycle:
        """Cycle of a network under a timing model."""
        return Sercos3Cycle(network, model)

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """Setting of the other timing methods, in the order of CoSeMa."""
        current = network.profile.bus.timing_method
        values = tuple({_METHOD: method} for method in _METHODS if method != current)
        return (Setting("timing_method", "timing method", Cost.SCHEDULE, (_METHOD,), values),)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """Perturbations: a wider gap, slower devices, and a later wake-up of the master."""
        bus = network.profile.bus
        beside = "" if bus.timing_method != "mdt-at-ucc" else "this timing method has no ring delay"
        later = {"bus.master_jitter_us": bus.master_jitter_us + _JITTER_STEP_US}
        return (
            Perturbation("gap +1 byte", {"bus.gap_bytes": bus.gap_bytes + 1}),
            Perturbation(
                "delay of a device +0.1 us", {"bus.device_delay_us": bus.device_delay_us + 0.1}, if_nothing=beside
            ),
            Perturbation(f"master's jitter +{_JITTER_STEP_US:g} us", later),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Payloads in whole words: four telegrams hold those of all devices, one telegram that of a device."""
        share = int(c.MOST_TELEGRAMS * c.MOST_BYTES) // int(network.nodes)
        return PayloadRange(
            int(c.WORD_BYTES), min(share, int(c.MOST_BYTES - c.CONNECTION_BYTES)), carrier="four telegrams"
        )

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Words for version, timing method and gap."""
        bus = network.profile.bus
        return (bus.version, f"timing method {bus.timing_method}", f"gap {bus.gap_bytes} bytes")

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:  # noqa: ARG002 - whatever their number
        """Warning of a channel for other frames that the master does not open."""
        given_us = network.nonperiodic_us
        if not 0 < given_us < c.LEAST_UCC_US:
            return []
        why = f"the master opens no channel for other frames of less than {c.LEAST_UCC_US:g} us"
        return [f"cycle.nonperiodic_us = {given_us:g}: {why}"]


BUS: Final = Sercos3()
