"""The keys that only profiles of a CAN bus have, in [bus], [payload], [[group]], [[message]] and [limits]."""

from collections.abc import Collection, Iterator
from typing import Annotated, Final, Literal

from pydantic import Field

from busplan.buses.can.equations import (
    LEAST_BIT_RATE,
    MAX_IDENTIFIER,
    MOST_BIT_RATE,
    MOST_DATA_BIT_RATE,
    IdentifierBits,
    c,
)
from busplan.buses.can.traffic import HOST, LOOP, NAMES, NODE, NOT_BY_PRIORITY, SYNC, Access
from busplan.elementwise import Number
from busplan.english import plural
from busplan.sections.base import (
    MAX_TIME_US,
    MIN_STEP_US,
    MISSING,
    TRANSACTION_KINDS,
    Count,
    Problem,
    Section,
    TimeUs,
    TransactionKind,
    groups_field,
)
from busplan.sections.cycle import (
    BusSection,
    CycleSection,
    GroupAxes,
    GroupName,
    GroupSection,
    Limits,
    NodeSection,
    PayloadSection,
    time_uncertainty_us,
    worst_of_cycles,
)
from busplan.sections.profile import CIRCLE_SECTIONS, OF_ALIKE_NODES, Profile

Identifier = Annotated[int, Field(ge=0, le=MAX_IDENTIFIER[29])]
BitRate = Annotated[float, Field(ge=LEAST_BIT_RATE, le=MOST_BIT_RATE, allow_inf_nan=False)]
DataBitRate = Annotated[float, Field(ge=LEAST_BIT_RATE, le=MOST_DATA_BIT_RATE, allow_inf_nan=False)]
PdoBytes = Annotated[
    tuple[Annotated[int, Field(ge=1, le=int(c.unchanged["FD_FRAME_BYTES"]))], ...],
    Field(strict=False, max_length=int(c.unchanged["MOST_PDOS"])),
]
PeriodUs = Annotated[float, Field(ge=MIN_STEP_US, le=MAX_TIME_US, allow_inf_nan=False)]
Queue = Literal["priority", "fifo", "single-buffer"]
FramesPerSecond = Annotated[float, Field(ge=1, le=1e6, allow_inf_nan=False)]
_OF_ADAPTER: Final = {
    "host_write_us": "ADAPTER_WRITE_US",
    "host_read_us": "ADAPTER_READ_US",
    "max_frames_s": "ADAPTER_FRAMES_S",
}
"""Constants of adapters with a word, by key."""
_MOST_CYCLES = 1000
_MOST_MESSAGES = 2048
"""As many as there are identifiers of 11 bits. Each is counted beside all others."""
_MOST_WITHOUT_SYNC = 500
"""Most messages beside requests, each of which may wait for all of them."""
_MOST_BESIDE_GROUPS = 8000
"""Most messages times groups: the most nodes of each group are searched beside all messages."""


