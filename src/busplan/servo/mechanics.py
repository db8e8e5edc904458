"""What lies between the encoders and the table: play, wrong scales, axes that are not square."""

from collections.abc import MutableSequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from busplan.servo.engine import Engine, compiled, is_compiled
from busplan.servo.parameters import Mechanics

Floats = NDArray[np.float64]

_PER_MILLION = 1e-6
_SIGNATURE = "void(float64[::1], float64, float64[::1])"


def table_position(
    x_mm: Floats, *, y_mm: Floats, mechanics: Mechanics, engine: Engine = "auto"
) -> tuple[Floats, Floats]:
    """Give the position of the table when the motors are at x, y.

    Parameters
    ----------
    x_mm, y_mm
        Positions of the motors in order of time, shape (n,) each [mm].
    mechanics
        Play, scales, squareness.
    engine
        As for `busplan.servo.axis.simulate_axis`.

    Returns
    -------
    tuple of ndarray
        x and y of the table, the very same arrays where nothing changes them [mm].

    References
    ----------
    ISO 230-4, on what circular tests show: reversal, scale mismatch and squareness errors.

    Examples
    --------
    >>> x, y = np.array([1000.0, 0.0]), np.array([0.0, 1000.0])
    >>> errors = Mechanics(scale_x_ppm=5.0, squareness_um_per_m=3.0)
    >>> table_x, table_y = table_position(x, y_mm=y, mechanics=errors)
    >>> table_x.tolist(), table_y.tolist()
    ([1000.005, 0.003], [0.0, 1000.0])
    """
    if mechanics.backlash_mm:
        x_mm = with_backlash(x_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
        y_mm = with_backlash(y_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
    if mechanics.scale_x_ppm:
        x_mm = x_mm * (1 + mechanics.scale_x_ppm * _PER_MILLION)
    if mechanics.scale_y_ppm:
        y_mm = y_mm * (1 + mechanics.scale_y_ppm * _PER_MILLION)
    if mechanics.squareness_um_per_m:
        x_mm = x_mm + y_mm * (mechanics.squareness_um_per_m * _PER_MILLION)
    return x_mm, y_mm


def with_backlash(motor_mm: Floats, *, backlash_mm: float, engine: Engine = "auto") -> Floats:
    """Give the position of a table that its motor drags through a gap.

    Parameters
    ----------
    motor_mm
        Position of the motor in order of time, shape (n,) [mm].
    backlash_mm
        Width of the gap [mm]; at the start the motor stands in its middle.
    engine
        As for `busplan.servo.axis.simulate_axis`.

    Returns
    -------
    ndarray
        Position of the table, shape (n,) [mm].

    Notes
    -----
    The table stays where it is until the motor reaches one side of the gap: the play operator,
    ``table = min(max(table, motor - b / 2), motor + b / 2)``.

    References
    ----------
    M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, Springer 1989.

    Examples
    --------
    >>> with_backlash(np.array([0.0, 3.0, 2.0, 0.0]), backlash_mm=2.0).tolist()
    [0.0, 2.0, 2.0, 1.0]
    """
    table_mm = np.empty_like(motor_mm)
    run = compiled(drag, _SIGNATURE) if is_compiled(engine) else None
    if run is not None:
        run(np.ascontiguousarray(motor_mm), backlash_mm / 2, table_mm)
    else:
        drag(motor_mm.tolist(), backlash_mm / 2, cast("MutableSequence[float]", table_mm.data))
    return table_mm


def drag(motor: MutableSequence[float], half: float, out: MutableSequence[float]) -> None:
    """Run the play operator; plain Python and numba alike.

    Parameters
    ----------
    motor
        Position of the motor in order of time [mm].
    half
        Half the gap [mm].
    out
        Takes the position of the table [mm].
    """
    table = motor[0]
    for i in range(len(motor)):
        if motor[i] - half > table:
            table = motor[i] - half
        elif motor[i] + half < table:
            table = motor[i] + half
        out[i] = table
