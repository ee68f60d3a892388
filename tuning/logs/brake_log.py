"""Brake logs: read, checked, on a uniform grid, in the project's units.

Channels may have any names, units and rates; what reading makes of them is said in `BrakeLog.notes`, what looks wrong
in `BrakeLog.doubts`, and what cannot be used is refused.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tuning.logs.channel_map import BRAKING, COLUMNS, REQUIRED, Choice, Source, checked, parse_columns, sources_of
from tuning.logs.checks import check_agreement, check_sampling, check_values
from tuning.logs.drive import Window, brakings
from tuning.logs.edge_channel import with_wheel_speed
from tuning.logs.edge_speed import EdgeStudy
from tuning.logs.grid import Signal, gaps_of, grid_of
from tuning.logs.quality import Quality, quality_of
from tuning.logs.recording import LogError
from tuning.logs.remarks import doubts_on, notes_on
from tuning.logs.signals import signals_of
from tuning.logs.signs import turned
from tuning.logs.stated import NOTHING, Stated, zero_of
from tuning.logs.tables import read_recording

__all__ = ["COLUMNS", "BrakeLog", "Reading", "parse_columns", "read_log", "reading"]

FEWEST_SAMPLES = 200
SLOWEST = 1.0
"""Vehicle speed below which a log is cut [m/s]: slip has no meaning at rest."""


@dataclasses.dataclass(frozen=True)
class BrakeLog:
    """A checked brake log on a uniform grid: arrays (samples,); signals that were not logged are None."""

    name: str
    time: np.ndarray
    """s, uniform"""
    wheel_speed: np.ndarray
    """rad/s; 0 where the wheel is locked"""
    vehicle_speed: np.ndarray
    """m/s, at least `SLOWEST`"""
    brake_pressure: np.ndarray | None = None
    """bar"""
    acceleration: np.ndarray | None = None
    """longitudinal, m/s^2, negative while braking"""
    force: np.ndarray | None = None
    """longitudinal tyre force, N, negative while braking"""
    load: np.ndarray | None = None
    """vertical, N"""
    measured: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    """by signal, bool (samples,): whether the sample is a measurement, not interpolated, held, clipped or stuck"""
    resolution: Mapping[str, float] = dataclasses.field(default_factory=dict)
    """by signal, the step of its quantisation in its unit; 0 if that is lost in its noise"""
    notes: tuple[str, ...] = ()
    """what reading did"""
    doubts: tuple[str, ...] = ()
    """what looks wrong, and was not refused"""

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals that were logged, but for time."""
        return tuple(name for name in COLUMNS if name != "time" and getattr(self, name) is not None)

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
        cut: dict[str, Any] = {name: getattr(self, name)[inside] for name in ("time", *self.signals)}
        return dataclasses.replace(self, **cut, measured={name: mask[inside] for name, mask in self.measured.items()})


class Reading(NamedTuple):
    """A log, and what it was made of."""

    log: BrakeLog
    sources: dict[str, Source]
    """by signal, the channel it comes from and its unit"""
    signals: list[Signal]
    """at their own instants"""
    qualities: list[Quality]
    """of these"""


def read_log(
    path: str | Path,
    columns: Mapping[str, str | Choice] | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    radius: float = 0.3,
    stated: Stated = NOTHING,
    edges: EdgeStudy | None = None,
) -> BrakeLog:
    """Read and check a brake log.

    Args:
        path: of a format of `tuning.logs.tables.READERS`.
        columns: signal -> "column", "column:unit" or what a channel map says, where they differ from `COLUMNS`.
        start: of the window of time to use [s].
        end: of that window [s].
        radius: wheel radius [m], for speeds of the rim, and the test whether wheel and vehicle speed agree.
        stated: what the car file states of zeros and delays (`tuning.logs.car.Car.stated`): signs and units are judged
            without them.
        edges: of the wheel, on the log's clock; its speed is then made of them, whatever the log has.

    Raises:
        LogError: naming file, column and row of whatever keeps the log from being used.
    """
    return reading(path, columns, start=start, end=end, radius=radius, stated=stated, edges=edges).log


def reading(
    path: str | Path,
    columns: Mapping[str, str | Choice] | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    radius: float = 0.3,
    stated: Stated = NOTHING,
    edges: EdgeStudy | None = None,
) -> Reading:
    """`read_log`, with what it was made of."""
    path = Path(path)
    whole = _on_grid(path, columns, start, end, radius, stated, edges)
    log = _agreeing(path, whole.sources, _moving(path, whole.log), radius, stated)
    windows = ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in _brakings(whole.log, stated))
    notes = (*log.notes, f"somebody brakes after speeding up: {windows}") if windows else log.notes
    return whole._replace(log=dataclasses.replace(log, notes=notes))


def read_brakings(
    path: str | Path,
    columns: Mapping[str, str | Choice] | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    radius: float = 0.3,
    stated: Stated = NOTHING,
    edges: EdgeStudy | None = None,
) -> list[BrakeLog | LogError]:
    """Read a log that may hold several brakings: the log of each, or why it cannot be used.

    A log of one braking is that of `read_log`.

    Args:
        path: as for `read_log`, as are the others.
        columns: where they differ from `COLUMNS`.
        start: of the window of time to use [s].
        end: of that window [s].
        radius: of the wheel [m].
        stated: as for `read_log`.
        edges: of the wheel, if its speed is made of them.

    Raises:
        LogError: as `read_log`.
    """
    path = Path(path)
    whole = _on_grid(path, columns, start, end, radius, stated, edges)
    windows = _brakings(whole.log, stated)
    if not windows:
        return [_agreeing(path, whole.sources, _moving(path, whole.log), radius, stated)]
    found: list[BrakeLog | LogError] = []
    for window in windows:
        try:
            found.append(_agreeing(path, whole.sources, _moving(path, whole.log.window(*window)), radius, stated))
        except LogError as error:
            found.append(error)
    return found


