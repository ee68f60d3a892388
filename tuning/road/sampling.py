"""Which samples of a log are measurements, and how far apart they are."""

import numpy as np

from tuning.logs.brake_log import BrakeLog


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
