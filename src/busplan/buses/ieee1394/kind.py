"""IEEE 1394 (FireWire) up to S400, as a kind of bus."""

from collections.abc import Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.figure import Figure
from busplan.buses.ieee1394 import figures, rules
from busplan.buses.ieee1394.broadcast import BroadcastCycle
from busplan.buses.ieee1394.constants import (
    CONSTANTS,
    MAX_GAP_COUNT,
    MAX_PAYLOAD_BYTES,
    PACKET_OVERHEAD_BYTES,
    PING_PER_NODE_US,
    PING_US,
    QUADLET_BYTES,
    REFERENCE_CABLE_M,
    SLICE_RATIO,
    safe_gap_count,
)
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.cycle_starts import EVENTS, STRETCHES, CycleWithStarts
from busplan.buses.ieee1394.limits import LIMITS
from busplan.buses.ieee1394.settings import gap_count, responses, schedule
from busplan.buses.ieee1394.timing import TIMING_MODELS, Responder, transaction
from busplan.buses.ieee1394.transactions import charges_own_hops, farthest_link, gap_count_of, hops_of, is_broadcast
from busplan.buses.network import Group, Network
from busplan.buses.parts import (
    Halves,
    Limit,
    PayloadRange,
    Perturbation,
    Setting,
    Starter,
    TimingModel,
    Value,
)
from busplan.buses.rule import Rule
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.sourced import Sourced

if TYPE_CHECKING:
    from busplan.buses.ieee1394.section import Ieee1394Profile
    from busplan.buses.published import EvidenceSection

_HOST_STEP_US: Final = 10.0
"""How much slower the host is made, to see what that does to the margin."""


