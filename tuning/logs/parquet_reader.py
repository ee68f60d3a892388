"""Parquet: columns of numbers, text or instants; a unit may stand in a column's metadata."""

from pathlib import Path

import numpy as np

from tuning.logs.recording import Channel, LogError, Recording, needs


def read_parquet(path: Path) -> Recording:
    """The columns of a Parquet file.

    Raises:
        LogError: if it is none, or `pyarrow` is not installed.
    """
    with needs(path, "Parquet", "formats"):
        import pyarrow
        from pyarrow import parquet
    try:
        table = parquet.read_table(path)
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise LogError(f"{path}: not a Parquet file: {error}") from None
    rows = np.arange(table.num_rows) + 1
    units = [(field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") for field in table.schema]
    cells = [column.to_pandas() for column in table.columns]
    return Recording(
        path,
        tuple(Channel(name, column, unit, None, rows) for name, column, unit in zip(table.column_names, cells, units)),
    )
