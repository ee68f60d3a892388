"""The slope of a mean that is smooth where its members are not: gradients along the members, and a fit through them.

Members l_i(x) of an ensemble have jumps, as where a switching moves to another tick; their mean over the ensemble has
none, but its slope is not the mean of their gradients g_i: what the jumps bring is missing, or wrong where it is
estimated. With every member evaluated at a point x + e_i of its own, least squares over the ensemble,

    l_i = level of its row + s' e_i + noise_i,

give a slope s that nothing is missing from, smoothed over the scatter of e_i, but with noise: covariance C. The mean
gradient g has hardly any noise, but a bias. Between them, as James and Stein have it,

    g + k (s - g),   k = max(0, 1 - (p - 2) / ((s - g)' C^-1 (s - g)))

for p > 2 parameters: in small ensembles the gradient, in large ones the fit, and never worse in the mean than the fit.
Source: James and Stein 1961, Estimation with quadratic loss.
"""

import jax.numpy as jnp

from absjax._numerics import safe_divide

RIDGE = 1e-6
"""Of the normal equations, as a share of their trace: offsets that do not vary leave the gradient as it is."""


def pooled_slope(losses, gradients, offsets):
    """Slope of the mean loss; traceable.

    Args:
        losses: (rows, draws), each row with a level of its own.
        gradients: of every loss with respect to its own point, (rows, draws, parameters).
        offsets: of these points from where the slope is wanted, (rows, draws, parameters).

    Returns:
        The slope (parameters,), and the share k of the fit in it.
    """
    rows, draws, size = offsets.shape
    apart = offsets - offsets.mean(axis=1, keepdims=True)
    mean = gradients.mean(axis=(0, 1))
    left = losses - losses.mean(axis=1, keepdims=True) - apart @ mean
    normal = jnp.einsum("rdp,rdq->pq", apart, apart)
    normal = normal + (RIDGE * jnp.trace(normal) + jnp.finfo(losses.dtype).tiny) * jnp.eye(size)
    missing = jnp.linalg.solve(normal, jnp.einsum("rdp,rd->p", apart, left))
    freedom = rows * (draws - 1) - size
    variance = jnp.sum((left - apart @ missing) ** 2) / max(freedom, 1)
    seen = missing @ normal @ missing
    share = jnp.maximum(0.0, 1 - safe_divide(max(size - 2, 1) * variance, seen, seen > 0, 1.0))
    share = share if freedom > 0 else jnp.zeros_like(share)
    return mean + share * missing, share
