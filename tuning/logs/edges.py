"""Logs of encoder edges as they come: instants in ticks or seconds, periods between edges, levels of a logic analyser.

All become integer ticks of a clock that never goes back. What reading makes of a log is said in `EdgeLog.notes`, what
looks wrong in `EdgeLog.doubts`; which edge is which tooth is found by `tuning.logs.teeth`.
"""

import dataclasses
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from tuning.logs.edge_clock import Unwrapped, check_fine, unwrapped
from tuning.logs.names import may_be, stated
from tuning.logs.recording import Channel, LogError, Recording, numbers
from tuning.logs.tables import read_recording

Kind = Literal["ticks", "seconds", "periods", "levels"]
KINDS: tuple[Kind, ...] = ("ticks", "seconds", "periods", "levels")
FEWEST_REVOLUTIONS = 5
SHORTEST_TICK = 1e-9
"""s; half a second of shorter ones would not be told apart in 32 bits"""
FASTEST = 700.0
"""Wheel speed that is not plausible any more, rad/s."""
SLOWEST = 0.5
"""Median wheel speed below which the clock is taken for a mistake, rad/s."""
PERIOD_NAMES = ("period", "interval", "delta", "width", "dt")
"""What names of channels of periods hold."""
TICK_NAMES = ("edge_tick", "ticks", "tick", "edges", "edge", "stamp", "stamps", "capture", "micros")
"""Of channels of instants, beside those of a time."""
DECIMALS = 9
"""Of seconds that count."""


@dataclasses.dataclass(frozen=True)
class EdgeLog:
    """A checked log of the edges of an encoder."""

    name: str
    stamps: np.ndarray
    """clock ticks, integers that increase"""
    clock: float
    """length of a tick, s"""
    teeth: int
    """N, as declared"""
    step: int = 1
    """ticks the clock moves at a time"""
    wraps: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0, np.int64))
    """edges at which the counter had overflowed"""
    modulus: int = 0
    """ticks after which the counter overflows; 0 if it never did"""
    notes: tuple[str, ...] = ()
    """what reading did"""
    doubts: tuple[str, ...] = ()
    """what looks wrong, and was not refused"""


class _Found(NamedTuple):
    """The channel the edges are in, and what it holds."""

    channel: Channel
    kind: Kind
    level: Channel | None
    scale: float | None
    """of the cells [s], where the name or the file states a unit"""


def read_edges(
    path: str | Path,
    *,
    teeth: int,
    clock: float | None = None,
    column: str | None = None,
    kind: Kind | None = None,
) -> EdgeLog:
    """Read and check the edges of an encoder, one row an edge; with levels, one row a sample or a change.

    Args:
        path: of a format of `tuning.logs.tables.READERS`.
        teeth: N of the encoder, missing ones counted.
        clock: length of a tick [s]; as the file states it, or 1 us, if None.
        column: with the edges; known by its name if None.
        kind: what it holds; known by names and cells if None.

    Raises:
        LogError: naming file, column and row of whatever keeps the log from being used.
    """
    path = Path(path)
    if teeth < 3:
        raise LogError(f"teeth = {teeth}; an encoder has at least 3")
    if clock is not None and not SHORTEST_TICK <= clock < 1:
        raise LogError(f"clock = {clock:g} s must be at least {SHORTEST_TICK:g} and below 1")
    if kind is not None and kind not in KINDS:
        raise LogError(f"kind = {kind!r} is unknown; there are {', '.join(KINDS)}")
    recording = read_recording(path)
    found = _found(recording, column, kind)
    cells, rows, notes = _told(recording, found)
    place = f"{path}, column {found.channel.name!r}"
    stamps, tick, said = _ticks(place, found, cells, rows, clock)
    notes += [*recording.notes, *said]
    if found.kind == "ticks" and stamps.size > 2 and _cut_off(stamps):
        notes.append(f"the last row, {rows[-1]}, is cut off; left out")
        stamps = stamps[:-1]
    unwrap = unwrapped(place, stamps, rows) if found.kind != "periods" else Unwrapped(stamps)
    notes += unwrap.notes
    stamps, wraps = unwrap.stamps, unwrap.wraps
    again = np.diff(stamps) == 0
    if again.any():
        kept = np.concatenate([[True], ~again])
        wraps = np.cumsum(kept)[wraps] - 1
        stamps = stamps[kept]
        notes.append(f"{again.sum()} edges at the instant of the edge before; left out")
    if stamps.size < FEWEST_REVOLUTIONS * teeth:
        raise LogError(f"{path}: {stamps.size} edges, {FEWEST_REVOLUTIONS} revolutions of {teeth} needed")
    steps = np.diff(stamps)
    speed = 2 * np.pi / teeth / (np.median(steps) * tick)
    step, doubts = check_fine(place, steps, tick, int(again.sum()))
    if not SLOWEST < speed < FASTEST:
        raise LogError(
            f"{place}: with {teeth} teeth and ticks of {tick:g} s the wheel turns at {speed:.3g} rad/s; "
            "is the clock right?"
        )
    return EdgeLog(path.name, stamps, tick, teeth, step, wraps, unwrap.modulus, tuple(notes), tuple(doubts))


