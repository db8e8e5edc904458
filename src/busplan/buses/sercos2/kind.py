"""SERCOS I and II, as a kind of bus."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.network import Network
from busplan.buses.parts import Limit, PayloadRange, Perturbation, Starter, TimingModel
from busplan.buses.rule import Rule
from busplan.buses.sercos import BASE, DELAYS, MEASURE, PIPELINE_CYCLES, WHOLE_PERIOD, WORD_BYTES, SercosBus
from busplan.buses.sercos2 import figures, rules
from busplan.buses.sercos2.constants import CONSTANTS, MOST_DRIVE_BYTES, PERIODS, TURNAROUND_US
from busplan.buses.sercos2.cycle import EVENTS, NONE, STRETCHES, WORST, Sercos2Cycle
from busplan.buses.sercos2.limits import LIMITS
from busplan.elementwise import plain
from busplan.sourced import Grade, Sourced

if TYPE_CHECKING:
    from busplan.buses.published import EvidenceSection
    from busplan.buses.sercos2.section import Sercos2Profile

_FASTEST: Final = 16


class Sercos2(SercosBus):
    """SERCOS I and II, whose drives answer one after the other, and are told in one telegram."""

    kind = "sercos2"
    title = "SERCOS I and II"
    timing_models = (
        TimingModel(WORST, "a stuff bit behind every five bits, the most there can be"),
        TimingModel(NONE, "no stuff bits"),
    )
    deciding_model = WORST
    term_figures = figures.TERMS
    capacity_figures = figures.CAPACITY
    setup_figures = (figures.DATA_RATE,)
    compared_figures = (figures.MDT_BYTES,)
    table_figures = (figures.MDT_BYTES,)
    latency_table_figures = DELAYS
    facts = ("data_rate_mbit_s",)
    limits: ClassVar[tuple[Limit, ...]] = LIMITS
    rules: ClassVar[tuple[Rule, ...]] = rules.RULES
    periods = PERIODS
    starter = Starter(
        """\
[bus]
kind = "sercos2"
data_rate_mbit_s = 16      # assumed: 2 or 4, and with SERCOS II 8 or 16
at_gap_us = 5              # assumed: no public figure says it; the master's time slots do""",
        slice_ratio=WHOLE_PERIOD,
        measure=MEASURE,
        base=BASE,
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants: ClassVar[Mapping[str, Sourced]] = CONSTANTS
    key_sources: ClassVar[Mapping[str, Sourced]] = {
        "bus.turnaround_us": TURNAROUND_US,
        "bus.pipeline_cycles": PIPELINE_CYCLES,
    }
    key_grades: ClassVar[Mapping[str, Grade]] = {"bus.at_gap_us": "assumed"}
    key_symbols: ClassVar[Mapping[str, str]] = {
        "bus.data_rate_mbit_s": "f",
        "bus.at_gap_us": "t_gap",
        "bus.at_start_us": "t_1",
        "bus.turnaround_us": "t_ATMT",
        "bus.recovery_us": "t_MTSY",
        "bus.pipeline_cycles": "n",
        "node.execution.worst_extra_us": "T_extra",
    }
    change_meanings: ClassVar[Mapping[str, str]] = {"bus.nodes": "the others on a second ring"}
    evidence_data = ("sercos2", "paper")
    evidence_profiles = ("sercos2-servo-8",)

    def profile_model(self) -> "type[Sercos2Profile]":
        """The model of its profiles."""
        from busplan.buses.sercos2.section import Sercos2Profile  # the one module of the bus that loads pydantic

        return Sercos2Profile

    def cycle(self, network: Network, *, model: str) -> Sercos2Cycle:
        """The cycle of a network under one timing model."""
        return Sercos2Cycle(network, model)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """A longer gap, and the fastest ring."""
        bus = network.profile.bus
        fastest = "it is the fastest already" if bus.data_rate_mbit_s == _FASTEST else ""
        return (
            Perturbation("gap between two drives +1 us", {"bus.at_gap_us": bus.at_gap_us + 1}),
            Perturbation(f"{_FASTEST} Mbit/s", {"bus.data_rate_mbit_s": _FASTEST}, why_not=fastest),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Whole words, as many as a drive can be told to send for each of its axes."""
        axes = min((int(plain(one.axes)) for one in network.groups), default=1)
        return PayloadRange(
            int(WORD_BYTES), int(MOST_DRIVE_BYTES) * max(axes, 1), "drives", carrier="a drive's telegram"
        )

    def way_charged(self, network: Network) -> str:  # noqa: ARG002 - all alike
        """Say what each drive is charged."""
        return "every drive its telegram and its record"

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """The data rate and the gap."""
        bus = network.profile.bus
        return (f"{bus.data_rate_mbit_s} Mbit/s", f"gap of {bus.at_gap_us:g} us between two drives (assumed)")

    def evidence(
        self, networks: Mapping[str, Network], published: Mapping[str, Mapping[str, Any]]
    ) -> "tuple[EvidenceSection, ...]":
        """Say which gap between two drives would make the published number of axes fit."""
        from busplan.buses.sercos2.evidence import axes_of_a_ring  # one command alone asks for it

        return axes_of_a_ring(networks["sercos2-servo-8"], published["sercos2"], published["paper"])


BUS: Final = Sercos2()
