"""Protocols of polled buses: what a telegram has beside its data, and the times between telegrams."""

from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field

from busplan.buses.network import Network
from busplan.elementwise import Number, choose, from_table, is_everywhere, is_off, larger, rounded_up, total
from busplan.sections.base import Bytes, Count, Section, TimeUs
from busplan.sourced import Constants, cached

c: Final = Constants("busplan.buses.polled")
"""Constants with a source, by their names here."""
_RATE_STEPS_KBIT_S: Final = (187.5, 500, 1500, 3000, 6000)
"""Highest bit rate of each column but the last of PROFIBUS' time ratios [kbit/s]."""

ProtocolName = Literal["profibus-dp", "modbus-rtu", "dynamixel-2", "feetech", "worldfip"]
Requests = Literal["exchange", "sync", "single"]
BitTimes = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Tolerance = Annotated[float, Field(ge=0, le=0.05, allow_inf_nan=False)]


class Protocol(Section):
    """Section [bus.protocol]: a serial protocol of the user's own; a size is without data, 0 for no such telegram."""

    bits_per_byte: Annotated[float, Field(ge=8, le=12)] = Field(description="Bits of a byte on the wire", examples=[10])
    word_bytes: Annotated[int, Field(ge=1, le=64)] = Field(
        default=1,
        description="Data of a telegram are whole words of this size, as registers of Modbus [bytes]",
        examples=[2],
    )
    read_request_bytes: Bytes = Field(default=0, description="Request to read one node [bytes]", examples=[8])
    read_answer_bytes: Bytes = Field(default=0, description="Answer to it, without its data [bytes]", examples=[6])
    write_request_bytes: Bytes = Field(
        default=0, description="Request to write one node, without its data [bytes]", examples=[7]
    )
    write_answer_bytes: Bytes = Field(
        default=0, description="Answer to it; 0 where nodes do not answer a write [bytes]", examples=[6]
    )
    exchange_request_bytes: Bytes = Field(
        default=0, description="Request that writes and reads one node, without its data [bytes]", examples=[9]
    )
    exchange_answer_bytes: Bytes = Field(default=0, description="Answer to it, without its data [bytes]", examples=[9])
    sync_read_bytes: Bytes = Field(default=0, description="Request that reads many nodes [bytes]", examples=[8])
    sync_write_bytes: Bytes = Field(default=0, description="Request that writes many nodes [bytes]", examples=[8])
    sync_node_bytes: Bytes = Field(default=0, description="What either has for each node [bytes]", examples=[1])
    global_bytes: Bytes = Field(
        default=0, description="Broadcast that may open a cycle, such as Global Control [bytes]", examples=[13]
    )
    silence_bits: BitTimes = Field(default=0.0, description="Silence that ends every telegram [bits]", examples=[38.5])
    silence_us: TimeUs = Field(default=0.0, description="Least of that silence [us]", examples=[1750])
    min_turn_bits: BitTimes = Field(default=0.0, description="Shortest wait for an answer [bits]", examples=[10])
    max_turn_bits: BitTimes = Field(default=0.0, description="Longest wait for an answer [bits]", examples=[70])
    master_turns: bool = Field(
        default=False,
        description="Whether the master waits for max_turn_bits, too, before its next telegram, as in WorldFIP",
        examples=[True],
    )
    clock_tolerance: Tolerance = Field(
        default_factory=lambda: float(c["SHARES[CLOCK_TOLERANCE]"]),
        description="Largest error of the bit rate, a share of it",
        examples=[0.01],
    )
    return_delay_us: TimeUs = Field(
        default=0.0, description="Delay of an answer that is set in a new node [us]", examples=[500]
    )
    max_nodes: Count = Field(default=1_000_000, description="Most nodes of a bus", examples=[253])
    max_bytes: Count = Field(default=1_000_000, description="Most data of a telegram [bytes]", examples=[249])
    max_bit_rate_kbit_s: Annotated[float, Field(gt=0, le=1e9)] = Field(
        default=1e9, description="Highest bit rate [kbit/s]", examples=[1000]
    )

    @property
    def requests(self) -> tuple[Requests, ...]:
        """The ways to ask that it has, the fastest first."""
        ways: dict[Requests, float] = {
            "exchange": self.exchange_request_bytes,
            "sync": self.sync_read_bytes,
            "single": self.read_request_bytes,
        }
        return tuple(way for way, size in ways.items() if not is_everywhere(size <= 0))

    def data_bytes(self, size: Number, requests: Number = 1) -> Number:
        """Data of a telegram where some share data of a size: whole words, the mean of the telegrams [bytes]."""
        if not is_everywhere(self.word_bytes <= 1):
            size = rounded_up(size / self.word_bytes) * self.word_bytes
        return size / requests

    def most_data_bytes(self, size: Number, requests: Number) -> Number:
        """The same of the largest of these telegrams [bytes]."""
        return rounded_up(size / (self.word_bytes * requests)) * self.word_bytes


