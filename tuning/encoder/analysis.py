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


class LogStudy(NamedTuple):
    """A log run through a chain; arrays (samples,)."""

    time: np.ndarray
    """in the log's clock, s"""
    measured: Rotation
    """of the time-stamping algorithm"""
    speed: np.ndarray
    """compensated, rad/s"""
    acceleration: np.ndarray
    """compensated, rad/s^2"""
    valid: np.ndarray
    coefficients: dict[str, np.ndarray]
    """of the error learned from each signal, a1, b1, a2, b2, ... [rad]; none without a compensation"""

    def within(self, valid: np.ndarray) -> "LogStudy":
        """Valid where these samples are too; as many samples as there are of these."""
        size = min(valid.size, self.time.size)
        cut = {name: getattr(self, name)[:size] for name in ("time", "speed", "acceleration")}
        measured = Rotation(*(x[:size] for x in self.measured))
        return self._replace(**cut, measured=measured, valid=self.valid[:size] & valid[:size])

    def without(self, signal: str) -> "LogStudy":
        """A signal as it was measured."""
        return self._replace(**{signal: getattr(self.measured, signal)})


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
        instants[0] * log.clock + (instants - instants[0]) * log.clock,
        Rotation(*map(np.asarray, measured.rotation)),
        np.asarray(found.speed),
        np.asarray(found.acceleration),
        np.asarray(measured.valid),
        coefficients,
    )


def periodic_part(study: LogStudy, signal: str, compensated: bool, teeth: int) -> float:
    """Rms of a signal at the multiples of the wheel's frequency that the teeth tell apart."""
    return float(np.sqrt(0.5 * np.sum(order_spectrum(study, signal, compensated, teeth // 2) ** 2)))


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
