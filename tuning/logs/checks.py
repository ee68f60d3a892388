"""What is refused: values that are not plausible in their unit, and signals that do not agree with each other."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from tuning.logs.channel_map import Source
from tuning.logs.grid import Signal
from tuning.logs.recording import LogError
from tuning.logs.stated import Stated, within, zero_of
from tuning.logs.units import Unit, unit_of

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
RELEASED, FEWEST_ROLLING = 0.03, 8
"""Share of the span of the pressure up to which the brake is released; samples of it from which a ratio is taken."""
FITS, WELL, OFF = 0.02, 0.03, 0.05
"""By how much R w / v of a rolling wheel is off 1 with the right unit, without a word, and without another unit."""
SLOWEST_SAMPLING, FASTEST_SAMPLING = 0.05, 1e-5
"""Sampling periods that can be used [s]."""


def check_values(path: Path, signals: Sequence[Signal], stated: Stated) -> None:
    """Refuse what no sensor of a car or rig tells.

    Args:
        path: of the log.
        signals: in the project's units and signs.
        stated: what the car file states; signs are judged without the zeros.

    Raises:
        LogError: naming file, column and row.
    """
    for signal in signals:
        name, values = signal.name, signal.values
        zero = zero_of(name, stated)
        middle = float(np.median(values)) - zero.value
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
                f"is the sensor connected? {name}= leaves it out"
            )
        if name == "brake_pressure" and middle < -zero.within:
            raise LogError(
                f"{path}, column {signal.channel.name!r}: mostly negative; braking pressure must be positive. "
                "If its zero is off, the car file can state it as pressure_zero"
            )
        if name in ("force", "acceleration") and middle > zero.within + np.std(values):
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


def rolling_ratio(log, radius: float) -> float:
    """R w / v while the wheel rolls: near the top of the samples of least pressure, or of all.

    Args:
        log: a `tuning.logs.brake_log.BrakeLog`.
        radius: of the wheel [m].
    """
    ratio = radius * log.wheel_speed / log.vehicle_speed
    if log.brake_pressure is not None:
        pressure = log.brake_pressure
        low = pressure <= np.quantile(pressure, 0.005) + RELEASED * np.ptp(pressure)
        if low.sum() >= FEWEST_ROLLING:
            return float(np.quantile(ratio[low], 0.9))
    return float(np.quantile(ratio, 0.95))


def check_agreement(path: Path, sources: Mapping[str, Source], log, radius: float, stated: Stated) -> list[str]:
    """Refuse units that are wrong without being implausible by themselves.

    Args:
        sources: of the signals.
        log: a `tuning.logs.brake_log.BrakeLog`.
        radius: of the wheel [m].
        stated: what the car file states: zero of the acceleration, delay of the vehicle's speed, and how well the
            radius is known.

    Returns:
        What is doubtful.

    Raises:
        LogError: naming file and columns.
    """
    doubts = []
    columns = {name: source.channel.name for name, source in sources.items()}
    if "speed_delay" in stated:
        now = np.interp(log.time + stated["speed_delay"].value, log.time, log.vehicle_speed)
        log = dataclasses.replace(log, vehicle_speed=now)
    well, off = (max(least, within("radius", stated) / radius) for least in (WELL, OFF))
    rolling = rolling_ratio(log, radius)
    top = float(np.quantile(radius * log.wheel_speed / log.vehicle_speed, 0.99))
    fitting = [] if abs(rolling - 1) < well else list(_fitting(sources, rolling, radius))
    if not 0.5 < top < 1.6 or (fitting and abs(rolling - 1) > off):
        hint = "one of them is in another unit, or the radius is wrong"
        if fitting:
            hint = "; ".join(f"it would be {ratio:.3f} with {name}={columns[name]}:{u}" for name, u, ratio in fitting)
        raise LogError(
            f"{path}, columns {columns['wheel_speed']!r} and {columns['vehicle_speed']!r}: a rolling wheel "
            f"of radius {radius:g} m would have R w / v near 1, here it is {rolling if fitting else top:.3g}; {hint}"
        )
    if rolling > 1 + well:  # below 1 it may be slip
        doubts.append(
            f"wheel_speed, vehicle_speed: while the wheel rolls R w / v is {rolling:.3f}, above 1; "
            f"the radius of {radius:g} m or one of the speeds is off"
        )
    if log.acceleration is not None:
        lost = log.vehicle_speed[0] - log.vehicle_speed[-1]
        zero, lasts = zero_of("acceleration", stated), log.time[-1] - log.time[0]
        integral = -np.trapezoid(log.acceleration - zero.value, log.time)
        slack = zero.within * lasts
        if lost > 3 and not 0.5 * lost - slack < integral < 2 * lost + slack:
            raise LogError(
                f"{path}, column {columns['acceleration']!r}: it integrates to {integral:.3g} m/s where the vehicle "
                f"lost {lost:.3g} m/s; is it in g?"
            )
    return doubts


def _fitting(sources: Mapping[str, Source], ratio: float, radius: float) -> Iterator[tuple[str, str, float]]:
    """Units in which one of the speeds would agree with the other: signal, unit, R w / v with it."""
    for name, inverted, candidates in (
        ("wheel_speed", False, ("rad/s", "rpm", "deg/s", "rev/s", "km/h", "m/s", "mph")),
        ("vehicle_speed", True, ("m/s", "km/h", "mph")),
    ):
        present = _scale(sources[name].unit, radius)
        for text in candidates:
            unit = unit_of(name, text)
            if unit is None or present is None:
                continue
            change = (_scale(unit, radius) or 1.0) / present
            found = ratio / change if inverted else ratio * change
            if abs(found - 1) < FITS:
                yield name, text, found


def _scale(unit: Unit, radius: float) -> float | None:
    """The project's unit over a unit; None for one that is not a mere factor."""
    return {"": unit.factor, "rim": unit.factor / radius}.get(unit.kind)
