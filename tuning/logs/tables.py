"""Logs as files: one reader per format, by the ending of the file's name."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from tuning.logs.csv_reader import read_csv
from tuning.logs.mat_reader import read_mat
from tuning.logs.mdf_reader import read_mdf
from tuning.logs.parquet_reader import read_parquet
from tuning.logs.recording import LogError, Recording

__all__ = ["READERS", "LogError", "column_of", "read_recording", "read_table"]

READERS: dict[str, Callable[[Path], Recording]] = {
    ".csv": read_csv,
    ".parquet": read_parquet,
    ".mat": read_mat,
    ".mf4": read_mdf,
    ".mdf": read_mdf,
}
"""By the ending of the file's name; others are read as `.csv`."""


def read_recording(path: Path) -> Recording:
    """The channels of a log.

    Raises:
        LogError: if there is no such file, or it is not of the format its name says, or holds no samples.
    """
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    recording = READERS.get(path.suffix.lower(), read_csv)(path)
    if not any(len(channel.cells) for channel in recording.channels):
        raise LogError(f"{path}: a header and no samples")
    return recording


def read_table(path: Path) -> pd.DataFrame:
    """A log as a table, every cell text; the index is the row in the file.

    Raises:
        LogError: if there is no such file, or it is not a table with a header of distinct names and a row.
    """
    recording = read_recording(path)
    columns = {}
    for name in recording.names:
        channel = recording.channel(name)
        columns[name] = pd.Series(np.asarray(channel.cells), index=channel.rows, dtype=str)
    if len({len(column) for column in columns.values()}) > 1:
        raise LogError(f"{path}: its columns are not of one length")
    return pd.DataFrame(columns)


def column_of(table: pd.DataFrame, name: str) -> pd.Series:
    """A column of a table whose names are distinct."""
    return pd.Series(table[name])
