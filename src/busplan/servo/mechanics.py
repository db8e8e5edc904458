"""Errors between encoders and table: play, scale errors, squareness.

All functions work in place, because the positions are large.
"""

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from busplan.servo.engine import Engine, compiled_kernel
from busplan.servo.kernel import drag
from busplan.servo.parameters import Mechanics

if TYPE_CHECKING:
    from collections.abc import MutableSequence

Floats = NDArray[np.float64]

_PER_MILLION = 1e-6


def move_to_table(x_mm: Floats, *, y_mm: Floats, mechanics: Mechanics, engine: Engine = "auto") -> None:
    """Convert positions of the motors to positions of the table, in place.

    Parameters
    ----------
    x_mm, y_mm
        Positions in order of time, shape (n,) each [mm]: of the motors before, of the table after the call.
    mechanics
        Play, scales, squareness.
    engine
        As for `busplan.servo.axis.simulate_axis`.

    References
    ----------
    ISO 230-4, on what circular tests show: reversal, scale mismatch and squareness errors.

    Examples
    --------
    >>> x, y = np.array([1000.0, 0.0]), np.array([0.0, 1000.0])
    >>> move_to_table(x, y_mm=y, mechanics=Mechanics(scale_x_ppm=5.0, squareness_um_per_m=3.0))
    >>> x.tolist(), y.tolist()
    ([1000.005, 0.003], [0.0, 1000.0])
    """
    if mechanics.backlash_mm:
        add_backlash(x_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
        add_backlash(y_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
    x_mm *= 1 + mechanics.scale_x_ppm * _PER_MILLION
    y_mm *= 1 + mechanics.scale_y_ppm * _PER_MILLION
    if mechanics.squareness_um_per_m:
        x_mm += y_mm * (mechanics.squareness_um_per_m * _PER_MILLION)


def add_backlash(position_mm: Floats, *, backlash_mm: float, engine: Engine = "auto") -> None:
    """Convert positions of a motor to those of a table behind a backlash, in place.

    Parameters
    ----------
    position_mm
        Positions in order of time, shape (n,) [mm].
    backlash_mm
        Width of the gap [mm]; the motor starts in its middle.
    engine
        As for `busplan.servo.axis.simulate_axis`.

    Notes
    -----
    The table does not move until the motor reaches one side of the gap. This is the play operator,
    ``table = min(max(table, motor - b / 2), motor + b / 2)``.

    References
    ----------
    M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, Springer 1989.

    Examples
    --------
    >>> position = np.array([0.0, 3.0, 2.0, 0.0])
    >>> add_backlash(position, backlash_mm=2.0)
    >>> position.tolist()
    [0.0, 2.0, 2.0, 1.0]
    """
    compiled = compiled_kernel(engine)
    if compiled is not None:
        compiled.drag(position_mm, backlash_mm / 2)
    else:
        drag(cast("MutableSequence[float]", position_mm.data), backlash_mm / 2)
