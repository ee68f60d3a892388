"""White noise that is drawn from seed and time: reproducible, whatever else is simulated, and with lanes."""

from functools import partial

import jax
import jax.numpy as jnp

CLOCK = 1e-6
"""Instants closer than this get the same noise, s."""


def _normal(seed, tick, dtype, channel):
    key = jax.random.fold_in(jax.random.key(seed), tick)
    return jax.random.normal(key if channel is None else jax.random.fold_in(key, channel), (), dtype)


def white_noise(seed, time, dtype, channel: int | None = None):
    """Standard normal noise of the samples taken at `time` [s]; arrays broadcast.

    Args:
        seed: integers.
        channel: for sensors that must not share their noise with others of the same seed.
    """
    tick = jnp.round(jnp.asarray(time) / CLOCK).astype(jnp.int32)
    return jnp.vectorize(partial(_normal, dtype=dtype, channel=channel))(seed, tick)