class CanBus(BusSection):
    """Section [bus]: a bus of CAN 2.0 or CAN FD, with a cycle of SYNC or of requests and answers."""

    kind: Literal["can"] = Field(description="Kind of bus", examples=["can"])
    bit_rate_kbit_s: BitRate = Field(description="Bit rate of the bus [kbit/s]", examples=[1000])
    data_bit_rate_kbit_s: DataBitRate | None = Field(
        default=None,
        description="Data bit rate of CAN FD; SYNC and PDOs are FD frames with it, and classical frames without it "
        "[kbit/s]",
        examples=[5000],
    )
    nodes: Count | None = Field(default=None, description="Distributed nodes N, host not counted", examples=[8])
    identifier_bits: IdentifierBits = Field(
        default=11,
        description="Length of identifiers, where a message does not say its own [bits]",
        examples=[11],
    )
    access: Access = Field(
        default="sync",
        description="Time at which nodes send: all at SYNC; each at a command of the host, which waits for its "
        "feedback before "
        "the next one (polled); or the same with all commands at once (burst). Robot motors know no SYNC",
        examples=["polled"],
    )
    sync_identifier: Identifier = Field(
        default_factory=lambda: int(c.SYNC_IDENTIFIER),
        description="Identifier of SYNC",
        examples=[int(c.unchanged["SYNC_IDENTIFIER"])],
    )
    sync_counter: bool = Field(
        default=False, description="Whether SYNC carries its counter, one byte (CiA 301)", examples=[True]
    )
    sync_jitter_us: TimeUs = Field(
        default=0.0,
        description="Largest delay of SYNC by the host, under the period; it shortens the cycle [us]",
        examples=[50],
    )
    sync_jitter_cycles: Count | None = worst_of_cycles("sync_jitter_us")
    pipeline_cycles: Annotated[int, Field(ge=0, le=_MOST_CYCLES)] = Field(
        default_factory=lambda: int(c.PIPELINE_CYCLES),
        description="Cycles from feedback to the command computed from it; 0: the host computes within the cycle; "
        "without SYNC 1 or more, by default 1. For latency, and a loop on the host",
        examples=[1],
    )
    host_us: TimeUs = Field(
        default=0.0,
        description="Host's time from the last feedback to the queued commands, used where pipeline_cycles is 0; "
        "without SYNC its time for each command [us]",
        examples=[100],
    )
    host_grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None, description="Grade of host_us", examples=["measured"]
    )
    host_uncertainty_us: TimeUs | None = Field(
        default=None,
        description="Standard uncertainty of host_us; without it 10 % where that is graded other than assumed, else "
        "host_us / sqrt(3) [us]",
        examples=[5],
    )
    adapter: Literal["kvaser-pcie", "candlelight", "none"] | None = Field(
        default=None,
        description="Host's adapter by a word, for what the next three keys do not give: kvaser-pcie has mean "
        "times, candlelight most frames a second; none adds nothing",
        examples=["kvaser-pcie"],
    )
    host_write_us: TimeUs | None = Field(
        default=None,
        description="Time of the host's adapter and driver from the program to the wire, known to 10 % [us]",
        examples=[100],
    )
    host_read_us: TimeUs | None = Field(
        default=None, description="The same from the wire to the program [us]", examples=[100]
    )
    max_frames_s: FramesPerSecond | None = Field(
        default=None,
        description="Most frames that the host's adapter sends and receives, on average [frames/s]",
        examples=[16_200],
    )
    queue: Queue | None = Field(
        default=None,
        description="Order in which host and nodes send what they have queued: priority, the smallest identifier "
        "first; fifo, first in first out; single-buffer; without it priority, assumed",
        examples=["fifo"],
    )
    clock_tolerance: Annotated[float, Field(ge=0, le=0.0158, allow_inf_nan=False)] = Field(
        default=0.0,
        description="Largest excess of the bit time, that of the slowest oscillator, a share 0..0.0158: a "
        "doubt of cycle, load and responses",
        examples=[0.005],
    )
    error_period_us: PeriodUs | None = Field(
        default=None,
        description="Shortest time between errors, each of which repeats a frame; with error_burst the mean time; "
        "without it no errors [us]",
        examples=[100_000],
    )
    error_burst: Count | None = Field(
        default=None,
        description="Errors that may come at once, with as many periods to the next; without it 1",
        examples=[3],
    )

    def _problems(self) -> Iterator[Problem]:
        if self.data_bit_rate_kbit_s is not None and self.data_bit_rate_kbit_s < self.bit_rate_kbit_s:
            why = f"is under bit_rate_kbit_s, {self.bit_rate_kbit_s:g}: CAN FD switches to no slower bit rate"
            yield Problem(why, key="data_bit_rate_kbit_s", kind="inconsistent")
        if self.error_period_us is None and self.error_burst is not None:
            why = "asks for error_period_us, the time from one burst of errors to the next"
            yield Problem(why, key="error_burst", kind="inconsistent")

    @property
    def host_doubt_us(self) -> Number:
        """Standard uncertainty of the host's own time [us]."""
        is_guess = self.host_grade in (None, "assumed")
        return time_uncertainty_us(self.host_us, is_guess=is_guess, given_us=self.host_uncertainty_us)

    def adapter_key(self, name: str) -> str:
        """Dotted key that gives a number of the adapter: its own, or that of the word."""
        return "bus.adapter" if getattr(self, name) is None and self.adapter else f"bus.{name}"

    def of_adapter(self, name: str) -> Number | None:
        """A number of the adapter, by its key: as given, or as its word says; None where neither gives it."""
        given: Number | None = getattr(self, name)
        return c.get(f"{_OF_ADAPTER[name]}[{self.adapter}]") if given is None else given

    @property
    def write_us(self) -> Number:
        """Time from the program to the wire; 0 where it is not known [us]."""
        return self._adapter_us("host_write_us")

    @property
    def read_us(self) -> Number:
        """Time from the wire to the program; 0 where it is not known [us]."""
        return self._adapter_us("host_read_us")

    def _adapter_us(self, name: str) -> Number:
        us = self.of_adapter(name)
        return 0.0 if us is None else us


