"""Derivatives in time of what is composed: lists (value, rate, rate of the rate, ...) of scalars or arrays."""

from collections.abc import Callable, Sequence
from math import factorial
from typing import Any

import jax
import jax.numpy as jnp


def along(function: Callable[[Any], Any], derivatives: Sequence[Any], order: int) -> list[Any]:
    """`function` of a signal whose derivatives are given, and its own derivatives up to `order`."""
    zero = 0.0 * jnp.sum(derivatives[0])

    def curve(time):
        return function(sum(d * time**k / factorial(k) for k, d in enumerate(derivatives[: order + 1])))

    return _derivatives(curve, zero, order)


def _derivatives(curve, zero, order: int) -> list[Any]:
    found, current = [curve(zero)], curve
    for _ in range(order):
        current = _rate(current)
        found.append(current(zero))
    return found


def _rate(curve):
    return lambda time: jax.jvp(curve, (time,), (jnp.ones_like(time),))[1]


def along_flow(field: Callable[[Any], Any], x, order: int) -> list[Any]:
    """x of x' = field(x), and its derivatives up to `order`: Lie derivatives of the identity."""
    found, current = [x], lambda x: x
    for _ in range(order):
        current = _lie(current, field)
        found.append(current(x))
    return found


def _lie(function, field):
    return lambda x: jax.jvp(function, (x,), (field(x),))[1]
