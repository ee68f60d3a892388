"""The time of a log: numbers in a unit, or dates and times of day, from the first sample on where it is absolute."""

from pathlib import Path

import numpy as np
import pandas as pd

from tuning.logs.channel_map import Source
from tuning.logs.recording import MISSING, LogError, numbers

EPOCHS = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"), (1e8, 1.0, "s"))
"""Smallest number, its unit [s], and its name, of a time since 1970: nothing else is as large."""


def instants(path: Path, source: Source) -> tuple[np.ndarray, list[str]]:
    """Time of the samples [s], NaN where a cell is empty; and notes.

    Raises:
        LogError: naming file, column and row of a cell that is no time.
    """
    cells = pd.Series(source.channel.cells)
    if pd.api.types.is_datetime64_any_dtype(cells):
        return _since_first(cells), ["time is absolute; counted from the first row"]
    if not pd.api.types.is_numeric_dtype(cells) and _is_written(cells):
        return _written(path, source, cells), ["time is of the day or absolute; counted from the first row"]
    values = numbers(path, source.channel)
    largest = np.nanmax(np.abs(values), initial=0)
    for least, scale, name in EPOCHS:
        if largest >= least and (source.choice.unit is None or least == EPOCHS[-1][0]):
            if source.choice.unit is not None:
                scale, name = source.unit.factor, source.unit.text
            first = values[np.flatnonzero(np.isfinite(values))[0]]
            return (values - first) * scale, [f"time is absolute, in {name} since 1970; counted from the first row"]
    return source.converted(values, 1.0), []


def _since_first(moments: pd.Series) -> np.ndarray:
    first = moments.dropna().iloc[:1].to_list()
    return np.array((moments - first[0]).dt.total_seconds() if first else np.full(len(moments), np.nan), float)


def _is_written(cells: pd.Series) -> bool:
    """Whether the first cell that is not empty is a date or a time of day."""
    told = [cell for cell in cells.iloc[:50].astype(str) if cell.strip().lower() not in MISSING]
    return bool(told) and ":" in told[0]


def _written(path: Path, source: Source, cells: pd.Series) -> np.ndarray:
    text = cells.astype(str).str.strip().str.replace(",", ".", regex=False)
    if "-" in text.iloc[0]:
        seconds = _since_first(pd.to_datetime(pd.Series(text), errors="coerce", format="ISO8601", utc=True))
    else:
        parts = text.str.split(":", expand=True).apply(pd.to_numeric, errors="coerce")
        places = 60.0 ** np.arange(parts.shape[1])[::-1]
        seconds = (parts.to_numpy(float) * places).sum(axis=1)
        seconds = seconds - seconds[np.flatnonzero(np.isfinite(seconds))[:1]].sum()
    bad = np.flatnonzero(~np.isfinite(seconds) & ~text.str.lower().isin(MISSING).to_numpy())
    if bad.size:
        channel = source.channel
        raise LogError(
            f"{path}, column {channel.name!r}, {channel.place(int(bad[0]))}: {text.iloc[bad[0]]!r} is neither "
            f"an ISO date with a time nor a time of day ({bad.size} such rows)"
        )
    return seconds
