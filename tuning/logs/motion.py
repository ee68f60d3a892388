"""How a wheel turns at the edges of a log: cubics in time through the angles of the edges around each."""

from typing import NamedTuple

import numpy as np

CHUNK = 50_000
"""Edges fitted at a time."""


class Motion(NamedTuple):
    """At the edges; arrays (edges,)."""

    speed: np.ndarray
    acceleration: np.ndarray
    off: np.ndarray
    """angle of the edge off the fit, on the scale of the noise of the angles"""
    noise: np.ndarray
    """of speed and acceleration over that of the angle, (edges, 2)"""
    inner: np.ndarray
    """whether the fit has as many edges on either side"""


def fitted(time, angle, stretch, half: int) -> Motion:
    """Cubics through the edges around each edge of the same stretch."""
    size = time.size
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    first = starts[stretch - stretch[0]] if stretch.size else starts
    last = np.append(starts[1:], size)[stretch - stretch[0]] - 1
    here = np.arange(size)
    begin = np.maximum(np.minimum(here - half, last - 2 * half), first)
    inner = (here - half >= first) & (here + half <= last)
    parts = [
        _cubic(time, angle, here[k : k + CHUNK], begin[k : k + CHUNK], half, last[k : k + CHUNK])
        for k in range(0, size, CHUNK)
    ]
    coefficients = np.concatenate([part[0] for part in parts])
    noise = np.concatenate([part[1] for part in parts])
    return Motion(
        coefficients[:, 1], 2 * coefficients[:, 2], -coefficients[:, 0] / noise[:, 0], noise[:, 1:], inner
    )


def _cubic(time, angle, here, begin, half: int, last):
    """Coefficients at each edge, and the noise of the first three over that of the angles."""
    index = begin[:, None] + np.arange(2 * half + 1)
    weight = (index <= last[:, None]).astype(float)
    index = np.minimum(index, last[:, None])
    x = time[index] - time[here][:, None]
    scale = np.abs(x).max(axis=1)
    x = x / scale[:, None]
    powers = np.stack([np.ones_like(x), x, x**2, x**3], axis=-1)
    weighted = powers * weight[..., None]
    normal = np.einsum("enp,enq->epq", weighted, powers)
    y = angle[index] - angle[here][:, None]
    inverse = np.linalg.inv(normal)
    found = np.einsum("epq,eq->ep", inverse, np.einsum("enp,en->ep", weighted, y))
    spread = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0))
    own = np.sqrt(np.maximum(1 - spread[:, 0] ** 2, 0.01))
    powers_of = scale[:, None] ** np.arange(4)
    noise = np.stack([own, spread[:, 1] / scale, 2 * spread[:, 2] / scale**2], axis=1)
    return found / powers_of, noise