def _found(recording: Recording, column: str | None, kind: Kind | None) -> _Found:
    """The channel of the edges: the one named, or the only one whose name says so."""
    level = None
    if kind in (None, "levels"):
        level = _level(recording, column, needed=kind == "levels")
    rest = [channel for channel in recording.channels if level is None or channel.name != level.name]
    if column is not None:
        channel = recording.channel(column)
    elif len(rest) == 1:
        channel = rest[0]
    else:
        named = [c for c in rest if _names_edges(c.name)] or [c for c in rest if _is_time(c.name)]
        if len(named) != 1:
            names = ", ".join(map(repr, [c.name for c in named or rest]))
            raise LogError(f"{recording.path}: {names} may each be the edges; declare one with --column")
        channel = named[0]
    bare, unit = stated("time", channel.name)
    scale = unit.factor if unit else _scale(channel.unit)
    if level is not None:
        return _Found(channel, "levels", level, scale)
    if kind is None:
        if any(word in bare.lower() for word in PERIOD_NAMES):
            kind = "periods"
        else:
            kind = "ticks" if _whole(channel) and scale in (None, 1e-6, 1e-9, 1e-3) else "seconds"
    return _Found(channel, kind, None, scale)


def _names_edges(name: str) -> bool:
    bare = stated("time", name)[0].lower()
    return bare in TICK_NAMES or any(word in bare.split("_") for word in PERIOD_NAMES)


def _is_time(name: str) -> bool:
    return may_be("time", name)


def _scale(unit: str) -> float | None:
    found = stated("time", f"t [{unit}]")[1] if unit else None
    return found.factor if found else None


def _level(recording: Recording, column: str | None, *, needed: bool) -> Channel | None:
    """The channel whose cells are 0 and 1, and both."""
    found = []
    for channel in recording.channels:
        if channel.name == column or len(recording.channels) < 2:
            continue
        cells = pd.Series(channel.cells).astype(str).str.strip()
        if set(cells.unique()[:4]) in ({"0", "1"}, {"0.0", "1.0"}):
            found.append(channel)
    if len(found) > 1:
        names = ", ".join(repr(channel.name) for channel in found)
        raise LogError(f"{recording.path}: {names} may each be the level; leave only one in the file")
    if needed and not found:
        raise LogError(f"{recording.path}: no column of levels, 0 and 1; there are {', '.join(recording.names)}")
    return found[0] if found else None


def _text(channel: Channel) -> pd.Series:
    return pd.Series(channel.cells).astype(str).str.strip().str.replace(channel.decimal, ".", regex=False)


def _whole(channel: Channel) -> bool:
    cells = pd.Series(channel.cells)
    if pd.api.types.is_numeric_dtype(cells):
        return bool((cells == cells.round()).all())
    return bool(_text(channel).str.fullmatch(r"[+-]?\d{1,18}(\.0*)?").mean() > 0.5)


