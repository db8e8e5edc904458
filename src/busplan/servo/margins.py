"""How far the position loop is from instability, as the discrete loop it is, its delay included.

All polynomials are in w = z - 1 (the delta operator): position loops have their poles close to z = 1, where
polynomials in z lose half of their digits. On the unit circle the gain and the phase of a ratio of such polynomials
are polynomials in y = |w|^2 = 4 sin^2(theta / 2), so all crossovers are roots and none is missed between the points
of a grid.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from busplan.servo.parameters import Axis, LoopTiming

Floats = NDArray[np.float64]

_US_PER_S = 1e6
_NYQUIST = 4.0
_SETTLED = 1e-3
"""Share of a disturbance that is left when the loop counts as settled."""
_REAL = 1e-6
"""Relative imaginary part up to which a root counts as real: two crossovers about to merge are one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """Stability of one position loop.

    Parameters
    ----------
    stable
        Whether all poles of the closed loop lie inside the unit circle. All else is None when they do not.
    phase_margin_deg
        Smallest turn of the loop's phase that makes it unstable [deg]; None when its gain is never 1.
    gain_margin_db
        Smallest change of the loop's gain, up or down, that makes it unstable [dB]; None when no change does.
    crossover_hz
        Frequency at which the gain is 1 and the phase margin is counted [Hz]; None when there is none.
    settling_us
        Time in which the slowest part of a disturbance falls to a thousandth [us].
    """

    stable: bool
    phase_margin_deg: float | None = None
    gain_margin_db: float | None = None
    crossover_hz: float | None = None
    settling_us: float | None = None


def loop_margins(axis: Axis, *, timing: LoopTiming) -> LoopMargins:
    """Give the stability margins of the discrete position loop.

    Parameters
    ----------
    axis
        Gains and drive lag; feed-forward, resolution and friction are not part of the linear loop.
    timing
        Where the loop is closed and how often; `delay_us` counts for the loop on the host.

    Returns
    -------
    LoopMargins
        Stability, phase margin, gain margin and crossover.

    Notes
    -----
    Loop gain L(z) = C(z) G(z), sampled each control period h, with the controller

        C = kp + ki h z / (z - 1) + kd (z - 1) / (h z)

    and the zero-order-hold equivalent of exp(-s Td) / (s (tau s + 1)) for any 0 <= Td <= h (modified z-transform):

        G = ((h - Td) z + Td) / (z (z - 1)) - tau (b0 z + b1) / (z (z - p)),
        p = exp(-h / tau), b0 = 1 - exp(-(h - Td) / tau), b1 = exp(-(h - Td) / tau) - p.

    Of several crossovers the one nearest to instability counts.

    References
    ----------
    G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems: systems with delay.
    K. J. Astrom, B. Wittenmark, Computer-Controlled Systems: sampling of systems with time delay.
    R. H. Middleton, G. C. Goodwin, Digital Control and Estimation: the delta operator.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> margins = loop_margins(axis, timing=LoopTiming(period_us=1000.0, loop="host", delay_us=1000.0))
    >>> round(margins.phase_margin_deg, 2), round(margins.gain_margin_db, 2), round(margins.crossover_hz, 2)
    (81.4, 20.0, 15.92)
    >>> loop_margins(axis, timing=LoopTiming(period_us=20000.0, loop="host", delay_us=10000.0)).stable
    False
    """
    numerator, denominator = _loop(axis, timing)
    poles = np.roots(np.polyadd(numerator, denominator))
    # |z|^2 - 1 without the digits that the 1 in z would cost.
    outside = 2 * poles.real + np.abs(poles) ** 2
    if not np.all(outside < 0):
        return LoopMargins(stable=False)
    turn, gain_one = _phase_margin(numerator, denominator)
    period_s = timing.control_period_us / _US_PER_S
    slowest = float(outside.max())
    settling = 2 * math.log(_SETTLED) / math.log1p(slowest) if slowest > -1 else 1.0
    return LoopMargins(
        stable=True,
        phase_margin_deg=turn,
        gain_margin_db=_gain_margin(numerator, denominator),
        crossover_hz=None if gain_one is None else gain_one / (2 * math.pi * period_s),
        settling_us=settling * timing.control_period_us,
    )


