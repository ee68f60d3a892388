"""Baselines: least squares of an XBS taken as constant, recursive or over a window.

Integrated from sample to sample, z1' = -(a/v) z1 XBS - b Pb' with a constant XBS is linear in it:

    z1(k+1) - z1(k) + b (Pb(k+1) - Pb(k)) = phi(k) XBS,   phi(k) = -a int z1/v dt

so that no signal is differentiated.
Source: Ono et al. 2003; Hoang 2014, eq. 2.1.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from absjax._numerics import safe_divide
from absjax.observers.base import Sample
from absjax.plant.wheel import Wheel


def _regression(samples: Sample, period, wheel: Wheel):
    y, v, pressure = samples
    rate = y / v
    phi = -wheel.slip_gain * 0.5 * period * (rate[1:] + rate[:-1])
    return phi, jnp.diff(y) + wheel.pressure_gain * jnp.diff(pressure)


@jax.jit
def recursive(samples: Sample, period, wheel: Wheel, memory: Any = 0.05, prior: Any = 1e-3) -> jax.Array:
    """XBS by recursive least squares with exponential forgetting.

    Args:
        samples: arrays (samples,).
        period: sampling period, s.
        memory: time constant of the forgetting, s, > 0.
        prior: weight of XBS = 0 before the first sample, > 0; m^2/s^4.

    Returns:
        Array (samples,).
    """
    phi, target = _regression(samples, period, wheel)
    forget = jnp.exp(-period / memory)

    def body(carry, sample):
        information, estimate = carry
        phi, target = sample
        information = forget * information + phi**2
        estimate = estimate + phi * (target - phi * estimate) / jnp.maximum(information, jnp.finfo(phi.dtype).tiny)
        return (information, estimate), estimate

    start = jnp.asarray(prior, phi.dtype), jnp.zeros((), phi.dtype)
    _, path = lax.scan(body, start, (phi, target))
    return jnp.concatenate([jnp.zeros(1, phi.dtype), path])


def windowed(samples: Sample, period, wheel: Wheel, window: int = 50, prior: Any = 1e-3) -> jax.Array:
    """XBS by least squares over the last `window` samples; the prior as for `recursive`. Array (samples,).

    Raises:
        ValueError: if the window is not at least one sample.
    """
    if window < 1:
        raise ValueError(f"window = {window} samples must be at least one")
    phi, target = _regression(samples, period, wheel)

    def over_window(values):
        return jnp.convolve(values, jnp.ones(window, values.dtype))[: values.shape[0]]

    information = over_window(phi**2) + prior
    estimate = safe_divide(over_window(phi * target), information, information > 0)
    return jnp.concatenate([jnp.zeros(1, phi.dtype), estimate])
