"""Points (slip, friction) of a log, by the most direct measurement it has."""

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from absjax.plant.wheel import GRAVITY, Wheel
from tuning.logs.brake_log import BrakeLog
from tuning.road.sampling import longest_gap

LONGEST_GAP = 0.03
"""Time without a measurement [s], of a slow sensor or a clipped one, from which its acceleration gives no friction."""
SMOOTHING = 0.021
"""Window of the smoothing differentiator [s]."""


class FrictionSamples(NamedTuple):
    """Points of the friction curve; arrays (samples,)."""

    time: np.ndarray
    slip: np.ndarray
    friction: np.ndarray
    """mu(lambda), negative while braking"""
    source: str
    """'force', 'acceleration', 'speed' or 'wheel': what the friction comes from"""


def is_rig(log: BrakeLog) -> bool:
    """Whether the speed under the wheel is imposed: it does not fall although the wheel is braked."""
    tenth = len(log.time) // 10
    fall = log.vehicle_speed[:tenth].mean() - log.vehicle_speed[-tenth:].mean()
    return bool(fall < 0.05 * log.vehicle_speed.mean())


def friction_samples(log: BrakeLog, wheel: Wheel, share: np.ndarray | None = None) -> FrictionSamples:
    """Friction from force (Fx / Fz), else acceleration (a / g), else speed (v' / g), else, on a rig and where the load
    changes, from the wheel's own balance (-(J w' + gamma_b Pb) / (R Fz)).

    Args:
        log: the log.
        wheel: wheel, load and brake.
        share: load over that of the wheel, (samples,), where it changes.
    """
    slip = float(wheel.radius) * log.wheel_speed / log.vehicle_speed - 1
    load = float(wheel.load) * (1.0 if share is None else share)
    if log.force is not None:
        return FrictionSamples(log.time, slip, log.force / load, "force")
    if log.brake_pressure is not None and (share is not None or is_rig(log)):
        return FrictionSamples(log.time, slip, balanced_force(log, wheel) / load, "wheel")
    if log.acceleration is not None and longest_gap(log, "acceleration") < LONGEST_GAP:
        return FrictionSamples(log.time, slip, log.acceleration / GRAVITY, "acceleration")
    return FrictionSamples(log.time, slip, rate_of(log, log.vehicle_speed) / GRAVITY, "speed")


def balanced_force(log: BrakeLog, wheel: Wheel) -> np.ndarray:
    """Tyre force -(J w' + gamma_b Pb) / R that wheel speed and pressure ask for [N], (samples,).

    Raises:
        ValueError: if no pressure was logged.
    """
    if log.brake_pressure is None:
        raise ValueError(f"{log.name}: no brake pressure")
    torque = float(wheel.inertia) * rate_of(log, log.wheel_speed) + float(wheel.brake_efficiency) * log.brake_pressure
    return -torque / float(wheel.radius)


def rate_of(log: BrakeLog, signal: np.ndarray, smoothing: float = SMOOTHING) -> np.ndarray:
    """d(signal)/dt, (samples,), smoothed over a window [s]."""
    window = max(5, 2 * round(smoothing / log.period / 2) + 1)
    return np.asarray(savgol_filter(signal, window, 2, deriv=1, delta=log.period))
