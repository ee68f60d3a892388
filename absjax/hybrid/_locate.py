"""Where a guard crosses zero inside a step, from its values and slopes at both ends.

The guard is replaced by its cubic Hermite interpolant on the unit interval,

    p(s) = g0 + s (d0 + s (b + s c)),   b = 3 (g1 - g0) - 2 d0 - d1,   c = d0 + d1 - 2 (g1 - g0),

with d0, d1 the slopes times the step. A guard that ends the step at or above zero has crossed; so has
one whose interior maximum s_max = d0 / (-b + sqrt(b^2 - 3 c d0)) is at or above zero, although it has
fallen back by the end of the step.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide

GRAZING_SLOPE = 1e-6
"""A root whose slope is below this share of the guard's excursion in the step is grazing."""


class Ends(NamedTuple):
    """Guard values and slopes-times-step at both ends of a step."""

    g0: jax.Array
    d0: jax.Array
    g1: jax.Array
    d1: jax.Array


def _coefficients(e: Ends):
    rise = e.g1 - e.g0
    return 3 * rise - 2 * e.d0 - e.d1, e.d0 + e.d1 - 2 * rise


def may_cross(e: Ends):
    """Whether the interpolant can reach zero after the start: a Bezier control value of it does."""
    return jnp.maximum(jnp.maximum(e.g0 + e.d0 * (1 / 3), e.g1 - e.d1 * (1 / 3)), e.g1) >= 0


def detect(e: Ends, humps: bool) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Whether the guard crosses in the step, a fraction by which it has, and the secant estimate.

    Without `humps`, guards that have fallen back by the end of the step are not looked for.
    """
    crosses, last, rise = e.g1 >= 0, jnp.ones_like(e.g1), e.g1 - e.g0
    if humps:
        b, c = _coefficients(e)
        falling = jnp.sqrt(jnp.maximum(b * b - 3 * c * e.d0, 0.0)) - b
        peak = safe_divide(e.d0, falling, falling != 0, -1.0)
        at_peak = e.g0 + peak * (e.d0 + peak * (b + peak * c))
        hump = ~crosses & (peak > 0) & (peak < 1) & (at_peak >= 0)
        last, rise = jnp.where(hump, peak, last), jnp.where(hump, at_peak - e.g0, rise)
        crosses = crosses | hump
    return crosses, last, jnp.clip(safe_divide(-e.g0, rise, crosses & (rise > 0)), 0.0, 1.0) * last


def refine(e: Ends, last, start) -> tuple[jax.Array, jax.Array]:
    """Root of the interpolant in [0, last] by two safeguarded Newton steps; and whether it grazes there."""
    b, c = _coefficients(e)
    low, high = jnp.zeros_like(start), last
    s = start
    for _ in range(2):
        value = e.g0 + s * (e.d0 + s * (b + s * c))
        slope = e.d0 + s * (2 * b + 3 * c * s)
        low, high = jnp.where(value < 0, s, low), jnp.where(value < 0, high, s)
        newton = s - safe_divide(value, slope, slope > 0)
        s = jnp.where((newton >= low) & (newton <= high) & (slope > 0), newton, 0.5 * (low + high))
    slope = e.d0 + s * (2 * b + 3 * c * s)
    excursion = jnp.abs(e.g0) + jnp.abs(e.g1) + jnp.abs(e.d0) + jnp.abs(e.d1)
    return s, slope <= GRAZING_SLOPE * excursion