def loop_gain(frequency_hz: Floats, *, axis: Axis, timing: LoopTiming) -> NDArray[np.complex128]:
    """Give the frequency response of the open position loop.

    Parameters
    ----------
    frequency_hz
        Frequencies above 0 and up to half the control rate, shape (n,) [Hz].
    axis, timing
        As for `loop_margins`.

    Returns
    -------
    ndarray
        L(exp(j 2 pi f h)), shape (n,) [1].

    Notes
    -----
    The closed loop follows its target with L / (1 + L).

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> response = loop_gain(np.array([5000.0]), axis=axis, timing=LoopTiming(period_us=1000.0))
    >>> complex(response[0].round(9))
    (-0.005+0j)
    """
    angle = 2 * math.pi * frequency_hz * (timing.control_period_us / _US_PER_S)
    return _at(angle, *_loop(axis, timing))


def _loop(axis: Axis, timing: LoopTiming) -> tuple[Floats, Floats]:
    """Numerator and denominator of the open loop in w = z - 1, highest power first."""
    period = timing.control_period_us / _US_PER_S
    delay = timing.delay_us / _US_PER_S if timing.loop == "host" else 0.0
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
    return np.polymul(control, np.polysub(motion, lagging)), np.polymul(control_poles, plant_poles)


def _decayed(time_s: float, lag_s: float) -> float:
    return -math.expm1(-time_s / lag_s) if lag_s else 1.0


def _at(angle: Floats, numerator: Floats, denominator: Floats) -> NDArray[np.complex128]:
    w = np.expm1(1j * angle)
    return np.asarray(np.polyval(numerator, w) / np.polyval(denominator, w))


def _phase_margin(numerator: Floats, denominator: Floats) -> tuple[float | None, float | None]:
    """Phase margin [deg] and the angle on the unit circle where it is counted [rad]."""
    angles = _angles(np.polyadd(_squared(numerator), -_squared(denominator)))
    if not angles.size:
        return None, None
    margins = np.abs(np.degrees(np.angle(-_at(angles, numerator, denominator))))
    return float(margins.min()), float(angles[margins.argmin()])


def _gain_margin(numerator: Floats, denominator: Floats) -> float | None:
    # At half the control rate everything is real, whatever the polynomial says.
    angles = np.append(_angles(_imaginary(numerator, denominator)), math.pi)
    response = _at(angles, numerator, denominator).real
    opposed = -response[response < 0]
    return float(np.abs(20 * np.log10(opposed)).min()) if opposed.size else None


def _angles(polynomial: Floats) -> Floats:
    """Angles on the upper unit circle at the roots of a polynomial in y [rad]."""
    roots = np.roots(polynomial)
    real = roots.real[np.abs(roots.imag) <= _REAL * np.abs(roots)]
    return np.asarray(2 * np.arcsin(np.sqrt(real[(real > 0) & (real <= _NYQUIST)]) / 2))


def _squared(polynomial: Floats) -> Floats:
    """|P(w)|^2 on the unit circle as a polynomial in y = w conj(w) = -(w + conj(w))."""
    total = np.zeros(1)
    for i, a in enumerate(polynomial[::-1]):
        for j, b in enumerate(polynomial[::-1]):
            if j >= i:
                term = _lucas(j - i, (np.array([2.0]), np.array([-1.0, 0.0]))) / (2 if i == j else 1)
                total = np.polyadd(total, a * b * np.polymul(_power(i), term))
    return total


def _imaginary(numerator: Floats, denominator: Floats) -> Floats:
    """Im(N conj(D)) / Im(w) on the unit circle as a polynomial in y."""
    total = np.zeros(1)
    for i, a in enumerate(numerator[::-1]):
        for j, b in enumerate(denominator[::-1]):
            term = _lucas(abs(i - j), (np.array([0.0]), np.array([1.0])))
            total = np.polyadd(total, np.sign(i - j) * a * b * np.polymul(_power(min(i, j)), term))
    return total


def _lucas(n: int, start: tuple[Floats, Floats]) -> Floats:
    """w^n + conj(w)^n from (2, -y), (w^n - conj(w)^n) / (w - conj(w)) from (0, 1): one recursion in y for both."""
    this, following = start
    for _ in range(n):
        this, following = following, -np.polymul([1.0, 0.0], np.polyadd(this, following))
    return this


def _power(n: int) -> Floats:
    return np.array([1.0] + [0.0] * n)
