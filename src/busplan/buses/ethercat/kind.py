"""EtherCAT as a kind of bus, with its limits and rules."""

from collections.abc import Iterator, Mapping
from functools import reduce
from math import ceil, inf
from typing import TYPE_CHECKING, Any, ClassVar, Final

from busplan.buses.bus import Bus
from busplan.buses.ethercat.cycle import (
    EVENTS,
    LAST_BYTE,
    STRETCHES,
    VENDORS,
    EthercatCycle,
    sync0_share,
)
from busplan.buses.ethercat.equations import (
    FIGURES,
    SEPARATE,
    SHARED,
    EthercatFigures,
    c,
    room_bytes,
)
from busplan.buses.ethercat.frames import data_bytes, datagrams, layout, moves_us
from busplan.buses.limits import NODE_LIMIT, NOT_SHOWN_KEPT, ExactLimit, Limit, ShareOfPeriod, WakeUp, nodes_limit
from busplan.buses.network import Group, Network
from busplan.buses.parts import Cost, Key, PayloadRange, Perturbation, Setting, Starter, TimingModel
from busplan.buses.rule import Recorded, RuleProblem, RuleSubject, read_rules
from busplan.buses.waterfall import RecordedCycles
from busplan.elementwise import Number, choose, larger
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.sections.base import MAX_TIME_US, value_at

if TYPE_CHECKING:
    from pathlib import Path


class BeforeSync0(ShareOfPeriod):
    """Limit of the command, which must be in every device before SYNC0."""

    key = "sync0"
    label = "SYNC0, before which commands must arrive"
    way_out = "a larger bus.sync_shift moves SYNC0 later"

    def share(self, network: Network) -> Number:
        """Time of SYNC0 as a share of the period [1]."""
        return sync0_share(network)

    def value(self, network: Network) -> Number:
        """Latest time at which the last device has taken its command, bias included [us]; 0 without clocks."""
        if not network.profile.bus.distributed_clocks:
            return 0.0
        cycle = EthercatCycle(network, LAST_BYTE)
        return cycle.last_command_us + cycle.bias_us()

    def doubt(self, network: Network) -> Number:
        """Standard uncertainty of `value` [us]."""
        return EthercatCycle(network, LAST_BYTE).command_doubt_us if network.profile.bus.distributed_clocks else 0.0

    def perhaps(self, network: Network) -> Number:
        """The master's time, all or none of which may pass before the frame [us]."""
        return network.profile.bus.master_us if network.profile.bus.distributed_clocks else 0.0

    def words(self, network: Network) -> str:
        """Words for the time of the last command; they tell if only the worst split of bus.master_us makes it late."""
        value_us, doubt_us, most_us = self.value(network), self.uncertainty(network), self.most(network)
        depends = self.verdict_code(network) == NOT_SHOWN_KEPT and value_us - doubt_us > most_us
        where = ", all of bus.master_us before the wire" if depends else ""
        return f"the last command comes at {value_us:.1f} +/- {doubt_us:.1f} us{where}, SYNC0 at {most_us:.1f} us"


class SyncWindow(Limit):
    """Limit of a frame's movement against SYNC0, by the window of each drive."""

    key = "sync_window"
    way_out = "measure bus.master_jitter_us, or make it smaller"
    place = "bus.master_jitter_us"

    def value(self, network: Network) -> Number:
        """Movement of frames beyond a drive's window, the largest of any group; below 0 inside the window [us]."""
        beyond_us: Number = -inf
        for group, us in _moves_us(network):
            beyond_us = larger(beyond_us, us - group.node.sync_window_us)
        return beyond_us + self.perhaps(network)

    def most(self, _network: Network) -> Number:
        """0 [us]."""
        return 0

    def perhaps(self, network: Network) -> Number:
        """Jitter of a master whose jitter is not given, which may be of any size; else 0 [us]."""
        return choose(network.profile.bus.master_jitter_us > 0, 0.0, MAX_TIME_US)

    def words(self, network: Network) -> str:
        """Words for the frame movement of the group farthest beyond its window, and for the jitter allowed."""
        jitter_us = network.profile.bus.master_jitter_us
        moves = ((group, us, group.node.sync_window_us) for group, us in _moves_us(network))
        group, us, most_us = max(moves, key=lambda move: move[1] - move[2])
        of_group = f"{group.name}: " if group.name else ""
        without = "" if jitter_us else " without the jitter, which is not given"
        left_us = most_us - us + jitter_us
        allowed = f"a jitter of {left_us:.4g} us is allowed" if left_us > 0 else "no jitter is small enough"
        return f"{of_group}frames move {us:.1f} us against SYNC0{without}, and a drive allows {most_us:g} us: {allowed}"


