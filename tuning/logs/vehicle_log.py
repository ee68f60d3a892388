"""Logs of a whole car: accelerations, yaw rate, steering angle, four wheel speeds, and the truth where there is one.

ISO axes: x forward, y left, yaw rate and steering positive to the left; the steering angle is that of the road wheels.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from absjax.sideslip.car import Car, CarSample
from tuning.logs.recording import LogError, Recording, numbers
from tuning.logs.tables import read_recording
from tuning.logs.vehicle_checks import check_contradictions, check_plausible, check_stuck

WHEELS = ("fl", "fr", "rl", "rr")
COLUMNS = {
    "time": "time_s",
    "longitudinal_acceleration": "longitudinal_acceleration_m_s2",
    "lateral_acceleration": "lateral_acceleration_m_s2",
    "yaw_rate": "yaw_rate_rad_s",
    "steering_angle": "steering_angle_rad",
    **{f"wheel_speed_{wheel}": f"wheel_speed_{wheel}_rad_s" for wheel in WHEELS},
}
"""Column of each signal, unless declared otherwise."""
TRUTH = {
    "longitudinal_speed": "true_vx_m_s",
    "lateral_speed": "true_vy_m_s",
    "yaw_rate": "true_yaw_rate_rad_s",
    "friction": "true_friction",
    "bank": "true_bank_rad",
}
"""Column of what is known besides, where it is."""
ACCELERATION, ANGLE = {"m/s2": 1.0, "g": 9.81}, {"rad": 1.0, "deg": np.pi / 180}
RATE = {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30}
FACTORS = {
    "time": {"s": 1.0, "ms": 1e-3},
    "longitudinal_acceleration": ACCELERATION,
    "lateral_acceleration": ACCELERATION,
    "yaw_rate": RATE,
    "steering_angle": ANGLE,
    **{f"wheel_speed_{wheel}": RATE for wheel in WHEELS},
}
"""By signal, then by unit; the first unit of each is the project's own."""
FEWEST_SAMPLES = 50
LONGEST_GAP = 0.1
"""Missing measurements up to this long are bridged [s]."""
SHORTEST_PERIOD, LONGEST_PERIOD = 1e-3, 0.05
UNEVEN = 0.2
"""Share of the sampling period by which an instant may be off."""


@dataclasses.dataclass(frozen=True)
class VehicleLog:
    """A checked log of a car, uniformly sampled."""

    name: str
    time: np.ndarray
    """(samples,) [s]"""
    samples: CarSample
    """arrays (samples,) and (samples, 4)"""
    truth: Mapping[str, np.ndarray]
    """by the names of `TRUTH`, (samples,); empty where the log has none"""
    notes: tuple[str, ...] = ()
    """what reading did, and what could not be checked"""

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return float(np.median(np.diff(self.time)))

    def biased(self, lateral: float) -> "VehicleLog":
        """The log with a bias [m/s^2] added to its lateral accelerometer."""
        acceleration = self.samples.lateral_acceleration + lateral
        return dataclasses.replace(self, samples=self.samples._replace(lateral_acceleration=acceleration))

    @property
    def true_side_slip(self) -> np.ndarray:
        """-atan2(vy, vx) of the truth [rad].

        Raises:
            LogError: if the log has no true velocities.
        """
        if not {"longitudinal_speed", "lateral_speed"} <= set(self.truth):
            names = f"{TRUTH['longitudinal_speed']!r} and {TRUTH['lateral_speed']!r}"
            raise LogError(f"{self.name}: no columns {names}; the true velocities are needed")
        return -np.arctan2(self.truth["lateral_speed"], self.truth["longitudinal_speed"])


def parse_vehicle_columns(declarations: str | None) -> dict[str, str]:
    """`"steering_angle=delta:deg"` as `{"steering_angle": "delta:deg"}`.

    Raises:
        LogError: if a part has no '=', or names no signal.
    """
    columns = {}
    for item in filter(None, (declarations or "").split(",")):
        signal, equals, column = (text.strip() for text in item.partition("="))
        if not equals:
            raise LogError(f"column declaration {item!r} must read SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT")
        if signal not in COLUMNS:
            raise LogError(f"signal {signal!r} is unknown; there are {', '.join(COLUMNS)}")
        columns[signal] = column
    return columns


