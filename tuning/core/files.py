"""Files: JSON read strictly and written whole or not at all, tables, and the folder a task writes to."""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from importlib import resources
from pathlib import Path
from typing import Any

import pandas

LARGEST_JSON = 2**24
"""Bytes of a JSON file; more is no configuration."""


def write_json(path: Path, data: dict[str, Any]) -> Path:
    """Write `data`; an existing file is replaced only by a complete one."""
    return write_whole(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def write_whole(path: Path, text: str) -> Path:
    """Write text as UTF-8; an existing file is replaced only by a complete one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(path.suffix + ".part")
    unfinished.write_bytes(text.encode("utf-8", "replace"))
    os.replace(unfinished, path)
    return path


def write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> Path:
    """Write rows with the same keys: a key a column."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pandas.DataFrame(list(rows)).to_csv(path, index=False)
    return path


def read_json(path: Path) -> Any:
    """Read a JSON file, with or without a byte order mark.

    Raises:
        ValueError: if there is no such file, or it is not JSON with distinct keys; names the file, and where.
    """
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    if path.stat().st_size > LARGEST_JSON:
        raise ValueError(f"{path}: {path.stat().st_size} bytes; {LARGEST_JSON} at most")
    try:
        return json.loads(path.read_text("utf-8-sig"), object_pairs_hook=_distinct)
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}, line {error.lineno}, column {error.colno}: not JSON: {error.msg}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not JSON: byte {error.start} is not UTF-8") from None
    except RecursionError:
        raise ValueError(f"{path}: not a configuration: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def data_folder() -> AbstractContextManager[Path]:
    """The package's data, as a folder while the context lasts."""
    return resources.as_file(resources.files("tuning") / "data")


def shipped(name: str) -> Any:
    """A JSON file among the package's data."""
    with data_folder() as data:
        return read_json(data / name)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {key!r} stands twice")
        found[key] = value
    return found


def require_folder(out: Path, inputs: Sequence[Path | None] = (), *, force: bool = False, resume: bool = False) -> None:
    """Check, before work begins, that a folder can be written to. It is not made yet.

    Args:
        inputs: files the task reads, which it must not overwrite.
        force: whether the files of another run may be replaced.
        resume: whether it is the folder of a run that goes on.

    Raises:
        ValueError: if it is no folder or not writable, holds an input, or another run; says what to do.
    """
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: there is a file of that name; a folder is needed")
    ancestor = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not (ancestor.is_dir() and os.access(ancestor, os.W_OK | os.X_OK)):
        raise ValueError(f"--out {out}: {ancestor} is not a folder that can be written to")
    for path in inputs:
        if path is not None and path.is_file() and out.resolve() in path.resolve().parents:
            raise ValueError(f"--out {out}: the input {path} lies in it and may be overwritten; choose another folder")
    if out.is_dir() and any(out.iterdir()) and not (force or resume):
        raise ValueError(f"--out {out}: the folder is not empty; choose another, or --force to overwrite what is there")
