"""Where the surface changes: exact search over all instants, by linear least squares.

For a fixed c2, Burckhardt's curve is linear in (c1, c3), so that the residual of any stretch of the log
follows from running sums; over a grid of c2 it costs the same for every stretch. A change is accepted
when it lowers Schwarz's criterion, and the sum of squares by a share worth the name.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.tyres.base import Tyre
from tuning.road.samples import FrictionSamples

SHORTEST = 0.25
"""Shortest stretch of one surface [s]."""
SMALLEST_GAIN = 1.3
"""By how much a change has to lower the sum of squares; less is what noise that varies with slip does."""
BLENDS = (0.001, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.06)
"""Lengths of the blend at a change that are tried [s]."""
RATES = np.geomspace(3.0, 200.0, 25)
"""Grid of c2."""


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

    def fit(self, first, last):
        """Residual (rates, stretches) and coefficients c1, c3 >= 0 of stretches [first, last)."""
        a, b, d, p, q = (s[:, last] - s[:, first] for s in self.sums)
        square = self.square[last] - self.square[first]
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = a * d - b * b
            c1, c3 = (d * p - b * q) / determinant, (a * q - b * p) / determinant
            alone = p / a
            interior = (determinant > 1e-12 * a * d) & (c3 >= 0) & (c1 >= 0)
            c1, c3 = np.where(interior, c1, np.maximum(alone, 0)), np.where(interior, c3, 0.0)
        c1 = np.nan_to_num(c1)
        return square - (2 * (c1 * p + c3 * q) - (c1 * c1 * a + 2 * c1 * c3 * b + c3 * c3 * d)), c1, c3

    def stretch(self, first: int, last: int) -> Stretch:
        residual, c1, c3 = self.fit(np.array([first]), np.array([last]))
        best = int(np.argmin(residual[:, 0]))
        return Stretch(
            first, last, (float(c1[best, 0]), float(RATES[best]), float(c3[best, 0])), float(residual[best, 0])
        )


def find_stretches(samples: FrictionSamples, most: int = 6) -> list[Stretch]:
    """Stretches of one surface each, found by repeated bisection.

    Args:
        samples: points of the friction curve.
        most: largest number of stretches.
    """
    period = float(np.median(np.diff(samples.time)))
    shortest = max(20, round(SHORTEST / period))
    sums = _Sums(samples.slip, samples.friction)
    stretches = [sums.stretch(0, len(samples.time))]
    while len(stretches) < most:
        splits = [(_split(sums, stretch, shortest), i) for i, stretch in enumerate(stretches)]
        gain, pair, i = max(((*found, i) for found, i in splits if found), default=(0.0, [], 0), key=lambda s: s[0])
        if gain <= 0:
            break
        stretches[i : i + 1] = pair
    return stretches


def _split(sums: _Sums, stretch: Stretch, shortest: int):
    """Best bisection of a stretch and by how much it lowers the criterion; None if it is too short."""
    cuts = np.arange(stretch.first + shortest, stretch.last - shortest)
    if not cuts.size:
        return None
    before = sums.fit(np.full_like(cuts, stretch.first), cuts)[0].min(axis=0)
    after = sums.fit(cuts, np.full_like(cuts, stretch.last))[0].min(axis=0)
    cut = int(cuts[np.argmin(before + after)])
    pair = [sums.stretch(stretch.first, cut), sums.stretch(cut, stretch.last)]
    n = stretch.last - stretch.first
    together, apart = stretch.residual, pair[0].residual + pair[1].residual
    if together < SMALLEST_GAIN * apart:
        return None
    return n * np.log(together / apart) - 4 * np.log(n), pair


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
