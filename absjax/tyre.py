"""Tyre curves: friction coefficient mu against wheel slip, its slope (XBS), curvature and peak.

Wheel slip is lambda = (R w - v) / v: negative while braking, -1 for a locked wheel. Curves are odd in
lambda. The extended braking stiffness (XBS) is mu'(lambda): positive on the stable side of the peak,
negative beyond it.
"""

from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp

from absjax.parameters import model, parameter


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


def _sign(slip):
    return jnp.where(slip < 0, -1.0, 1.0)


@model
class Burckhardt:
    """Burckhardt's curve, extended oddly: mu = sign(lambda) [c1 (1 - exp(-c2 s)) - c3 s], s = |lambda|.

    Coefficients are stored positive, for braking and driving alike. Source: Aguado-Rojas 2019, eq. 2.5.
    """

    c1: jax.Array | float = parameter("c1, friction of the saturated curve, no unit", low=0.0, trainable=True)
    c2: jax.Array | float = parameter("c2, how fast it saturates with slip, no unit", low=0.0, trainable=True)
    c3: jax.Array | float = parameter("c3, loss of friction with slip, no unit", low=0.0, trainable=True)

    def friction(self, slip):
        """mu(lambda)."""
        sign = _sign(slip)
        return sign * self.c1 * (1 - jnp.exp(-(self.c2 * sign * slip))) - self.c3 * slip

    def stiffness(self, slip):
        """XBS: mu' = c1 c2 exp(-c2 |lambda|) - c3, in (-c3, c1 c2 - c3]."""
        return self.c1 * self.c2 * jnp.exp(-(self.c2 * _sign(slip) * slip)) - self.c3

    def curvature(self, slip):
        """mu'' = -sign(lambda) c1 c2^2 exp(-c2 |lambda|); while braking mu'' = c2 mu' + c2 c3."""
        sign = _sign(slip)
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


@model
class ExponentialBasis:
    """Linearly parametrised curve, for lambda <= 0 and extended oddly:

        mu = th0 lambda + th1 (exp(d1 lambda) - 1) / d1 + th2 (exp(d2 lambda) - 1) / d2

    so that mu''' = a0 + a1 mu' + a2 mu'' with a0 = d1 d2 th0, a1 = -d1 d2, a2 = d1 + d2.
    Source: Hoang et al. 2014, eq. 18.
    """

    theta0: jax.Array | float = parameter("th0, linear coefficient, no unit")
    theta1: jax.Array | float = parameter("th1, coefficient of the slow exponential, no unit")
    theta2: jax.Array | float = parameter("th2, coefficient of the fast exponential, no unit")
    rate1: jax.Array | float = parameter("d1, slow rate, no unit", default=22.0, low=0.0, open_low=True)
    rate2: jax.Array | float = parameter("d2, fast rate, no unit", default=52.0, low=0.0, open_low=True)

    def basis(self, slip):
        """The three functions th0, th1, th2 multiply, stacked on the last axis."""
        sign = _sign(slip)
        s = sign * slip
        columns = [s, -jnp.expm1(-self.rate1 * s) / self.rate1, -jnp.expm1(-self.rate2 * s) / self.rate2]
        return jnp.stack([sign * column for column in columns], axis=-1)

    def friction(self, slip):
        """mu(lambda)."""
        columns = self.basis(slip)
        return self.theta0 * columns[..., 0] + self.theta1 * columns[..., 1] + self.theta2 * columns[..., 2]

    def stiffness(self, slip):
        """XBS: mu' = th0 + th1 exp(-d1 |lambda|) + th2 exp(-d2 |lambda|)."""
        s = _sign(slip) * slip
        return self.theta0 + self.theta1 * jnp.exp(-self.rate1 * s) + self.theta2 * jnp.exp(-self.rate2 * s)

    def curvature(self, slip):
        """mu''(lambda)."""
        sign = _sign(slip)
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
        slip, friction: arrays (points,), any sign of slip.
        rate1, rate2: the rates, which are not fitted.

    Raises:
        ValueError: with fewer than three points, or shapes that differ.
    """
    slip, friction = jnp.asarray(slip), jnp.asarray(friction)
    if slip.shape != friction.shape or slip.ndim != 1 or slip.size < 3:
        raise ValueError(f"slip {slip.shape} and friction {friction.shape} must be one shape (points,), points >= 3")
    template = ExponentialBasis(0.0, 0.0, 0.0, rate1, rate2)
    theta, *_ = jnp.linalg.lstsq(template.basis(slip), friction)
    return ExponentialBasis(theta[0], theta[1], theta[2], rate1, rate2)
