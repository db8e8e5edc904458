"""SERCOS III, as a kind of bus."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.network import Network
from busplan.buses.parts import Cost, Limit, PayloadRange, Perturbation, Setting, Starter, TimingModel
from busplan.buses.rule import Rule
from busplan.buses.sercos import BASE, DELAYS, MEASURE, PIPELINE_CYCLES, WHOLE_PERIOD, WORD_BYTES, SercosBus
from busplan.buses.sercos3 import figures, rules
from busplan.buses.sercos3.constants import (
    COMPONENT_DELAY_US,
    CONNECTION_BYTES,
    CONSTANTS,
    DEFAULT_GAP_BYTES,
    DEVICE_DELAY_US,
    LEAST_UCC_US,
    MASTER_DELAY_US,
    MASTER_JITTER_US,
    MOST_BYTES,
    MOST_TELEGRAMS,
    PERIODS,
)
from busplan.buses.sercos3.cycle import EVENTS, STRETCHES, TELEGRAMS, WINDOW, Sercos3Cycle
from busplan.buses.sercos3.limits import LIMITS
from busplan.elementwise import plain
from busplan.sourced import Sourced

if TYPE_CHECKING:
    from busplan.buses.published import EvidenceSection
    from busplan.buses.sercos3.section import Sercos3Profile

_METHOD: Final = "bus.timing_method"
_METHODS: Final = ("mdt-at-ucc", "mdt-ucc-at", "at-last")


class Sercos3(SercosBus):
    """SERCOS III, whose devices take their data from the MDT and put theirs into the AT while these pass."""

    kind = "sercos3"
    title = "SERCOS III"
    timing_models = (
        TimingModel(WINDOW, "telegrams, jitter, master and devices, and the ring delay where the method has it"),
        TimingModel(TELEGRAMS, "telegrams and their gaps alone, as performance tables count"),
    )
    deciding_model = WINDOW
    term_figures = figures.TERMS
    capacity_figures = figures.CAPACITY
    compared_figures = figures.COUNTS
    table_figures = figures.COUNTS
    latency_table_figures = DELAYS
    planned_figures = tuple(one.key for one in figures.COUNTS)
    limits: ClassVar[tuple[Limit, ...]] = LIMITS
    rules: ClassVar[tuple[Rule, ...]] = rules.RULES
    periods = PERIODS
    starter = Starter(
        """\
[bus]
kind = "sercos3"
version = "V1.1"           # assumed: from V1.1 on each device's data carry 2 bytes of connection control
gap_bytes = 37             # what every device takes; S-0-1036 of the network says what it runs at""",
        slice_ratio=WHOLE_PERIOD,
        measure=MEASURE,
        base=BASE,
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants: ClassVar[Mapping[str, Sourced]] = CONSTANTS
    key_sources: ClassVar[Mapping[str, Sourced]] = {
        "bus.gap_bytes": DEFAULT_GAP_BYTES,
        "bus.device_delay_us": DEVICE_DELAY_US,
        "bus.master_jitter_us": MASTER_JITTER_US,
        "bus.master_delay_us": MASTER_DELAY_US,
        "bus.component_delay_us": COMPONENT_DELAY_US,
        "bus.pipeline_cycles": PIPELINE_CYCLES,
    }
    key_symbols: ClassVar[Mapping[str, str]] = {
        "bus.gap_bytes": "gap",
        "bus.device_delay_us": "t_dev",
        "bus.master_jitter_us": "J_master",
        "bus.master_delay_us": "t_master",
        "bus.component_delay_us": "t_comp",
        "bus.at_start_us": "t_1,min",
        "bus.pipeline_cycles": "n",
        "node.execution.worst_extra_us": "T_extra",
    }
    warning_keys = ("cycle.nonperiodic_us",)
    warning_constants = (LEAST_UCC_US,)
    change_meanings: ClassVar[Mapping[str, str]] = {
        "bus.nodes": "the others on a second network",
        _METHOD: "a setting of the master",
    }
    change_words: ClassVar[Mapping[str, str]] = {_METHOD: "method {}"}
    evidence_data = ("sercos3",)
    evidence_profiles = ("sercos3-servo-8",)

    def profile_model(self) -> "type[Sercos3Profile]":
        """The model of its profiles."""
        from busplan.buses.sercos3.section import Sercos3Profile  # the one module of the bus that loads pydantic

        return Sercos3Profile

    def cycle(self, network: Network, *, model: str) -> Sercos3Cycle:
        """The cycle of a network under one timing model."""
        return Sercos3Cycle(network, model)

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """The other timing methods, in the order of CoSeMa."""
        own = network.profile.bus.timing_method
        values = tuple({_METHOD: one} for one in _METHODS if one != own)
        return (Setting("timing_method", "timing method", Cost.SCHEDULE, (_METHOD,), values),)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """A wider gap, and slower devices."""
        bus = network.profile.bus
        beside = "" if bus.timing_method != "mdt-at-ucc" else "this timing method has no ring delay"
        return (
            Perturbation("gap +1 byte", {"bus.gap_bytes": bus.gap_bytes + 1}),
            Perturbation(
                "delay of a device +0.1 us", {"bus.device_delay_us": bus.device_delay_us + 0.1}, if_nothing=beside
            ),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Whole words that four telegrams carry for all devices, no more than one carries for a device."""
        share = int(MOST_TELEGRAMS * MOST_BYTES) // int(plain(network.nodes))
        return PayloadRange(
            int(WORD_BYTES), min(share, int(MOST_BYTES - CONNECTION_BYTES)), "telegrams", carrier="four telegrams"
        )

    def way_charged(self, network: Network) -> str:  # noqa: ARG002 - all alike
        """Say what each device is charged."""
        return "every device its connection control and its data"

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Version, timing method and gap."""
        bus = network.profile.bus
        return (bus.version, f"timing method {bus.timing_method}", f"gap {bus.gap_bytes} bytes")

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:  # noqa: ARG002 - whatever their number
        """A channel for other frames that the master does not open."""
        given_us = plain(network.nonperiodic_us)
        if not 0 < given_us < LEAST_UCC_US:
            return []
        why = f"the master opens no channel for other frames of less than {LEAST_UCC_US:g} us"
        return [f"Warning: cycle.nonperiodic_us = {given_us:g}: {why}."]

    def evidence(
        self, networks: Mapping[str, Network], published: Mapping[str, Mapping[str, Any]]
    ) -> "tuple[EvidenceSection, ...]":
        """Compare the drives that are published of a network with those that the telegrams carry."""
        from busplan.buses.sercos3.evidence import performance  # one command alone asks for it

        return performance(networks["sercos3-servo-8"], published["sercos3"])


BUS: Final = Sercos3()
