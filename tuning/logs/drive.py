"""Where in the log of a whole drive somebody brakes.

Between two brakings the vehicle gets faster or stands still. A log in which it never gets faster is one braking, as it
is.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

REGAINED = 1.0
"""Speed [m/s] by which the vehicle is faster again between two brakings."""
BRAKING, LET_GO = 0.7, 0.3
"""Deceleration from which somebody brakes, and below which nobody does any more [m/s^2]."""
CALM = 0.3
"""Window over which a deceleration counts [s]."""
LEAD, STEADY = 0.5, 0.4
"""Time before a braking that is taken with it [s], while the acceleration is no more than that [m/s^2]: a wheel that
rolls tells radius and zeros."""


class Window(NamedTuple):
    """A stretch of a log."""

    start: float
    """s"""
    end: float
    """s"""


def brakings(
    time: np.ndarray, speed: np.ndarray, acceleration: np.ndarray | None, *, slowest: float, shortest: float
) -> list[Window]:
    """The brakings of a drive, in their order; empty where it is no drive.

    Args:
        time: uniform [s].
        speed: of the vehicle [m/s].
        acceleration: measured [m/s^2], or None.
        slowest: speed below which the vehicle counts as standing still [m/s].
        shortest: time that a braking has at least [s].
    """
    period = float(np.median(np.diff(time)))
    width = max(3, round(CALM / period))
    speed = uniform_filter1d(speed, width, mode="nearest")
    moving = speed >= slowest
    if np.max(speed - np.minimum.accumulate(speed)) <= REGAINED:
        return []
    # A measured speed may be slow and late, an acceleration is neither.
    rate = np.gradient(speed, period) if acceleration is None else uniform_filter1d(acceleration, width, mode="nearest")
    held = (rate < -LET_GO) & moving
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
    found: list[tuple[int, int]] = []
    for first, last in zip(edges[::2], edges[1::2] - 1):
        if rate[first : last + 1].min() > -BRAKING:
            continue
        if found and _goes_on(speed[found[-1][1] : first + 1], slowest):
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    windows = [Window(float(time[_lead(rate, moving, a, period)]), float(time[b])) for a, b in found]
    return [window for window in windows if window.end - window.start >= shortest]


def _lead(rate: np.ndarray, moving: np.ndarray, first: int, period: float) -> int:
    """First sample of what is taken with a braking that begins at a sample."""
    # The mean over a window falls by so much before anybody brakes.
    before = np.arange(max(0, first - round((LEAD + 0.5 * CALM) / period)), first)
    unsteady = np.flatnonzero((np.abs(rate[before]) > STEADY) | ~moving[before])
    return int(before[unsteady[-1]]) + 1 if unsteady.size else int(before[0]) if before.size else first


def _goes_on(between: np.ndarray, slowest: float) -> bool:
    """Whether a braking goes on after speeds in between: the vehicle was neither faster than before nor at rest."""
    return bool(between.min() >= slowest and between.max() < between[0] + REGAINED)
