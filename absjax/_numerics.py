"""Small numerical tools every model uses: pytree arithmetic, masked division, one Runge-Kutta step."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp


def per_lane(values, leaf):
    """Values (lanes,) with as many axes as a leaf (lanes, ...), to be broadcast over it; scalars as they are."""
    return jnp.reshape(values, jnp.shape(values) + (1,) * (jnp.ndim(leaf) - jnp.ndim(values)))


def tree_where(condition, yes: Any, no: Any) -> Any:
    """Leafwise `jnp.where` over two pytrees of equal structure; leaves may have axes after those of the condition."""
    return jax.tree.map(lambda a, b: jnp.where(per_lane(condition, a), a, b), yes, no)


def pick(index, values):
    """The entry of `values` at an integer index; the first where there is no such entry."""
    picked = values[0]
    for i, value in enumerate(values[1:], start=1):
        picked = jnp.where(index == i, value, picked)
    return picked


def first_open(guards: tuple) -> tuple[jax.Array, jax.Array]:
    """Whether any of the guards is at or above zero, and the first that is."""
    found, slot = jnp.asarray(guards[0] >= 0), jnp.zeros(jnp.shape(guards[0]), jnp.int32)
    for i, guard in enumerate(guards[1:], start=1):
        slot = jnp.where((guard >= 0) & ~found, i, slot)
        found = found | (guard >= 0)
    return found, slot


def safe_divide(numerator, denominator, valid, otherwise=0.0):
    """`numerator / denominator` where `valid`, else `otherwise`; no NaN in value or gradient (double-where)."""
    return jnp.where(valid, numerator / jnp.where(valid, denominator, 1.0), otherwise)


def computed_once(tree: Any) -> Any:
    """The same values to the bit, each computed once for all that use it; for what is long and has many consumers.

    XLA's CPU backend fuses cheap arithmetic into every consumer and computes it there anew, but no division. Here every
    float is divided by 1, of which the compiler cannot know that it is: by itself where it is not a number.
    """

    def once(leaf):
        if not jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
            return leaf
        return leaf / jax.lax.stop_gradient(jnp.where(leaf == leaf, 1.0, leaf))

    return jax.tree.map(once, tree)


def rk4_step(flow: Callable, time, state: Any, step, slope: Any) -> tuple[Any, Any]:
    """One classical fourth-order Runge-Kutta step: the state at its end, and the last of the four slopes.

    Args:
        flow: `flow(time, state) -> d(state)/dt`, with None in the place of what stays constant.
        slope: `flow(time, state)`, which the caller has at hand already.
    """

    def ahead(derivative, h):
        return jax.tree.map(lambda x, d: x if d is None else x + h * d, state, derivative)

    def combine(x, a, b, c, d):
        return x if a is None else x + step * (1 / 6) * (a + 2 * (b + c) + d)

    k1 = slope
    k2 = flow(time + step / 2, ahead(k1, step / 2))
    k3 = flow(time + step / 2, ahead(k2, step / 2))
    k4 = flow(time + step, ahead(k3, step))
    return jax.tree.map(combine, state, k1, k2, k3, k4), k4
