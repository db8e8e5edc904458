"""Stability margins of the discrete position loop with its delay.

All polynomials are in w = z - 1 (delta operator): position loops have poles close to z = 1, where polynomials in z lose
half of their digits.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from busplan.servo.parameters import Axis, LoopTiming

Floats = NDArray[np.float64]

_US_PER_S = 1e6
_SETTLED = 1e-3
"""Rest of a disturbance at which the loop counts as settled."""
_GRID = 4000
_BISECTIONS = 60
_DOUBLE_POLE_STEPS = 5
"""Each step of this fixed point is ten times closer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """Stability of a position loop."""

    stable: bool
    """Whether all poles of the closed loop lie inside the unit circle. If not, all other values are None."""
    phase_margin_deg: float | None = None
    """Smallest change of the loop's phase that makes it unstable [deg]; None if its gain is never 1."""
    gain_margin_db: float | None = None
    """Smallest change of the loop's gain, up or down, that makes it unstable [dB]; None if none does."""
    crossover_hz: float | None = None
    """Frequency of gain 1 at which the phase margin is measured [Hz]; None if there is none."""
    settling_us: float | None = None
    """Time in which the slowest part of a disturbance decays to a thousandth [us]."""

    def time_to_us(self, share: float) -> float:
        """Time until at most a share of a disturbance is left, also of a double pole; infinite if unstable [us].

        Notes
        -----
        A pole of time constant T leaves exp(-t / T), a double pole (1 + t / T) exp(-t / T).
        """
        if self.settling_us is None:
            return math.inf
        constants = least = max(-math.log(share), 0.0)
        for _ in range(_DOUBLE_POLE_STEPS):
            constants = least + math.log1p(constants)
        return self.settling_us * constants / -math.log(_SETTLED)


@lru_cache(maxsize=64)
def loop_margins(axis: Axis, *, timing: LoopTiming) -> LoopMargins:
    """Compute the stability margins of the discrete position loop, without feed-forward, resolution and friction.

    Notes
    -----
    Loop gain L(z) = C(z) G(z), sampled each control period h, with the controller

        C = kp + ki h z / (z - 1) + kd (z - 1) / (h z)

    and the zero-order-hold equivalent of exp(-s Td) / (s (tau s + 1)) for any 0 <= Td <= h (modified z-transform; each
    whole period of a longer delay is a further 1 / z):

        G = ((h - Td) z + Td) / (z (z - 1)) - tau (b0 z + b1) / (z (z - p)),
        p = exp(-h / tau), b0 = 1 - exp(-(h - Td) / tau), b1 = exp(-(h - Td) / tau) - p.

    With several crossovers, the nearest to instability counts.

    References
    ----------
    G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems: systems with delay.
    K. J. Astrom, B. Wittenmark, Computer-Controlled Systems: sampling of systems with time delay.
    R. H. Middleton, G. C. Goodwin, Digital Control and Estimation: the delta operator.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0, delay_us=1000.0)
    >>> margins = loop_margins(axis, timing=LoopTiming(period_us=1000.0, loop="host"))
    >>> round(margins.phase_margin_deg, 2), round(margins.gain_margin_db, 2), round(margins.crossover_hz, 2)
    (81.4, 20.0, 15.92)
    >>> loop_margins(axis, timing=LoopTiming(period_us=30000.0, loop="host")).stable
    False
    """
    numerator, denominator = _loop(axis, timing)
    poles = np.roots(np.polyadd(numerator, denominator))
    # |z|^2 - 1, computed from w to keep all digits.
    outside = 2 * poles.real + np.abs(poles) ** 2
    if not np.all(outside < 0):
        return LoopMargins(stable=False)
    angles = _grid(numerator, denominator, poles)
    turn, gain_one = _phase_margin(angles, numerator, denominator)
    period_s = timing.control_period_us / _US_PER_S
    slowest = float(outside.max())
    # No loop settles sooner than after a period, and one with poles at 0 does, rounding aside.
    settling = max(1.0, 2 * math.log(_SETTLED) / math.log1p(slowest)) if slowest > -1 else 1.0
    return LoopMargins(
        stable=True,
        phase_margin_deg=turn,
        gain_margin_db=_gain_margin(angles, numerator, denominator),
        crossover_hz=None if gain_one is None else gain_one / (2 * math.pi * period_s),
        settling_us=settling * timing.control_period_us,
    )


