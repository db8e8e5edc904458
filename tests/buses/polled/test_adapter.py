"""The adapter of a polled bus beside an event simulation, and at its ends by hand."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan import BusplanError
from busplan.buses.polled.cycle import PolledCycle
from busplan.profile.document import decode, validate
from busplan.questions.fit.network import network_of
from tests.oracles.adapter_simulation import Adapter, Exchange, cycle_us, shares
from tests.registers import at_least

OWN = """[bus.protocol]
bits_per_byte = 12
read_request_bytes = 6
read_answer_bytes = 5
write_request_bytes = 6
sync_read_bytes = 7
sync_write_bytes = 8
sync_node_bytes = 2
fast_answer_bytes = 3
fast_node_bytes = 2
"""


@dataclass
class Frames:
    """Bytes of a protocol's telegrams, without data."""

    bits: int
    read: tuple[int, int]
    write: tuple[int, int]
    sync: tuple[int, int, int] = (0, 0, 0)
    fast: tuple[int, int] = (0, 0)
    exchange: tuple[int, int] = (0, 0)
    word: int = 1


# ROBOTIS, protocol 2.0; Feetech, SCServo library; Modbus over serial line V1.02; and `OWN`.
FRAMES = {
    "dynamixel-2": Frames(10, (14, 11), (12, 11), (14, 14, 1), (8, 4)),
    "feetech": Frames(10, (8, 6), (7, 6), (8, 8, 1)),
    "modbus-rtu": Frames(11, (8, 5), (9, 8), exchange=(13, 5), word=2),
    "own": Frames(12, (6, 5), (6, 0), (7, 8, 2), (3, 2)),
}
WAYS = {
    "dynamixel-2": ("sync", "fast-sync", "single"),
    "feetech": ("sync", "single"),
    "modbus-rtu": ("exchange", "single"),
    "own": ("sync", "fast-sync", "single"),
}


