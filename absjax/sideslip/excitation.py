"""What a run offers the adaptation: persistency of excitation, the driving pattern, and whether theta can be told.

With eta_v = theta (f_y*(vy) - f_y*(vy - d)) / (m d), its limit for d = 0 being theta df_y*/dvy / m, and
eta_theta = f_y*(vy - d) / m, condition (9) asks that for each deviation d the determinant of

    W(t) = int_(t-T)^t [eta_v, eta_theta]' [eta_v, eta_theta] ds

be bounded away from zero. Source: Grip et al. 2008, Theorem 1 and section 7. Ours: the smallest eigenvalue is taken of
W with eta_v on the scale k = 0.5 max(v, 3) / C of the monitor, so that both signals are accelerations; and with an
error of the lateral acceleration of standard deviation `error` that stays for `correlation`, theta is told to within

    deviation = error sqrt(correlation W_vv / det W)
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.sideslip.base import Estimate
from absjax.sideslip.car import Car, CarSample
from absjax.sideslip.observer import SideSlipObserver

STRAIGHT, CIRCLE, VARIED = 0, 1, 2
PATTERNS = ("straight-path driving", "sustained circle", "varied lateral velocity")
"""Driving patterns of section 7, in the order of their codes."""
STRAIGHT_BELOW = 0.3
"""Root mean square of r v in a window below which the path is straight [m/s^2]."""
STEADY_BELOW = 0.3
"""Share of it below which its standard deviation is that of a circle."""
UNKNOWN = 1e3
"""Deviation where nothing tells theta."""


class Excitation(NamedTuple):
    """Along a run, arrays (samples,); windows end at the sample, and are shorter at the begin."""

    determinant: np.ndarray
    """left-hand side of (9), m^2/s^4; the least over the deviations of vy"""
    eigenvalue: np.ndarray
    """smallest of W, eta_v scaled, m^2/s^3; the least over the deviations"""
    deviation: np.ndarray
    """within which theta is told; the largest over the deviations"""
    pattern: np.ndarray
    """code of `PATTERNS`"""
    identifiable: np.ndarray
    """bool: deviation at most `within`"""


def regressors(observer: SideSlipObserver, car: Car, samples: CarSample, estimate: Estimate, deviation: float = 0.0):
    """(eta_v [1/s], eta_theta [m/s^2]) along a run, (samples,).

    Args:
        estimate: of the run; what it says is taken for the truth.
        deviation: d, of the estimated lateral velocity [m/s].
    """

    def one(sample, estimate):
        vx, vy, r, theta = estimate
        level = observer.accelerometer.level(sample)
        there = observer.forces(car, (vx, vy - deviation, r), level)
        if deviation == 0:
            slope = there.lateral_slope
        else:
            slope = (observer.forces(car, (vx, vy, r), level).lateral - there.lateral) / deviation
        return theta * slope / car.mass, there.lateral / car.mass

    return jax.vmap(one)(samples, estimate)


def excitation(
    observer: SideSlipObserver,
    car: Car,
    samples: CarSample,
    estimate: Estimate,
    period: float,
    *,
    window: float = 2.0,
    deviations: tuple[float, ...] = (0.0, -0.1, 0.1),
    error: float = 0.3,
    correlation: float = 0.1,
    within: float = 0.1,
) -> Excitation:
    """Excitation along a run.

    Args:
        estimate: of the run, arrays (samples,).
        period: of sampling [s].
        window: T [s].
        deviations: of the lateral velocity for which (9) is asked [m/s].
        error: of the lateral acceleration, of sensor and model [m/s^2].
        correlation: time for which it stays [s].
        within: deviation of theta up to which it counts as identifiable.

    Raises:
        ValueError: if the window is not longer than a sample.
    """
    length = round(window / period)
    if length < 2:
        raise ValueError(f"window = {window:g} s must be two samples of {period:g} s at least")
    samples = jax.tree.map(jnp.asarray, samples)
    stiffness = observer.friction_model.stiffness(jnp.zeros(()))
    scale = np.asarray(0.5 * jnp.maximum(estimate.longitudinal_speed, 3.0) / stiffness)
    determinant, eigenvalue, deviation = [], [], []
    for d in deviations:
        slope, force = (np.asarray(x, float) for x in regressors(observer, car, samples, estimate, d))
        vv, vt, tt = (_windowed(x, length) * period for x in (slope**2, slope * force, force**2))
        sv, st = (_windowed(x, length) * period for x in ((scale * slope) ** 2, scale * slope * force))
        left = np.maximum(vv * tt - vt**2, 0.0)
        determinant.append(left)
        eigenvalue.append(np.maximum((sv + tt - np.sqrt((sv - tt) ** 2 + 4 * st**2)) / 2, 0.0))
        told = np.divide(left, vv, out=np.zeros_like(left), where=vv > 0)
        deviation.append(np.minimum(error * np.sqrt(correlation / np.maximum(told, 1e-12)), UNKNOWN))
    worst = np.max(deviation, axis=0)
    lateral = np.asarray(samples.yaw_rate) * np.asarray(estimate.longitudinal_speed)
    pattern = patterns(lateral, length)
    return Excitation(np.min(determinant, axis=0), np.min(eigenvalue, axis=0), worst, pattern, worst <= within)


def patterns(lateral: np.ndarray, length: int) -> np.ndarray:
    """Driving patterns from r v [m/s^2] in windows of so many samples; codes (samples,)."""
    counts = np.minimum(np.arange(len(lateral)) + 1, length)
    mean, power = _windowed(lateral, length) / counts, _windowed(lateral**2, length) / counts
    varies = np.sqrt(np.maximum(power - mean**2, 0.0)) >= STEADY_BELOW * np.sqrt(power)
    return np.where(power < STRAIGHT_BELOW**2, STRAIGHT, np.where(varies, VARIED, CIRCLE))


def _windowed(values: np.ndarray, length: int) -> np.ndarray:
    """Sums over the last so many values."""
    total = np.concatenate([np.zeros(1), np.cumsum(values)])
    first = np.maximum(np.arange(len(values)) + 1 - length, 0)
    return total[1:] - total[first]


def intervals(codes: np.ndarray, time: np.ndarray, shortest: float = 0.5) -> list[tuple[float, float, int]]:
    """Stretches (from, to, code) in which a code stays; those shorter than `shortest` [s] join the one before."""
    changes = np.flatnonzero(np.diff(codes)) + 1
    firsts = np.concatenate([[0], changes])
    ends = np.concatenate([time[changes], time[-1:]])
    found: list[tuple[float, float, int]] = []
    for first, end in zip(firsts, ends):
        start, code = float(time[first]), int(codes[first])
        if found and (end - start < shortest or found[-1][2] == code):
            found[-1] = (found[-1][0], float(end), found[-1][2])
        else:
            found.append((start, float(end), code))
    return found
