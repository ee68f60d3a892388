"""Vehicle speed over a log: a scan over its samples."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from absjax.speed.base import SpeedEstimator, SpeedSamples


class SpeedEstimates(NamedTuple):
    """A run of an estimator over a log; arrays (samples,)."""

    speed: Any
    """v^ [m/s]"""
    acceleration: Any
    """without the bias that has been found [m/s^2]"""
    path: Any
    """states"""


@jax.jit
def estimate_speed(estimator: SpeedEstimator, samples: SpeedSamples, period, *, speed: Any = None) -> SpeedEstimates:
    """Estimate the speed of a vehicle over a log.

    Differentiable, and to be vmapped over logs, parameter sets or both.

    Args:
        estimator: one of `absjax.speed.SPEED_ESTIMATORS`, for example.
        samples: the log, which begins with free rolling.
        period: sampling period [s].
        speed: at the first sample [m/s]; that of the fastest rim when None.

    Raises:
        ValueError: if the estimator needs more wheels than there are.
    """
    dtype = jnp.result_type(samples.rims, samples.acceleration, jnp.float32)
    estimator, samples, period = jax.tree.map(lambda x: jnp.asarray(x, dtype), (estimator, samples, period))
    start = estimator.initial_state(jnp.max(samples.rims[0]) if speed is None else jnp.asarray(speed, dtype))

    def body(state, sample: SpeedSamples):
        state = estimator.update(state, sample.acceleration, tuple(sample.rims), period)
        return state, state

    rest = jax.tree.map(lambda x: x[1:], samples)
    _, path = lax.scan(jax.checkpoint(body, prevent_cse=False), start, rest)
    path = jax.tree.map(lambda x, xs: jnp.concatenate([x[None], xs]), start, path)
    acceleration = jax.vmap(estimator.acceleration_of)(path, samples.acceleration)
    return SpeedEstimates(jax.vmap(estimator.speed_of)(path), acceleration, path)