def _loop(axis: Axis, timing: LoopTiming) -> tuple[Floats, Floats]:
    """Numerator and denominator of the open loop in w = z - 1, highest power first."""
    period = timing.control_period_us / _US_PER_S
    waiting, rest_us = timing.delay_parts(axis.delay_us) if timing.loop == "host" else (0, 0.0)
    delay = rest_us / _US_PER_S
    lag = axis.drive_lag_us / _US_PER_S
    z, integrator, derivative = np.array([1.0, 1.0]), np.array([1.0, 0.0]), np.array([1.0, 0.0])
    proportional = axis.position_gain_per_s * z
    control = np.polyadd(proportional, axis.derivative_gain / period * derivative)
    control_poles = z
    if axis.integral_gain_per_s2:
        summed = axis.integral_gain_per_s2 * period * np.polymul(z, z)
        control = np.polyadd(np.polymul(control, integrator), summed)
        control_poles = np.polymul(z, integrator)
    rest, decayed, moved = period - delay, _decayed(period, lag), _decayed(period - delay, lag)
    drive_pole = np.array([1.0, decayed])
    motion = np.polymul([rest, period], drive_pole)
    lagging = lag * np.polymul([moved, decayed], integrator)
    plant_poles = np.polymul(np.polymul(z, integrator), drive_pole)
    for _ in range(waiting):
        plant_poles = np.polymul(plant_poles, z)
    return np.polymul(control, np.polysub(motion, lagging)), np.polymul(control_poles, plant_poles)


def _decayed(time_s: float, lag_s: float) -> float:
    return -math.expm1(-time_s / lag_s) if lag_s else 1.0


def _at(angle: Floats, numerator: Floats, denominator: Floats) -> NDArray[np.complex128]:
    w = np.expm1(1j * angle)
    return np.asarray(np.polyval(numerator, w) / np.polyval(denominator, w))


def _grid(numerator: Floats, denominator: Floats, poles: NDArray[Any]) -> Floats:
    """Angles between which to search crossovers [rad].

    The loop gain is smooth between its corners, so a fine grid over all of them is enough, except at notches of lightly
    damped zeros, whose angles are added to the grid.
    """
    zeros = np.roots(numerator)
    corners = np.abs(np.concatenate([zeros, np.roots(denominator), poles]))
    lowest = min(0.01 * corners[corners > 0].min(), 0.1)
    notches = np.abs(np.angle(1 + zeros))
    # Not np.union1d: it loads numpy.ma, which takes as long as all margins.
    return np.sort(np.concatenate((np.geomspace(lowest, math.pi, _GRID), notches[notches > lowest])))


def _phase_margin(angles: Floats, numerator: Floats, denominator: Floats) -> tuple[float | None, float | None]:
    """Phase margin [deg] and its angle on the unit circle [rad]."""
    crossings = _crossings(angles, lambda angle: np.abs(_at(angle, numerator, denominator)) - 1)
    if not crossings.size:
        return None, None
    margins = np.abs(np.degrees(np.angle(-_at(crossings, numerator, denominator))))
    return float(margins.min()), float(crossings[margins.argmin()])


def _gain_margin(angles: Floats, numerator: Floats, denominator: Floats) -> float | None:
    crossings = _crossings(angles[:-1], lambda angle: _at(angle, numerator, denominator).imag)
    # At half the control rate the response is real without a change of sign.
    response = _at(np.append(crossings, math.pi), numerator, denominator).real
    opposed = -response[response < 0]
    return float(np.abs(20 * np.log10(opposed)).min()) if opposed.size else None


def _crossings(angles: Floats, measure: Callable[[Floats], Floats]) -> Floats:
    """Angles at which the measure changes its sign, by bisection [rad]."""
    positive = measure(angles) > 0
    before = np.flatnonzero(positive[:-1] != positive[1:])
    low, high = angles[before], angles[before + 1]
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        crossed = (measure(middle) > 0) != positive[before]
        low, high = np.where(crossed, low, middle), np.where(crossed, middle, high)
    return np.asarray((low + high) / 2)
