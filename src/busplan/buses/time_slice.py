"""The time slice of a communication cycle, equations (1) and (2) of the paper.

Each parameter is a float or an array, and so is the result, in their broadcast shape; times are in us. N is the number
of distributed nodes, the host not counted, and alpha the share of the period T_s that belongs to communication, 0..1.
Zero nodes raise ZeroDivisionError. Other buses than IEEE 1394 have other terms: there a node's slice is T_need / N.
"""

from busplan.elementwise import Number
from busplan.sourced import SYMBOLS, published

SYMBOLS.update(
    {
        "period_us": "T_s",
        "slice_ratio": "alpha",
        "nodes": "N",
        "available_us": "alpha T_s",
        "required_us": "T_need",
        "reads_us": "T_r",
        "writes_us": "T_w",
        "nonperiodic_us": "T_npd",
        "sync_us": "CTS",
    }
)


@published(1, symbol="T_cs", section="II")
def time_slice_us(period_us: Number, *, slice_ratio: Number, nodes: Number) -> Number:
    """Communication time slice that the cycle gives each node.

    T_cs = alpha T_s / N [us].

    Examples
    --------
    >>> time_slice_us(4000.0, slice_ratio=0.5, nodes=2)
    1000.0
    """
    return slice_ratio * period_us / nodes


@published(2, symbol="T_cs", section="III-C")
def required_time_slice_us(
    reads_us: Number, *, writes_us: Number, nonperiodic_us: Number, sync_us: Number, nodes: Number
) -> Number:
    """Communication time slice that each node needs.

    T_cs = (T_r + T_w + T_npd + CTS) / N [us].

    Examples
    --------
    >>> required_time_slice_us(100.0, writes_us=150.0, nonperiodic_us=30.0, sync_us=20.0, nodes=2)
    150.0
    """
    return (reads_us + writes_us + nonperiodic_us + sync_us) / nodes
