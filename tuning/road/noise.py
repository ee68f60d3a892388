"""How noisy a channel is, from its own measurements."""

import numpy as np

from tuning.logs.brake_log import BrakeLog
from tuning.road.sampling import measured


def white_noise(signal: np.ndarray) -> float:
    """Standard deviation of the sensor noise of a smooth signal sampled fast, from its fourth differences."""
    if len(signal) < 12:
        return 1e-12
    return float(np.median(np.abs(np.diff(signal, 4))) / 0.6745 / np.sqrt(70)) + 1e-12


def noise_of(log: BrakeLog, signal: str, inside: np.ndarray | None = None) -> float:
    """Standard deviation of a signal's measurements, rounding included; never 0.

    Args:
        log: the log.
        signal: which of its signals.
        inside: samples to look at; all when None.
    """
    at = measured(log, signal) if inside is None else measured(log, signal) & inside
    values = getattr(log, signal)
    rounding = log.resolution.get(signal, 0.0) / np.sqrt(12)
    least = 1e-6 * float(np.ptp(values)) + 1e-12
    return max(float(np.hypot(white_noise(values[at]), rounding)), least)