@cached(maxsize=16)
def _shipped(name: str) -> Protocol:
    """A protocol of the constants, whose values keep their sources."""
    values: Any = {key.lower(): value for key, value in c.by_key(name).items()}
    return Protocol.model_construct(**{key: value for key, value in values.items() if key in Protocol.model_fields})


_CONSTANTS: Final[dict[str, str]] = {
    "profibus-dp": "PROFIBUS",
    "modbus-rtu": "MODBUS",
    "dynamixel-2": "DYNAMIXEL",
    "feetech": "FEETECH",
    "worldfip": "WORLDFIP",
}
"""Name of the constants of each protocol."""
BUFFERED: Final = ("profibus-dp", "worldfip")
"""Protocols whose nodes answer from a buffer: their execution runs beside the telegrams."""


def protocol_of(bus: Any) -> Protocol:
    """The protocol of a section [bus]."""
    return _shipped(_CONSTANTS[bus.protocol]) if isinstance(bus.protocol, str) else bus.protocol


class Times(NamedTuple):
    """Times between telegrams [us]."""

    before: Number
    """Idle bus before each request."""
    typical_turn: Number
    """Wait for an answer, the node's own time left out: of a typical node, or the shortest."""
    longest_turn: Number
    """The longest."""
    after: Number
    """Idle bus after an answer."""
    silent: Number
    """Idle bus after a request without an answer."""
    once: Number
    """Token and GAP of PROFIBUS, once a cycle."""
    timeout: Number
    """How long the master waits for an answer that does not come."""


def times(network: Network) -> Times:
    """Times between the telegrams of a network [us]."""
    bus, protocol = network.profile.bus, protocol_of(network.profile.bus)
    bit_us = 1000 / bus.bit_rate_kbit_s
    if bus.protocol == "profibus-dp":
        return _profibus(bus, bit_us)
    silence_us = larger(_bits_us(protocol.silence_bits, bit_us), protocol.silence_us)
    delay_us = protocol.return_delay_us if bus.return_delay_us is None else bus.return_delay_us
    most_bits = protocol.max_turn_bits if bus.max_turn_bits is None else bus.max_turn_bits
    shortest_us = silence_us + _bits_us(protocol.min_turn_bits, bit_us) + delay_us
    longest_us = shortest_us
    if not is_off(most_bits):
        longest_us = larger(silence_us + most_bits * bit_us + delay_us, shortest_us)
    after_us = silence_us + (_bits_us(most_bits, bit_us) if protocol.master_turns else 0.0)
    # An arbiter waits once more before it answers a request of its own.
    silent_us = after_us * (2 if bus.protocol == "worldfip" else 1)
    return Times(0.0, shortest_us, longest_us, after_us, silent_us, 0.0, bus.timeout_us or 0.0)


def _bits_us(bits: Number, bit_us: Number) -> Number:
    """Time of some bits, 0.0 of none [us]."""
    return 0.0 if is_off(bits) else bits * bit_us


def _profibus(bus: Any, bit_us: Number) -> Times:
    """Times of PROFIBUS DP: T_SYN, T_SDR, T_ID1 = 35 + 2 T_SET + T_QUI, T_ID2 = max(T_ID1, max T_SDR) [us].

    Once a cycle the master passes the token to itself, T_SYN + token + T_ID2, and asks an address of the GAP that
    nobody has, T_SYN + SD1 + T_SL (Felser, PROFIBUS manual, calculation for single masters).
    """
    own = c.by_key("PROFIBUS")
    place = total(choose(bus.bit_rate_kbit_s > step, 1, 0) for step in _RATE_STEPS_KBIT_S)

    def at_rate(table: Any, words: str) -> Number:
        return from_table(tuple(map(float, table.values())), place, words=words)

    max_bits: Number = bus.max_turn_bits
    if bus.max_turn_bits is None:
        max_bits = at_rate(c.by_key("MAX_DELAY_BITS"), "max T_SDR of the bit rate")
    slot_bits = at_rate(c.by_key("SLOT_BITS"), "T_SL of the bit rate")
    setup_bits = 2 * at_rate(c.by_key("SETUP_BITS"), "T_SET of the bit rate")
    after_bits = own["IDLE_BITS"] + setup_bits + at_rate(c.by_key("QUIET_BITS"), "T_QUI of the bit rate")
    silent_bits = larger(after_bits, max_bits)
    before_bits, byte_bits = own["SYNCHRONISATION_BITS"], own["BITS_PER_BYTE"]
    token_bits = before_bits + own["TOKEN_BYTES"] * byte_bits + silent_bits
    once_bits = token_bits + before_bits + own["STATUS_BYTES"] * byte_bits + slot_bits
    bits = (before_bits, own["TYPICAL_DELAY_BITS"], larger(max_bits, own["TYPICAL_DELAY_BITS"]))
    timeout_us = slot_bits * bit_us if bus.timeout_us is None else bus.timeout_us
    before_us, typical_us, longest_us = (number * bit_us for number in bits)
    after_us, silent_us, once_us = (number * bit_us for number in (after_bits, silent_bits, once_bits))
    return Times(before_us, typical_us, longest_us, after_us, silent_us, once_us, timeout_us)
