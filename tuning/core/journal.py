"""What has been evaluated in a run, on disk after every evaluation: a run that was killed goes on as if it were not.

A run is a sequence of evaluations, each of which follows from those before. Resumed, it asks for the same ones again;
those in the journal are answered from it, so that it comes to the same parameters to the last bit.
"""

import hashlib
import io
import json
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

HEADER = struct.Struct("<Q32s")
"""Of a record: its length, and its SHA-256; a record cut short by the end of the process has neither right."""


class Journal:
    """Evaluations in order; without a path nothing is kept."""

    def __init__(self, path: Path | None = None, identity: dict[str, Any] | None = None, *, resume: bool = False):
        """Begin a journal, or go on with one.

        Args:
            identity: what the run is of, as JSON holds it; kept at the beginning.

        Raises:
            ValueError: if a run is to go on that is not there, or is of something else; names what differs.
        """
        self.path, self._known, self._count = path, iter(()), 0
        self._identity: dict[str, Any] | None = identity or {}
        if path is not None and resume:
            records, end = _read(path)
            _require_same(path, identity or {}, json.loads(records[0][0]))
            with path.open("r+b") as file:
                file.truncate(end)
            self._known, self._identity = iter(records[1:]), None

    @property
    def begun(self) -> bool:
        """Whether there is something on disk to go on from."""
        return self.path is not None and self._identity is None

    def evaluate(self, function: Callable[..., Any], *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
        """Arrays `function` makes of arrays: from the journal if it was asked for the same before.

        Raises:
            ValueError: if the journal has the answer to another question.
        """
        asked = tuple(_bytes(np.asarray(a)) for a in arrays)
        self._count += 1
        kept = next(self._known, None)
        if kept is not None:
            if kept[: len(asked)] != asked:
                raise ValueError(f"{self.path}: evaluation {self._count} is not that of this run; it cannot go on")
            return tuple(np.load(io.BytesIO(answer)) for answer in kept[len(asked) :])
        found = function(*arrays)
        answers = tuple(np.asarray(a) for a in (found if isinstance(found, tuple) else (found,)))
        if self.path is not None:
            self._append(asked + tuple(map(_bytes, answers)))
        return answers

    def _append(self, parts: tuple[bytes, ...]) -> None:
        assert self.path is not None
        if self._identity is not None:
            # Nothing is made before there is something to keep.
            identity, self._identity = json.dumps(self._identity, sort_keys=True).encode(), None
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.unlink(missing_ok=True)
            self._append((identity,))
        body = b"".join(struct.pack("<Q", len(part)) + part for part in parts)
        with self.path.open("ab") as file:
            file.write(HEADER.pack(len(body), hashlib.sha256(body).digest()) + body)
            file.flush()
            os.fsync(file.fileno())


def identity_of(path: Path) -> dict[str, Any]:
    """What the run of a journal is of.

    Raises:
        ValueError: if there is no journal.
    """
    return json.loads(_read(path)[0][0][0])


def _bytes(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def _read(path: Path) -> tuple[list[tuple[bytes, ...]], int]:
    """Complete records of a journal, and where they end."""
    if not path.is_file():
        raise ValueError(f"{path}: no such file; there is no run to resume")
    data, at, records = path.read_bytes(), 0, []
    while at + HEADER.size <= len(data):
        length, digest = HEADER.unpack_from(data, at)
        body = data[at + HEADER.size : at + HEADER.size + length]
        if len(body) < length or hashlib.sha256(body).digest() != digest:
            break
        records.append(tuple(_parts(body)))
        at += HEADER.size + length
    if not records:
        raise ValueError(f"{path}: not the journal of a run")
    return records, at


def _parts(body: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(body):
        (length,) = struct.unpack_from("<Q", body, at)
        yield body[at + 8 : at + 8 + length]
        at += 8 + length


def _require_same(path: Path, wanted: dict[str, Any], kept: dict[str, Any]) -> None:
    for key in sorted(set(wanted) | set(kept)):
        if json.dumps(wanted.get(key), sort_keys=True) != json.dumps(kept.get(key), sort_keys=True):
            raise ValueError(
                f"{path}: the run is of {key} = {kept.get(key)!r}, not {wanted.get(key)!r}; it cannot go on"
            )
