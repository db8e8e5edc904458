"""The time slice of a communication cycle, equations (1) and (2) of the paper: they hold for every kind of bus."""

from busplan.elementwise import Number
from busplan.sourced import SYMBOLS, published

SYMBOLS.update(
    {
        "period_us": "T_s",
        "slice_ratio": "alpha",
        "nodes": "N",
        "available_us": "alpha T_s",
        "required_us": "T_need",
        "nonperiodic_us": "T_npd",
    }
)


@published(1, symbol="T_cs", section="II")
def time_slice_us(period_us: Number, *, slice_ratio: Number, nodes: Number) -> Number:
    """Communication time slice that the cycle gives each node.

    Parameters
    ----------
    period_us
        Communication period T_s [us]; float or array.
    slice_ratio
        Share alpha of the period that belongs to communication, 0..1 [1]; float or array.
    nodes
        Number of distributed nodes N, host not counted [1]; float or array.

    Returns
    -------
    float
        T_cs = alpha T_s / N [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `nodes` is zero.

    Examples
    --------
    >>> time_slice_us(4000.0, slice_ratio=0.5, nodes=2)
    1000.0
    """
    return slice_ratio * period_us / nodes


@published(2, symbol="T_cs", section="III-C")
def required_time_slice_us(required_us: Number, *, nodes: Number) -> Number:
    """Communication time slice that each node needs.

    Parameters
    ----------
    required_us
        What the whole cycle needs, the sum of its terms [us]; float or array. The paper has four: all reads T_r and all
        writes T_w with their gaps, the time for non-periodic data T_npd, and the synchronous packet CTS.
    nodes
        Number of distributed nodes N [1]; float or array.

    Returns
    -------
    float
        T_cs = T_need / N [us]; the broadcast shape of the arguments.

    Raises
    ------
    ZeroDivisionError
        `nodes` is zero.

    Examples
    --------
    >>> required_time_slice_us(300.0, nodes=2)
    150.0
    """
    return required_us / nodes
