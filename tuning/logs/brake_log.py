"""Brake logs: read, checked, in the project's units.

A log is a table with one row per sample. Columns of other names and units are declared, as in
`{"vehicle_speed": "v_kmh:km/h"}`; nothing is renamed, converted or resampled without being told.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tuning.logs.tables import LogError, column_of, read_table
from tuning.logs.units import FACTORS

COLUMNS = {
    "time": "time_s",
    "wheel_speed": "wheel_speed_rad_s",
    "vehicle_speed": "vehicle_speed_m_s",
    "brake_pressure": "brake_pressure_bar",
    "acceleration": "longitudinal_acceleration_m_s2",
    "force": "longitudinal_force_n",
    "load": "vertical_load_n",
}
"""Column of each signal, unless declared otherwise."""
REQUIRED = ("time", "wheel_speed", "vehicle_speed", "brake_pressure")
FEWEST_SAMPLES = 200
LARGEST = {
    "wheel_speed": (600.0, "rpm or deg/s"),
    "vehicle_speed": (110.0, "km/h or mph"),
    "brake_pressure": (400.0, "kPa, Pa or psi"),
    "acceleration": (30.0, "another unit"),
    "force": (5e4, "another unit"),
    "load": (5e4, "another unit"),
}
"""Largest magnitude that is plausible, and the unit a larger one suggests."""


@dataclasses.dataclass(frozen=True)
class BrakeLog:
    """A checked brake log: arrays (samples,); signals that were not logged are None."""

    name: str
    time: np.ndarray
    """s, strictly increasing"""
    wheel_speed: np.ndarray
    """rad/s, > 0"""
    vehicle_speed: np.ndarray
    """m/s, > 0"""
    brake_pressure: np.ndarray
    """bar"""
    acceleration: np.ndarray | None = None
    """longitudinal, m/s^2, negative while braking"""
    force: np.ndarray | None = None
    """longitudinal tyre force, N, negative while braking"""
    load: np.ndarray | None = None
    """vertical, N"""

    @property
    def period(self) -> float:
        """Median sampling period [s]."""
        return float(np.median(np.diff(self.time)))

    def window(self, start: float | None = None, end: float | None = None) -> "BrakeLog":
        """The samples with start <= time <= end.

        Raises:
            LogError: if fewer than `FEWEST_SAMPLES` are left.
        """
        low, high = -np.inf if start is None else start, np.inf if end is None else end
        inside = (self.time >= low) & (self.time <= high)
        if inside.sum() < FEWEST_SAMPLES:
            raise LogError(
                f"{self.name}: {inside.sum()} samples between {low:g} s and {high:g} s, {FEWEST_SAMPLES} needed"
            )
        signals = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "name"}
        cut: dict[str, Any] = {k: None if v is None else v[inside] for k, v in signals.items()}
        return BrakeLog(self.name, **cut)


def parse_columns(declarations: str | None) -> dict[str, str]:
    """`"wheel_speed=omega:rpm,time=t"` as `{"wheel_speed": "omega:rpm", "time": "t"}`.

    Raises:
        LogError: if a part has no '=', or names no signal.
    """
    columns = {}
    for item in filter(None, (declarations or "").split(",")):
        signal, equals, column = item.partition("=")
        if not equals:
            raise LogError(f"column declaration {item!r} must read SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT")
        columns[signal.strip()] = column.strip()
    return _checked_signals(columns)


def _checked_signals(columns: Mapping[str, str]) -> dict[str, str]:
    for signal in columns:
        if signal not in COLUMNS:
            raise LogError(f"signal {signal!r} is unknown; there are {', '.join(COLUMNS)}")
    return dict(columns)


def read_log(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    radius: float = 0.3,
) -> BrakeLog:
    """Read and check a brake log.

    Args:
        path: of a format of `tuning.logs.tables.READERS`, with a header row.
        columns: signal -> "column" or "column:unit", where they differ from `COLUMNS`.
        start: of the window of time to use [s].
        end: of that window [s].
        radius: wheel radius [m], for the test whether wheel and vehicle speed are in their units.

    Raises:
        LogError: naming file, column and row of whatever keeps the log from being used.
    """
    path = Path(path)
    wanted = {**COLUMNS, **_checked_signals(columns or {})}
    table = read_table(path)
    signals = {}
    for signal, declared in wanted.items():
        column, _, unit = declared.partition(":")
        optional = signal not in REQUIRED and signal not in (columns or {})
        if column not in table.columns:
            if optional:
                continue
            raise LogError(f"{path}: no column {column!r} for {signal}; there are {', '.join(map(str, table.columns))}")
        factor = FACTORS[signal].get(unit or next(iter(FACTORS[signal])))
        if factor is None:
            raise LogError(
                f"{path}, column {column!r}: unit {unit!r} is unknown; {signal} may be in {', '.join(FACTORS[signal])}"
            )
        signals[signal] = _numbers(path, column, column_of(table, column)) * factor
    names = {signal: wanted[signal].partition(":")[0] for signal in signals}
    _check_time(path, names["time"], signals["time"])
    inside = _inside(signals["time"], start, end)
    first_row = int(np.argmax(inside)) + 2
    log = BrakeLog(name=path.name, **signals).window(start, end)
    _check_values(path, names, log, first_row)
    _check_agreement(path, names, log, radius)
    return log


def _inside(time, start, end):
    return (time >= (-np.inf if start is None else start)) & (time <= (np.inf if end is None else end))


def _numbers(path: Path, column: str, cells: pd.Series) -> np.ndarray:
    values = np.asarray(pd.to_numeric(cells, errors="coerce"), float)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        shown = cells.iloc[bad[0]] or "empty"
        raise LogError(
            f"{path}, column {column!r}, row {bad[0] + 2}: {shown!r} is not a finite number ({bad.size} such rows)"
        )
    return values


def _check_time(path: Path, column: str, time: np.ndarray) -> None:
    if time.size < FEWEST_SAMPLES:
        raise LogError(f"{path}: {time.size} samples, {FEWEST_SAMPLES} needed")
    steps = np.diff(time)
    for bad, what in ((steps == 0, "repeats the time before it"), (steps < 0, "goes back in time")):
        if bad.any():
            row = int(np.argmax(bad)) + 3
            raise LogError(f"{path}, column {column!r}, row {row}: {time[row - 2]:g} s {what}")
    period = np.median(steps)
    gaps = np.flatnonzero(steps > 5 * period)
    if gaps.size:
        raise LogError(
            f"{path}, column {column!r}, row {gaps[0] + 3}: a gap of {steps[gaps[0]]:g} s; "
            f"the sampling period is {period:g} s"
        )
    if not 1e-5 <= period <= 0.05:
        raise LogError(
            f"{path}, column {column!r}: sampling period {period:g} s; 10 us to 50 ms can be used. Is time in s?"
        )


def _check_values(path: Path, names: Mapping[str, str], log: BrakeLog, first_row: int) -> None:
    for signal, (largest, other) in LARGEST.items():
        values = getattr(log, signal)
        if values is not None and np.abs(values).max() > largest:
            row = int(np.argmax(np.abs(values)))
            raise LogError(
                f"{path}, column {names[signal]!r}, row {row + first_row}: {values[row]:g} is not plausible "
                f"for {signal} in {next(iter(FACTORS[signal]))}; is it in {other}? "
                f"Declare it as {signal}={names[signal]}:UNIT"
            )
    for signal in ("vehicle_speed", "wheel_speed"):
        values = getattr(log, signal)
        if (values <= 0).any():
            row = int(np.argmax(values <= 0))
            raise LogError(
                f"{path}, column {names[signal]!r}, row {row + first_row}: {signal} is {values[row]:g} "
                f"at {log.time[row]:g} s; slip has no meaning there, end the window before"
            )
    for signal in ("wheel_speed", "vehicle_speed", "brake_pressure", "acceleration", "force"):
        values = getattr(log, signal)
        if values is not None and np.ptp(values) == 0:
            raise LogError(
                f"{path}, column {names[signal]!r}: {signal} never changes from {values[0]:g}; is the sensor connected?"
            )
    if np.median(log.brake_pressure) < 0:
        raise LogError(
            f"{path}, column {names['brake_pressure']!r}: mostly negative; braking pressure must be positive"
        )
    for signal in ("force", "acceleration"):
        values = getattr(log, signal)
        if values is not None and np.median(values) > 0 and np.median(values) > np.std(values):
            raise LogError(
                f"{path}, column {names[signal]!r}: mostly positive; {signal} must be negative while braking"
            )
    if log.load is not None and (log.load <= 0).any():
        row = int(np.argmax(log.load <= 0))
        raise LogError(f"{path}, column {names['load']!r}, row {row + first_row}: vertical load is {log.load[row]:g} N")


def _check_agreement(path: Path, names: Mapping[str, str], log: BrakeLog, radius: float) -> None:
    """Units that are wrong by orders of magnitude without being implausible by themselves."""
    ratio = float(np.quantile(radius * log.wheel_speed / log.vehicle_speed, 0.99))
    if not 0.5 < ratio < 1.6:
        raise LogError(
            f"{path}, columns {names['wheel_speed']!r} and {names['vehicle_speed']!r}: a rolling wheel "
            f"of radius {radius:g} m would have R w / v near 1, here it is {ratio:.3g}; "
            "one of them is in another unit, or the radius is wrong"
        )
    if log.acceleration is not None:
        lost = log.vehicle_speed[0] - log.vehicle_speed[-1]
        integral = -np.trapezoid(log.acceleration, log.time)
        if lost > 3 and not 0.5 < integral / lost < 2:
            raise LogError(
                f"{path}, column {names['acceleration']!r}: it integrates to {integral:.3g} m/s where the vehicle lost "
                f"{lost:.3g} m/s; is it in g?"
            )