class RandomBus:
    """A bus as a profile, and as exchanges of the simulation."""

    def __init__(self, rng: Random) -> None:
        self.rng = rng
        self.protocol = rng.choice(sorted(FRAMES))
        self.frames, self.way = FRAMES[self.protocol], rng.choice(WAYS[self.protocol])
        self.rate = rng.choice([9.6, 57.6, 115.2, 1000.0])
        self.byte = Fraction(self.frames.bits * 1000) / Fraction(self.rate)
        sizes = rng.sample(range(2, 41, 2), rng.randint(1, 3))
        self.groups = [(rng.randint(1, 9), read, 2 * rng.randint(1, 20)) for read in sizes]
        """Nodes, bytes read and bytes written of each group; no two are alike, which would be one."""
        self.reads, self.writes = (1, 1) if self.way == "exchange" else (rng.randint(1, 3), rng.randint(1, 3))
        self.timer = rng.choice([0, 500, 1000, 2000, 16_000, rng.randint(1, 20_000)])
        self.packet = rng.choice([1, 8, 62, 62, 510, rng.randint(1, 70)])
        self.frame = rng.choice([0, 125, 1000])
        self.delay, self.own = rng.choice([0, 0, 250, 500]), rng.choice([0, 22, 1000])
        self.host = rng.choice([0, 0, rng.randint(1, 3000)])
        self.retries, self.timeout = rng.choice([0, 0, 1, 2]), rng.randint(0, 5000)
        self.silence = Fraction(0)
        if self.protocol == "modbus-rtu":
            self.silence = Fraction(77, 2) * 1000 / Fraction(self.rate) if self.rate < 19.2 else Fraction(1750)

    def profile(self) -> busplan.Profile:
        is_own = self.protocol == "own"
        groups = "".join(
            f'[[group]]\nname = "g{number}"\nnodes = {nodes}\naxes = 1\nread_bytes = {read}\nwrite_bytes = {write}\n'
            f'execution = {{kind = "linear", grade = "measured", base_us = {self.own}, per_byte_us = 0}}\n'
            for number, (nodes, read, write) in enumerate(self.groups)
        )
        text = (
            f'schema_version = 1\nname = "random"\n[bus]\nkind = "polled"\nbit_rate_kbit_s = {self.rate}\n'
            + ("" if is_own else f'protocol = "{self.protocol}"\n')
            + f'requests = "{self.way}"\nreads = {self.reads}\nwrites = {self.writes}\nhost_us = {self.host}\n'
            f"return_delay_us = {self.delay}\nretries = {self.retries}\ntimeout_us = {self.timeout}\n"
            f"adapter = {{ timer_us = {self.timer}, packet_bytes = {self.packet}, frame_us = {self.frame} }}\n"
            + (OWN if is_own else "")
            + f"[cycle]\nperiod_us = 10000\n{groups}"
        )
        return validate(decode(text.encode(), name="random"))

    def exchanges(self) -> list[Exchange]:
        """Exchanges of a cycle; repeated requests come before any of those with answers."""
        wait = self.silence + self.delay + self.own
        parts = [*self._reads(wait)]
        writes = [] if self.way == "exchange" else [*self._writes(wait)]
        if self.way == "exchange":
            parts[0] = parts[0]._replace(pause=Fraction(self.host))
        else:
            writes[0] = writes[0]._replace(pause=Fraction(self.host))
        parts += writes
        answered = [number for number, part in enumerate(parts) if part.answers]
        for _ in range(self.retries):
            number = self.rng.choice(answered)
            pause = parts[number].pause + self._longest() * self.byte + self.timeout
            parts[number] = parts[number]._replace(pause=pause)
        return parts

    def _words(self, size: int, requests: int = 1) -> Iterator[int]:
        return (self.frames.word * share for share in shares(-(-size // self.frames.word), requests))

    def _longest(self) -> int:
        of_all, frames = [], self.frames
        for nodes, _, write in self.groups:
            if self.way == "exchange":
                of_all.append(frames.exchange[0] + write)
            elif self.way == "single":
                of_all.append(max(frames.read[0], frames.write[0] + max(self._words(write, self.writes))))
            else:
                of_all.append(frames.sync[0] + nodes * frames.sync[2])
        return max(of_all)

    def _reads(self, wait: Fraction) -> Iterator[Exchange]:
        frames = self.frames
        for nodes, read, write in self.groups:
            if self.way == "exchange":
                for _ in range(nodes):
                    yield Exchange(frames.exchange[0] + write, [(wait, frames.exchange[1] + read)])
                continue
            for size in self._words(read, self.reads):
                request = frames.sync[0] + nodes * frames.sync[2]
                if self.way == "sync":
                    yield Exchange(request, [(wait, frames.read[1] + size)] * nodes)
                elif self.way == "fast-sync":
                    yield Exchange(request, [(wait, frames.fast[0] + nodes * (frames.fast[1] + size))])
                else:
                    for _ in range(nodes):
                        yield Exchange(frames.read[0], [(wait, frames.read[1] + size)])

    def _writes(self, wait: Fraction) -> Iterator[Exchange]:
        frames = self.frames
        for nodes, _, write in self.groups:
            for size in self._words(write, self.writes):
                if self.way in ("sync", "fast-sync"):
                    yield Exchange(frames.sync[1] + nodes * (frames.sync[2] + size))
                    continue
                for _ in range(nodes):
                    answers = [(wait, frames.write[1])] if frames.write[1] else []
                    yield Exchange(frames.write[0] + size, answers)

    def simulated_us(self) -> float:
        rng = self.rng
        phases = (Fraction(rng.randint(0, 10**6), 10**6) for _ in range(3))
        timer, frame, start = (
            phase * length for phase, length in zip(phases, (self.timer, self.frame, 1), strict=True)
        )
        adapter = Adapter(Fraction(self.timer), self.packet, Fraction(self.frame), timer_phase=timer, frame_phase=frame)
        return float(cycle_us(self.exchanges(), adapter, start=start, byte=self.byte, silence=self.silence))


def ends_us(profile: busplan.Profile) -> tuple[float, float]:
    cycle, typical = (PolledCycle(network_of(profile), model) for model in ("standard", "typical"))
    least_us = cycle.required_us - cycle.possible_us()
    assert typical.required_us == pytest.approx(least_us, rel=1e-9)
    return least_us, cycle.required_us


def place(seed: int) -> tuple[float, float, float]:
    """Ends of a random bus, and the time that is simulated between them [us]."""
    bus = RandomBus(Random(seed))
    least_us, most_us = ends_us(bus.profile())
    simulated_us = bus.simulated_us()
    assert least_us * (1 - 1e-9) <= simulated_us <= most_us * (1 + 1e-9), (seed, vars(bus), least_us, simulated_us)
    return least_us, simulated_us, most_us


@given(st.integers(0, 10**9))
def test_a_cycle_is_never_outside_its_ends(seed: int) -> None:
    place(seed)


def test_both_ends_are_reached() -> None:
    is_near_least = is_near_most = 0
    for seed in range(at_least(50)):
        least_us, simulated_us, most_us = place(seed)
        if most_us > 1.05 * least_us:
            is_near_least += simulated_us < 1.02 * least_us
            is_near_most += simulated_us > 0.98 * most_us
    assert min(is_near_least, is_near_most) >= at_least(1), (is_near_least, is_near_most)


ABOVE = {"read and write of one servo, optimised", "fast sync read and write, optimised"}
"""Measured rows with the wait of a program until its write is out, which is the host's time."""


def test_measured_times_lie_between_their_ends() -> None:
    (kind,) = busplan.evidence("polled").kinds
    rows = [one for section in kind.sections for one in section.comparisons if one.method.startswith("at ")]
    assert len(rows) == 2 * (4 + 11 + 2)
    is_fault = {
        "at least": lambda residual: residual > 0,
        "at most": lambda residual: residual < 0,
    }
    outside = {row.quantity for row in rows if row.residual is not None and is_fault[row.method](row.residual)}
    assert outside == ABOVE


def servo(**changes: Any) -> busplan.Profile:
    """One read of 4 bytes from each of 3 servos at 1 Mbaud: 14 and 15 bytes of 10 us, and 50 us, each 340 us."""
    own: dict[str, Any] = {"node__execution__base_us": 50.0, "bus__host_us": 0.0, "bus__nodes": 3}
    own |= {"bus__requests": "single", "payload__read_bytes": 4, "node__execution__uncertainty_us": None}
    own |= {"node__execution__grade": "measured", "bus__clock_tolerance": 0.0, **changes}
    return busplan.load_profile(
        "dynamixel-arm-14", changes={key.replace("__", "."): value for key, value in own.items()}
    )


@pytest.mark.parametrize(
    ("adapter", "least_us", "most_us"),
    [
        # The timer hides all but the first exchange, or is hidden; a write of 4 bytes has 16 and 11 bytes, and 50 us.
        ("ftdi", 340 + 5 * 16_000, 3 * 340 + 3 * 320 + 6 * 17_000),
        ("ftdi-low-latency", 340 + 5 * 1000, 3 * 340 + 3 * 320 + 6 * 2000),
        ({"timer_us": 100.0, "frame_us": 125.0}, 3 * 340 + 3 * 320, 3 * 340 + 3 * 320 + 6 * 225),
        # An answer of 15 bytes fills its packet and goes at once; one of 11 bytes waits.
        ({"timer_us": 1000.0, "packet_bytes": 15}, 3 * 340 + 3 * 1000, 3 * 340 + 3 * 320 + 6 * 2000),
        ("none", 3 * 340 + 3 * 320, 3 * 340 + 3 * 320),
    ],
)
def test_the_ends_by_hand(adapter: object, least_us: float, most_us: float) -> None:
    assert ends_us(servo(bus__adapter=adapter)) == pytest.approx((least_us, most_us))


def test_the_ends_of_exchanges_by_hand() -> None:
    # Six boards of Modbus at 115.2 kbit/s: 13 + 4 and 5 + 4 bytes of 11 bits, twice 1750 us of silence, 50 us.
    boards = servo(
        bus__protocol="modbus-rtu",
        bus__requests="exchange",
        bus__nodes=6,
        bus__bit_rate_kbit_s=115.2,
        bus__adapter={"timer_us": 10_000.0, "frame_us": 0.0},
    )
    exchange_us = (17 + 9) * 11 / 0.1152 + 2 * 1750 + 50
    assert ends_us(boards) == pytest.approx((exchange_us + 5 * 10_000, 6 * (exchange_us + 10_000)))
    # An answer of 9 bytes fills a packet of 3, and goes at once.
    full = busplan.load_profile(boards, changes={"bus.adapter.packet_bytes": 3})
    assert ends_us(full)[0] == pytest.approx(6 * exchange_us)


@pytest.mark.parametrize(("packet_bytes", "is_full"), [(13, True), (14, True), (15, False), (6, False)])
def test_of_requests_that_share_data_either_answer_may_fill_its_packet(packet_bytes: int, is_full: bool) -> None:
    # A servo's 5 bytes come as 2 and as 3, each beside 11 of its answer; the longer of the two has the shorter wait.
    adapter = {"timer_us": 1000.0, "packet_bytes": packet_bytes, "frame_us": 0.0}
    least_us, _ = ends_us(servo(bus__reads=2, payload__read_bytes=5, bus__adapter=adapter))
    mean_us, longer_us = ((14 + 11 + size) * 10 + 50 for size in (2.5, 3))
    wait_us = 0 if is_full else 1000 - longer_us
    assert least_us == pytest.approx(6 * mean_us + 5 * wait_us + 3 * 1000)


@pytest.mark.parametrize(("host_us", "seen_us"), [(300.0, 0.0), (680.0, 0.0), (800.0, 120.0)])
def test_the_hosts_time_hides_in_the_wait_of_the_first_write(host_us: float, seen_us: float) -> None:
    least_us, most_us = ends_us(servo(bus__adapter="ftdi-low-latency", bus__host_us=host_us))
    assert (least_us, most_us) == pytest.approx((340 + 5 * 1000 + seen_us, 13_980 + host_us))


@pytest.mark.parametrize(
    ("period_us", "verdict"),
    [(5339.0, "does not fit"), (5341.0, "not shown to fit"), (13_979.0, "not shown to fit"), (13_981.0, "fits")],
)
def test_it_fits_by_the_upper_end_and_does_not_by_the_lower(period_us: float, verdict: str) -> None:
    changes = {
        "bus__adapter": "ftdi-low-latency",
        "cycle__period_us": period_us,
        "node__execution__uncertainty_us": 0.0,
    }
    assert busplan.capacity(servo(**changes)).verdict == verdict


def test_a_fast_sync_read_has_one_answer_of_all() -> None:
    # Requests as a sync read, 14 + 3 bytes; an answer of 8 and 4 + 4 for each servo, behind one wait of 50 us. The sync
    # write has 14 and 1 + 4 for each.
    fast_us = 170 + 50 + (8 + 3 * 8) * 10 + (14 + 3 * 5) * 10
    assert ends_us(servo(bus__requests="fast-sync", bus__adapter="none")) == pytest.approx((fast_us, fast_us))
    with pytest.raises(BusplanError, match="it has sync, single"):
        servo(bus__protocol="feetech", bus__requests="fast-sync")


def test_explain_and_the_card_have_both_ends() -> None:
    profile = servo(bus__adapter="ftdi-low-latency")
    for figure, ends in (("required_us", (5340, 13_980)), ("cycle_adapter_us", (3360, 12_000))):
        derivations = busplan.explain(profile, figure).derivations
        assert [one.value for one in derivations] == pytest.approx(ends[::-1])
    card = busplan.capacity(profile).verdicts[0].card
    (used,) = ("".join(map(str, line.parts)) for label, line in card.lines if label == "used")
    assert used == "at least 5340.0, at most 13980.0 us of 10000, 140 %"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bus.adapter": "usb"}, 'expected "ftdi", "ftdi-low-latency" or "none"'),
        ({"bus.adapter": {"timer": 1000}}, "did you mean timer_us"),
        ({"bus.adapter": {"timer_us": 1000, "packet_bytes": 0}}, "bus.adapter.packet_bytes: must be 1 or more"),
        ({"bus.adapter_us": 1000.0}, "did you mean adapter"),
    ],
)
def test_a_wrong_adapter_says_what_would_be_right(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BusplanError) as refused:
        busplan.load_profile("dynamixel-arm-14", changes=changes)
    assert words in str(refused.value)
    assert "(a " not in str(refused.value)
