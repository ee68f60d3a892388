"""From channels to signals: cells to numbers, numbers to the project's units, samples at increasing instants."""

from collections.abc import Sequence

import numpy as np

from tuning.logs.channel_map import Source
from tuning.logs.grid import Signal
from tuning.logs.instants import instants
from tuning.logs.recording import Channel, LogError, Recording, numbers


def signals_of(recording: Recording, sources: Sequence[Source], radius: float) -> tuple[list[Signal], list[str]]:
    """The signals of a recording, but for time, each at the instants at which it has a measurement; and notes.

    Args:
        recording: what the file holds.
        sources: where signals come from, `time` among them if channels do not bring their own.
        radius: of the wheel [m], for speeds of its rim.

    Raises:
        LogError: naming file, column and row of a cell that is no number, or a time that does not increase.
    """
    clock = next((source for source in sources if source.signal == "time"), None)
    rest = [source for source in sources if source.signal != "time"]
    cells = {source.signal: numbers(recording.path, source.channel) for source in rest}
    shared, notes = instants(recording.path, clock) if clock else (None, [])
    found: dict[str, Signal] = {}
    kept: dict[int, np.ndarray] = {}
    for source in rest:
        own = source.channel.time
        time, channel = (own, source.channel) if own is not None else (shared, clock and clock.channel)
        if time is None or channel is None:
            raise LogError(f"{recording.path}, column {source.channel.name!r}: no time; declare it as time=COLUMN")
        if len(cells[source.signal]) != len(time):
            raise LogError(
                f"{recording.path}, column {source.channel.name!r}: {len(cells[source.signal])} samples, "
                f"{channel.name!r} has {len(time)}"
            )
        if id(time) not in kept:
            beside = [cells[other.signal] for other in rest if own is None or other.channel.time is own]
            beside = [values for values in beside if len(values) == len(time)]
            kept[id(time)] = _increasing(recording, channel, time, beside, notes)
        there = kept[id(time)]
        found[source.signal] = _signal(source, time[there], cells[source.signal][there], there, radius)
    for source in rest:
        if source.unit.kind == "slip":
            found[source.signal] = _from_slip(found[source.signal], found["vehicle_speed"], radius)
    return list(found.values()), notes


def _signal(source: Source, time: np.ndarray, cells: np.ndarray, index: np.ndarray, radius: float) -> Signal:
    there = np.isfinite(cells)
    values = source.converted(cells[there], radius)
    return Signal(source.signal, source.channel, time[there] - source.choice.delay, values, index[there])


def _from_slip(slip: Signal, vehicle: Signal, radius: float) -> Signal:
    """w = (1 + lambda) v / R."""
    speed = np.interp(slip.time, vehicle.time, vehicle.values) if vehicle.time.size else np.zeros(slip.time.size)
    return slip.with_values((1 + slip.values) * speed / radius)


def _increasing(recording: Recording, clock: Channel, time: np.ndarray, cells: list[np.ndarray], notes: list[str]):
    """Indices of the samples to keep: rows without a time, and repeated rows, left out."""
    kept = np.flatnonzero(np.isfinite(time))
    if kept.size < len(time):
        notes.append(f"{len(time) - kept.size} rows without a time left out")
    repeated = np.flatnonzero(np.diff(time[kept]) == 0) + 1
    if repeated.size:
        here, before = kept[repeated], kept[repeated - 1]
        same = np.all([(c[here] == c[before]) | np.isnan(c[here]) for c in cells], axis=0)
        if same.all():
            kept = np.delete(kept, repeated)
            notes.append(f"{repeated.size} rows that repeat the row before left out")
    steps = np.diff(time[kept])
    for bad, what in ((steps == 0, "repeats the time before it"), (steps < 0, "goes back in time")):
        if bad.any():
            at = int(kept[int(np.argmax(bad)) + 1])
            raise LogError(f"{recording.path}, column {clock.name!r}, {clock.place(at)}: {time[at]:g} s {what}")
    return kept
