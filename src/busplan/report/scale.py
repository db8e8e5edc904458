"""Round marks for any scale."""

from math import ceil, floor, log10
from typing import NamedTuple


class Tick(NamedTuple):
    """One mark of a scale."""

    at_us: float
    label: str


def ticks(from_us: float, to_us: float, *, most: int) -> tuple[Tick, ...]:
    """Round marks inside a window, 1, 2 or 5 times a power of ten apart.

    Parameters
    ----------
    from_us, to_us
        The window [us].
    most
        Most marks, 1 or more.

    Examples
    --------
    >>> [tick.label for tick in ticks(0.4, 51.0, most=6)]
    ['10', '20', '30', '40', '50']
    >>> [tick.label for tick in ticks(0.0, 0.3, most=4)]
    ['0.0', '0.1', '0.2', '0.3']
    """
    # A step that is longer than this meets the window no more often than `most`, wherever the window begins.
    smallest_us = (to_us - from_us) / most * (1 + 1e-6)
    magnitude = floor(log10(smallest_us))
    factor, power = next(
        (one, magnitude + add) for add in (0, 1) for one in (1, 2, 5) if one * 10.0 ** (magnitude + add) > smallest_us
    )
    step_us = factor * 10.0**power
    first, last = ceil(from_us / step_us - 1e-9), floor(to_us / step_us + 1e-9)
    decimals = max(0, -power)
    return tuple(Tick(number * step_us, f"{number * step_us:.{decimals}f}") for number in range(first, last + 1))
