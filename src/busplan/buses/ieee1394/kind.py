"""IEEE 1394 (FireWire) as a kind of bus."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.ieee1394.broadcast import BroadcastCycle
from busplan.buses.ieee1394.constants import (
    MAX_GAP_COUNT,
    QUADLET_BYTES,
    c,
)
from busplan.buses.ieee1394.cycle import EVENTS, STRETCHES, CycleWithStarts, Ieee1394Cycle
from busplan.buses.ieee1394.figures import FIGURES, GAP_COUNT_SAFE
from busplan.buses.ieee1394.rules import LIMITS, RULES, unsafe_words
from busplan.buses.ieee1394.timing import Responder, transaction
from busplan.buses.ieee1394.transactions import (
    answers_split,
    charges_own_hops,
    gap_count_of,
    has_gaps,
    hops_of,
    is_broadcast,
    safe_gap_count_of,
)
from busplan.buses.network import Network
from busplan.buses.parts import (
    Cost,
    Key,
    MeasuredLatencies,
    PacketTime,
    PayloadRange,
    Perturbation,
    Safety,
    Setting,
    Starter,
    TimingModel,
    Value,
)
from busplan.english import plural
from busplan.errors import BusplanError

_HOST_STEP_US: Final = 10.0
"""Step by which the host is slowed for the sensitivity of the margin [us]."""


def packets_of(network: Network, group: str, model: str, kind: str, payload_bytes: int) -> PacketTime:
    """Time of the packets of a split transaction with the farthest node of a group.

    Raises `BusplanError` where the nodes do not answer split, for then no execution time is on the bus, and where the
    times of the speed are lower bounds.
    """
    if not has_gaps(network):
        raise BusplanError(
            f"the time of packets at {network.profile.bus.speed} is known as a lower bound only: no execution time can "
            "be found from a latency"
        )
    if is_broadcast(network):
        raise BusplanError(
            'cycle.schedule = "broadcast": no execution time is on the bus, so none can be found from a latency; '
            'calibrate with cycle.schedule = "individual"'
        )
    nodes = network.group_named(group)
    answer, key = getattr(nodes.node, f"{kind}_response"), nodes.node_key(f"{kind}_response")
    if answer != "split":
        raise BusplanError(
            f'{key} = "{answer}": a {answer} {kind} has no execution time on the bus, so none can '
            f'be found from its latency; leave its lines out, or calibrate with {key} = "split"'
        )
    cycle = Ieee1394Cycle(network, model)  # type: ignore[arg-type]
    phases = transaction(
        kind,  # type: ignore[arg-type]
        model=cycle.model,
        delays=cycle.delays_to_farthest(group),
        payload_bytes=payload_bytes,
        responder=Responder(0.0),
        overhead_bytes=nodes.payload.overhead_bytes,
    )
    return PacketTime(phases.latency_us, phases.subaction_gap_us)


def fitted_against(network: Network, model: str) -> dict[str, Value]:
    """Timing model and gap count that an execution time is fitted against."""
    return {"residual": model, "measured_gap_count": int(gap_count_of(network))}


_UNSPLIT: Final = {"read_response": "concatenated", "write_response": "unified"}
"""Answers that need no second arbitration."""


def _gap_count(network: Network) -> Setting:
    """Setting of the smallest safe gap count."""
    key = "bus.gap_count"
    empty = Setting("gap_count", "gap count", Cost.REGISTER, (key,), ())
    # From S800 on there are no gaps; the table holds only for cables of its length.
    if not (has_gaps(network) and network.profile.bus.cable_is_standard):
        return empty
    safe = safe_gap_count_of(network)
    return empty if gap_count_of(network) == safe else empty._replace(values=({key: safe},))


def _responses(network: Network) -> Setting:
    """Setting of answers without a second arbitration: of reads, of writes, of both."""
    keys = tuple(group.key(name) for group in network.groups for name in _UNSPLIT)
    if is_broadcast(network):
        return Setting("responses", "responses", Cost.RESPONSES, keys, ())
    of_reads, of_writes = (
        {group.key(name): answer for group in network.groups if getattr(group.node, name) == "split"}
        for name, answer in _UNSPLIT.items()
    )
    both = {**of_reads, **of_writes} if of_reads and of_writes else {}
    return Setting("responses", "responses", Cost.RESPONSES, keys, tuple(filter(None, (of_reads, of_writes, both))))


class Ieee1394(Bus):
    """The bus of the paper."""

    kind = "ieee1394"
    title = "IEEE 1394"
    also_called = ("FireWire", "1394")
    timing_models = (
        TimingModel("standard", "the standard's clock and packets, and the gaps as the bus runs them"),
        TimingModel("paper", "the paper's equations as published"),
    )
    figures = FIGURES
    safety = Safety("gap count", GAP_COUNT_SAFE, {"bus.gap_count": MAX_GAP_COUNT})
    limits = LIMITS
    rules = RULES
    starter = Starter(
        """\
