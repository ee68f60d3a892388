"""What a log of edges says: wheel speed and acceleration with the encoder's errors taken off, and those errors."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.encoder.edges import pack
from absjax.encoder.rotation import Rotation
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from tuning.encoder.chains import SIGNALS
from tuning.logs.edges import EdgeLog
from tuning.logs.tables import LogError

PER_ORDER, FEWEST_POINTS = 4, 128
"""Points a revolution is resampled to, for every order of the spectrum, and at least."""
LARGEST_CAPACITY = 32
"""Most edges between two samples."""
MISSED = 1.6
"""An interval so many times those around it has an edge missing in it."""

NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median deviation."""


class ToothErrors(NamedTuple):
    """Where the edges of an encoder lie off their places, in encoder cycles."""

    tooth: np.ndarray
    """of every edge, (edges,); tooth 0 is the first of the log"""
    error: np.ndarray
    """of every edge, (edges,)"""
    mean: np.ndarray
    """by tooth, (teeth,)"""
    missing: int
    """edges that are missing from the log"""

    @property
    def eccentricity(self) -> float:
        """e / r: amplitude of the first harmonic of the mean error, rad."""
        teeth = self.mean.size
        return float(2 / teeth * abs(np.fft.fft(self.mean)[1]) * 2 * np.pi / teeth)

    @property
    def tolerance(self) -> float:
        """Half the width of a uniform distribution of what the first harmonic leaves of the mean error, cycles."""
        teeth = self.mean.size
        spectrum = np.fft.rfft(self.mean)
        spectrum[:2] = 0.0
        return float(np.sqrt(3) * np.fft.irfft(spectrum, teeth).std())

    @property
    def jitter(self) -> float:
        """Standard deviation of what does not repeat from revolution to revolution, cycles.

        From the median deviation, since a changing speed adds to the errors of its revolutions.
        """
        return float(NORMAL * np.median(np.abs(self.error - self.mean[self.tooth])))


class LogStudy(NamedTuple):
    """A log run through a chain; arrays (samples,)."""

    time: np.ndarray
    """since the first edge, s"""
    measured: Rotation
    """of the time-stamping algorithm"""
    speed: np.ndarray
    """compensated, rad/s"""
    acceleration: np.ndarray
    """compensated, rad/s^2"""
    valid: np.ndarray
    coefficients: dict[str, np.ndarray]
    """of the error learned from each signal, a1, b1, a2, b2, ... [rad]; none without a compensation"""


def study_log(log: EdgeLog, chain: WheelSpeedChain, period: float = 1e-3) -> LogStudy:
    """Run a log through a chain.

    Args:
        period: between samples [s], a whole number of ticks.

    Raises:
        LogError: if it is not, or more than `LARGEST_CAPACITY` edges fall between two samples.
    """
    ticks = round(period / log.clock)
    if ticks < 1 or abs(ticks * log.clock - period) > 1e-6 * period:
        raise LogError(f"{log.name}: a period of {period:g} s is not a whole number of ticks of {log.clock:g} s")
    edges, instants = pack(log.stamps, ticks)
    if edges.ages.shape[1] > LARGEST_CAPACITY:
        raise LogError(
            f"{log.name}: {edges.ages.shape[1]} edges within {period:g} s; {LARGEST_CAPACITY} at most. "
            "A shorter period, or is the clock wrong?"
        )
    found, state = estimate(chain, edges, ticks, jnp.asarray(log.clock, jnp.result_type(float)))
    coefficients = {
        signal: np.asarray(getattr(chain, signal).coefficients(getattr(state, signal)))
        for signal in SIGNALS
        if hasattr(getattr(chain, signal), "coefficients")
    }
    measured = found.measured
    return LogStudy(
        (instants - instants[0]) * log.clock,
        Rotation(*map(np.asarray, measured.rotation)),
        np.asarray(found.speed),
        np.asarray(found.acceleration),
        np.asarray(measured.valid),
        coefficients,
    )


def tooth_errors(log: EdgeLog) -> ToothErrors:
    """Errors of the edges against a wheel whose speed changes little within two revolutions.

    The time of an edge is compared with the mean over the revolution around it, in which errors that repeat cancel.

    Raises:
        LogError: if a tooth is never seen.
    """
    steps = np.diff(log.stamps).astype(float)
    around = np.median(np.stack([np.roll(steps, i) for i in (-2, -1, 1, 2)]), axis=0)
    passed = np.where(steps > MISSED * around, np.maximum(np.round(steps / around), 1), 1).astype(int)
    tooth = np.concatenate([[0], np.cumsum(passed)])
    # Missing edges are put back where a straight line has them.
    every = np.arange(tooth[-1] + 1)
    time = np.interp(every, tooth, (log.stamps - log.stamps[0]).astype(float))
    window = np.ones(log.teeth + 1) / log.teeth
    window[[0, -1]] *= 0.5
    if log.teeth % 2:
        window = np.ones(log.teeth) / log.teeth
    smooth = np.convolve(time, window, mode="valid")
    half = (window.size - 1) // 2
    inner = slice(half, half + smooth.size)
    pace = np.convolve(np.gradient(time), window, mode="valid")
    error = (time[inner] - smooth) / pace
    # What a changing speed adds is the same for all teeth of a revolution.
    centred = error - np.convolve(np.pad(error, half, mode="edge"), window, mode="valid")
    seen = np.isin(every[inner], tooth)
    index = every[inner] % log.teeth
    unseen = np.setdiff1d(np.arange(log.teeth), index[seen])
    if unseen.size:
        raise LogError(
            f"{log.name}: tooth {unseen[0]} of {log.teeth}, counted from the first edge, never passes "
            f"({unseen.size} such teeth); is the number of teeth right?"
        )
    mean = np.array([centred[seen & (index == k)].mean() for k in range(log.teeth)])
    return ToothErrors(index[seen], centred[seen], mean, int((passed - 1).sum()))


def order_spectrum(study: LogStudy, signal: str, compensated: bool, orders: int = 30) -> np.ndarray:
    """Amplitudes of a signal at 1, 2, ... times the wheel's frequency, (orders,); valid samples only."""
    values = getattr(study if compensated else study.measured, signal)[study.valid]
    angle = np.unwrap(study.measured.angle[study.valid])
    turns, points = int((angle[-1] - angle[0]) / (2 * np.pi)), max(PER_ORDER * orders, FEWEST_POINTS)
    grid = angle[0] + 2 * np.pi / points * np.arange(turns * points)
    resampled = np.interp(grid, angle, values)
    window = np.hanning(grid.size)
    spectrum = np.fft.rfft((resampled - resampled.mean()) * window) * 2 / window.sum()
    return np.abs(spectrum[turns * np.arange(1, orders + 1)])
