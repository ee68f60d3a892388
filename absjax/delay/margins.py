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
        crossovers: w of the gain crossovers, rad/s, three; infinite where there is none.
        delays: at which the loop has a pole at each of them, s; infinite likewise.
        stable: whether the loop is stable without delay.
    """

    margin: jax.Array
    crossovers: tuple[jax.Array, jax.Array, jax.Array]
    delays: tuple[jax.Array, jax.Array, jax.Array]
    stable: jax.Array


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
    cubic = (jnp.ones_like(t), q + t - k, 1 + t * q - k * r, t - k)
    crossovers, delays = zip(*(_crossing(X, real, K, v, theta, wn, zn, zd) for X, real in _roots(cubic)))
    stable = _stable(K, v, theta, wn, zn, zd)
    least = jnp.minimum(jnp.minimum(delays[0], delays[1]), delays[2])
    return DelayMargin(jnp.where(stable, least, 0.0), crossovers, delays, stable)


def _crossing(X, real, K, v, theta, wn, zn, zd):
    """Crossover and delay of a root of the cubic."""
    crosses = real & (X > 0)
    X = jnp.where(crosses, X, 1.0)
    y = jnp.sqrt(X)
    angle = jnp.arctan2(2 * zn * y, 1 - X) - jnp.arctan2(2 * zd * y, 1 - X) - jnp.arctan2(v * wn * y, theta)
    lead = jnp.mod(math.pi + angle, 2 * math.pi)
    return jnp.where(crosses, wn * y, jnp.inf), jnp.where(crosses, lead / (wn * y), jnp.inf)


def _roots(cubic):
    """The three roots of X^3 + b X^2 + c X + d, and whether they are real; of a pair that is not, its real part.

    Trigonometric form for three real ones, hyperbolic for one; the derivative is the implicit one.
    """
    fixed = tuple(map(lax.stop_gradient, cubic))
    _, b, c, d = fixed
    shift, p, q = -b / 3, c - b * b / 3, 2 * b**3 / 27 - b * c / 3 + d
    discriminant = -(4 * p**3 + 27 * q * q)
    three = (discriminant >= 0) & (p < 0)
    m = 2 * jnp.sqrt(jnp.where(three, -p, 3.0) / 3)
    cosine = jnp.clip(safe_divide(3 * q, p * m, three), -1.0, 1.0)
    turned = jnp.arccos(cosine) / 3
    half = 0.5 * q
    root = jnp.sqrt(jnp.maximum(half**2 + p**3 / 27, 0.0))
    # The summand that does not cancel; the other follows from the product of both.
    large = jnp.cbrt(-half - jnp.where(half < 0, -root, root))
    single = large - safe_divide(p, 3 * large, large != 0)
    found = []
    for i in range(3):
        X = shift + jnp.where(three, m * jnp.cos(turned - 2 * math.pi * i / 3), single if i == 0 else -0.5 * single)
        real = three if i else jnp.ones_like(three)
        for _ in range(POLISHING):
            X = X - jnp.where(real, _newton(fixed, X), 0.0)
        slope = _slope(fixed, X)
        found.append((X - safe_divide(_value(cubic, X), slope, real & (slope != 0)), real))
    return found


def _value(cubic, X):
    a, b, c, d = cubic
    return ((a * X + b) * X + c) * X + d


def _slope(cubic, X):
    a, b, c, _ = cubic
    return (3 * a * X + 2 * b) * X + c


def _newton(cubic, X):
    slope = _slope(cubic, X)
    return safe_divide(_value(cubic, X), slope, slope != 0)


def _stable(K, v, theta, wn, zn, zd):
    """Routh's criterion for (v s + theta) (s^2 + 2 zd wn s + wn^2) + K (s^2 + 2 zn wn s + wn^2)."""
    a2 = theta + K + 2 * zd * v * wn
    a1 = v * wn + 2 * (zd * theta + zn * K)
    a0 = (theta + K) * wn
    return (a2 > 0) & (a0 > 0) & (a2 * a1 > v * a0)