class CanPayload(PayloadSection):
    """Section [payload]: what each node sends (read) and receives (write) in a cycle, and in which PDOs."""

    pdo_per: Literal["node", "axis"] = Field(
        default="node",
        description="Whether each node or each axis has a PDO in each direction; axes share the payload",
        examples=["axis"],
    )
    every: Annotated[int, Field(ge=1, le=int(c.unchanged["MOST_EVERY"]))] = Field(
        default=1,
        description="PDOs go with every n-th SYNC (CANopen's transmission type n); all count from the same SYNC",
        examples=[4],
    )
    feedback_identifier: Identifier | None = Field(
        default=None,
        description="Identifier of the first feedback PDO; without it 0x181, or the next one after the group before",
        examples=[0x181],
    )
    command_identifier: Identifier | None = Field(
        default=None,
        description="Identifier of the first command PDO; without it 0x201, or the next one after the group before",
        examples=[0x201],
    )
    feedback_pdos: PdoBytes | None = Field(
        default=None,
        description="Data of each feedback PDO, up to 8 (CAN FD 64), [] for none; their sum is the default of "
        "read_bytes [bytes]",
        examples=[[6, 6]],
    )
    command_pdos: PdoBytes | None = Field(
        default=None,
        description="Data of each command PDO; their sum is the default of write_bytes [bytes]",
        examples=[[6, 6]],
    )

    def _problems(self) -> Iterator[Problem]:
        for kind in TRANSACTION_KINDS:
            key = f"{NAMES[kind]}_pdos"
            if getattr(self, key) == () and any(self._parts(kind)):
                why = f"is empty, so nothing is sent, and {self.key_of(kind)} has data; give one of the two"
                yield Problem(why, key=key, kind="inconsistent")

    def _parts(self, kind: TransactionKind) -> tuple[Number | None, Number | None]:
        fixed, per_axis = super()._parts(kind)
        lengths = getattr(self, f"{NAMES[kind]}_pdos")
        if lengths is None or fixed is not None or per_axis is not None:
            return fixed, per_axis
        return (None, sum(lengths)) if self.pdo_per == "axis" else (sum(lengths), None)


class CanNode(NodeSection):
    """Section [node]: a distributed node."""

    queue: Queue | None = Field(
        default=None, description="Order in which it sends what it has queued; without it that of the bus"
    )


class CanGroup(CanNode, CanPayload, GroupSection):
    """One of the sections [[group]]: nodes that are alike, in the order of their identifiers."""

    axes: GroupAxes = Field(examples=[4])