def _told(recording: Recording, found: _Found) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Indices of the cells that are edges; the lines they stand in; notes."""
    count = len(found.channel.cells)
    rows = np.arange(count) + 1 if found.channel.rows is None else np.asarray(found.channel.rows)
    if found.level is None:
        return np.arange(count), rows, []
    level = numbers(recording.path, found.level)
    if len(level) != count:
        raise LogError(f"{recording.path}: {len(level)} levels and {count} instants")
    up = np.flatnonzero((level[1:] == 1) & (level[:-1] == 0)) + 1
    if level[0] == 1 and count > 1 and level[1] == 0:
        up = np.concatenate([[0], up])
    note = f"levels of {found.level.name!r}: {up.size} rising edges taken, of {count} rows"
    return up, rows[up], [note]


def _ticks(place: str, found: _Found, kept: np.ndarray, rows: np.ndarray, clock: float | None):
    """Stamps of the cells kept, integers; the length of a tick; notes."""
    if found.kind == "ticks":
        tick = clock or found.scale or 1e-6
        return _integers(place, found.channel, kept, rows), tick, []
    if found.kind == "periods" and _whole(found.channel):
        tick = clock or found.scale or 1e-6
        periods = _integers(place, found.channel, kept, rows)
        bad = periods <= 0
        if bad.any():
            at = int(np.argmax(bad))
            raise LogError(f"{place}, row {rows[at]}: {periods[at]} is no period ({bad.sum()} such rows)")
        note = f"{periods.size} periods in ticks of {tick:g} s, summed; time from the first edge on"
        return np.concatenate([[0], np.cumsum(periods)]), tick, [note]
    scale = found.scale or (clock if clock is not None and found.kind == "periods" else 1.0)
    values = numbers_of(place, found.channel, kept, rows) * scale
    decimals = _decimals(found.channel, kept, scale)
    tick = 10.0**-decimals
    if np.abs(values).max(initial=0) / tick > 2**62:
        raise LogError(f"{place}: instants of up to {np.abs(values).max():g} s are not told apart to {tick:g} s")
    if found.kind == "periods":
        values = np.concatenate([[0.0], np.cumsum(values)])
    note = f"{found.kind if found.kind != 'levels' else 'instants'} in seconds, to {tick:g} s"
    return np.round(values / tick).astype(np.int64), tick, [note]


def _cut_off(stamps: np.ndarray) -> bool:
    """Whether the last number is the beginning of a longer one."""
    last, before = str(stamps[-1]), str(stamps[-2])
    back = np.flatnonzero(np.diff(stamps) < 0)
    return back.tolist() == [stamps.size - 2] and len(last) < len(before) and before.startswith(last[:-1])


def _decimals(channel: Channel, kept: np.ndarray, scale: float) -> int:
    """Decimals of a second that are written."""
    shift = -round(np.log10(scale))
    cells = pd.Series(channel.cells)
    if pd.api.types.is_numeric_dtype(cells):
        return DECIMALS
    text = _text(channel).iloc[kept]
    if text.str.contains("[eE]").any():
        return DECIMALS
    written = text.str.partition(".")[2].str.len().max()
    return int(np.clip(written + shift, 1, DECIMALS))


def numbers_of(place: str, channel: Channel, kept: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Cells as numbers.

    Raises:
        LogError: naming the row of the first that is none.
    """
    values = np.array(pd.to_numeric(_text(channel).iloc[kept], errors="coerce"), float)
    bad = ~np.isfinite(values)
    if bad.any():
        at = int(np.argmax(bad))
        shown = pd.Series(channel.cells).iloc[kept[at]] or "empty"
        raise LogError(f"{place}, row {rows[at]}: {shown!r} is not a number ({bad.sum()} such rows)")
    return values


def _integers(place: str, channel: Channel, kept: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Exactly, however large: no number of a text passes through a float."""
    cells = pd.Series(channel.cells).iloc[kept]
    if pd.api.types.is_integer_dtype(cells):
        return cells.to_numpy(np.int64)
    if pd.api.types.is_numeric_dtype(cells):
        return np.round(numbers_of(place, channel, kept, rows)).astype(np.int64)
    text = _text(channel).iloc[kept]
    good = text.str.fullmatch(r"[+-]?\d{1,18}(\.0*)?")
    if not good.all():
        at = int(np.argmin(good.to_numpy()))
        shown = cells.iloc[at] or "empty"
        raise LogError(f"{place}, row {rows[at]}: {shown!r} is not an integer number of ticks")
    return text.str.partition(".")[0].astype(np.int64).to_numpy()