def read_vehicle_log(path: str | Path, car: Car, columns: Mapping[str, str] | None = None) -> VehicleLog:
    """Read a log of a car, and check that its signals agree with each other.

    Args:
        path: of a format of `tuning.logs.tables.READERS`.
        car: that was driven.
        columns: signal -> "column" or "column:unit", where they differ from `COLUMNS`.

    Raises:
        LogError: naming file, column and row of whatever keeps the log from being used, and what contradicts what.
    """
    path = Path(path)
    recording = read_recording(path)
    wanted = {**COLUMNS, **(columns or {})}
    names = {signal: text.partition(":")[0] for signal, text in wanted.items()}
    values = {signal: _column(recording, signal, text) for signal, text in wanted.items()}
    time = values.pop("time")
    _check_time(recording, names["time"], time)
    notes = list(recording.notes)
    for signal, column in values.items():
        bridged = _bridged(recording, names[signal], time, column)
        if bridged:
            notes.append(f"{names[signal]}: {bridged} missing samples bridged")
    check_plausible(path, names, values, _place(recording, names))
    check_stuck(path, names, time, values, car)
    notes += check_contradictions(path, names, time, values, car)
    wheels = np.stack([values.pop(f"wheel_speed_{wheel}") for wheel in WHEELS], axis=1)
    truth = {name: numbers(path, recording.channel(c)) for name, c in TRUTH.items() if c in recording.names}
    for name, column in truth.items():
        if not np.isfinite(column).all():
            raise LogError(f"{path}, column {TRUTH[name]!r}: {np.sum(~np.isfinite(column))} samples are missing")
    return VehicleLog(path.name, time, CarSample(**values, wheel_speed=wheels), truth, tuple(notes))


def _place(recording: Recording, names: Mapping[str, str]):
    return lambda signal, at: recording.channel(names[signal]).place(at)


def _column(recording: Recording, signal: str, text: str) -> np.ndarray:
    column, _, unit = text.partition(":")
    if column not in recording.names:
        there = ", ".join(recording.names)
        raise LogError(f"{recording.path}: no column {column!r} for {signal}; there are {there}")
    units = FACTORS[signal]
    if unit and unit not in units:
        raise LogError(f"{recording.path}, column {column!r}: unit {unit!r} is unknown; there are {', '.join(units)}")
    return numbers(recording.path, recording.channel(column)) * (units[unit] if unit else 1.0)


def _check_time(recording: Recording, column: str, time: np.ndarray) -> None:
    where, channel = f"{recording.path}, column {column!r}", recording.channel(column)
    if time.size < FEWEST_SAMPLES:
        raise LogError(f"{recording.path}: {time.size} samples, {FEWEST_SAMPLES} needed")
    if not np.isfinite(time).all():
        raise LogError(f"{where}, {channel.place(int(np.argmin(np.isfinite(time))))}: no time")
    steps = np.diff(time)
    if steps.min() <= 0:
        raise LogError(f"{where}, {channel.place(int(np.argmax(steps <= 0)) + 1)}: the time does not increase")
    period = float(np.median(steps))
    if not SHORTEST_PERIOD <= period <= LONGEST_PERIOD:
        raise LogError(f"{where}: sampling period {period:g} s; 1 ms to 50 ms can be used. Is time in s?")
    off = np.abs(steps - period) > UNEVEN * period
    if off.any():
        at = int(np.argmax(off)) + 1
        raise LogError(
            f"{where}, {channel.place(at)}: {steps[at - 1]:g} s after the sample before, elsewhere {period:g} s; "
            "uniform samples are needed"
        )


def _bridged(recording: Recording, name: str, time: np.ndarray, values: np.ndarray) -> int:
    """Number of missing samples, which are interpolated in place.

    Raises:
        LogError: if they are missing for longer than `LONGEST_GAP`.
    """
    there = np.isfinite(values)
    if there.all():
        return 0
    if not there.any():
        raise LogError(f"{recording.path}, column {name!r}: no measurement at all")
    edges = np.flatnonzero(np.diff(np.concatenate([[True], there, [True]]).astype(int)))
    first, length = edges[::2], edges[1::2] - edges[::2]
    longest = int(np.argmax(length))
    period = float(np.median(np.diff(time)))
    if length[longest] * period > LONGEST_GAP:
        place = recording.channel(name).place(int(first[longest]))
        raise LogError(
            f"{recording.path}, column {name!r}, {place}: no measurement for {length[longest] * period:.3g} s "
            f"from {time[first[longest]]:g} s on; up to {LONGEST_GAP:g} s are bridged"
        )
    values[~there] = np.interp(time[~there], time[there], values[there])
    return int(np.sum(~there))
