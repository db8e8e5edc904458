"""An event simulation of a polled bus, byte by byte, that shares no code with busplan.

A master sends scripts of bytes; each node hears the end of a request, waits its own time, and sends its answer; the
master goes on when the last byte has come and the bus has been idle long enough. All times are in bit times until the
end, with exact fractions.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

# kbit/s: max T_SDR, T_SL, T_QUI, T_SET (PROFIBUS manual, time ratios)
RATIOS = {
    187.5: (60, 100, 0, 1),
    500: (100, 200, 0, 1),
    1500: (150, 300, 0, 1),
    3000: (250, 400, 3, 4),
    6000: (450, 600, 6, 8),
    12000: (800, 1000, 9, 16),
}


class Wire:
    """The clock of a half-duplex line, in bit times."""

    def __init__(self, bits_per_byte: int) -> None:
        self.now = Fraction(0)
        self.bits_per_byte = bits_per_byte
        self.busy_until = Fraction(0)

    def send(self, telegram: bytes) -> None:
        assert self.now >= self.busy_until  # nobody speaks while another does
        for _ in telegram:
            self.now += self.bits_per_byte
        self.busy_until = self.now

    def wait(self, bits: Fraction | float) -> None:
        self.now += Fraction(bits)


Wait = Callable[[], Fraction]


def profibus_us(rate: float, payloads: list[tuple[int, int]], *, sdr: Wait, is_isochronous: bool) -> float:
    """A cycle of one master: Global Control, an exchange with each slave, an unanswered GAP request, the token."""
    most, slot, quiet, setup = RATIOS[rate]
    idle_1 = 35 + 2 * setup + quiet
    idle_2 = max(idle_1, most)
    wire = Wire(11)
    if is_isochronous:
        wire.wait(33)
        wire.send(b"\x68LL\x68DSF" + b"ss" + b"cg" + b"C\x16")  # SD LE LEr SD DA SA FC, SAPs, control, group, FCS ED
        wire.wait(idle_2)
    for written, read in payloads:
        wire.wait(33)
        wire.send(b"\x68LL\x68DSF" + bytes(written) + b"C\x16")
        wire.wait(sdr())
        wire.send(b"\x68LL\x68DSF" + bytes(read) + b"C\x16")
        wire.wait(idle_1)
    wire.wait(33)
    wire.send(b"\x10DSFC\x16")
    wire.wait(slot)
    wire.wait(33)
    wire.send(b"\xdcDS")
    wire.wait(idle_2)
    return float(wire.now * 1000 / Fraction(rate))


class Servos(NamedTuple):
    """Frames of a serial servo: what stands before and behind its parameters."""

    head: bytes  # header, identifier, length
    tail: bytes  # checksum
    address: bytes
    length: bytes


DYNAMIXEL = Servos(b"\xff\xff\xfd\x00ILL", b"CC", b"AA", b"NN")
FEETECH = Servos(b"\xff\xffIL", b"C", b"A", b"N")


def servos_us(
    kind: Servos,
    rate: float,
    nodes: int,
    *,
    read: int,
    write: int,
    reads: int,
    is_sync: bool,
    turn_us: float,
) -> float:
    """A cycle of serial servos: all are read, then all are written."""
    wire, bit_us = Wire(10), Fraction(1000) / Fraction(rate)
    turn = Fraction(turn_us) / bit_us
    status = b"E" if kind is FEETECH else b"\x55E"

    def frame(instruction: bytes, parameters: bytes) -> bytes:
        return kind.head + instruction + parameters + kind.tail

    def talk(request: bytes, answers: list[bytes]) -> None:
        wire.send(request)
        for answer in answers:
            wire.wait(turn)
            wire.send(answer)

    for part in range(reads if read else 0):
        size = read // reads + (part < read % reads)
        answer = kind.head + status + bytes(size) + kind.tail
        if is_sync:
            talk(frame(b"\x82", kind.address + kind.length + bytes(nodes)), [answer] * nodes)
        else:
            for _ in range(nodes):
                talk(frame(b"\x02", kind.address + kind.length), [answer])
    if not write:
        return float(wire.now * bit_us)
    if is_sync:
        talk(frame(b"\x83", kind.address + kind.length + bytes(nodes * (1 + write))), [])
    else:
        for _ in range(nodes):
            talk(frame(b"\x03", kind.address + bytes(write)), [kind.head + status + kind.tail])
    return float(wire.now * bit_us)


def registers(size: int, requests: int = 1) -> list[bytes]:
    """Data of each request that has a share of some bytes: registers of two bytes, the last one filled up."""
    whole = [b"rr"] * -(-size // 2)
    return [b"".join(whole[request::requests]) for request in range(requests)]


def modbus_us(
    rate: float, nodes: int, *, read: int, write: int, node_us: float, is_exchange: bool, reads: int = 1
) -> float:
    """A cycle of Modbus RTU: silence ends each frame, and a node answers behind it."""
    wire, bit_us = Wire(11), Fraction(1000) / Fraction(rate)
    silence = Fraction(77, 2) if rate <= 19.2 else Fraction(1750) / bit_us
    reading = [(b"afaaqqcc", b"afn" + data + b"cc") for data in registers(read, reads)] if read else []
    writing = [(b"afaaqqn" + registers(write)[0] + b"cc", b"afaaqqcc")] if write else []
    frames = (
        [(b"af" + bytes(4) + bytes(4) + b"n" + registers(write)[0] + b"cc", b"afn" + registers(read)[0] + b"cc")]
        * nodes
        if is_exchange and read and write
        else reading * nodes + writing * nodes
    )
    for request, answer in frames:
        wire.send(request)
        wire.wait(silence)
        wire.wait(Fraction(node_us) / bit_us)
        wire.send(answer)
        wire.wait(silence)
    return float(wire.now * bit_us)
