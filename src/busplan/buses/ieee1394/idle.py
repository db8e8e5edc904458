"""Idle bus around a transaction: the gaps as `paper` adds them up, and as the bus runs them.

A gap is a threshold of an idle period: the time for which the bus has been idle. Gaps of a transaction are not
added to each other, and the time in which a node executes is idle bus, too. Fairness lets a node start one asynchronous
packet in a fairness interval, which an idle period of the arbitration reset gap ends.

The execution time is an upper bound, and a faster node must not lengthen the cycle: each time is the largest over all
faster nodes.

References
----------
TI, TSB12LV01B data sheet, p. 7-6, and TSB12LV32-EP: both gaps are detected when the bus has been idle for their time.
"""

from typing import Literal, NamedTuple

from busplan.elementwise import Number, choose, is_off, larger, smaller

Answer = Literal["split", "concatenated", "unified"]
"""Answer of a node to a request.

split: it acknowledges, executes, and arbitrates for its response. concatenated: its response follows its acknowledge,
and the bus stays busy. unified: its acknowledge completes the transaction.
"""


class Gaps(NamedTuple):
    """The gaps of a bus [us], and whether a single node answers on it."""

    subaction_us: Number
    """T_sub."""
    arbitration_reset_us: Number
    """T_reset."""
    both_us: Number
    """T_sum, equation (10)."""
    alone: Number
    """Whether there is a single node: a boolean, or an array of booleans."""


class IdleTime(NamedTuple):
    """Idle bus around a transaction, without the execution [us]."""

    idle_us: Number
    """Idle bus of the gaps."""
    host_us: Number
    """Idle bus while the host takes longer than the gaps."""


def gaps_added_up(_answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> IdleTime:  # noqa: ARG001
    """Both gaps after every transaction, whatever the node and the host do, as equation (11) has it."""
    return IdleTime(gaps.both_us, 0.0)


def gaps_as_thresholds(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> IdleTime:
    """Idle bus of a transaction as the bus runs it.

    Parameters
    ----------
    answer
        How the node answers.
    gaps
        The gaps.
    execution_us
        Upper bound of the execution time of a split transaction [us]; of any sort.
    host_us
        The host's own time between a response and its next request [us]; of any sort.

    Examples
    --------
    >>> gaps = Gaps(10.5, 21.0, 31.5, alone=False)
    >>> gaps_as_thresholds("split", gaps=gaps, execution_us=36.5, host_us=0.0)
    IdleTime(idle_us=10.5, host_us=0.0)
    >>> gaps_as_thresholds("split", gaps=gaps, execution_us=0.0, host_us=30.0)
    IdleTime(idle_us=31.5, host_us=9.0)
    """
    if answer == "split":
        without_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=0.0)
        if is_off(host_us):
            return IdleTime(without_host_us - execution_us, 0.0)
        with_host_us = between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us)
        return IdleTime(without_host_us - execution_us, with_host_us - without_host_us)
    idle_us = gaps.arbitration_reset_us
    return IdleTime(
        idle_us, between_packets_us(answer, gaps=gaps, execution_us=execution_us, host_us=host_us) - idle_us
    )


def between_packets_us(answer: Answer, *, gaps: Gaps, execution_us: Number, host_us: Number) -> Number:
    """Time of a transaction without its packets: execution, gaps and host [us].

    A split transaction has two idle periods, before and after its response. A fast node ends the first before the
    arbitration reset gap has passed; then the second must be as long as that gap. A single node on the bus may have
    used its turn in the fairness interval; then the first must be as long.

    Parameters
    ----------
    answer, gaps, execution_us, host_us
        As in `gaps_as_thresholds`.
    """
    sub_us, reset_us = gaps.subaction_us, gaps.arbitration_reset_us
    if answer != "split":
        return larger(reset_us, host_us)
    first_us = choose(gaps.alone, reset_us, larger(sub_us, smaller(execution_us, reset_us)))
    fast_us = first_us + larger(reset_us, host_us)
    return larger(fast_us, execution_us + larger(sub_us, host_us))
