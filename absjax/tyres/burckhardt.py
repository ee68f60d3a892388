"""Burckhardt's curve."""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.tyres.base import Peak, sign_of


@model
class Burckhardt:
    """Burckhardt's curve, extended oddly: mu = sign(lambda) [c1 (1 - exp(-c2 s)) - c3 s], s = |lambda|.

    Coefficients are stored positive, for braking and driving alike. Source: Aguado-Rojas 2019, eq. 2.5.
    """

    title: ClassVar[str] = "Burckhardt"
    beyond_peak: ClassVar[tuple[str, ...]] = ("c3",)

    c1: Any = parameter("c1, friction of the saturated curve, no unit", low=0.0, trainable=True, span=(0.02, 2.0))
    c2: Any = parameter("c2, how fast it saturates with slip, no unit", low=0.0, trainable=True, span=(3.0, 400.0))
    c3: Any = parameter("c3, loss of friction with slip, no unit", low=0.0, trainable=True, span=(1e-3, 1.5))

    def friction(self, slip):
        """mu(lambda)."""
        sign = sign_of(slip)
        return sign * self.c1 * (1 - jnp.exp(-(self.c2 * sign * slip))) - self.c3 * slip

    def stiffness(self, slip):
        """XBS: mu' = c1 c2 exp(-c2 |lambda|) - c3, in (-c3, c1 c2 - c3]."""
        return self.c1 * self.c2 * jnp.exp(-(self.c2 * sign_of(slip) * slip)) - self.c3

    def curvature(self, slip):
        """mu'' = -sign(lambda) c1 c2^2 exp(-c2 |lambda|); while braking mu'' = c2 mu' + c2 c3."""
        sign = sign_of(slip)
        return -sign * self.c1 * self.c2**2 * jnp.exp(-(self.c2 * sign * slip))

    def slip_at(self, stiffness):
        """Slip lambda < 0 at which XBS has a value in (-c3, c1 c2 - c3)."""
        return -jnp.log(self.c1 * self.c2 / (stiffness + self.c3)) / self.c2

    def peak(self) -> Peak:
        """Peak at s* = ln(c1 c2 / c3) / c2; without one inside (0, 1) the end of the interval is the peak."""
        ratio_ok = (self.c3 > 0) & (self.c2 > 0) & (self.c1 * self.c2 > self.c3)
        ratio = jnp.where(ratio_ok, self.c1 * self.c2 / jnp.where(self.c3 > 0, self.c3, 1.0), 2.0)
        inside = jnp.log(ratio) / jnp.where(ratio_ok, self.c2, 1.0)
        falling = self.c1 * self.c2 <= self.c3
        slip = jnp.where(falling, 0.0, jnp.where(ratio_ok & (inside < 1), inside, 1.0))
        return Peak(slip, self.friction(slip))