class CanMessage(Section):
    """One of the sections [[message]]: another message on the bus, as SDO, heartbeat or emergency."""

    name: GroupName = Field(description="Name of the message; its keys are message.NAME.key", examples=["sdo"])
    identifier: Identifier = Field(
        description="Identifier; smaller ones go first. With per_node, node n has identifier + n, from 1 on",
        examples=[0x581],
    )
    identifier_bits: IdentifierBits | None = Field(
        default=None,
        description="Length of the identifier; without it that of the bus [bits]",
        examples=[29],
    )
    per_node: bool = Field(
        default=False, description="Whether each node sends one, in the order of the profile", examples=[True]
    )
    sender: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None,
        description=f"Who sends it: {HOST}, {NODE} for one of nodes that are alike, a group, or another device by its "
        "name. Messages of a sender share its queue",
        examples=[HOST],
    )
    fd: bool = Field(default=False, description="Whether it is a CAN FD frame", examples=[True])
    brs: bool = Field(
        default=True,
        description="Whether an FD frame switches to bus.data_bit_rate_kbit_s",
        examples=[False],
    )
    payload_bytes: Annotated[int, Field(ge=0, le=int(c.unchanged["FD_FRAME_BYTES"]))] = Field(
        description="Data, up to 8, of an FD frame up to 64 [bytes]", examples=[8]
    )
    period_us: PeriodUs = Field(
        description="Shortest time between messages; with burst the mean time [us]", examples=[10_000]
    )
    period_grade: Literal["measured", "derived", "calibrated", "assumed"] | None = Field(
        default=None,
        description='Grade of period_us; with "assumed" no plan is shown to fit',
        examples=["assumed"],
    )
    burst: Count = Field(
        default=1, description="Frames that may come at once, with as many periods to the next", examples=[5]
    )
    jitter_us: TimeUs = Field(
        default=0.0, description="Largest delay of its queueing; may exceed the period [us]", examples=[500]
    )
    deadline_us: PeriodUs | Literal["none"] | None = Field(
        default=None,
        description='Time from its start to its arrival, at most; "none" for a message that has none; without it the '
        "period [us]",
        examples=[5000],
    )

    def _problems(self) -> Iterator[Problem]:
        if self.per_node and self.sender is not None:
            yield Problem("has each node for its sender", key="sender", kind="inconsistent")
        if self.payload_bytes > c.FRAME_BYTES and not self.fd:
            why = f"is over the {c.FRAME_BYTES:g} bytes of a classical frame; fd = true allows {c.FD_FRAME_BYTES:g}"
            yield Problem(why, key="payload_bytes")
        if not (self.brs or self.fd):
            why = "is of an FD frame that keeps the bit rate, and a classical frame has one alone; write fd = true"
            yield Problem(why, key="brs", kind="inconsistent")


class CanLimits(Limits):
    """Section [limits]: what a plan must keep free, and the load of the bus."""

    max_load: Annotated[float, Field(gt=0, le=0.999, allow_inf_nan=False)] = Field(
        default_factory=lambda: float(c.MAX_LOAD),
        description="Largest worst-case load of the bus, 0..0.999 (Lenze: 0.8); without SYNC none, unless it is given",
        examples=[0.6],
    )


_OF_NODES: Final = (*OF_ALIKE_NODES, "group")
_OF_CYCLE: Final = {
    "bus": (
        "access",
        "sync_identifier",
        "sync_counter",
        "sync_jitter_us",
        "sync_jitter_cycles",
        "pipeline_cycles",
        "host_us",
        "host_grade",
        "host_uncertainty_us",
        "host_write_us",
        "host_read_us",
    ),
    "limits": ("reserve", "max_utilisation", "min_spare_nodes", "min_spare_axes"),
}
"""Keys of sections that only a network with a cycle has."""
_OF_SYNC: Final = ("sync_identifier", "sync_counter", "sync_jitter_us", "sync_jitter_cycles")
"""Keys of section [bus] that only a cycle with SYNC has."""
_PDO_NAMES: Final = tuple(NAMES.values())


