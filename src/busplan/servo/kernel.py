"""The fixed-step kernel: one function for plain Python and numba.

It runs over the rows of a move (see `busplan.servo.rows`). A row is a number of sub-steps of equal length; its action
says what happens in each: sample and control, let the command take effect, store the position.

For speed, `x + ROUND - ROUND` replaces `round(x)`: adding 1.5 * 2^52 leaves no bits for the fraction, so the float unit
rounds (half to even, exact below 2^51). The order of all operations is fixed, so both engines give the same floats.
"""

from collections.abc import Iterable, MutableSequence
from math import tanh

CONTROL = 1
SWITCH = 2
STORE = 4

ROUND = 6755399441055744.0
"""1.5 * 2^52."""
ALL_BUT_ONE = 20.0
"""For larger arguments, tanh is exactly 1."""

INTEGRAL = 5
LAST_ERROR = 6

Constants = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""kp [1/s], ki [1/s^2], kd / control period [1/s], control period [s], counts [1/mm], count [mm], lowest and
highest command [mm/s], levels [s/mm], level [mm/s], drive offset [mm/s], friction [mm/s], 1 / smoothing [s/mm].
An element whose ki, kd, counts, levels or friction is 0 is left out."""


def run_rows(  # noqa: C901, PLR0912, PLR0915 - calls would cost more than the arithmetic
    state: MutableSequence[float],
    constants: Constants,
    out: MutableSequence[float],
    substeps: Iterable[int],
    target: Iterable[float],
    increment: Iterable[float],
    forward: Iterable[float],
    action: Iterable[int],
    length: Iterable[float],
    drive_keep: Iterable[float],
    drive_shift: Iterable[float],
    friction_keep: Iterable[float],
    friction_shift: Iterable[float],
) -> int:
    """Run one axis over a chunk of rows.

    Parameters
    ----------
    state
        Position [mm], drive velocity [mm/s], friction disturbance [mm/s], friction sign [1], command in effect [mm/s],
        integral of the error [mm s], last error [mm]; updated in place.
    constants
        See `Constants`.
    out
        Receives the position at the end of every stored sub-step [mm].
    substeps, target, increment, forward, action, length, drive_keep, drive_shift, friction_keep, friction_shift
        Columns of `busplan.servo.rows.KernelRows`.

    Returns
    -------
    int
        Number of positions stored.
    """
    kp, ki, kd, period, counts, resolution, lowest, highest, levels, level, offset, friction, sharpness = constants
    position, velocity, disturbance, sign, command, _, _ = state
    # Every chunk begins with a control, so no command is pending between chunks.
    pending = command
    stored = 0
    for n, start, move, feed, act, dt, keep, shift, fade, fade_shift in zip(  # noqa: B905 - numba knows no strict
        substeps,
        target,
        increment,
        forward,
        action,
        length,
        drive_keep,
        drive_shift,
        friction_keep,
        friction_shift,
    ):
        control = act & CONTROL
        switch = act & SWITCH
        store = act & STORE
        aim = start
        for _ in range(n):
            if control:
                error = aim - position
                if counts > 0.0:
                    error = aim - (position * counts + ROUND - ROUND) * resolution
                pending = kp * error + feed
                # Rarely used values stay in `state`, so that compiled code does not compute them for all loops.
                if ki > 0.0:
                    state[INTEGRAL] += error * period
                    pending += ki * state[INTEGRAL]
                if kd > 0.0:
                    pending += kd * (error - state[LAST_ERROR])
                    state[LAST_ERROR] = error
                # Anti-windup: a clipped command does not integrate further into the limit.
                if pending > highest:
                    pending = highest
                    if ki > 0.0 and error > 0.0:
                        state[INTEGRAL] -= error * period
                elif pending < lowest:
                    pending = lowest
                    if ki > 0.0 and error < 0.0:
                        state[INTEGRAL] -= error * period
                if levels > 0.0:
                    pending = (pending * levels + ROUND - ROUND) * level
                aim += move
            if switch:
                command = pending
            if friction > 0.0:
                turned = velocity * sharpness
                if turned > ALL_BUT_ONE:
                    turned = 1.0
                elif turned < -ALL_BUT_ONE:
                    turned = -1.0
                else:
                    turned = tanh(turned)
                disturbance += friction * (sign - turned)
                sign = turned
            wanted = command + offset
            lag = velocity - wanted
            position += wanted * dt + lag * shift + disturbance * fade_shift
            velocity = wanted + lag * keep
            disturbance *= fade
            if store:
                out[stored] = position
                stored += 1
    state[0] = position
    state[1] = velocity
    state[2] = disturbance
    state[3] = sign
    state[4] = command
    return stored
