"""Where the surface changes: the best of all partitions, by linear least squares.

For a fixed c2, Burckhardt's curve is linear in (c1, c3), so that the residual of any stretch of the log
follows from running sums; over a grid of c2 it costs the same for every stretch. A change is accepted
when it lowers Schwarz's criterion, and the sum of squares by a share worth the name.
"""

from copy import copy
from itertools import pairwise
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.tyres.base import Tyre
from tuning.road.samples import FrictionSamples

SHORTEST = 0.25
"""Shortest stretch of one surface [s]."""
GRID, FINEST = 0.01, 400
"""Cuts are looked for every so many seconds, and at no more than so many places."""
SMALLEST_GAIN = 1.3
"""By how much a change has to lower the sum of squares; less is what noise that varies with slip does."""
BLENDS = (0.001, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.06)
"""Lengths of the blend at a change that are tried [s]."""
RATES = np.geomspace(3.0, 200.0, 49)
"""Grid of c2, within 5 % of any: as fine as that, what it leaves of a curve is less than a quiet sensor's noise, and no
second surface mends it."""


class Stretch(NamedTuple):
    """Samples [first, last) of one surface, and a rough fit."""

    first: int
    last: int
    coefficients: tuple[float, float, float]
    residual: float
    """sum of squares"""


class _Sums:
    """Running sums of the normal equations, arrays (rates, samples + 1)."""

    def __init__(self, slip: np.ndarray, friction: np.ndarray):
        s = np.abs(slip)
        rising = np.sign(slip) * (1 - np.exp(-RATES[:, None] * s))
        falling = np.broadcast_to(-slip, rising.shape)
        columns = (rising**2, rising * falling, falling**2, rising * friction, falling * friction)
        self.sums = [np.pad(np.cumsum(c, axis=1), ((0, 0), (1, 0))) for c in columns]
        self.square = np.concatenate([[0.0], np.cumsum(friction**2)])

    def at(self, knots: np.ndarray) -> "_Sums":
        """At some of the samples only, so that stretches are from one of them to another."""
        some = copy(self)
        some.sums, some.square = [s[:, knots] for s in self.sums], self.square[knots]
        return some

    def fit(self, first, last):
        """Residual (rates, stretches) and coefficients c1, c3 >= 0 of stretches [first, last), arrays or slices."""
        a, b, d, p, q = (s[:, last] - s[:, first] for s in self.sums)
        square = self.square[last] - self.square[first]
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = a * d - b * b
            c1, c3 = (d * p - b * q) / determinant, (a * q - b * p) / determinant
            alone = np.divide(p, a, out=np.zeros_like(p), where=a > 0)
            interior = (determinant > 1e-12 * a * d) & (c3 >= 0) & (c1 >= 0)
            c1, c3 = np.where(interior, c1, np.maximum(alone, 0)), np.where(interior, c3, 0.0)
        return square - (2 * (c1 * p + c3 * q) - (c1 * c1 * a + 2 * c1 * c3 * b + c3 * c3 * d)), c1, c3

    def stretch(self, first: int, last: int) -> Stretch:
        residual, c1, c3 = self.fit(np.array([first]), np.array([last]))
        best = int(np.argmin(residual[:, 0]))
        return Stretch(
            first, last, (float(c1[best, 0]), float(RATES[best]), float(c3[best, 0])), float(residual[best, 0])
        )


def find_stretches(samples: FrictionSamples, most: int = 6) -> list[Stretch]:
    """Stretches of one surface each: the best partition into each number of them, by dynamic programming.

    Cuts lie on a grid first, and are then moved to where they are best. A stretch more has to lower the sum of squares
    by a share worth the name, and Schwarz's criterion.

    Args:
        samples: points of the friction curve.
        most: largest number of stretches.
    """
    period, size = float(np.median(np.diff(samples.time))), len(samples.time)
    shortest = max(20, round(SHORTEST / period))
    sums = _Sums(samples.slip, samples.friction)
    stride = max(1, round(max(GRID / period, size / FINEST)))
    inner = np.arange(0, size - stride // 2, stride)
    # A cut nearer to an end would leave it too short a stretch.
    inner = inner[(inner >= shortest) & (inner <= size - shortest)]
    knots = np.array([0, *inner, size])
    best = _partitions(sums, knots, shortest, most)
    chosen = [0, size]
    for cuts in best[1:]:
        fewer, more = (sum(sums.stretch(a, b).residual for a, b in pairwise(c)) for c in (chosen, cuts))
        if size * np.log(fewer / more) > 4 * np.log(size) * (len(cuts) - len(chosen)) and fewer >= SMALLEST_GAIN * more:
            chosen = _moved(sums, cuts, stride, shortest)
    return [sums.stretch(a, b) for a, b in pairwise(chosen)]


def _partitions(sums: _Sums, knots: np.ndarray, shortest: int, most: int) -> list[list[int]]:
    """Cuts, ends included, of the best partition into 1, 2, ... stretches, as far as there is room."""
    count = len(knots)
    costs, known = np.full((count, count), np.inf), sums.at(knots)
    for i, nearest in enumerate(np.searchsorted(knots, knots + shortest)):
        if nearest < count:
            costs[i, nearest:] = known.fit(slice(i, i + 1), slice(nearest, None))[0].min(axis=0)
    total, origin = costs[0].copy(), []
    found = [[int(knots[0]), int(knots[-1])]]
    for _ in range(most - 1):
        through = total[:, None] + costs
        origin.append(np.argmin(through, axis=0))
        total = np.min(through, axis=0)
        if not np.isfinite(total[-1]):
            break
        cuts, at = [count - 1], count - 1
        for back in reversed(origin):
            at = int(back[at])
            cuts.append(at)
        found.append([int(knots[i]) for i in [0, *reversed(cuts)]])
    return found


def _moved(sums: _Sums, cuts: list[int], stride: int, shortest: int) -> list[int]:
    """Every inner cut where it is best between its neighbours, within two strides."""
    cuts = list(cuts)
    for i in range(1, len(cuts) - 1):
        low = max(cuts[i - 1] + shortest, cuts[i] - 2 * stride)
        high = min(cuts[i + 1] - shortest, cuts[i] + 2 * stride)
        at = np.arange(low, high + 1)
        if len(at):
            before = sums.fit(np.full_like(at, cuts[i - 1]), at)[0].min(axis=0)
            after = sums.fit(at, np.full_like(at, cuts[i + 1]))[0].min(axis=0)
            cuts[i] = int(at[np.argmin(before + after)])
    return cuts


def refine_change(samples: FrictionSamples, before: Tyre, after: Tyre, near: int) -> tuple[float, float]:
    """Beginning and length [s] of the linear blend that fits the points around a change best."""
    window = np.abs(samples.time - samples.time[near]) < 0.15
    time, friction = samples.time[window], samples.friction[window]
    slip = jnp.asarray(samples.slip[window])
    old, new = np.asarray(before.friction(slip)), np.asarray(after.friction(slip))
    best = (np.inf, 0.0, 0.0)
    for blend in BLENDS:
        starts = samples.time[near] - blend / 2 + np.arange(-0.05, 0.05, 5e-4)
        share = np.clip((time[:, None] - starts) / blend, 0, 1)
        costs = np.sum((friction[:, None] - old[:, None] - share * (new - old)[:, None]) ** 2, axis=0)
        at = int(np.argmin(costs))
        best = min(best, (float(costs[at]), float(starts[at]), blend))
    return best[1], best[2]
