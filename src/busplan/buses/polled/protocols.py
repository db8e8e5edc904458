"""Protocols of polled buses: sizes of telegrams without data, and times between telegrams."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, get_args

from busplan.buses.network import Network
from busplan.elementwise import (
    Number,
    choose,
    from_table,
    is_everywhere,
    is_off,
    larger,
    rounded_down,
    rounded_up,
    smaller,
    total,
)
from busplan.sourced import Constants, cached

c: Final = Constants(
    "busplan.buses.polled",
    beside=(
        *("name", "called", "rates", "start", "execution", "evidence", "nodes", "base_us"),
        *("is_buffered", "is_stuffed", "has_token", "has_arbiter"),
    ),
)
"""Constants with a source, by their names."""
PROTOCOLS: Final = MappingProxyType({words["name"]: table for table, words in c.beside.items()})
"""Table of the constants of each protocol, by the protocol's name in a profile."""
_RATE_STEPS_KBIT_S: Final = (187.5, 500, 1500, 3000, 6000)
"""Highest bit rate of each column but the last of PROFIBUS' time ratios [kbit/s]."""
UNLIMITED: Final = 1_000_000
"""Number of nodes, and data bytes of a telegram, of a protocol that limits neither."""
UNLIMITED_KBIT_S: Final = 1e9

Requests = Literal["exchange", "fast-sync", "sync", "single"]
FASTEST_FIRST: Final[tuple[Requests, ...]] = get_args(Requests)
TOGETHER: Final[tuple[Requests, ...]] = ("fast-sync", "sync")
"""Ways in which one request reads all nodes of a group."""


class ProtocolFigures(NamedTuple):
    """A serial protocol; floats, arrays or traced numbers. A size is without data; 0 means no such telegram."""

    bits_per_byte: Number
    clock_tolerance: Number
    word_bytes: Number = 1
    read_request_bytes: Number = 0
    read_answer_bytes: Number = 0
    write_request_bytes: Number = 0
    write_answer_bytes: Number = 0
    exchange_request_bytes: Number = 0
    exchange_answer_bytes: Number = 0
    sync_read_bytes: Number = 0
    sync_write_bytes: Number = 0
    sync_node_bytes: Number = 0
    fast_answer_bytes: Number = 0
    fast_node_bytes: Number = 0
    global_bytes: Number = 0
    silence_bits: Number = 0.0
    silence_us: Number = 0.0
    min_turn_bits: Number = 0.0
    max_turn_bits: Number = 0.0
    master_turns: Number = False
    return_delay_us: Number = 0.0
    max_nodes: Number = UNLIMITED
    max_bytes: Number = UNLIMITED
    max_bit_rate_kbit_s: Number = UNLIMITED_KBIT_S
    called: tuple[str, ...] = ()
    """Names that users give the protocol, its title first; none for a protocol of the user's own."""
    rates: Mapping[str, Any] = MappingProxyType({"kbit_s": ()})
    """Usual bit rates, for plans, with grade and source."""
    evidence: tuple[str, ...] = ()
    """Data files that its figures are checked against."""
    is_buffered: bool = False
    """Whether nodes answer from a buffer: their execution runs beside the telegrams."""
    is_stuffed: bool = False
    """Whether data may get stuffed bytes, one in three at most; the figures have none."""
    has_token: bool = False
    """Whether the time ratios of PROFIBUS hold, with token and GAP once a cycle."""
    has_arbiter: bool = False
    """Whether the master waits once more before it answers a request of its own."""

    @property
    def requests(self) -> tuple[Requests, ...]:
        """Ways in which nodes can be asked, the default first."""
        ways: dict[Requests, Number] = {
            "exchange": self.exchange_request_bytes,
            "sync": self.sync_read_bytes,
            "fast-sync": smaller(self.sync_read_bytes, self.fast_answer_bytes),
            "single": self.read_request_bytes,
        }
        return tuple(way for way, size in ways.items() if not is_everywhere(size <= 0))

    def data_bytes(self, size: Number, requests: Number = 1) -> Number:
        """Data of a telegram when `requests` share `size` bytes [bytes]: whole words, the mean of the telegrams."""
        if not is_everywhere(self.word_bytes <= 1):
            size = rounded_up(size / self.word_bytes) * self.word_bytes
        return size / requests

    def most_data_bytes(self, size: Number, requests: Number) -> Number:
        """Data of the largest telegram when `requests` share `size` bytes [bytes]."""
        return rounded_up(size / (self.word_bytes * requests)) * self.word_bytes

    def least_data_bytes(self, size: Number, requests: Number) -> Number:
        """Data of the smallest telegram when `requests` share `size` bytes [bytes]."""
        return rounded_down(rounded_up(size / self.word_bytes) / requests) * self.word_bytes


