"""Logs of encoder edges: integer clock ticks from a CSV file, read and checked."""

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd

from tuning.logs.tables import LogError, column_of, read_table

FEWEST_REVOLUTIONS = 5
SHORTEST_TICK = 1e-9
"""s; half a second of shorter ones would not be told apart in 32 bits"""
FASTEST = 700.0
"""Wheel speed that is not plausible any more, rad/s."""
SLOWEST = 0.5
"""Median wheel speed below which the clock is taken for a mistake, rad/s."""


@dataclasses.dataclass(frozen=True)
class EdgeLog:
    """A checked log of the edges of an encoder."""

    name: str
    stamps: np.ndarray
    """clock ticks, integers that increase"""
    clock: float
    """length of a tick, s"""
    teeth: int
    """N"""


def read_edges(path: str | Path, *, teeth: int, clock: float = 1e-6, column: str = "edge_tick") -> EdgeLog:
    """Read and check the edge times of an encoder, one row an edge.

    Args:
        path: a CSV file with a header row.
        teeth: N of the encoder.
        clock: length of a tick [s].
        column: with the instants of the edges in ticks.

    Raises:
        LogError: naming file, column and row (the header is row 1) of whatever keeps the log from being used.
    """
    path = Path(path)
    if teeth < 3:
        raise LogError(f"teeth = {teeth}; an encoder has at least 3")
    if not SHORTEST_TICK <= clock < 1:
        raise LogError(f"clock = {clock:g} s must be at least {SHORTEST_TICK:g} and below 1")
    table = read_table(path)
    if column not in table.columns:
        raise LogError(f"{path}: no column {column!r}; there are {', '.join(map(str, table.columns))}")
    stamps = _integers(path, column, column_of(table, column))
    steps = np.diff(stamps)
    for bad, what in ((steps == 0, "repeats the edge before it"), (steps < 0, "goes back in time")):
        if bad.any():
            row = int(np.argmax(bad)) + 3
            raise LogError(
                f"{path}, column {column!r}, row {row}: {stamps[row - 2]} {what}; "
                "has the counter overflowed, or is there more than one channel?"
            )
    if stamps.size < FEWEST_REVOLUTIONS * teeth:
        raise LogError(f"{path}: {stamps.size} edges, {FEWEST_REVOLUTIONS} revolutions of {teeth} needed")
    speed = 2 * np.pi / teeth / (np.median(steps) * clock)
    if not SLOWEST < speed < FASTEST:
        raise LogError(
            f"{path}, column {column!r}: with {teeth} teeth and ticks of {clock:g} s the wheel turns at "
            f"{speed:.3g} rad/s; is the clock right?"
        )
    return EdgeLog(path.name, stamps, clock, teeth)


def _integers(path: Path, column: str, cells: pd.Series) -> np.ndarray:
    """Exactly, however large: no number passes through a float."""
    stripped = cells.str.strip()
    good = stripped.str.fullmatch(r"[+-]?\d{1,18}(\.0*)?")
    if not good.all():
        row = int(np.argmin(good.to_numpy()))
        shown = cells.iloc[row] or "empty"
        raise LogError(f"{path}, column {column!r}, row {row + 2}: {shown!r} is not an integer number of ticks")
    return stripped.str.partition(".")[0].astype(np.int64).to_numpy()
