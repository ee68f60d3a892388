"""Delay margins of the loops on slip and acceleration, with all crossovers, in closed form.

    L = G N,   G = K / (v s + theta),  theta = a mu',   N = ((s/wn)^2 + 2 zn s/wn + 1) / ((s/wn)^2 + 2 zd s/wn + 1)

|L(j w)| = 1 is a cubic in X = (w / wn)^2,

    K^2 ((1 - X)^2 + 4 zn^2 X) = (v^2 wn^2 X + theta^2) ((1 - X)^2 + 4 zd^2 X)

and the margin the least of mod(pi + arg L, 2 pi) / w over its positive roots, infinite without any: the loop is then
stable whatever the delay. A loop that is unstable without delay has no margin. Without the filter zn = zd.
Source: Hoang 2014 (thesis), section 8.4.1; there the crossovers with the filter are approximated.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from absjax._numerics import safe_divide

POLISHING = 3
"""Steps of Newton's method from the closed form of a root, against cancellation in it."""


class DelayMargin(NamedTuple):
    """Delay margin of a loop; differentiable but for `stable`.

    Attributes:
        margin: s; infinite where no delay makes the loop unstable, 0 where it is so without any.
        crossovers: w of the gain crossovers, rad/s, (3,); infinite where there is none.
        delays: at which the loop has a pole at each of them, s, (3,); infinite likewise.
        stable: whether the loop is stable without delay.
    """

    margin: jax.Array
    crossovers: jax.Array
    delays: jax.Array
    stable: jax.Array


@jax.jit
def delay_margin(gain, speed, theta, notch: Any = 1.0, zn: Any = 1.0, zd: Any = 1.0) -> DelayMargin:
    """Delay margin of the loop; scalars. Without `zn` and `zd` there is no filter.

    Args:
        gain: K > 0, m/s^2 as in `absjax.controllers.slip.SlipControl`.
        speed: v > 0, m/s.
        theta: a mu', m/s^2.
        notch: wn, rad/s; v / R where the filter follows the wheel.
        zn: damping of its numerator.
        zd: damping of its denominator.
    """
    args = (gain, speed, theta, notch, zn, zd)
    K, v, theta, wn, zn, zd = jnp.broadcast_arrays(*(jnp.asarray(x, jnp.result_type(float, *args)) for x in args))
    p, q, r = v * wn, 4 * zd**2 - 2, 4 * zn**2 - 2
    # (p^2 X + theta^2) (X^2 + q X + 1) - K^2 (X^2 + r X + 1), divided by p^2.
    t, k = (theta / p) ** 2, (K / p) ** 2
    X, real = _roots((q + t - k, 1 + t * q - k * r, t - k))
    crosses = real & (X > 0)
    X = jnp.where(crosses, X, 1.0)
    y = jnp.sqrt(X)
    angle = jnp.arctan2(2 * zn * y, 1 - X) - jnp.arctan2(2 * zd * y, 1 - X) - jnp.arctan2(p * y, theta)
    crossovers = jnp.where(crosses, wn * y, jnp.inf)
    delays = jnp.where(crosses, jnp.mod(math.pi + angle, 2 * math.pi) / (wn * y), jnp.inf)
    stable = _stable(K, v, theta, wn, zn, zd)
    return DelayMargin(jnp.where(stable, jnp.min(delays), 0.0), crossovers, delays, stable)


def _roots(cubic):
    """The three roots (3,) of X^3 + b X^2 + c X + d, and whether they are real; of a pair that is not, its real part.

    Trigonometric form for three real ones, hyperbolic for one; the derivative is the implicit one.
    """
    b, c, d = fixed = tuple(map(lax.stop_gradient, cubic))
    p, q = c - b * b / 3, 2 * b**3 / 27 - b * c / 3 + d
    three = (4 * p**3 + 27 * q * q <= 0) & (p < 0)
    m = 2 * jnp.sqrt(jnp.where(three, -p, 3.0) / 3)
    turned = jnp.arccos(jnp.clip(safe_divide(3 * q, p * m, three), -1.0, 1.0)) / 3
    half = 0.5 * q
    root = jnp.sqrt(jnp.maximum(half**2 + p**3 / 27, 0.0))
    # The summand that does not cancel; the other follows from the product of both.
    large = jnp.cbrt(-half - jnp.where(half < 0, -root, root))
    single = large - safe_divide(p, 3 * large, large != 0)
    first = jnp.arange(3) == 0
    cosines = m * jnp.cos(turned - 2 * math.pi / 3 * jnp.arange(3))
    X = jnp.where(three, cosines, jnp.where(first, single, -0.5 * single)) - b / 3
    real = three | first

    def newton(_, X):
        slope = _slope(fixed, X)
        return X - safe_divide(_value(fixed, X), slope, real & (slope != 0))

    X = lax.stop_gradient(lax.fori_loop(0, POLISHING, newton, X))
    slope = _slope(fixed, X)
    return X - safe_divide(_value(cubic, X), slope, real & (slope != 0)), real


def _value(cubic, X):
    b, c, d = cubic
    return ((X + b) * X + c) * X + d


def _slope(cubic, X):
    b, c, _ = cubic
    return (3 * X + 2 * b) * X + c


def _stable(K, v, theta, wn, zn, zd):
    """Routh's criterion for (v s + theta) (s^2 + 2 zd wn s + wn^2) + K (s^2 + 2 zn wn s + wn^2)."""
    a2 = theta + K + 2 * zd * v * wn
    a1 = v * wn + 2 * (zd * theta + zn * K)
    a0 = (theta + K) * wn
    return (a2 > 0) & (a0 > 0) & (a2 * a1 > v * a0)
