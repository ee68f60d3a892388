"""What is refused: values that are not plausible in their unit, and signals that do not agree with each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tuning.logs.grid import Signal
from tuning.logs.recording import LogError

LARGEST = {
    "wheel_speed": (600.0, "rad/s", "rpm or deg/s"),
    "vehicle_speed": (110.0, "m/s", "km/h or mph"),
    "brake_pressure": (400.0, "bar", "kPa, Pa or psi"),
    "acceleration": (30.0, "m/s2", "another unit"),
    "force": (5e4, "N", "another unit"),
    "load": (5e4, "N", "another unit"),
}
"""Largest magnitude that is plausible, in which unit, and the unit a larger one suggests."""
BACKWARDS = -0.5
"""Wheel speed below which a wheel turns backwards [rad/s]; less is the noise of a locked one."""
SLOWEST_SAMPLING, FASTEST_SAMPLING = 0.05, 1e-5
"""Sampling periods that can be used [s]."""


def check_values(path: Path, signals: Sequence[Signal]) -> None:
    """Refuse what no sensor of a car or rig tells.

    Raises:
        LogError: naming file, column and row.
    """
    for signal in signals:
        name, values = signal.name, signal.values
        largest, unit, other = LARGEST[name]
        if np.abs(values).max() > largest:
            at = int(np.argmax(np.abs(values)))
            raise LogError(
                f"{path}, {signal.place(at)}: {values[at]:g} is not plausible for {name} in {unit}; "
                f"is it in {other}? Declare it as {name}={signal.channel.name}:UNIT"
            )
        if name == "wheel_speed" and values.min() < BACKWARDS:
            at = int(np.argmax(values < BACKWARDS))
            raise LogError(
                f"{path}, {signal.place(at)}: wheel_speed is {values[at]:g} at {signal.time[at]:g} s; "
                "a braked wheel does not turn backwards"
            )
        if name != "load" and np.ptp(values) == 0:
            raise LogError(
                f"{path}, column {signal.channel.name!r}: {name} never changes from {values[0]:g}; "
                "is the sensor connected?"
            )
        if name == "brake_pressure" and np.median(values) < 0:
            raise LogError(
                f"{path}, column {signal.channel.name!r}: mostly negative; braking pressure must be positive"
            )
        if name in ("force", "acceleration") and np.median(values) > max(0, np.std(values)):
            raise LogError(
                f"{path}, column {signal.channel.name!r}: mostly positive; {name} must be negative while braking"
            )
        if name == "load" and values.min() <= 0:
            at = int(np.argmax(values <= 0))
            raise LogError(f"{path}, {signal.place(at)}: vertical load is {values[at]:g} N")


def check_sampling(path: Path, column: str, period: float) -> None:
    """Refuse a period of sampling in which no braking is seen, or that is none.

    Raises:
        LogError: naming file and column.
    """
    if not FASTEST_SAMPLING <= period <= SLOWEST_SAMPLING:
        raise LogError(
            f"{path}, column {column!r}: sampling period {period:g} s; 10 us to 50 ms can be used. Is time in s?"
        )


def check_agreement(path: Path, columns: Mapping[str, str], log, radius: float) -> None:
    """Refuse units that are wrong without being implausible by themselves.

    Args:
        columns: of the signals, for messages.
        log: a `tuning.logs.brake_log.BrakeLog`.
        radius: of the wheel [m].

    Raises:
        LogError: naming file and columns.
    """
    ratio = float(np.quantile(radius * log.wheel_speed / log.vehicle_speed, 0.99))
    if not 0.5 < ratio < 1.6:
        raise LogError(
            f"{path}, columns {columns['wheel_speed']!r} and {columns['vehicle_speed']!r}: a rolling wheel "
            f"of radius {radius:g} m would have R w / v near 1, here it is {ratio:.3g}; "
            "one of them is in another unit, or the radius is wrong"
        )
    if log.acceleration is not None:
        lost = log.vehicle_speed[0] - log.vehicle_speed[-1]
        integral = -np.trapezoid(log.acceleration, log.time)
        if lost > 3 and not 0.5 < integral / lost < 2:
            raise LogError(
                f"{path}, column {columns['acceleration']!r}: it integrates to {integral:.3g} m/s where the vehicle "
                f"lost {lost:.3g} m/s; is it in g?"
            )
