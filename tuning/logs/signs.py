"""Signs: logs count vertical load, force and deceleration either way. They are turned where that is beyond doubt.

A load that is negative throughout is counted downwards (SAE axes). An acceleration that integrates to the speed lost
is a deceleration. A force against the slip is one of the road on the tyre counted backwards.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from tuning.logs.grid import Signal

SLIPPING = 0.03
"""Slip, in magnitude, from which the sign of the force is judged."""
ENOUGH = 20
"""Samples for that."""


def turned(signals: Sequence[Signal], declared: Collection[str], radius: float) -> tuple[list[Signal], list[str]]:
    """Signals of the project's signs, and what was turned.

    Args:
        signals: in the project's units.
        declared: signals whose sign is declared; left as they are.
        radius: of the wheel [m].
    """
    known = {signal.name: signal for signal in signals}
    reasons = {
        "load": "all of it is negative, as in SAE axes",
        "acceleration": "it integrates to the speed that is lost",
        "force": "it has the sign of braking where the wheel is driven, and the other way round",
    }
    found, notes = [], []
    for signal in signals:
        test = _TESTS.get(signal.name)
        if test and signal.name not in declared and test(signal, known, radius):
            signal = signal.with_values(-signal.values)
            notes.append(f"{signal.name} turned: {reasons[signal.name]}")
        found.append(signal)
    return found, notes


def _load(load: Signal, known: Mapping[str, Signal], radius: float) -> bool:
    return bool(load.values.max() < 0)


def _acceleration(acceleration: Signal, known: Mapping[str, Signal], radius: float) -> bool:
    speed = known["vehicle_speed"]
    start, end = max(speed.time[0], acceleration.time[0]), min(speed.time[-1], acceleration.time[-1])
    inside = (acceleration.time >= start) & (acceleration.time <= end)
    before, after = np.interp([start, end], speed.time, speed.values)
    lost = float(before - after)
    integral = float(np.trapezoid(acceleration.values[inside], acceleration.time[inside]))
    return lost > 3 and 0.5 < integral / lost < 2


def _force(force: Signal, known: Mapping[str, Signal], radius: float) -> bool:
    wheel, vehicle = known["wheel_speed"], known["vehicle_speed"]
    speed = np.interp(force.time, vehicle.time, vehicle.values)
    slip = radius * np.interp(force.time, wheel.time, wheel.values) / np.maximum(speed, 1.0) - 1
    slipping = np.abs(slip) > SLIPPING
    against = np.sign(force.values[slipping]) == -np.sign(slip[slipping])
    return bool(slipping.sum() >= ENOUGH and np.mean(against) > 0.9)


_TESTS = {"load": _load, "acceleration": _acceleration, "force": _force}