def _moves_us(network: Network) -> Iterator[tuple[Group, Number]]:
    """Groups whose drives have a window about SYNC0, and the movement of their frames against it [us]."""
    for index, group in enumerate(network.groups):
        if network.profile.bus.distributed_clocks and group.node.sync_window_us is not None:
            yield group, network.profile.bus.master_jitter_us + moves_us(network, index)


LIMITS: Final = (
    NODE_LIMIT,
    nodes_limit("devices", lambda: c.MOST_DEVICES, "segment", of="addresses of a"),
    ExactLimit(
        "payload",
        "a device of {value:.0f} bytes is over the {most:.0f} bytes of a frame, and no device is split",
        lambda network: reduce(larger, (data_bytes(group, network) for group in network.groups)),
        lambda network: room_bytes(datagrams(network)),
        way_out="use a smaller payload",
    ),
    ExactLimit(
        "cable",
        "a cable of {value:g} m is over the {most:g} m of 100BASE-TX",
        lambda network: reduce(larger, (group.node.cable_length_m for group in network.groups)),
        lambda _network: c.MOST_CABLE_M,
        way_out="put a device in between",
        place="node.cable_length_m",
    ),
    BeforeSync0(),
    SyncWindow(),
    WakeUp("bus.master_jitter_us"),
)


