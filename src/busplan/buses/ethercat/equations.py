"""Length of EtherCAT frames, for numbers of any sort."""

from typing import Final

from busplan.buses.ethercat.constants import (
    BYTE_US,
    CABLE_US_PER_M,
    CHECK_BYTES,
    DATAGRAM_BYTES,
    ETHERNET_BYTES,
    GAP_BYTES,
    HEADER_BYTES,
    LEAST_FRAME_BYTES,
    MOST_FRAME_BYTES,
    PREAMBLE_BYTES,
)
from busplan.elementwise import Number, alike, choose, larger, plain

_BOTH_WAYS: Final = 2


def datagram_bytes(data_bytes: Number) -> Number:
    """Bytes of a datagram: 10 of header, its data, 2 of working counter [bytes].

    Parameters
    ----------
    data_bytes
        Its data [bytes]; float or array.

    Examples
    --------
    >>> datagram_bytes(8)
    20.0
    """
    return data_bytes + DATAGRAM_BYTES


def overhead_bytes(like: Number) -> Number:
    """Bytes of a frame on the wire beside its datagrams and padding: preamble, headers, check and gap [bytes].

    Parameters
    ----------
    like
        A number that they are computed with, which says of what sort they are.

    Examples
    --------
    >>> overhead_bytes(1)
    40.0
    """
    return alike(PREAMBLE_BYTES, like) + ETHERNET_BYTES + HEADER_BYTES + CHECK_BYTES + GAP_BYTES


def padding_bytes(datagrams_bytes: Number) -> Number:
    """Bytes that fill a frame up to the shortest one; 0 of a frame that holds nothing [bytes].

    Parameters
    ----------
    datagrams_bytes
        All its datagrams; 0 where there is no frame [bytes]; float or array.

    Examples
    --------
    >>> padding_bytes(20), padding_bytes(100), padding_bytes(0)
    (24.0, 0.0, 0.0)
    """
    short: Number = larger(LEAST_FRAME_BYTES - (datagrams_bytes + overhead_bytes(datagrams_bytes)), 0.0)
    return choose(datagrams_bytes > 0, short, 0.0)


def frame_bytes(datagrams_bytes: Number) -> Number:
    """Bytes of a frame on the wire: preamble, headers, datagrams, check, gap and padding [bytes].

    Parameters
    ----------
    datagrams_bytes
        All its datagrams [bytes]; float or array.

    Examples
    --------
    >>> frame_bytes(datagram_bytes(125)), frame_bytes(datagram_bytes(1)), frame_bytes(datagram_bytes(1486))
    (177.0, 84.0, 1538.0)
    """
    return datagrams_bytes + overhead_bytes(datagrams_bytes) + padding_bytes(datagrams_bytes)


def room_bytes(datagrams: int) -> float:
    """Most process data of a frame with a number of datagrams [bytes].

    Parameters
    ----------
    datagrams
        How many datagrams share them [1].

    Examples
    --------
    >>> room_bytes(1), room_bytes(2)
    (1486.0, 1474.0)
    """
    return plain(MOST_FRAME_BYTES - plain(overhead_bytes(1)) - datagrams * DATAGRAM_BYTES)


def sending_us(wire_bytes: Number) -> Number:
    """Time of some bytes on the wire [us].

    Parameters
    ----------
    wire_bytes
        The bytes [bytes]; float or array.

    Examples
    --------
    >>> sending_us(100)
    8.0
    """
    return wire_bytes * BYTE_US


def cable_us(cable_m: Number) -> Number:
    """Time that a cable takes there and back [us].

    Parameters
    ----------
    cable_m
        Its length [m]; float or array.

    Examples
    --------
    >>> cable_us(100)
    1.0
    """
    return _BOTH_WAYS * cable_m * CABLE_US_PER_M


def device_us(delay_us: Number) -> Number:
    """Time that a device takes there and back [us].

    Parameters
    ----------
    delay_us
        Its delay one way [us]; float or array.

    Examples
    --------
    >>> device_us(0.5)
    1.0
    """
    return _BOTH_WAYS * delay_us
