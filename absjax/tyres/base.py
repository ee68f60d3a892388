"""Tyre curves: friction coefficient mu against wheel slip, its slope (XBS), curvature and peak.

Wheel slip is lambda = (R w - v) / v: negative while braking, -1 for a locked wheel. Curves are odd in
lambda. The extended braking stiffness (XBS) is mu'(lambda): positive on the stable side of the peak,
negative beyond it.
"""

from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp


class Peak(NamedTuple):
    """Largest friction for slips of magnitude 0 to 1, and the magnitude of slip where it lies."""

    slip: jax.Array
    friction: jax.Array


class Tyre(Protocol):
    """What roads ask of a tyre curve; arrays broadcast."""

    def friction(self, slip: jax.Array) -> jax.Array:
        """mu(lambda), no unit."""
        ...

    def stiffness(self, slip: jax.Array) -> jax.Array:
        """XBS = mu'(lambda), no unit."""
        ...


def sign_of(slip):
    return jnp.where(slip < 0, -1.0, 1.0)
