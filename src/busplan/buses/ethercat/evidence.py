"""Figures of EtherCAT frames for rows of evidence; each function takes any cycle of the kind."""

from typing import Final

from busplan.buses.ethercat import equations
from busplan.buses.ethercat.equations import c


def room_bytes(_cycle: object, *, with_clocks: bool = False) -> float:
    """Most process data of a frame with one datagram, alone or with the datagram of the clocks [bytes]."""
    return equations.room_bytes(1) - (c.by_key("CLOCK_BYTES")["SOEM"] if with_clocks else 0)


def frame_bytes(_cycle: object, *, data_bytes: int) -> float:
    """A frame with one datagram on the wire [bytes]."""
    return equations.frame_bytes(equations.datagram_bytes(data_bytes))


def on_the_wire_us(_cycle: object, *, wire_bytes: int, devices: int, cable_length_m: float) -> float:
    """Time of a frame through E-bus devices and back, each with a cable before it [us]."""
    hop_us = equations.device_us(c.by_key("DELAY_US")["E-bus"]) + equations.cable_us(cable_length_m)
    return equations.sending_us(wire_bytes) + devices * hop_us


FUNCTIONS: Final = {function.__name__: function for function in (room_bytes, frame_bytes, on_the_wire_us)}