[bus]
kind = "ieee1394"
speed = "S400"             # assumed: the slowest port on the way decides, S100, S200 or S400
gap_count = "optimal"      # assumed: the smallest safe one; the bus manager must write it, until then it is 63
cycle_master = true        # assumed: an OHCI host sends cycle starts unless its software stops them (Linux, ohci.c)""",
        slice_ratio="0.8          # assumed: the share for communication; the rest is for the host's own work",
        measure="measure latencies, then: busplan calibrate {file} MEASUREMENTS.csv{group} --apply",
        table="""\
kind = "table"
grade = "assumed"          # another machine's: between 0 and twice it
payload_bytes = [0, 4, 16, 32, 64, 128, 256, 512, 1024, 2048]   # 0 and 2048 are extrapolated
time_us = [36.8, 36.8, 36.7, 45.4, 54.7, 84.9, 141.1, 223.2, 426.7, 833.7]
""",
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.nodes": Key(meaning="move the other nodes to a second bus"),
        "bus.max_hops": Key(meaning="rewired as a tree"),
        "bus.speed": Key(meaning="if all nodes support it"),
        "bus.cable_length_m": Key(default="REFERENCE_CABLE_M", role="cable"),
        "cycle.slice_ratio": Key(default="SLICE_RATIO"),
        "cycle.schedule": Key(meaning="if the firmware of all nodes can"),
        "cycle.sync.ping_us": Key("ping", "PING_US"),
        "cycle.sync.ping_per_node_us": Key("ping_node", "PING_PER_NODE_US"),
        "bus.sync_jitter_us": Key("J", role="wake-up"),
        "host.transaction_us": Key("T_host", role="host"),
        "payload.overhead_bytes": Key("overhead", "PACKET_OVERHEAD_BYTES"),
        "node.read_response": Key(meaning="if the nodes can"),
        "node.write_response": Key(meaning="if the nodes can"),
        "node.response_us": Key("T_hold"),
        "node.execution.worst_extra_us": Key("T_extra"),
        "node.execution.residual": Key(chooses=True),
    }
    calibration = MeasuredLatencies(packets_of, fitted_against)
    term_removals: ClassVar[tuple[Mapping[str, Value], ...]] = (
        {"bus.cycle_master": False, "bus.isochronous_us": 0.0},
        {"host.transaction_us": 0.0},
        {"bus.sync_jitter_us": 0.0},
        {"cycle.retries": 0},
    )
    modules = ("evidence",)
    evidence_data = ("paper", "dvrk", "ieee1394")

    def cycle(self, network: Network, *, model: str) -> CycleWithStarts:
        """Cycle of a network under a timing model, by its schedule."""
        schedule = BroadcastCycle if is_broadcast(network) else Ieee1394Cycle
        return schedule(network, model)  # type: ignore[arg-type]

    def evidence_for(self, network: Network) -> tuple[str, ...]:
        """Evidence data for the network; none from S800 on, where no figure is published."""
        return self.evidence_data if has_gaps(network) else ()

    def cannot_express(self, network: Network, *, model: str) -> tuple[str, ...]:
        """Keys of the profile for which the paper's equations have no term."""
        profile = network.profile
        paper_has_not = {
            "bus.speed": not has_gaps(network),
            "bus.cycle_master": profile.bus.cycle_master and "cycle_master" in profile.bus.model_fields_set,
            "bus.sync_jitter_us": profile.bus.sync_jitter_us,
            "bus.phy_delay_us": profile.bus.phy_delay_us is not None,
            "bus.charge_hops": profile.bus.charge_hops != "farthest",
            "cycle.schedule": profile.cycle.schedule != "individual",
            "cycle.retries": profile.cycle.retries,
            "host.transaction_us": profile.host.transaction_us,
        }
        for nodes in network.profile.node_groups:
            paper_has_not[nodes.node_key("read_response")] = nodes.node.read_response != "split"
            paper_has_not[nodes.node_key("write_response")] = nodes.node.write_response != "split"
            paper_has_not[nodes.node_key("execution.worst_extra_us")] = nodes.node.execution.worst_extra_us
        return tuple(key for key, is_set in paper_has_not.items() if is_set) if model == "paper" else ()

    def latency_subject(self, network: Network) -> str:
        """Words for the way that the latency covers."""
        if is_broadcast(network):
            return ", ".join(("the data of all nodes to the host and the commands to them", *self.setup_words(network)))
        nodes = f"{plural(int(network.nodes), 'node')}"
        farthest = f"farthest of {nodes}" if network.is_uniform else "the farthest node of each group"
        return ", ".join((farthest, *self.setup_words(network)))

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - latencies, too
        """Whether any transaction is split: other answers, and broadcasts, keep the execution off the bus."""
        return not is_broadcast(network) and any(map(answers_split, network.groups))

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """Settings to try: the gap count (one register in each node), the nodes' answers, and the other schedule."""
        key, schedule_name = "cycle.schedule", "individual" if is_broadcast(network) else "broadcast"
        schedule = Setting("schedule", "schedule", Cost.SCHEDULE, (key,), ({key: schedule_name},))
        return (_gap_count(network), _responses(network), schedule)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """Perturbations of the margin: one more hop, one more busy retry, a slower host, a later wake-up."""
        profile = network.profile
        is_chain = profile.bus.max_hops is None
        return (
            Perturbation(
                "one more hop",
                {"bus.max_hops": int(hops_of(network)) + 1},
                why_not="in a chain the hops follow the nodes" if is_chain else "",
            ),
            Perturbation("one more busy retry", {"cycle.retries": profile.cycle.retries + 1}),
            Perturbation(
                f"host time +{_HOST_STEP_US:g} us",
                {"host.transaction_us": profile.host.transaction_us + _HOST_STEP_US},
                if_nothing="the gaps after the transactions hide it",
            ),
            Perturbation(
                f"host's jitter +{_HOST_STEP_US:g} us",
                {"bus.sync_jitter_us": profile.bus.sync_jitter_us + _HOST_STEP_US},
            ),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Payloads in whole quadlets, up to the largest packet of the speed."""
        speed = network.profile.bus.speed
        return PayloadRange(QUADLET_BYTES, int(c.by_key("MAX_PAYLOAD_BYTES")[speed]), carrier=speed)

    def path_words(self, network: Network) -> str:
        """Words for the hops that each node is charged."""
        if is_broadcast(network):
            return "every packet at the hops of the farthest"
        if not charges_own_hops(network):
            return "every node at the hops of the farthest"
        is_at_all = network.profile.bus.root != "host" and has_gaps(network)
        return f"every node at its own hops{', arbitration at all' if is_at_all else ''}"

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Words for hops, gap count and a schedule other than the individual one."""
        hops, cycle = hops_of(network), network.profile.cycle
        schedule = (f"broadcast schedule by {cycle.broadcast_request} requests",) if is_broadcast(network) else ()
        gaps = f"gap count {gap_count_of(network)}" if has_gaps(network) else "no gaps: lower bounds"
        return (f"{plural(int(hops), 'hop')}", gaps, *schedule)

    def warnings(self, network: Network, *, nodes: Sequence[int]) -> list[str]:
        """Warnings of an unsafe gap count, and of cables that the table does not hold for."""
        bus = network.profile.bus
        sizes = [network.with_nodes(number) for number in nodes] if network.is_uniform else [network]
        warnings = [unsafe_words(sized) for sized in sizes if not self.is_safe(sized)][:1]
        if has_gaps(network) and not bus.cable_is_standard:
            warnings.append(
                f"cables of {bus.cable_length_m:g} m are longer than the {c.REFERENCE_CABLE_M:g} m that the "
                "gap-count table holds for"
            )
        return warnings


BUS: Final = Ieee1394()
