"""A tyre curve through points (slip, friction), both with errors, and the zeros of both.

mu_k + z = mu(R w_k / v_k - 1),    z: zero of the friction,   R: radius, which is the zero of the slip
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from tuning.road.arrow_fit import Fit, Prior, arrow_fit
from tuning.road.curve import Curve
from tuning.road.noise import white_noise

BLOCK = 50
"""Samples that form a cluster for the covariance; all of them where there are fewer."""
SWEEPS = 4


@partial(jax.jit, static_argnums=0)
def _model(curve: Curve, coefficients, slip):
    tyre = curve.tyre(coefficients)
    by_coefficient = jax.jacfwd(lambda c: curve.tyre(c).friction(slip))(coefficients)
    return tyre.friction(slip), by_coefficient, tyre.stiffness(slip)


def fit_curve(curve: Curve, ratio, friction, slip_noise, start, *, radius: Prior, zero: Prior) -> Fit:
    """Least squares weighted by the effective variance sigma_mu^2 + (mu'(lambda) sigma_lambda)^2.

    Args:
        curve: the kind of curve.
        ratio: w / v of each point [1/m], (samples,).
        friction: of each point, negative while braking, (samples,).
        slip_noise: standard deviation of each slip, (samples,).
        start: coefficients.
        radius: what is known of R [m], arrays (1,); a spread of 0 fixes it.
        zero: the same of z.

    Returns:
        A `Fit` of the coefficients, then R and z.
    """
    block, size = min(BLOCK, len(ratio)), len(curve.names)
    usable = len(ratio) // block * block
    order = slice(len(ratio) - usable, None)
    ratio, friction, slip_noise = ratio[order], friction[order], slip_noise[order]
    noise = white_noise(friction)
    prior = Prior(
        np.concatenate([np.zeros(size), radius.mean, zero.mean]),
        np.concatenate([np.full(size, np.inf), radius.spread, zero.spread]),
    )
    free = prior.spread > 0
    shared = np.where(free, np.concatenate([start, radius.mean, zero.mean]), prior.mean)
    known = Prior(prior.mean[free], prior.spread[free])
    lower = np.concatenate([curve.lower, [1e-3, -np.inf]])
    fit = None
    for _ in range(SWEEPS):
        stiffness = np.asarray(_model(curve, jnp.asarray(shared[:size]), jnp.asarray(shared[size] * ratio - 1))[2])
        weight = 1 / np.sqrt(noise**2 + (stiffness * slip_noise) ** 2)

        def evaluate(some, own, weight=weight, shared=shared):
            point = shared.copy()
            point[free] = some
            given = jnp.asarray(point[:size]), jnp.asarray(point[size] * ratio - 1)
            value, slope, stiffness = map(np.asarray, _model(curve, *given))
            slope = np.column_stack([slope, stiffness * ratio, -np.ones(usable)])[:, free]
            residual = ((value - point[size + 1] - friction) * weight).reshape(-1, block)
            return residual, (slope * weight[:, None]).reshape(*residual.shape, -1), np.zeros((*residual.shape, 0))

        fit = arrow_fit(evaluate, shared[free], np.zeros((usable // block, 0)), lower=lower[free], prior=known)
        shared = shared.copy()
        shared[free] = fit.shared
    assert fit is not None
    return fit.of_all(shared, free)
