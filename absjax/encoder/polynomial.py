"""Least-squares polynomials through stamps, on the unit interval.

By polynomials orthogonal over the points (Forsythe's recurrence), so no system of equations is solved:

    p_0 = 1,   p_{j+1}(s) = (s - a_j) p_j(s) - b_j p_{j-1}(s)
    a_j = <s p_j, p_j> / <p_j, p_j>,   b_j = <p_j, p_j> / <p_{j-1}, p_{j-1}>

with <f, g> the sum over the points.
Source: Aguado-Rojas 2019, appendix C, for the scaling; Forsythe 1957 for the recurrence.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide


def unit_interval(intervals, teeth, counts, dtype) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Stamps shifted and scaled to the unit interval.

    Args:
        intervals: times between successive edges, newest first, (n - 1,).
        teeth: teeth between them, (n - 1,).
        counts: which of the n edges count, newest first, (n,).

    Returns:
        The scaled stamps, newest (1) first; the span they were scaled by; the teeth passed since, negative. The
        stamps of edges that do not count mean nothing.
    """

    def before(values):
        steps = jnp.where(counts[1:], values.astype(dtype), 0.0)
        return jnp.concatenate([jnp.zeros(1, dtype), jnp.cumsum(steps)])

    ages = before(intervals)
    span = ages[-1]
    return 1 - safe_divide(ages, span, span > 0), span, -before(teeth)


class Fit(NamedTuple):
    """A polynomial at a point: scalars, and sums over the points it was fitted to."""

    value: jax.Array
    slope: jax.Array
    curvature: jax.Array
    by_slope: jax.Array
    """weights of the fitted values in the slope, (n,)"""
    by_curvature: jax.Array
    """and in the curvature, (n,)"""


def fit(s, y, counts, now, order: int) -> Fit:
    """Least-squares polynomial of an order through the points (s, y) that count, at `now`."""
    weight = counts.astype(s.dtype)
    residual = y * weight
    one, zero = jnp.ones_like(now), jnp.zeros_like(now)
    basis, basis_before = weight, jnp.zeros_like(s)
    at, at_before = (one, zero, zero), (zero, zero, zero)
    square_before = one
    value, slope, curvature = zero, zero, zero
    by_slope = by_curvature = jnp.zeros_like(s)
    for j in range(order + 1):
        square = jnp.sum(basis * basis)
        coefficient = safe_divide(jnp.sum(residual * basis), square, square > 0)
        residual = residual - coefficient * basis
        value, slope, curvature = (x + coefficient * p for x, p in zip((value, slope, curvature), at))
        share = safe_divide(basis, square, square > 0)
        by_slope, by_curvature = by_slope + at[1] * share, by_curvature + at[2] * share
        a = safe_divide(jnp.sum(s * basis * basis), square, square > 0)
        b = safe_divide(square, square_before, square_before > 0) if j else zero
        basis, basis_before = (s - a) * basis - b * basis_before, basis
        (p0, p1, p2), (q0, q1, q2) = at, at_before
        at_before = at
        at = ((now - a) * p0 - b * q0, p0 + (now - a) * p1 - b * q1, 2 * p1 + (now - a) * p2 - b * q2)
        square_before = square
    return Fit(value, slope, curvature, by_slope, by_curvature)
