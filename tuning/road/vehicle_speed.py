"""The vehicle's speed as it comes: slow and late, beside an acceleration that is neither.

    v(t_k) = v0 + b (t_k - d) + int_0^{t_k - d} a dt        d: delay, b: bias of the acceleration and slope

For a given d this is linear in (v0, b). The delay is where the sum of squares is least; what a stop tells of it is
how the deceleration comes and goes.
"""

from typing import NamedTuple

import numpy as np

from absjax.plant.wheel import GRAVITY
from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.road.noise import noise_of
from tuning.road.sampling import measured

DELAYS = np.arange(-0.05, 0.4, 2.5e-3)
"""Grid of d [s], where nobody says what it is."""
FAR, CERTAIN = 4, 1e-6
"""Standard deviations to both sides of a delay that the car file gives; the least of them [s]."""
BIAS, USUAL = 0.25, 0.1
"""Standard deviation of the bias, of accelerometer and slope, before the log is seen [m/s^2]; a usual delay, and how
far others are off it [s]."""
BEGINNING = 0.03
"""What a log begins with [s]."""
ERRORS = 8
"""Of the integral of the acceleration: an offset, a drift, and the first terms of the walk that noise makes."""
FIRST_NOISE = 0.05
"""Of a measurement of the speed, to begin with [m/s]."""
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
    bias: tuple[float, float]
    """of the acceleration and the slope together, beyond what is known of them, and its standard deviation, m/s^2"""
    errors: np.ndarray
    """what the course may be off, one standard deviation of each of `ERRORS` independent courses, m/s, (samples,
    `ERRORS`)"""


def motion_of(log: BrakeLog, car: Car) -> Motion | None:
    """Delay and course of the speed by the integral of the acceleration; None without one.

    Args:
        log: with vehicle speed and acceleration.
        car: what is known of bias, slope and delay.
    """
    if log.acceleration is None:
        return None
    rate = log.acceleration - car.priors["acceleration_bias"].value + GRAVITY * car.priors["slope"].value
    usual, about, delays = _delays(car)
    at = np.flatnonzero(measured(log, "vehicle_speed"))
    time, told = log.time[at] - log.time[0], log.vehicle_speed[at]
    clock = log.time - log.time[0]
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * log.period)])

    first = float(np.mean(rate[: max(1, round(BEGINNING / log.period))]))
    middle = float(np.mean(time))
    lever = time - middle

    def fitted(delay):
        then = time - delay
        # Before its first sample the log is taken to have gone on as it begins.
        rest = told - np.interp(then, clock, travelled) - first * np.minimum(then, 0.0)
        # The bias is known beforehand to be small, the delay not to be large.
        bias = lever @ rest / (lever @ lever + (noise / BIAS) ** 2)
        start = np.mean(rest) - bias * (middle - delay)
        miss = rest - start - bias * then
        known = (bias * noise / BIAS) ** 2 + ((delay - usual) * noise / about) ** 2
        return float((np.sum(miss**2) + known) / len(at)), (start, bias), then, miss

    def searched():
        costs = np.array([fitted(delay)[0] for delay in delays])
        best = int(np.argmin(costs))
        return costs, best, max(float(np.sqrt(np.mean(fitted(delays[best])[3] ** 2))), 1e-4)

    noise = FIRST_NOISE
    noise = searched()[2]
    costs, best, noise = searched()
    delay, spread = float(delays[best]), np.inf
    if 0 < best < len(delays) - 1:
        bend = costs[best - 1] - 2 * costs[best] + costs[best + 1]
        step = delays[1] - delays[0]
        delay += 0.5 * step * (costs[best - 1] - costs[best + 1]) / bend
        spread = float(np.sqrt(2 * noise**2 / (len(at) * bend / step**2)))
    _, (start, bias), then, _ = fitted(delay)
    late = np.interp(then, clock, rate) + bias
    columns = np.stack([np.ones(len(then)), then, -late], axis=1) / noise
    known = np.diag([0.0, 1 / BIAS**2, 1 / about**2])
    covariance = np.linalg.inv(columns.T @ columns + known)
    middle = float(-covariance[0, 1] / covariance[1, 1])
    offset = covariance[0, 0] - covariance[0, 1] ** 2 / covariance[1, 1]
    drift = float(np.sqrt(covariance[1, 1]))
    line = np.stack([np.full(len(clock), np.sqrt(max(offset, 0.0))), drift * (clock - middle)])
    errors = np.concatenate([line, _walk(clock, noise_of(log, "acceleration"))])
    course = start + bias * clock + travelled
    return Motion(delay, spread, course, noise, (float(bias), drift), errors.T)


def _delays(car: Car) -> tuple[float, float, np.ndarray]:
    """What a delay is about, its standard deviation before the log is seen, and where it is looked for [s]."""
    known = car.stated.get("speed_delay")
    if known is None:
        return USUAL, USUAL, DELAYS
    about = max(known.spread, CERTAIN)
    several = max(2 * FAR**2, round(2 * FAR * about / (DELAYS[1] - DELAYS[0])))
    return known.value, about, known.value + FAR * about * np.linspace(-1, 1, several + 1)


def _walk(clock: np.ndarray, noise: float) -> np.ndarray:
    """What noise of the acceleration makes of its integral: its first terms, (terms, samples).

    A random walk is sum_k Z_k s sqrt(2 T) sin((k - 1/2) pi t / T) / ((k - 1/2) pi), s = noise sqrt(period), Z_k
    standard normal; what of each is a straight line the measured speeds have put right.
    """
    length, k = clock[-1] + clock[1], np.arange(1, ERRORS - 1)[:, None] - 0.5
    terms = noise * np.sqrt(2 * length * clock[1]) * np.sin(k * np.pi * clock / length) / (k * np.pi)
    return terms - np.stack([np.polyval(np.polyfit(clock, term, 1), clock) for term in terms])
