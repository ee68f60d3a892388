"""The slope of a mean that is smooth where its members are not: their gradients, and a fit through them.

The losses l_i of an ensemble have jumps, as where a switching moves to another tick; their mean has none, but its slope
is not the mean of their gradients g_i: what the jumps bring is missing, or wrong where it is estimated. With every
member evaluated at a pair of points x + e_i and x - e_i, least squares over the pairs,

    (l_i(x + e_i) - l_i(x - e_i)) / 2 = s' e_i + noise_i,

give a slope s that misses nothing, smoothed over the scatter of e_i, but noisy: covariance C. The mean gradient g has
hardly any noise, but a bias. Between them, as James and Stein have it,

    g + k (s - g),   k = max(0, 1 - (p - 2) / ((s - g)' C^-1 (s - g)))

for p parameters: in small ensembles the gradient, in large ones the fit. Both come of one reverse pass.
Source: James and Stein 1961, Estimation with quadratic loss.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax._numerics import safe_divide

RIDGE = 1e-9
"""Of the normal equations, as a share of their trace: along offsets that do not vary the gradient stays as it is."""


class Pooled(NamedTuple):
    """A slope made of gradients and a fit."""

    slope: jnp.ndarray
    """(parameters,)"""
    share: jnp.ndarray
    """k, of the fit"""


def offsets(seed, pairs: int, size: int, scale: float) -> np.ndarray:
    """e_i (pairs, size): normal, of a standard deviation, the same whenever they are asked for."""
    return scale * np.random.default_rng(seed).normal(size=(pairs, size))


def pairs_within(points, offsets, low, high):
    """Centres (pairs, sets, parameters) and offsets (pairs, parameters) of pairs that lie within limits (parameters,).

    A pair keeps its offset, and its centre gives way: what lies beyond a limit may have no meaning, and its loss would
    drown the others.
    """
    apart = jnp.clip(offsets, -(high - low) / 2, (high - low) / 2)
    reach = jnp.abs(apart)[:, None]
    return jnp.clip(points, low + reach, high - reach), apart


def pooled_slope(losses, gradients, offsets) -> Pooled:
    """Slope of the mean loss; traceable.

    Args:
        losses: at x + e and x - e, (2, pairs).
        gradients: of every loss with respect to its own point, (2, pairs, parameters).
        offsets: e, (pairs, parameters).
    """
    pairs, size = offsets.shape
    mean = gradients.mean(axis=(0, 1))
    left = (losses[0] - losses[1]) / 2 - offsets @ mean
    normal = offsets.T @ offsets
    solvable = normal + (RIDGE * jnp.trace(normal) + jnp.finfo(losses.dtype).tiny) * jnp.eye(size)
    missing = jnp.linalg.solve(solvable, offsets.T @ left)
    variance = jnp.sum((left - offsets @ missing) ** 2) / max(pairs - size, 1)
    seen = missing @ normal @ missing
    share = jnp.maximum(0.0, 1 - safe_divide(max(size - 2, 1) * variance, seen, seen > 0, 1.0))
    share = share if pairs > size else jnp.zeros_like(share)
    return Pooled(mean + share * missing, share)
