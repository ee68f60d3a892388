"""MATLAB files: vectors, in structures or not, of versions up to 7 (by SciPy) and of 7.3 (HDF5, by h5py).

A structure with a vector `Time` and one `Value` (or `Data`) of the same length is a channel with its own instants, as
loggers export them. Vectors of units beside names, as tyre rigs export them (`channel.name`, `channel.units`), are
taken for units.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tuning.logs.recording import Channel, LogError, Recording, needs

HDF = b"\x89HDF"
LONGEST_HEADER = 4096
"""Bytes within which an HDF5 file begins: MATLAB writes a header of its own before it."""
DEEPEST = 8
"""Structures within structures that are followed."""
INSTANTS, VALUES, UNITS = ("time", "t"), ("value", "values", "data"), ("unit", "units")
"""Names of the entries of a channel, in small letters."""


def read_mat(path: Path) -> Recording:
    """The vectors of a MATLAB file.

    Raises:
        LogError: if it is none or holds no vectors, or `h5py` is needed and not installed.
    """
    with path.open("rb") as file:
        modern = HDF in file.read(LONGEST_HEADER)
    held = _modern(path) if modern else _classic(path)
    units = _named_units(held)
    channels = [
        Channel(name, values, unit or units.get(name, ""), time) for name, values, unit, time in _channels(held)
    ]
    if not channels:
        raise LogError(f"{path}: no vectors of numbers in it; tables and timetables must be saved as structures")
    return Recording(path, tuple(channels))


def _classic(path: Path) -> Mapping[str, Any]:
    from scipy.io import loadmat

    try:
        held = loadmat(path, simplify_cells=True)
    except Exception as error:  # SciPy raises what its parser stumbles over: any kind
        raise LogError(f"{path}: not a MATLAB file: {error}") from None
    return {name: value for name, value in held.items() if not name.startswith("__")}


def _modern(path: Path) -> Mapping[str, Any]:
    with needs(path, "MATLAB files of version 7.3", "formats"):
        import h5py

    def plain(item, depth=0) -> Any:
        if isinstance(item, h5py.Group):
            inner = item.items() if depth < DEEPEST else ()
            return {name: plain(value, depth + 1) for name, value in inner if not name.startswith("#")}
        if item.attrs.get("MATLAB_class") == b"char":
            return "".join(map(chr, item[()].ravel())) if item.dtype.kind in "ui" else ""
        return item[()].squeeze() if item.dtype.kind in "biuf" else None

    try:
        with h5py.File(path) as file:
            return plain(file)
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise LogError(f"{path}: not a MATLAB file of version 7.3: {error}") from None


def _channels(held: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, np.ndarray, str, np.ndarray | None]]:
    """Name, values, unit and, where it has its own, instants of every vector."""
    small = {name.lower(): value for name, value in held.items()}
    time: Any
    values: Any
    unit: Any
    time, values, unit = (next((small[n] for n in names if n in small), None) for names in (INSTANTS, VALUES, UNITS))
    if _is_vector(time) and _is_vector(values) and len(time) == len(values):
        yield prefix.rstrip("."), values, unit if isinstance(unit, str) else "", np.asarray(time, float)
        return
    for name, value in held.items():
        if isinstance(value, Mapping):
            yield from _channels(value, f"{prefix}{name}.")
        elif _is_vector(value):
            yield prefix + name, value, "", None


def _is_vector(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 1 and value.size > 1 and value.dtype.kind in "biuf"


def _named_units(held: Mapping[str, Any]) -> dict[str, str]:
    """Units by name, from a structure that lists both."""
    found: dict[str, str] = {}
    for value in held.values():
        if not isinstance(value, Mapping):
            continue
        small = {name.lower(): entry for name, entry in value.items()}
        names: Any = small.get("name")
        units: Any = small.get("units", small.get("unit"))
        if np.ndim(names) == 1 and np.shape(names) == np.shape(units):
            found |= {str(name): str(unit) for name, unit in zip(np.asarray(names), np.asarray(units))}
    return found
