"""A curve that is linear in its coefficients, on two exponentials of given rates."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.tyres.base import Peak, sign_of


@model
class ExponentialBasis:
    """Linearly parametrised curve, for lambda <= 0 and extended oddly:

        mu = th0 lambda + th1 (exp(d1 lambda) - 1) / d1 + th2 (exp(d2 lambda) - 1) / d2

    so that mu''' = a0 + a1 mu' + a2 mu'' with a0 = d1 d2 th0, a1 = -d1 d2, a2 = d1 + d2.
    Source: Hoang et al. 2014, eq. 18.
    """

    title: ClassVar[str] = "exponential basis"
    beyond_peak: ClassVar[tuple[str, ...]] = ()

    theta0: Any = parameter("th0, linear coefficient, no unit", trainable=True, span=(-2.0, 1.0))
    theta1: Any = parameter("th1, coefficient of the slow exponential, no unit", trainable=True, span=(-80.0, 80.0))
    theta2: Any = parameter("th2, coefficient of the fast exponential, no unit", trainable=True, span=(-80.0, 80.0))
    rate1: Any = parameter("d1, slow rate, no unit", default=22.0, low=0.0, open_low=True)
    rate2: Any = parameter("d2, fast rate, no unit", default=52.0, low=0.0, open_low=True)

    def basis(self, slip):
        """The three functions th0, th1, th2 multiply, stacked on the last axis."""
        sign = sign_of(slip)
        s = sign * slip
        columns = [s, -jnp.expm1(-self.rate1 * s) / self.rate1, -jnp.expm1(-self.rate2 * s) / self.rate2]
        return jnp.stack([sign * column for column in columns], axis=-1)

    def friction(self, slip):
        """mu(lambda)."""
        columns = self.basis(slip)
        return self.theta0 * columns[..., 0] + self.theta1 * columns[..., 1] + self.theta2 * columns[..., 2]

    def stiffness(self, slip):
        """XBS: mu' = th0 + th1 exp(-d1 |lambda|) + th2 exp(-d2 |lambda|)."""
        s = sign_of(slip) * slip
        return self.theta0 + self.theta1 * jnp.exp(-self.rate1 * s) + self.theta2 * jnp.exp(-self.rate2 * s)

    def curvature(self, slip):
        """mu''(lambda)."""
        sign = sign_of(slip)
        s = sign * slip
        slow = self.theta1 * self.rate1 * jnp.exp(-self.rate1 * s)
        return -sign * (slow + self.theta2 * self.rate2 * jnp.exp(-self.rate2 * s))

    def jerk_coefficients(self):
        """(a0, a1, a2) of mu''' = a0 + a1 mu' + a2 mu'' while braking."""
        return self.rate1 * self.rate2 * self.theta0, -self.rate1 * self.rate2, self.rate1 + self.rate2

    def peak(self) -> Peak:
        """Largest friction on 0 <= |lambda| <= 1: a grid of 201 slips, then Newton steps on mu' = 0."""
        grid = jnp.linspace(0.0, 1.0, 201)
        best = jnp.argmax(jax.vmap(self.friction)(grid), axis=0)
        slip = grid[best]
        inner = (best > 0) & (best < 200)
        for _ in range(4):
            curvature = self.curvature(slip)
            newton = slip - self.stiffness(slip) / jnp.where(curvature < 0, curvature, -1.0)
            slip = jnp.where(inner & (curvature < 0), jnp.clip(newton, 0.0, 1.0), slip)
        return Peak(slip, self.friction(slip))


def fit_exponential_basis(slip, friction, *, rate1: float = 22.0, rate2: float = 52.0) -> ExponentialBasis:
    """Unweighted linear least squares of `ExponentialBasis` to points (slip, friction).

    Args:
        slip: of the points, (points,), any sign.
        friction: of the points, (points,).
        rate1: d1, the slow rate, which is not fitted.
        rate2: d2, the fast rate, which is not fitted.

    Raises:
        ValueError: with fewer than three points, or shapes that differ.
    """
    slip, friction = jnp.asarray(slip), jnp.asarray(friction)
    if slip.shape != friction.shape or slip.ndim != 1 or slip.size < 3:
        raise ValueError(f"slip {slip.shape} and friction {friction.shape} must be one shape (points,), points >= 3")
    template = ExponentialBasis(0.0, 0.0, 0.0, rate1, rate2)
    theta, *_ = jnp.linalg.lstsq(template.basis(slip), friction)
    return ExponentialBasis(theta[0], theta[1], theta[2], rate1, rate2)