@cached(maxsize=16)
def _shipped(name: str) -> ProtocolFigures:
    """A shipped protocol of the constants, whose values keep their sources."""
    table = PROTOCOLS[name]
    values: Any = {key.lower(): value for key, value in c.by_key(table).items()} | c.beside[table]
    known = {key: values[key] for key in ProtocolFigures._fields if key in values}
    return ProtocolFigures(**{"clock_tolerance": c["SHARES[CLOCK_TOLERANCE]"], **known})


def protocol_of(bus: Any) -> ProtocolFigures:
    """Protocol of a section [bus]."""
    return _shipped(bus.protocol) if isinstance(bus.protocol, str) else ProtocolFigures(**vars(bus.protocol))


ADAPTERS: Final = tuple(name.split("[")[1][:-1] for name in c if name.startswith("ADAPTER_TIMER_US["))
"""Names of the usual adapters of a host."""
NO_ADAPTER: Final = "none"


class AdapterFigures(NamedTuple):
    """An adapter between the host and the bus; floats, arrays or traced numbers."""

    timer_us: Number = 0.0
    """Time from the last packet to the host until bytes go that do not fill one."""
    packet_bytes: Number = 1
    """Data of a packet, which goes at once when it is full."""
    frame_us: Number = 0.0
    """USB frame: the longest time that a packet waits for the host."""

    @property
    def is_off(self) -> bool:
        """Whether there is no adapter, or one that takes no time."""
        return is_off(self.timer_us) and is_off(self.frame_us)

    def least_wait_us(self, exchange_us: Number, answers_bytes: Iterable[Number]) -> Number:
        """Least time from the end of an exchange to its last packet, behind another exchange [us].

        The timer runs from the last packet of the exchange before; a last packet that is full does not wait for it.
        `answers_bytes` are the sizes of all answers together, of each exchange that may be this one.
        """
        wait_us = larger(self.timer_us - exchange_us, 0.0)
        for size in answers_bytes:
            packets = size / self.packet_bytes
            wait_us = choose(rounded_down(packets) >= packets, 0.0, wait_us)
        return wait_us


def adapter_of(bus: Any) -> AdapterFigures:
    """Adapter of a section [bus]; none where it has none."""
    if bus.adapter is None or bus.adapter == NO_ADAPTER:
        return AdapterFigures()
    if isinstance(bus.adapter, str):
        return AdapterFigures(*(c[f"ADAPTER_{key.upper()}[{bus.adapter}]"] for key in AdapterFigures._fields))
    return AdapterFigures(**vars(bus.adapter))


class Times(NamedTuple):
    """Times between telegrams [us]."""

    before: Number
    """Idle bus before each request."""
    typical_turn: Number
    """Wait for an answer, without the node's own time: of a typical node, or the shortest."""
    longest_turn: Number
    """Longest wait for an answer, without the node's own time."""
    after: Number
    """Idle bus after an answer."""
    silent: Number
    """Idle bus after a request without an answer."""
    once: Number
    """Token and GAP of PROFIBUS, once a cycle."""
    timeout: Number
    """Wait of the master for an answer that does not come."""


def times(network: Network) -> Times:
    """Times between the telegrams of a network [us]."""
    bus, protocol = network.profile.bus, protocol_of(network.profile.bus)
    bit_us = 1000 / bus.bit_rate_kbit_s
    if protocol.has_token:
        return _profibus(bus, bit_us)
    silence_us = larger(_bits_us(protocol.silence_bits, bit_us), protocol.silence_us)
    delay_us = protocol.return_delay_us if bus.return_delay_us is None else bus.return_delay_us
    most_bits = protocol.max_turn_bits if bus.max_turn_bits is None else bus.max_turn_bits
    shortest_us = silence_us + _bits_us(protocol.min_turn_bits, bit_us) + delay_us
    longest_us = shortest_us
    if not is_off(most_bits):
        longest_us = larger(silence_us + most_bits * bit_us + delay_us, shortest_us)
    after_us = silence_us + (_bits_us(most_bits, bit_us) if protocol.master_turns else 0.0)
    silent_us = after_us * (2 if protocol.has_arbiter else 1)
    timeout_us = 0.0 if bus.timeout_us is None else bus.timeout_us
    return Times(0.0, shortest_us, longest_us, after_us, silent_us, 0.0, timeout_us)


def _bits_us(bits: Number, bit_us: Number) -> Number:
    """Time of some bits [us]; 0.0 for none."""
    return 0.0 if is_off(bits) else bits * bit_us


def _profibus(bus: Any, bit_us: Number) -> Times:
    """Times of PROFIBUS DP: T_SYN, T_SDR, T_ID1 = 35 + 2 T_SET + T_QUI, T_ID2 = max(T_ID1, max T_SDR) [us].

    Once a cycle the master passes the token to itself, T_SYN + token + T_ID2, and asks an unused address of the GAP,
    T_SYN + SD1 + T_SL (Felser, PROFIBUS manual, calculation for single masters).
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
