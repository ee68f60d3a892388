"""What a file of a log holds, before anybody says what it means: channels, each with its cells, unit and places."""

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

MISSING = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-")
"""Texts, in small letters, that say that there is no measurement in a cell."""


class LogError(ValueError):
    """A log that cannot be used; the message names file, column and row (the line of the file)."""


@dataclasses.dataclass(frozen=True)
class Channel:
    """A channel as the file has it.

    Attributes:
        name: in the file.
        cells: text or numbers, one a sample; `MISSING` text or NaN where there is none.
        unit: as the file says it; empty where it does not.
        time: of each sample [s], where the format gives it; None where the time is a channel beside.
        rows: lines of the file; None where a file has no lines: then samples are counted from 1.
        decimal: decimal sign of text.
    """

    name: str
    cells: Any
    unit: str = ""
    time: np.ndarray | None = None
    rows: np.ndarray | None = None
    decimal: str = "."

    def place(self, index: int) -> str:
        """Where a sample stands, for messages."""
        return f"sample {index + 1}" if self.rows is None else f"row {self.rows[index]}"


@dataclasses.dataclass(frozen=True)
class Recording:
    """The channels of a file."""

    path: Path
    channels: tuple[Channel, ...]
    notes: tuple[str, ...] = ()
    """what reading left out"""

    @property
    def names(self) -> list[str]:
        """Of the channels, in the order of the file."""
        return [channel.name for channel in self.channels]

    def channel(self, name: str) -> Channel:
        """The channel of a name.

        Raises:
            LogError: if there is none, or more than one.
        """
        found = [channel for channel in self.channels if channel.name == name]
        if not found:
            raise LogError(f"{self.path}: no column {name!r}; there are {', '.join(self.names)}")
        if len(found) > 1:
            raise LogError(f"{self.path}: column {name!r} stands twice in the header")
        return found[0]


@contextlib.contextmanager
def needs(path: Path, what: str, extra: str) -> Iterator[None]:
    """What is imported inside is an extra of the project.

    Raises:
        LogError: naming the file and what to install, where it is missing.
    """
    try:
        yield
    except ImportError as error:
        raise LogError(f"{path}: {what} need {error.name}: pip install 'absjax[{extra}]'") from None


def table_recording(
    path: Path,
    table: pd.DataFrame,
    *,
    units: Sequence[str] = (),
    rows: np.ndarray | None = None,
    decimal: str = ".",
    notes: Sequence[str] = (),
) -> Recording:
    """A recording whose channels share their rows.

    Args:
        table: a column a channel.
        units: as the file says them, in the order of the columns.
        rows: line of the file of each row; without them the header is line 1.
        decimal: decimal sign of text.
        notes: what reading left out.
    """
    rows = np.arange(len(table)) + 2 if rows is None else rows
    units = units or [""] * table.shape[1]
    channels = [
        Channel(str(name), table.iloc[:, i], unit, None, rows, decimal)
        for i, (name, unit) in enumerate(zip(table.columns, units))
    ]
    return Recording(path, tuple(channels), tuple(notes))


def numbers(path: Path, channel: Channel) -> np.ndarray:
    """The cells of a channel as numbers, NaN where there is no measurement.

    Raises:
        LogError: at the first cell that is neither a finite number nor empty.
    """
    cells = pd.Series(channel.cells)
    if channel.decimal != "." and not pd.api.types.is_numeric_dtype(cells):
        cells = cells.str.replace(channel.decimal, ".", regex=False)
    values = np.array(pd.to_numeric(cells, errors="coerce"), float)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size and not pd.api.types.is_numeric_dtype(cells):
        missing = cells.iloc[bad].astype(str).str.strip().str.lower().isin(MISSING).to_numpy()
        values[bad[missing]] = np.nan
        bad = bad[~missing]
    else:
        bad = bad[np.isinf(values[bad])]
    if bad.size:
        shown = pd.Series(channel.cells).iloc[bad[0]]
        raise LogError(
            f"{path}, column {channel.name!r}, {channel.place(bad[0])}: {shown!r} is not a finite number "
            f"({bad.size} such rows)"
        )
    return values
