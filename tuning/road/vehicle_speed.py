"""The vehicle's speed as it comes: slow and late, beside an acceleration that is neither.

    v(t_k) = v0 + b (t_k - d) + int_0^{t_k - d} a dt        d: delay, b: bias of the acceleration and slope

For a given d this is linear in (v0, b). The delay is where the sum of squares is least; what a stop tells of it is
how the deceleration comes and goes.
"""

from typing import NamedTuple

import numpy as np

from tuning.logs.brake_log import BrakeLog

DELAYS = np.arange(-0.05, 0.4, 2.5e-3)
"""Grid of d [s]."""
SLOW = 0.025
"""Time between measurements [s] from which the speed is not fast enough to be a state of its own."""
SIGNIFICANT = 3.0
"""Standard deviations by which a delay has to differ from 0 to be taken for one at first."""


class Motion(NamedTuple):
    """The vehicle's speed by its acceleration."""

    delay: float
    """s"""
    delay_spread: float
    """standard deviation, s"""
    speed: np.ndarray
    """v at the grid's times, m/s, (samples,)"""
    noise: float
    """of a measurement of the speed, m/s"""


def motion_of(log: BrakeLog) -> Motion | None:
    """Delay and course of the speed by the integral of the acceleration; None without one.

    Args:
        log: with vehicle speed and acceleration.
    """
    if log.acceleration is None:
        return None
    at = np.flatnonzero(measured(log, "vehicle_speed"))
    time, told = log.time[at] - log.time[0], log.vehicle_speed[at]
    clock = log.time - log.time[0]
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (log.acceleration[1:] + log.acceleration[:-1]) * log.period)])

    def fitted(delay):
        then = time - delay
        inside = then >= 0
        columns = np.stack([np.ones(inside.sum()), then[inside]], axis=1)
        rest = told[inside] - np.interp(then[inside], clock, travelled)
        solution = np.linalg.lstsq(columns, rest, rcond=None)[0]
        miss = rest - columns @ solution
        return float(np.mean(miss**2)), solution, int(inside.sum())

    costs = np.array([fitted(delay)[0] for delay in DELAYS])
    best = int(np.argmin(costs))
    delay, spread = float(DELAYS[best]), np.inf
    if 0 < best < len(DELAYS) - 1:
        bend = costs[best - 1] - 2 * costs[best] + costs[best + 1]
        step = DELAYS[1] - DELAYS[0]
        delay += 0.5 * step * (costs[best - 1] - costs[best + 1]) / bend
        spread = float(np.sqrt(2 * costs[best] / (len(at) * bend / step**2)))
    cost, (start, bias), _ = fitted(delay)
    return Motion(delay, spread, start + bias * clock + travelled, float(np.sqrt(cost)))


def measured(log: BrakeLog, signal: str) -> np.ndarray:
    """Which samples of a signal are measurements, bool (samples,); all of them where nothing else is said."""
    return np.asarray(log.measured.get(signal, np.ones(len(log.time), bool)))


def interval_of(log: BrakeLog, signal: str) -> float:
    """Usual time between measurements of a signal [s]."""
    at = np.flatnonzero(measured(log, signal))
    return log.period * float(np.median(np.diff(at))) if len(at) > 1 else np.inf


def longest_gap(log: BrakeLog, signal: str) -> float:
    """Longest time between measurements of a signal [s]."""
    at = np.flatnonzero(measured(log, signal))
    return log.period * float(np.max(np.diff(at))) if len(at) > 1 else np.inf
