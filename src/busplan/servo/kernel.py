"""The fixed-step kernel: plain Python, compiled by Cython when the package is built (types: `_kernel.pxd`).

`run_rows` runs over the rows of a move (see `busplan.servo.rows`). A row is a number of sub-steps of equal length; its
action says what happens in each: sample and control, let the command take effect, store the position.

For speed, `x + ROUND - ROUND` replaces `round(x)`: adding 1.5 * 2^52 leaves no bits for the fraction, so the float unit
rounds (half to even, exact below 2^51). The order of all operations is fixed, and compiled code may not fuse them, so
both engines give the same floats.
"""

# Called as math.tanh, so that compiled code calls that of C.
import math
from collections.abc import MutableSequence, Sequence

CONTROL = 1
SWITCH = 2
STORE = 4

ROUND = 6755399441055744.0
"""1.5 * 2^52."""

POSITION = 0
VELOCITY = 1
DISTURBANCE = 2
SIGN = 3
COMMAND = 4
INTEGRAL = 5
LAST_ERROR = 6
QUEUE = 7
"""Place of the oldest command that waits for its turn; further ones stand behind it."""

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
    substeps: Sequence[int],
    target: Sequence[float],
    increment: Sequence[float],
    forward: Sequence[float],
    action: Sequence[int],
    length: Sequence[float],
    drive_keep: Sequence[float],
    drive_shift: Sequence[float],
    friction_keep: Sequence[float],
    friction_shift: Sequence[float],
) -> int:
    """Run an axis over a chunk of rows.

    Parameters
    ----------
    state
        Position [mm], drive velocity [mm/s], friction disturbance [mm/s], friction sign [1], command in effect [mm/s],
        integral of the error [mm s], last error [mm], and the commands that wait for their turn, the oldest first
        [mm/s]; updated in place. A control puts its command behind them and takes the oldest out.
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
    position, velocity, disturbance = state[POSITION], state[VELOCITY], state[DISTURBANCE]
    sign, command = state[SIGN], state[COMMAND]
    # Every chunk begins with a control, so no command is pending between chunks.
    pending = command
    remembers = ki > 0.0 or kd > 0.0
    last = len(state) - 1
    stored = 0
    for row in range(len(substeps)):
        act = action[row]
        control = act & CONTROL
        switch = act & SWITCH
        store = act & STORE
        aim = target[row]
        move = increment[row]
        feed = forward[row]
        dt = length[row]
        keep = drive_keep[row]
        shift = drive_shift[row]
        fade = friction_keep[row]
        fade_shift = friction_shift[row]
        for _ in range(substeps[row]):
            if control:
                error = aim - (position * counts + ROUND - ROUND) * resolution if counts > 0.0 else aim - position
                pending = kp * error + feed
                if remembers:
                    # Rarely used values stay in `state`, so that compiled code does not keep them for all loops.
                    state[INTEGRAL] += error * period
                    pending += ki * state[INTEGRAL]
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
                if last >= QUEUE:
                    newest = pending
                    pending = state[QUEUE]
                    for place in range(QUEUE, last):
                        state[place] = state[place + 1]
                    state[last] = newest
                aim += move
            if switch:
                command = pending
            if friction > 0.0:
                turned = math.tanh(velocity * sharpness)
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
    state[POSITION] = position
    state[VELOCITY] = velocity
    state[DISTURBANCE] = disturbance
    state[SIGN] = sign
    state[COMMAND] = command
    return stored


def drag(position: MutableSequence[float], half: float) -> None:
    """Turn positions of a motor into those of the table, in place: the play operator, with half the gap [mm]."""
    table = position[0]
    for i in range(len(position)):
        motor = position[i]
        if motor - half > table:
            table = motor - half
        elif motor + half < table:
            table = motor + half
        position[i] = table
