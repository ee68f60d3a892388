"""From a brake log to what an observer is told: x2, v and pressure, and the XBS measured force gives."""

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from absjax.observers.base import Sample
from absjax.plant.wheel import Wheel
from absjax.tyres.base import Tyre
from tuning.logs.brake_log import BrakeLog
from tuning.logs.tables import LogError

WINDOW = 0.015
"""Window of the smoothing filter that differentiates the wheel speed [s]."""
ORDER = 3
"""Degree of its polynomial: odd, so that the filter has no phase and keeps cubic signals."""


class LogSignals(NamedTuple):
    """A log as an observer sees it; arrays (samples,)."""

    time: np.ndarray
    samples: Sample
    slip: np.ndarray


def observer_signals(log: BrakeLog, wheel: Wheel, window: float = WINDOW) -> LogSignals:
    """x2 = R w' - v' of a log, its speeds smoothed and differentiated, its pressure smoothed alike.

    One filter (Savitzky and Golay) for all signals, so that z1' = -(a/v) z1 XBS - b Pb' goes on to hold
    between them but for the product's share of the filter's bandwidth.

    Args:
        log: a checked log, uniformly sampled.
        wheel: the radius is used.
        window: of the filter, s.

    Raises:
        LogError: if the sampling is not uniform, or the window is shorter than five samples.
    """
    if log.brake_pressure is None:
        raise LogError(f"{log.name}: no brake pressure; an observer needs it")
    steps = np.diff(log.time)
    if np.ptp(steps) > 0.01 * log.period:
        raise LogError(f"{log.name}: sampled every {steps.min():g} to {steps.max():g} s; an observer needs one period")
    length = 2 * round(window / log.period / 2) + 1
    if length < 5:
        raise LogError(f"{log.name}: a window of {window:g} s holds {length} samples, five at least")

    def smooth(signal, derivative=0):
        return np.asarray(savgol_filter(signal, length, ORDER, deriv=derivative, delta=log.period))

    radius, speed = float(wheel.radius), smooth(log.vehicle_speed)
    y = radius * smooth(log.wheel_speed, 1) - smooth(log.vehicle_speed, 1)
    slip = radius * smooth(log.wheel_speed) / speed - 1
    return LogSignals(log.time, Sample(y, speed, smooth(log.brake_pressure)), slip)


def force_stiffness(signals: LogSignals, tyre: Tyre) -> np.ndarray:
    """XBS the measured force gives: slope of the curve fitted to (slip, force / load), at the measured slip.

    Source: Aguado-Rojas 2019, section 3.5. The curve comes from `tuning.road.identify.identify`.
    """
    return np.asarray(tyre.stiffness(signals.slip))
