"""Vehicle speed over a log, and over free rolling before a manoeuvre: scans over samples."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from absjax.speed.accelerometer import Accelerometer
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
    begin = jnp.max(samples.rims[0]) if speed is None else jnp.asarray(speed, dtype)
    start = estimator.initial_state(begin, samples.rims.shape[1])

    def body(state, sample: SpeedSamples):
        state = estimator.update(state, sample.acceleration, tuple(sample.rims), period)
        return state, state

    rest = jax.tree.map(lambda x: x[1:], samples)
    _, path = lax.scan(jax.checkpoint(body, prevent_cse=False), start, rest)
    path = jax.tree.map(lambda x, xs: jnp.concatenate([x[None], xs]), start, path)
    acceleration = jax.vmap(estimator.acceleration_of)(path, samples.acceleration)
    return SpeedEstimates(jax.vmap(estimator.speed_of)(path), acceleration, path)


def after_rolling(
    estimator: SpeedEstimator, accelerometer: Accelerometer | None, speed, wheels: int, period: float, samples: int
) -> Any:
    """State of an estimator that has been told of a car which rolls freely, for so many samples up to the time 0.

    A control unit is not turned on by the brake pedal: before, it has seen wheels that roll, which tell the bias of its
    accelerometer. Scalars per lane.

    Args:
        estimator: begins at the first sample.
        accelerometer: tells no acceleration, with its errors; None without any.
        speed: of the car and its rims [m/s].
        wheels: how many are told.
        period: between two samples [s].
        samples: how many; 0: it begins now.
    """
    rims = (speed,) * wheels

    def body(state, number):
        told = 0.0 * speed if accelerometer is None else accelerometer.measure(0.0 * speed, -period * number)
        return estimator.update(state, told, rims, period), None

    return lax.scan(body, estimator.initial_state(speed, wheels), jnp.arange(samples - 1, -1, -1))[0]
