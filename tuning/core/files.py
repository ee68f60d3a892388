"""Results as files: JSON written whole or not at all."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas


def write_json(path: Path, data: dict[str, Any]) -> Path:
    """Write `data`; an existing file is replaced only by a complete one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(path.suffix + ".part")
    unfinished.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n")
    os.replace(unfinished, path)
    return path


def write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> Path:
    """Write rows with the same keys: a key a column."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pandas.DataFrame(list(rows)).to_csv(path, index=False)
    return path


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        ValueError: if there is no such file or it is not JSON; names file, line and column.
    """
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    try:
        return json.loads(path.read_text())
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}, line {error.lineno}, column {error.colno}: not JSON: {error.msg}") from None
