"""Signs: logs count vertical load, force and deceleration either way. They are turned where that is beyond doubt.

A load that is negative throughout is counted downwards (SAE axes). An acceleration that integrates to the speed lost
is a deceleration. A force against the slip is one of the road on the tyre counted backwards.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from tuning.logs.grid import Signal
from tuning.logs.stated import Stated, zero_of

SLIPPING = 0.03
"""Slip, in magnitude, from which the sign of the force is judged."""
ENOUGH = 20
"""Samples for that."""


def turned(
    signals: Sequence[Signal], declared: Collection[str], radius: float, stated: Stated
) -> tuple[list[Signal], list[str]]:
    """Signals of the project's signs, and what was turned.

    Args:
        signals: in the project's units.
        declared: signals whose sign is declared; left as they are.
        radius: of the wheel [m].
        stated: what the car file states; zeros are those of the project's signs.
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
        if test and signal.name not in declared and test(signal, known, radius, zero_of(signal.name, stated).value):
            signal = signal.with_values(-signal.values)
            notes.append(f"{signal.name} turned: {reasons[signal.name]}")
        found.append(signal)
    return found, notes


def _load(load: Signal, known: Mapping[str, Signal], radius: float, zero: float) -> bool:
    return bool(load.values.max() < 0)


def _acceleration(acceleration: Signal, known: Mapping[str, Signal], radius: float, zero: float) -> bool:
    speed = known["vehicle_speed"]
    start, end = max(speed.time[0], acceleration.time[0]), min(speed.time[-1], acceleration.time[-1])
    inside = (acceleration.time >= start) & (acceleration.time <= end)
    before, after = np.interp([start, end], speed.time, speed.values)
    lost = float(before - after)
    integral = float(np.trapezoid(acceleration.values[inside], acceleration.time[inside]))
    if lost <= 3:
        return False
    as_it_is, other_way = ((sign * integral + zero * (start - end)) / -lost for sign in (1, -1))
    return 0.5 < other_way < 2 and abs(other_way - 1) < abs(as_it_is - 1)


def _force(force: Signal, known: Mapping[str, Signal], radius: float, zero: float) -> bool:
    wheel, vehicle = known["wheel_speed"], known["vehicle_speed"]
    speed = np.interp(force.time, vehicle.time, vehicle.values)
    slip = radius * np.interp(force.time, wheel.time, wheel.values) / np.maximum(speed, 1.0) - 1
    slipping = np.abs(slip) > SLIPPING
    as_it_is, other_way = (np.sign(sign * force.values[slipping] - zero) == np.sign(slip[slipping]) for sign in (1, -1))
    return bool(slipping.sum() >= ENOUGH and np.mean(other_way) > 0.9 >= np.mean(as_it_is))


_TESTS = {"load": _load, "acceleration": _acceleration, "force": _force}