class Ieee1394(Bus):
    """The bus of the paper."""

    kind = "ieee1394"
    title = "IEEE 1394"
    timing_models = (
        TimingModel("paper", "the paper's equations as published"),
        TimingModel("standard", "the standard's clock and packets, and the gaps as the bus runs them"),
    )
    deciding_model = "standard"
    term_figures = figures.TERMS
    capacity_figures = figures.CAPACITY
    setup_figures = figures.SETUP
    compared_figures = figures.COMPARED
    table_figures = figures.TABLE
    latency_table_figures = figures.LATENCY_TABLE
    planned_figures = ("gap_count", "gap_count_safe")
    facts = ("hops", "gap_count")
    safety = "gap count"
    safety_figure = figures.GAP_COUNT_SAFE
    limits: ClassVar[tuple[Limit, ...]] = LIMITS
    rules: ClassVar[tuple[Rule, ...]] = rules.RULES
    starter = Starter(
        """\
[bus]
kind = "ieee1394"
speed = "S400"             # assumed: the slowest port on the way decides, S100, S200 or S400
gap_count = "optimal"      # assumed: the smallest safe one; the bus manager must write it, until then it is 63""",
        slice_ratio="0.8          # assumed: the share for communication; the rest is for the host's own work",
        measure="measure latencies, then: busplan calibrate {file} MEASUREMENTS.csv{group} --apply",
        base="time in a node between a request and its response",
    )
    command_events = (("write", "request_data"), ("write", "execution"), ("write", "worst_extra"))
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants: ClassVar[Mapping[str, Sourced]] = CONSTANTS
    key_sources: ClassVar[Mapping[str, Sourced]] = {
        "bus.cable_length_m": REFERENCE_CABLE_M,
        "cycle.slice_ratio": SLICE_RATIO,
        "cycle.sync.ping_us": PING_US,
        "cycle.sync.ping_per_node_us": PING_PER_NODE_US,
        "payload.overhead_bytes": PACKET_OVERHEAD_BYTES,
    }
    key_symbols: ClassVar[Mapping[str, str]] = {
        "payload.overhead_bytes": "overhead",
        "host.transaction_us": "T_host",
        "node.execution.worst_extra_us": "T_extra",
        "node.response_us": "T_hold",
        "cycle.sync.ping_us": "ping",
        "cycle.sync.ping_per_node_us": "ping_node",
    }
    choosing_keys = ("execution.grade", "execution.residual")
    warning_keys = ("bus.cable_length_m",)
    warning_constants = (REFERENCE_CABLE_M,)
    change_meanings: ClassVar[Mapping[str, str]] = {
        "bus.max_hops": "rewired as a tree",
        "bus.nodes": "the others on a second bus",
        "bus.speed": "if all nodes can",
        "cycle.schedule": "if the firmware of all nodes can",
        "node.read_response": "if the nodes can",
        "node.write_response": "if the nodes can",
    }
    reset_changes: ClassVar[Mapping[str, Value]] = {"bus.gap_count": MAX_GAP_COUNT}
    cable_key = "bus.cable_length_m"
    host_keys = ("host.transaction_us",)
    term_removals: ClassVar[tuple[Mapping[str, Value], ...]] = (
        {"bus.cycle_master": False, "bus.isochronous_us": 0.0},
        {"host.transaction_us": 0.0},
        {"cycle.retries": 0},
    )
    evidence_data = ("paper", "dvrk", "ieee1394")
    evidence_profiles = ("paper-two-node", "dvrk")
    change_words: ClassVar[Mapping[str, str]] = {
        "bus.gap_count": "gap count {}",
        "bus.max_hops": "tree of {} hops",
        "bus.speed": "speed {}",
        "cycle.schedule": "schedule {}",
        "node.read_response": "reads {}",
        "node.write_response": "writes {}",
    }

    def profile_model(self) -> "type[Ieee1394Profile]":
        """The model of its profiles."""
        from busplan.buses.ieee1394.section import Ieee1394Profile  # the one module of the bus that loads pydantic

        return Ieee1394Profile

    def cycle(self, network: Network, *, model: str) -> CycleWithStarts:
        """The cycle of a network under one timing model, by its schedule."""
        schedule = BroadcastCycle if is_broadcast(network) else Ieee1394Cycle
        return schedule(network, model)  # type: ignore[arg-type]

    @property
    def latency_figures(self) -> tuple[Figure, ...]:
        """Of `latency`, in the order of its document."""
        return figures.LATENCY

    def cannot_express(self, network: Network, *, model: str) -> tuple[str, ...]:
        """Keys that the paper's equations have no term for."""
        profile = network.profile
        own = {
            "bus.cycle_master": profile.bus.cycle_master,
            "bus.phy_delay_us": profile.bus.phy_delay_us is not None,
            "bus.charge_hops": profile.bus.charge_hops != "farthest",
            "cycle.schedule": profile.cycle.schedule != "individual",
            "cycle.retries": profile.cycle.retries,
            "host.transaction_us": profile.host.transaction_us,
        }
        for one in network.alike:
            own[one.node_key("read_response")] = one.node.read_response != "split"
            own[one.node_key("write_response")] = one.node.write_response != "split"
            own[one.node_key("execution.worst_extra_us")] = one.node.execution.worst_extra_us
        return tuple(key for key, is_set in own.items() if is_set) if model == "paper" else ()

    def latency_subject(self, network: Network) -> str:
        """Say whose latency it is."""
        if is_broadcast(network):
            return ", ".join(("the data of all nodes to the host and the commands to them", *self.setup_words(network)))
        nodes = f"{network.nodes} node{'s' * (network.nodes != 1)}"
        farthest = f"farthest of {nodes}" if network.is_uniform else "the farthest node of each group"
        return ", ".join((farthest, *self.setup_words(network)))

    def halves(self, network: Network, *, group: str, model: str, kind: str, payload_bytes: int) -> Halves:
        """What the packets of a split transaction with the farthest node of a group take.

        Raises
        ------
        BusplanError
            Nodes do not answer such a transaction split: then no execution time is on the bus.
        """
        if is_broadcast(network):
            raise BusplanError(
                'cycle.schedule = "broadcast": no execution time is on the bus, so none can be found from a latency; '
                'calibrate with cycle.schedule = "individual"'
            )
        said = next(one for one in network.alike if one.name == group)
        answer, key = getattr(said.node, f"{kind}_response"), said.node_key(f"{kind}_response")
        if answer != "split":
            raise BusplanError(
                f'{key} = "{answer}": a {answer} {kind} has no execution time on the bus, so none can '
                f'be found from its latency; leave its lines out, or calibrate with {key} = "split"'
            )
        phases = transaction(
            kind,  # type: ignore[arg-type]
            model=TIMING_MODELS[model],  # type: ignore[index]
            link=farthest_link(network, group),
            payload_bytes=payload_bytes,
            overhead_bytes=said.payload.overhead_bytes,
            responder=Responder(0.0),
        )
        parts_us = (phases.latency_us, phases.request_and_acknowledge_us, phases.subaction_gap_us)
        return Halves(*map(plain, parts_us))

    def fit_keys(self, network: Network, *, model: str | None) -> dict[str, Value]:
        """The timing model and the gap count."""
        return {"residual": model or "none", "measured_gap_count": int(gap_count_of(network))}

    def taking_us(self, group: Group, network: Network) -> float:
        """Nothing behind a split write, which holds the execution; else the node executes beside the bus [us]."""
        is_split = group.node.write_response == "split" and not is_broadcast(network)
        return 0.0 if is_split else super().taking_us(group, network)

    def loop_periods(self, network: Network, *, at_sync: bool) -> int:
        """One, or more where a node has not executed its command when the next synchronous packet comes."""
        if not at_sync:
            return 0
        behind_us = max(self.taking_us(one, network) for one in network.groups)
        period_us = plain(network.period_us)
        needed_us = min(plain(self.cycle(network, model=self.deciding_model).required_us), period_us)
        return max(1, ceil((needed_us + behind_us) / period_us)) if behind_us else 1

    def has_execution(self, network: Network) -> bool:
        """Whether a transaction is split: other answers keep the execution off the bus, and so do broadcasts."""
        return not is_broadcast(network) and any(
            "split" in (one.node.read_response, one.node.write_response) for one in network.groups
        )

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """The gap count, one register in each node, how the nodes answer, and the other schedule."""
        return (gap_count(network), responses(network), schedule(network))

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """One hop, one busy retry, and a slower host."""
        profile = network.profile
        is_chain = profile.bus.max_hops is None
        return (
            Perturbation(
                "one hop more",
                {"bus.max_hops": int(hops_of(network)) + 1},
                why_not="in a chain the hops follow the nodes" if is_chain else "",
            ),
            Perturbation("one busy retry more", {"cycle.retries": profile.cycle.retries + 1}),
            Perturbation(
                f"host time +{_HOST_STEP_US:g} us",
                {"host.transaction_us": profile.host.transaction_us + _HOST_STEP_US},
                if_nothing="the gaps behind the transactions hide it",
            ),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Whole quadlets up to the largest packet of the speed."""
        speed = network.profile.bus.speed
        return PayloadRange(QUADLET_BYTES, int(MAX_PAYLOAD_BYTES[speed]), "speed", carrier=speed)

    def way_charged(self, network: Network) -> str:
        """Say whose hops each node is charged."""
        if is_broadcast(network):
            return "every packet at the hops of the farthest"
        if not charges_own_hops(network):
            return "every node at the hops of the farthest"
        return f"every node at its own hops{'' if network.profile.bus.root == 'host' else ', arbitration at all'}"

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Hops, gap count, and a schedule that is not the individual one."""
        hops, cycle = hops_of(network), network.profile.cycle
        schedule = (f"broadcast schedule by {cycle.broadcast_request} requests",) if is_broadcast(network) else ()
        return (f"{hops} hop{'s' * (hops != 1)}", f"gap count {gap_count_of(network)}", *schedule)

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:
        """An unsafe gap count, and cables that the table does not hold for."""
        bus, found = network.profile.bus, []
        limit = "" if bus.cable_is_standard else f" for cables of up to {REFERENCE_CABLE_M:g} m"
        for one in [network.with_nodes(number) for number in nodes] if network.is_uniform else [network]:
            if not self.is_safe(one):
                hops, given = hops_of(one), gap_count_of(one)
                found.append(
                    f"Warning: gap count {given} is unsafe for {hops} hop{'s' * (hops != 1)} "
                    f"({one.nodes} node{'s' * (one.nodes != 1)}); "
                    f"the smallest safe one is {safe_gap_count(hops)}{limit}."
                )
                break
        if not bus.cable_is_standard:
            found.append(
                f"Warning: cables of {bus.cable_length_m:g} m are longer than the {REFERENCE_CABLE_M:g} m that the "
                "gap-count table holds for."
            )
        return found

    def evidence(
        self, networks: Mapping[str, Network], published: Mapping[str, Mapping[str, Any]]
    ) -> "tuple[EvidenceSection, ...]":
        """Compare what is published of the paper's bench, of the dVRK and of the bus with what the equations give."""
        from busplan.buses.ieee1394.evidence import kit_sections, standard_sections  # one command alone asks for it
        from busplan.buses.ieee1394.paper import bus_sections

        return (
            *bus_sections(networks["paper-two-node"], published["paper"]),
            *kit_sections(networks["dvrk"], published["dvrk"]),
            *standard_sections(networks["paper-two-node"], published["ieee1394"]),
        )


BUS: Final = Ieee1394()
