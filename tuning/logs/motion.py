"""How a wheel turns at the edges of a log: cubics in time through the angles of the edges around each."""

from typing import NamedTuple

import numpy as np

CHUNK = 50_000
"""Edges fitted at a time."""
TINY = 1e-12
"""Keeps the fit to fewer than four edges solvable; its noise is then beyond use."""


class Motion(NamedTuple):
    """At the edges; arrays (edges,)."""

    speed: np.ndarray
    acceleration: np.ndarray
    off: np.ndarray
    """angle of the edge off the fit, on the scale of the noise of the angles"""
    raw: np.ndarray
    """the same, as it is"""
    noise: np.ndarray
    """of speed and acceleration over that of the angle, (edges, 2)"""
    inner: np.ndarray
    """whether the fit has as many edges on either side"""


def fitted(time, angle, stretch, half: int, only: np.ndarray | None = None) -> Motion:
    """Cubics through the edges around each edge of the same stretch.

    Args:
        time: of the edges [s].
        angle: of the wheel [rad].
        stretch: of every edge; edges of others are not looked at.
        half: edges on either side.
        only: indices of the edges wanted; all if None.
    """
    size = time.size
    starts = np.flatnonzero(np.diff(stretch, prepend=stretch[:1] - 1))
    number = np.cumsum(np.diff(stretch, prepend=stretch[:1]) > 0)
    here = np.arange(size) if only is None else only
    first, last = starts[number[here]], np.append(starts[1:], size)[number[here]] - 1
    begin = np.maximum(np.minimum(here - half, last - 2 * half), first)
    inner = (here - half >= first) & (here + half <= last)
    parts = [
        _cubic(time, angle, here[k : k + CHUNK], begin[k : k + CHUNK], last[k : k + CHUNK], 2 * half + 1)
        for k in range(0, here.size, CHUNK)
    ]
    found, noise = (np.concatenate(x) for x in zip(*parts)) if parts else (np.zeros((0, 4)), np.zeros((0, 3)))
    return Motion(found[:, 1], 2 * found[:, 2], -found[:, 0] / noise[:, 0], -found[:, 0], noise[:, 1:], inner)


def _cubic(time, angle, here, begin, last, count: int):
    """Coefficients at each edge; noise of the edge off the fit, of speed and acceleration, over that of angles."""
    index = begin[:, None] + np.arange(count)
    weight = (index <= last[:, None]).astype(float)
    index = np.minimum(index, last[:, None])
    x = time[index] - time[here][:, None]
    scale = np.abs(x).max(axis=1)
    scale[scale == 0] = 1.0
    x = x / scale[:, None]
    y = angle[index] - angle[here][:, None]
    moments, products, power = [], [], weight
    for k in range(7):
        moments.append(power.sum(axis=1))
        if k < 4:
            products.append((power * y).sum(axis=1))
        power = power * x
    normal = np.stack([np.stack([moments[i + j] for j in range(4)], axis=-1) for i in range(4)], axis=-2)
    inverse = np.linalg.inv(normal + TINY * np.eye(4))
    found = (inverse @ np.stack(products, axis=-1)[..., None])[..., 0]
    spread = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0))
    own = np.sqrt(np.maximum(1 - spread[:, 0] ** 2, 0.01))
    noise = np.stack([own, spread[:, 1] / scale, 2 * spread[:, 2] / scale**2], axis=1)
    return found / scale[:, None] ** np.arange(4), noise
