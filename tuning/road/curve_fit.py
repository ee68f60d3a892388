"""A tyre curve through points (slip, friction), both with errors."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from tuning.road.arrow_fit import Fit, arrow_fit
from tuning.road.curve import Curve

BLOCK = 50
"""Samples that form a cluster for the covariance."""
SWEEPS = 4


@partial(jax.jit, static_argnums=0)
def _model(curve: Curve, coefficients, slip):
    tyre = curve.tyre(coefficients)
    by_coefficient = jax.jacfwd(lambda c: curve.tyre(c).friction(slip))(coefficients)
    return tyre.friction(slip), by_coefficient, tyre.stiffness(slip)


def fit_curve(curve: Curve, slip, friction, slip_noise, start) -> Fit:
    """Least squares weighted by the effective variance sigma_mu^2 + (mu'(lambda) sigma_lambda)^2.

    Args:
        curve: the kind of curve.
        slip: of the points, (samples,).
        friction: of the points, (samples,), negative while braking.
        slip_noise: standard deviation of each slip, (samples,).
        start: coefficients.
    """
    usable = len(slip) // BLOCK * BLOCK
    order = slice(len(slip) - usable, None)
    slip, friction, slip_noise = slip[order], friction[order], slip_noise[order]
    noise = white_noise(friction)
    shared, fit = np.asarray(start, float), None
    for _ in range(SWEEPS):
        stiffness = np.asarray(_model(curve, jnp.asarray(shared), jnp.asarray(slip))[2])
        weight = 1 / np.sqrt(noise**2 + (stiffness * slip_noise) ** 2)

        def evaluate(c, own, weight=weight):
            value, slope, _ = map(np.asarray, _model(curve, jnp.asarray(c), jnp.asarray(slip)))
            blocks = (-1, BLOCK)
            residual = ((value - friction) * weight).reshape(blocks)
            return residual, (slope * weight[:, None]).reshape(*residual.shape, -1), np.zeros((*residual.shape, 0))

        fit = arrow_fit(evaluate, shared, np.zeros((usable // BLOCK, 0)), lower=curve.lower)
        shared = fit.shared
    assert fit is not None
    return fit


def white_noise(signal: np.ndarray) -> float:
    """Standard deviation of the sensor noise of a smooth signal sampled fast, from its second differences."""
    return float(np.median(np.abs(np.diff(signal, 2))) / 0.6745 / np.sqrt(6)) + 1e-12
