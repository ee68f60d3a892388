"""Tables of logs, one reader per format: by the ending of the file's name."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd


class LogError(ValueError):
    """A log that cannot be used; the message names file, column and row (the header is row 1)."""


def read_csv(path: Path) -> pd.DataFrame:
    """A CSV file as it stands, every cell text.

    Raises:
        LogError: if it is not a table with a header of distinct names.
    """
    try:
        header = pd.read_csv(path, header=None, nrows=1, dtype=str).iloc[0]
        table = pd.read_csv(path, dtype=str, keep_default_na=False, skipinitialspace=True)
    except pd.errors.EmptyDataError:
        raise LogError(f"{path}: the file is empty") from None
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: not a table of comma-separated values: {error}") from None
    repeated = header[header.duplicated()]
    if len(repeated):
        raise LogError(f"{path}: column {repeated.iloc[0]!r} stands twice in the header")
    return table


READERS: dict[str, Callable[[Path], pd.DataFrame]] = {".csv": read_csv}
"""By the ending of the file's name; others are read as `.csv`."""


def read_table(path: Path) -> pd.DataFrame:
    """A log as a table, every cell text.

    Raises:
        LogError: if there is no such file, or it is not a table with a header of distinct names and a row.
    """
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    table = READERS.get(path.suffix.lower(), read_csv)(path)
    if not len(table):
        raise LogError(f"{path}: a header and no samples")
    return table


def column_of(table: pd.DataFrame, name: str) -> pd.Series:
    """A column of a table whose names are distinct."""
    return pd.Series(table[name])
