"""CAN 2.0 with a CANopen cycle, as a kind of bus."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.can import figures, rules
from busplan.buses.can.constants import (
    BASE_BITS,
    CONSTANTS,
    FRAME_BYTES,
    MAX_LOAD,
    MOST_PDOS,
    PIPELINE_CYCLES,
    SYNC_IDENTIFIER,
)
from busplan.buses.can.cycle import EVENTS, NONE, STRETCHES, WORST, CanCycle
from busplan.buses.can.limits import LIMITS
from busplan.buses.figure import Figure
from busplan.buses.network import Network
from busplan.buses.parts import Limit, PayloadRange, Perturbation, Setting, Starter, TimingModel
from busplan.buses.rule import Rule
from busplan.elementwise import Number, larger, plain
from busplan.sourced import Sourced

if TYPE_CHECKING:
    from busplan.buses.can.section import CanProfile
    from busplan.buses.published import EvidenceSection

_HOST_STEP_US: Final = 10.0


class Can(Bus):
    """Classical CAN, whose nodes send at SYNC."""

    kind = "can"
    title = "CAN"
    timing_models = (
        TimingModel(WORST, "as many stuff bits as a frame of its length can have"),
        TimingModel(NONE, "no stuff bits"),
    )
    deciding_model = WORST
    term_figures = figures.TERMS
    capacity_figures = figures.CAPACITY
    setup_figures = (figures.BIT_RATE,)
    compared_figures = figures.LOADS
    table_figures = figures.LOADS
    latency_table_figures = figures.LATENCY_TABLE
    has_many_transactions = True
    planned_figures = ("bus_load",)
    facts = ("bit_rate_kbit_s",)
    limits: ClassVar[tuple[Limit, ...]] = LIMITS
    rules: ClassVar[tuple[Rule, ...]] = rules.RULES
    starter = Starter(
        """\
[bus]
kind = "can"
bit_rate_kbit_s = 1000     # assumed: the cable decides, 1000 for less than 40 m or so
pipeline_cycles = 1        # assumed: the host computes in the next cycle; 0: in the same one, in bus.host_us""",
        period="10ms",
        slice_ratio="1            # assumed: the whole period is for communication",
        measure="measure both on a node: SYNC to its frame, command to effect",
        base="from SYNC to a queued feedback PDO, and from a command PDO to its effect",
    )
    command_events = (("command", "command_frame"),)
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants: ClassVar[Mapping[str, Sourced]] = CONSTANTS
    key_sources: ClassVar[Mapping[str, Sourced]] = {
        "bus.pipeline_cycles": PIPELINE_CYCLES,
        "bus.sync_identifier": SYNC_IDENTIFIER,
        "limits.max_load": MAX_LOAD,
    }
    key_symbols: ClassVar[Mapping[str, str]] = {
        "bus.bit_rate_kbit_s": "f",
        "bus.identifier_bits": "id_bits",
        "bus.host_us": "host",
        "bus.pipeline_cycles": "n",
        "node.execution.worst_extra_us": "T_extra",
        "message.payload_bytes": "s",
        "message.period_us": "T",
        "message.jitter_us": "J",
        "message.deadline_us": "D",
        "message.identifier": "id",
    }
    change_meanings: ClassVar[Mapping[str, str]] = {
        "bus.nodes": "the others on a second bus",
        "bus.bit_rate_kbit_s": "if the cable is short enough",
        "bus.identifier_bits": "all identifiers fit",
    }
    change_words: ClassVar[Mapping[str, str]] = {
        "bus.bit_rate_kbit_s": "{} kbit/s",
        "bus.identifier_bits": "identifiers of {} bits",
        "payload.pdo_per": "PDOs of each {}",
        "pdo_per": "PDOs of each {}",
    }
    term_removals: ClassVar[tuple[Mapping[str, float], ...]] = ({"bus.host_us": 0.0},)
    evidence_data = ("can", "paper")
    model_error = "this timing model takes 8 to 15% more than frames that were measured"
    loop_key = "bus.pipeline_cycles"

    def profile_model(self) -> "type[CanProfile]":
        """The model of its profiles."""
        from busplan.buses.can.section import CanProfile  # the one module of the bus that loads pydantic

        return CanProfile

    def cycle(self, network: Network, *, model: str) -> CanCycle:
        """The cycle of a network under one timing model."""
        return CanCycle(network, model)

    @property
    def latency_figures(self) -> tuple[Figure, ...]:
        """Of `latency`, in the order of its document."""
        return figures.LATENCY

    def latency_subject(self, network: Network) -> str:
        """Say whose response time it is."""
        return ", ".join((f"worst case of SYNC, of the last PDO of {_all_nodes(network)}", *self.setup_words(network)))

    def shortest_period_us(self, network: Network, needed_us: Number) -> Number:
        """The shortest period that gives a cycle its time and keeps the load; deadlines may ask for more [us]."""
        return larger(super().shortest_period_us(network, needed_us), CanCycle(network, WORST).load_period_us)

    def latency_has_execution(self, network: Network) -> bool:  # noqa: ARG002 - none has
        """A response time ends when the frame has arrived, and begins when it is queued."""
        return False

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """PDOs of each axis, a higher bit rate, identifiers of 11 bits."""
        from busplan.buses.can.settings import settings  # plans alone ask for them

        return settings(network)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """A slower host, SYNC with its counter, and identifiers of 29 bits."""
        bus = network.profile.bus
        counted = "SYNC has its counter already" if bus.sync_counter else ""
        extended = "they have 29 bits already" if bus.identifier_bits > BASE_BITS else ""
        elsewhere = "the host computes in cycles of its own" if bus.pipeline_cycles else ""
        return (
            Perturbation(
                f"host +{_HOST_STEP_US:g} us", {"bus.host_us": bus.host_us + _HOST_STEP_US}, why_not=elsewhere
            ),
            Perturbation("SYNC with counter", {"bus.sync_counter": True}, why_not=counted),
            Perturbation("identifiers of 29 bits", {"bus.identifier_bits": 29}, why_not=extended),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Whole bytes up to four frames."""
        largest = int(MOST_PDOS * FRAME_BYTES)
        each = min((plain(one.axes) for one in network.groups if one.said.payload.pdo_per == "axis"), default=1)
        return PayloadRange(1, largest * max(int(each), 1), "PDOs", carrier="four frames")

    def loop_periods(self, network: Network, *, at_sync: bool) -> int:
        """The host's pipeline, and the period to the next SYNC."""
        return super().loop_periods(network, at_sync=at_sync) + int(plain(network.profile.bus.pipeline_cycles))

    def sync_jitter_us(self, network: Network) -> Number:
        """Half of what messages may hold SYNC up [us]."""
        return CanCycle(network, WORST).sync_spread_us / 2

    def way_charged(self, network: Network) -> str:  # noqa: ARG002 - all alike
        """Say what each frame is charged."""
        return "every frame with the stuff bits of its length"

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """The bit rate."""
        return (f"{network.profile.bus.bit_rate_kbit_s} kbit/s",)

    def evidence(
        self,
        networks: Mapping[str, Network],  # noqa: ARG002 - it is asked for frames and messages alone
        published: Mapping[str, Mapping[str, Any]],
    ) -> "tuple[EvidenceSection, ...]":
        """Compare published frames, loads and response times with what the equations give."""
        from busplan.buses.can.evidence import can_sections  # one command alone asks for it

        return can_sections(published["can"], published["paper"])


def _all_nodes(network: Network) -> str:
    return "all nodes" if network.is_uniform else "each group"


BUS: Final = Can()
