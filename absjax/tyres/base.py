"""Tyre curves: friction coefficient mu against wheel slip, its slope (XBS), curvature and peak.

Wheel slip is lambda = (R w - v) / v: negative while braking, -1 for a locked wheel. Curves are odd in
lambda. The extended braking stiffness (XBS) is mu'(lambda): positive on the stable side of the peak,
negative beyond it.
"""

from typing import Any, ClassVar, NamedTuple, Protocol

import jax.numpy as jnp


class Peak(NamedTuple):
    """Largest friction for slips of magnitude 0 to 1, and the magnitude of slip where it lies."""

    slip: Any
    friction: Any


class Tyre(Protocol):
    """What roads, tuning and identification ask of a tyre curve; arrays broadcast.

    A tyre is a class made by `absjax.parameters.model`, its coefficients scalars made by `parameter`, those that are
    identified from a log `trainable`, with a `span` in which they are looked for. Derivatives with respect to them are
    taken by JAX.
    """

    title: ClassVar[str]
    """for tables and figures"""
    beyond_peak: ClassVar[tuple[str, ...]]
    """coefficients that only slips beyond the peak can tell"""

    def friction(self, slip: Any) -> Any:
        """mu(lambda), no unit."""
        ...

    def stiffness(self, slip: Any) -> Any:
        """XBS = mu'(lambda), no unit."""
        ...

    def peak(self) -> Peak:
        """Largest friction for slips of magnitude 0 to 1, and where it lies."""
        ...


def sign_of(slip):
    return jnp.where(slip < 0, -1.0, 1.0)
