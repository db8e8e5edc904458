"""Arrival of set-points: jitter of the synchronous packet, skew between nodes, lost packets.

The synchronous packet (SP) is a broadcast, so its jitter is common to all axes. Each node receives its set-points in
packets of its own, so losses are drawn for each node separately. Each random quantity has its own stream: removing the
losses does not change the jitter.

Arrays have an entry for each set-point, shape (cycles + 1,): the first and the last are the axis at rest.
"""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from busplan.servo.parameters import Delivery, OnLoss, refuse
from busplan.servo.runnable import unfit_delivery

AxisName = Literal["x", "y"]
"""Axis of a node; the skew is added on "y"."""
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_JITTER_STREAM = 0
_LOSS_STREAM = {"x": 1, "y": 2}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arrivals:
    """Arrivals of the packets of each cycle at a node, and whether they arrive."""

    offsets_us: Floats
    """Delay of the SP of each cycle [us]."""
    lost: Flags
    """True if the packet with the set-point (for a loop on the host: the command) is lost."""
    on_loss: OnLoss = "hold"

    @classmethod
    def punctual(cls, cycles: int) -> Self:
        """Arrivals without delay and loss.

        Examples
        --------
        >>> Arrivals.punctual(2).offsets_us.tolist()
        [0.0, 0.0, 0.0]
        """
        return cls(offsets_us=np.zeros(cycles + 1), lost=np.zeros(cycles + 1, dtype=np.bool_))


def arrivals(delivery: Delivery, *, name: AxisName, cycles: int, period_us: float) -> Arrivals:
    """Draw the arrivals at a node for a whole move; the same seed gives the same arrivals.

    Jitter and skew that together exceed half the period are refused: they could change the order of the SPs.

    Examples
    --------
    >>> arrivals(Delivery(skew_us=3.0), name="y", cycles=3, period_us=1000.0).offsets_us.tolist()
    [0.0, 3.0, 3.0, 0.0]
    """
    return Arrivals(
        offsets_us=arrival_offsets_us(delivery, name=name, cycles=cycles, period_us=period_us),
        lost=lost_cycles(delivery, name=name, cycles=cycles),
        on_loss=delivery.on_loss,
    )


def arrival_offsets_us(delivery: Delivery, *, name: AxisName, cycles: int, period_us: float) -> Floats:
    """Delay of each SP at a node: uniform within plus or minus the jitter, about the skew; 0 at rest [us].

    Only its spread matters. A real delay is skewed, but that changes its mean, and a mean delay common to all axes does
    not change the contour.
    """
    refuse(*unfit_delivery(delivery, period_us=period_us))
    offsets = np.zeros(cycles + 1)
    # Without jitter nothing is drawn: numpy.random takes longer to load than all delays to compute.
    if delivery.jitter_us:
        random = np.random.default_rng([delivery.seed, _JITTER_STREAM])
        offsets += delivery.jitter_us * random.uniform(-1.0, 1.0, cycles + 1)
    offsets += delivery.skew_us if name == "y" else 0.0
    offsets[[0, -1]] = 0.0
    return offsets


def lost_cycles(delivery: Delivery, *, name: AxisName, cycles: int) -> Flags:
    """Draw the cycles in which the packet to a node is lost; never the first, at rest.

    Examples
    --------
    >>> lost_cycles(Delivery(loss_probability=1.0), name="x", cycles=2).tolist()
    [False, True, True]
    """
    if not delivery.loss_probability:
        return np.zeros(cycles + 1, dtype=np.bool_)
    random = np.random.default_rng([delivery.seed, _LOSS_STREAM[name]])
    lost = random.random(cycles + 1) < delivery.loss_probability
    lost[0] = False
    return lost


def received_mm(setpoints_mm: Floats, *, lost: Flags, on_loss: OnLoss) -> Floats:
    """Set-points that the node uses: where one is lost, the last one, or the line through the last two.

    Examples
    --------
    >>> lost = np.array([False, False, True, True])
    >>> received_mm(np.array([0.0, 1.0, 5.0, 7.0]), lost=lost, on_loss="extrapolate").tolist()
    [0.0, 1.0, 2.0, 3.0]
    >>> received_mm(np.array([0.0, 1.0, 5.0, 7.0]), lost=lost, on_loss="hold").tolist()
    [0.0, 1.0, 1.0, 1.0]
    """
    received = setpoints_mm.copy()
    # In order: a loss may follow another.
    for cycle in np.flatnonzero(lost).tolist():
        last = received[cycle - 1]
        before = received[max(cycle - 2, 0)] if on_loss == "extrapolate" else last
        received[cycle] = last + (last - before)
    return received