def _brakings(log: BrakeLog, stated: Stated) -> list[Window]:
    """Those of a drive; none of a log of measured force, as of a rig."""
    if log.force is not None:
        return []
    shortest = FEWEST_SAMPLES * log.period
    rate = None if log.acceleration is None else log.acceleration - zero_of("acceleration", stated).value
    return brakings(log.time, log.vehicle_speed, rate, slowest=SLOWEST, shortest=shortest)


def _on_grid(path: Path, columns, start, end, radius: float, stated: Stated, edges: EdgeStudy | None) -> Reading:
    """The whole log, at rest and in motion."""
    recording = read_recording(path)
    columns = dict(columns or {})
    if edges is not None:
        recording = with_wheel_speed(recording, edges)
        columns.pop("wheel_speed", None)
    found, notes = sources_of(recording, checked(columns), radius)
    sources = {source.signal: source for source in found}
    signals, left_out = signals_of(recording, found, radius)
    signals, empty = _filled(path, signals)
    _check_size(path, sources, signals)
    signals = _windowed(path, signals, start, end)
    signals, signs = turned(signals, {name for name, source in sources.items() if source.choice.sign}, radius, stated)
    check_values(path, signals, stated)
    qualities = [
        quality_of(signal.name, signal.time, signal.values, zero_of(signal.name, stated)) for signal in signals
    ]
    for signal, quality in zip(signals, qualities):
        gaps_of(path, signal, quality.taken)
    grid = grid_of(signals, qualities)
    if grid.time.size < FEWEST_SAMPLES:
        raise LogError(f"{path}: {grid.time.size} samples of all signals together, {FEWEST_SAMPLES} needed")
    log = BrakeLog(
        path.name,
        grid.time,
        **grid.values,
        measured=grid.measured,
        resolution={signal.name: quality.resolution for signal, quality in zip(signals, qualities)},
        notes=(*recording.notes, *notes, *left_out, *empty, *signs, *notes_on(path, signals, qualities, grid)),
        doubts=(*(edges.reasons if edges else ()), *doubts_on(signals, qualities)),
    )
    return Reading(log, sources, signals, qualities)


def _agreeing(path: Path, sources: Mapping[str, Source], log: BrakeLog, radius: float, stated: Stated) -> BrakeLog:
    doubts = check_agreement(path, sources, log, radius, stated)
    return dataclasses.replace(log, doubts=(*log.doubts, *doubts))


def _filled(path: Path, signals: list[Signal]) -> tuple[list[Signal], list[str]]:
    """Signals that have samples, and what was left out."""
    empty = [signal for signal in signals if signal.time.size < 2]
    filled = [signal for signal in signals if signal.time.size >= 2]
    for signal in empty:
        if signal.name in REQUIRED or not {kept.name for kept in filled} & set(BRAKING):
            raise LogError(f"{path}, column {signal.channel.name!r}: {signal.time.size} samples of {signal.name}")
    return filled, [f"{signal.name}: column {signal.channel.name!r} is empty; left out" for signal in empty]


def _check_size(path: Path, sources: Mapping[str, Source], signals: list[Signal]) -> None:
    most = max(signal.time.size for signal in signals)
    if most < FEWEST_SAMPLES:
        raise LogError(f"{path}: {most} samples, {FEWEST_SAMPLES} needed")
    clock = sources["time"].channel.name if "time" in sources else signals[0].channel.name
    check_sampling(path, clock, min(float(np.median(np.diff(signal.time))) for signal in signals))


def _windowed(path: Path, signals: list[Signal], start: float | None, end: float | None) -> list[Signal]:
    low, high = -np.inf if start is None else start, np.inf if end is None else end
    cut = [signal.only((signal.time >= low) & (signal.time <= high)) for signal in signals]
    most = max(signal.time.size for signal in cut)
    if most < FEWEST_SAMPLES or min(signal.time.size for signal in cut) < 2:
        raise LogError(f"{path}: {most} samples between {low:g} s and {high:g} s, {FEWEST_SAMPLES} needed")
    return cut


def _moving(path: Path, log: BrakeLog) -> BrakeLog:
    """The longest stretch in which the vehicle moves.

    Raises:
        LogError: if it is too short.
    """
    moving = log.vehicle_speed >= SLOWEST
    if moving.all():
        return log
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(int)))
    first, last = edges[::2], edges[1::2] - 1
    if not first.size or (last - first).max() + 1 < FEWEST_SAMPLES:
        most = int((last - first).max()) + 1 if first.size else 0
        raise LogError(
            f"{path}: {most} samples in a row in which the vehicle is faster than {SLOWEST:g} m/s, "
            f"{FEWEST_SAMPLES} needed; slip has no meaning at rest"
        )
    longest = int(np.argmax(last - first))
    start, end = float(log.time[first[longest]]), float(log.time[last[longest]])
    note = f"cut to {start:g} to {end:g} s: elsewhere the vehicle is slower than {SLOWEST:g} m/s"
    return dataclasses.replace(log.window(start, end), notes=(*log.notes, note))
