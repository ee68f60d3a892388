"""How a wheel turned: its angle at equally spaced instants, and between two of them.

Between two instants the angle is the quintic Hermite polynomial of angle, speed and acceleration at both:
its error is (period^6 / 46080) d^6 th/dt^6 where the motion is smooth.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp


class Rotation(NamedTuple):
    """Motion of a wheel at an instant; or at equally spaced ones, arrays (samples,)."""

    angle: Any
    """th [rad]"""
    speed: Any
    """w = th' [rad/s], >= 0"""
    acceleration: Any
    """w' [rad/s^2]"""

    @classmethod
    def of_speed(cls, speed, acceleration, period) -> "Rotation":
        """The rotation of a wheel whose speed and acceleration are known at equally spaced instants, (..., samples).

        th(k+1) - th(k) = period (w(k) + w(k+1)) / 2 + period^2 (w'(k) - w'(k+1)) / 12, of fourth order.
        """
        speed, acceleration = jnp.asarray(speed), jnp.asarray(acceleration)
        w = 0.5 * (speed[..., 1:] + speed[..., :-1])
        change = acceleration[..., :-1] - acceleration[..., 1:]
        turned = jnp.cumsum(period * w + period**2 / 12 * change, axis=-1)
        return cls(jnp.concatenate([jnp.zeros_like(turned[..., :1]), turned], axis=-1), speed, acceleration)


def hermite(before: Rotation, after: Rotation, period) -> tuple[jax.Array, ...]:
    """Of the angle turned since `before`, a polynomial of degree 5 in the share s of the period; from s^1 on."""
    rise = after.angle - before.angle
    d0, d1 = period * before.speed, period * after.speed
    h0, h1 = 0.5 * period**2 * before.acceleration, 0.5 * period**2 * after.acceleration
    # What is left of angle, slope and curvature at s = 1 after the first three terms.
    a, b, c = rise - d0 - h0, d1 - d0 - 2 * h0, 2 * (h1 - h0)
    return d0, h0, 10 * a - 4 * b + 0.5 * c, -15 * a + 7 * b - c, 6 * a - 3 * b + 0.5 * c