def no_common_clock(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where a circle test is asked for, but no clock makes the axes act at the same time."""
    profile = subject.profile
    if profile.asks_for_circle and not value_at(profile, "bus.distributed_clocks"):
        yield RuleProblem(
            "bus.distributed_clocks",
            "without them each drive acts when its frame passes, one after the other",
            "set bus.distributed_clocks = true if the drives have them",
            ("bus.distributed_clocks = true",),
        )


def command_behind_sync(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Problem where the last command may come after SYNC0, and so take effect cycles later."""
    figures = subject.deciding
    if BeforeSync0.key not in (*figures.exceeded, *(figures.not_shown or ())):
        return
    own = EthercatFigures.of(figures)
    late = max(ceil((own.command_us - (own.sync0_us or 0.0)) / figures.period_us), 1)
    maybe = "" if BeforeSync0.key in figures.exceeded else "maybe "
    yield RuleProblem(
        "bus.sync_shift",
        f"{subject.limit_words(BeforeSync0.key)}: {maybe}{plural(late, 'cycle')} late",
        BeforeSync0.way_out,
        subject.cure().cure,
    )


RULES: Final = read_rules("busplan.buses.ethercat", {"BP131": no_common_clock, "BP132": command_behind_sync})


_PROCESS_DATA = "bus.process_data"
_MASTER_STEP_US = 10.0


class Ethercat(Bus):
    """EtherCAT: the master's frames pass all devices in every cycle."""

    kind = "ethercat"
    title = "EtherCAT"
    timing_models = (
        TimingModel(LAST_BYTE, "until the last byte of the last frame is back at the master"),
        TimingModel(VENDORS, "as vendors count: sending, propagation, and reception of the last frame"),
    )
    figures = FIGURES
    limits = LIMITS
    rules = RULES
    starter = Starter(
        """\
[bus]
kind = "ethercat"
# master = "SOEM"          # or IgH, ethercrab, TwinCAT, acontis; without it the most bytes of all but ethercrab
distributed_clocks = true  # assumed: the drives act at SYNC0, at bus.sync_shift of the period
# master_jitter_us = 20    # latest start of its frames after the task: measure it under load; default 0""",
        node="""\
# port = "E-bus"           # of terminals on a backplane; default 100BASE-TX
# cable_length_m = 10      # from the device before it; default 0
""",
        host="tuned",
        slice_ratio="1            # assumed: the master computes in the next cycle with what it received in this one",
        measure="measure both on a drive: SYNC0 to its feedback, frame to command taken; no frame waits for them",
        base="from SYNC0 to feedback, and from the frame to a command that is taken",
    )
    event_kinds = EVENTS
    stretch_kinds = STRETCHES
    constants = c
    keys: ClassVar[Mapping[str, Key]] = {
        "bus.nodes": Key(meaning="move the other devices to a second segment"),
        "bus.master_us": Key("T_master", role="host"),
        "bus.master_jitter_us": Key("J", role="wake-up"),
        "bus.mailbox_polls": Key("polls"),
        "bus.mailbox_bytes": Key("B", "MAILBOX_BYTES"),
        "bus.sync_shift": Key("shift", "SYNC_SHIFT", meaning="drives act, and sample, later"),
        "bus.pipeline_cycles": Key("n", "PIPELINE_CYCLES", role="pipeline"),
        "bus.distributed_clocks": Key(role="clock"),
        "node.cable_length_m": Key("L", role="cable"),
        "node.delay_us": Key("t_d"),
        "node.execution.worst_extra_us": Key("T_extra"),
    }
    term_removals: ClassVar[tuple[Mapping[str, str | float], ...]] = (
        {"bus.master_us": 0.0},
        {"bus.master_jitter_us": 0.0},
        {"bus.mailbox_polls": 0},
    )
    modules = ("evidence", "emulated")
    recordings = "a capture of the master's port, pcap or pcapng,"
    evidence_data = ("ethercat",)

    def cycle(self, network: Network, *, model: str) -> EthercatCycle:
        """Cycle of a network under a timing model."""
        return EthercatCycle(network, model)

    def latency_subject(self, network: Network) -> str:
        """Words for the way that the latency covers, and for what the master and the clocks add."""
        bus = network.profile.bus
        clocks = f"SYNC0 at {bus.sync_shift:.0%} of the period" if bus.distributed_clocks else "no distributed clocks"
        cycles = f"{plural(bus.pipeline_cycles, 'cycle')} in the master"
        return f"worst case of a command, of feedback and of a loop over both, {cycles}, {clocks}"

    def has_execution(self, network: Network, *, of_latency: bool = False) -> bool:  # noqa: ARG002 - of every network
        """Whether execution counts: in latencies only, since no device delays a frame for it."""
        return of_latency

    def settings(self, network: Network) -> tuple[Setting, ...]:
        """Setting of a later SYNC0, for commands that would come after it."""
        bus = network.profile.bus
        if not (bus.distributed_clocks and bus.sync_shift):
            return ()
        later = ({"bus.sync_shift": tenths / 10} for tenths in range(1, 10) if tenths / 10 > bus.sync_shift)
        return (Setting("sync_shift", "shift of SYNC0", Cost.REGISTER, ("bus.sync_shift",), tuple(later)),)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        """Perturbations: one more mailbox poll, a slower master, separate inputs and outputs, distributed clocks."""
        bus: Any = network.profile.bus
        return (
            Perturbation("one more mailbox poll", {"bus.mailbox_polls": bus.mailbox_polls + 1}),
            Perturbation(f"master +{_MASTER_STEP_US:g} us", {"bus.master_us": bus.master_us + _MASTER_STEP_US}),
            Perturbation(
                f"master's jitter +{_MASTER_STEP_US:g} us",
                {"bus.master_jitter_us": bus.master_jitter_us + _MASTER_STEP_US},
            ),
            Perturbation(
                "separate bytes for inputs and outputs",
                {_PROCESS_DATA: SEPARATE},
                why_not="" if layout(network) == SHARED else "they are already",
            ),
            Perturbation(
                "distributed clocks",
                {"bus.distributed_clocks": True},
                why_not="it has them already" if bus.distributed_clocks else "",
            ),
        )

    def payloads(self, network: Network) -> PayloadRange:
        """Payloads in whole bytes, up to what a frame holds."""
        each = 1 if layout(network) == SHARED else 2
        return PayloadRange(1, int(room_bytes(datagrams(network)) / each), carrier="a frame")

    def setup_words(self, network: Network) -> tuple[str, ...]:
        """Words for the layout of process data, the frames, and the clocks."""
        count = int(self.cycle(network, model=LAST_BYTE).packing.frames)
        clocks = ("distributed clocks",) if network.profile.bus.distributed_clocks else ()
        return (layout(network), f"{plural(count, 'frame')}", *clocks)

    def recorded(
        self, network: Network, path: "Path", *, share: float, channel: str | None, progress: Progress
    ) -> Recorded:
        """Comparison of a capture of the master's port with the plan."""
        _require_no_channel(channel)
        from busplan.buses.ethercat.recorded import recorded  # Only one command needs it, and it loads numpy.

        return recorded(network, path, share=share, progress=progress)

    def recorded_cycles(
        self, network: Network, path: "Path", *, channel: str | None, progress: Progress
    ) -> RecordedCycles:
        """The whole cycles of a capture of the master's port beside those of the plan."""
        _require_no_channel(channel)
        from busplan.buses.ethercat.waterfall import recorded_cycles  # As above.

        return recorded_cycles(network, path, progress=progress)


def _require_no_channel(channel: str | None) -> None:
    if channel is not None:
        raise BusplanError(f"channel {channel}: a capture of EtherCAT is of one port; only CAN logs have channels")


BUS = Ethercat()