class CanProfile(Profile):
    """A whole profile: one motion network and its cycle, or a network of messages alone."""

    bus: CanBus = Field(description="The bus")
    # Without a cycle nothing of it comes twice.
    cycle: CycleSection = Field(
        default_factory=lambda: CycleSection(period_us=MAX_TIME_US),
        description="The communication cycle; a network of messages alone has none",
    )
    payload: CanPayload | None = Field(default=None, description="Payload of a cycle, where nodes are alike")
    node: CanNode | None = Field(default=None, description="One distributed node, where nodes are alike")
    group: Annotated[tuple[CanGroup, ...], groups_field(c.unchanged["MOST_NODES"])] = Field(
        default=(), description="Groups of unlike nodes, instead of bus.nodes, [node] and [payload]"
    )
    message: Annotated[tuple[CanMessage, ...], Field(strict=False, max_length=_MOST_MESSAGES)] = Field(
        default=(), description="Other messages on the bus"
    )
    limits: CanLimits = Field(default_factory=CanLimits, description="Requirements of the gate beyond fitting")

    @property
    def has_cycle(self) -> bool:
        """Whether it has nodes, and so a cycle."""
        return bool(self.group) or self.node is not None

    @property
    def most_load(self) -> Number:
        """The largest load that is allowed; 1 without SYNC, where every frame has its place, unless it is given."""
        is_given = self.bus.access == "sync" or "max_load" in self.limits.model_fields_set
        return self.limits.max_load if is_given else 1.0

    @classmethod
    def nodes_problems(cls, given: Collection[str]) -> Iterator[Problem]:
        """Tell what is wrong with the way a profile gives its nodes: all alike, in groups, or none beside messages."""
        if "message" in given and not any(key in given for key in _OF_NODES):
            if "cycle" in given:
                why = "has no nodes; add bus.nodes, [node] and [payload], or remove it: messages alone have no cycle"
                yield Problem(why, key="cycle", kind="inconsistent")
            return
        yield from super().nodes_problems(given)
        if "cycle" not in given:
            yield Problem(MISSING, key="cycle", kind="missing-key")

    def _problems(self) -> Iterator[Problem]:
        if not self.has_cycle:
            yield from self._problems_of_no_cycle()
        if self.bus.access != "sync":
            yield from self._problems_of_no_sync()
        elif self.bus.sync_jitter_us >= self.cycle.period_us:
            why = f"is not under cycle.period_us, {self.cycle.period_us:g}: the next SYNC would come before it"
            yield Problem(why, key="bus.sync_jitter_us", kind="inconsistent")
        if self.has_cycle:
            yield from self._problems_of_many()
        yield from self._names_problems()
        yield from self._identifiers_problems()
        if self.bus.data_bit_rate_kbit_s is None:
            yield from self._problems_of_no_data_bit_rate()

    def _problems_of_many(self) -> Iterator[Problem]:
        """More messages than are computed beside a cycle."""
        number, groups = len(self.message), len(self.node_groups)
        most = min(_MOST_BESIDE_GROUPS // groups, _MOST_MESSAGES if self.bus.access == "sync" else _MOST_WITHOUT_SYNC)
        if number > most:
            beside = "a cycle of requests" if most == _MOST_WITHOUT_SYNC else plural(groups, "group")
            yield Problem(f"has {number:,} entries, must have {most:,} or fewer beside {beside}", "message")

    def _problems_of_no_cycle(self) -> Iterator[Problem]:
        """Keys of a cycle, of a network without nodes."""
        keys: list[str] = [name for name in CIRCLE_SECTIONS if name in self.model_fields_set]
        keys += (
            f"{section}.{name}"
            for section, names in _OF_CYCLE.items()
            for name in names
            if name in getattr(self, section).model_fields_set
        )
        keys += (f"message.{place}.per_node" for place, message in enumerate(self.message) if message.per_node)
        why = "asks for nodes, and a network of messages alone has none; remove it"
        yield from (Problem(why, key=key, kind="inconsistent") for key in keys)

    def _problems_of_no_sync(self) -> Iterator[Problem]:
        """Keys that only a cycle with SYNC has, and nodes without a command or an answer."""
        bus, names = self.bus, dict(self._payloads())
        keys = [f"bus.{name}" for name in _OF_SYNC if name in bus.model_fields_set]
        keys += (f"{section}.every" for section, payload in names.items() if payload.every > 1)
        sections = {**({} if self.node is None else {"node": self.node}), "bus": bus, **names}
        keys += (f"{name}.queue" for name, part in sections.items() if getattr(part, "queue", None) in NOT_BY_PRIORITY)
        if (self.servo.loop, self.servo.update) == ("host", "next_sync"):
            keys.append("servo.update")
        if "pipeline_cycles" in bus.model_fields_set and not bus.pipeline_cycles:
            keys.append("bus.pipeline_cycles")
        none = f'and bus.access = "{bus.access}" has none'
        words = {
            "pipeline_cycles": "asks for SYNC: without it a command rests on an earlier cycle; write 1 or more",
            "queue": f"is computed with SYNC alone, {none}; remove it, and by priority is assumed",
            "update": f"asks for SYNC, {none}; say on_arrival",
        }
        yield from (
            Problem(words.get(key.split(".")[-1], f"asks for SYNC, {none}; remove it"), key, "inconsistent")
            for key in keys
        )
        for section, nodes in zip(names, self.node_groups, strict=True):
            for kind in TRANSACTION_KINDS:
                if nodes.bytes_of(kind) <= 0:
                    why = "comes to 0 bytes, and a command and its answer have data: 1 or more"
                    yield Problem(why, f"{section}.{nodes.payload.key_of(kind)}", "inconsistent")

    def _names_problems(self) -> Iterator[Problem]:
        """Names of messages that another message has, or the cycle."""
        names: set[str] = set()
        for place, message in enumerate(self.message):
            key = f"message.{place}.name"
            if message.name in names:
                yield Problem("there is a message of this name", key=key, kind="inconsistent")
            elif message.name in (SYNC, LOOP, *_PDO_NAMES):
                yield Problem("is what the frames of the cycle are called", key=key, kind="inconsistent")
            names.add(message.name)

    def _identifiers_problems(self) -> Iterator[Problem]:
        """Identifiers that are too large for their length, and those of an earlier group."""
        for key, identifier, bits in self._identifiers():
            if identifier is not None and identifier > MAX_IDENTIFIER[bits]:
                yield Problem(f"is over {MAX_IDENTIFIER[bits]}, the largest of {bits} bits", key, "inconsistent")
        for place, message in enumerate(self.message):
            most = MAX_IDENTIFIER[message.identifier_bits or self.bus.identifier_bits]
            if message.per_node and most - c.MOST_NODES < message.identifier <= most:
                yield Problem(f"leaves no room for {c.MOST_NODES:g} nodes below {most}", f"message.{place}.identifier")
        for name in (f"{direction}_identifier" for direction in _PDO_NAMES):
            identifiers = [getattr(group, name) for group in self.group]
            for place, identifier in enumerate(identifiers):
                if identifier is not None and identifier in identifiers[:place]:
                    yield Problem("an earlier group has it", key=f"group.{place}.{name}", kind="inconsistent")

    def _identifiers(self) -> Iterator[tuple[str, int | None, int]]:
        """Keys of identifiers, each with its value and the length."""
        bits = self.bus.identifier_bits
        if self.has_cycle:
            yield "bus.sync_identifier", self.bus.sync_identifier, bits
        for section, payload in self._payloads():
            yield f"{section}.feedback_identifier", payload.feedback_identifier, bits
            yield f"{section}.command_identifier", payload.command_identifier, bits
        for place, message in enumerate(self.message):
            yield f"message.{place}.identifier", message.identifier, message.identifier_bits or bits

    def _problems_of_no_data_bit_rate(self) -> Iterator[Problem]:
        """Frames that only a bus with a data bit rate has."""
        for place, message in enumerate(self.message):
            if message.fd and message.brs:
                why = "asks for bus.data_bit_rate_kbit_s; brs = false says a frame without a switch of bit rate"
                yield Problem(why, f"message.{place}.fd")
        for section, payload in self._payloads():
            for name in (f"{direction}_pdos" for direction in _PDO_NAMES):
                if max(getattr(payload, name) or (0,)) > c.FRAME_BYTES:
                    why = f"has a PDO over the {c.FRAME_BYTES:g} bytes of a classical frame"
                    yield Problem(why, f"{section}.{name}")

    def _payloads(self) -> Iterator[tuple[str, CanPayload]]:
        """Section [payload] or all groups, each with its key."""
        if self.payload is not None:
            yield "payload", self.payload
        yield from ((f"group.{place}", group) for place, group in enumerate(self.group))


PROFILE: Final = CanProfile
