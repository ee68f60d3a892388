"""Tangent of one iteration of `absjax.hybrid._step`, decisions and step sizes taken from its record.

With x(h) the Runge-Kutta step of size h from the lane's place, and g(h) the guard at its end,

    d x1 = dx|h + x_h dh,    dh = d(left)       for a step to the next grid point
                             dh = h d(left) / left   for a step over a part of the way there
                             dh = -dg|h / g_h   for a step that ends on a guard

where |h is the derivative at fixed h. The second is the implicit function theorem for g(h) = 0, with
the scheme's own g_h: the result is the derivative of the numerical scheme, saltation included.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from absjax._numerics import per_lane, pick, rk4_step, safe_divide, tree_where
from absjax.hybrid._lanes import CROSSING, NORMAL, PART, Grid, Lanes, step_of, time_of
from absjax.hybrid._step import Tile


def tangent(
    tile_of: Callable[[Any], Tile],
    parameters: Any,
    grid: Grid,
    lanes: Lanes,
    kept,
    d_parameters: Any,
    d_state: Any,
    d_left,
):
    """Tangents of state and time left after the iteration, and of the size of a step that ended on a guard.

    Args:
        tile_of: the tile for given parameters.
        lanes: the lanes before the iteration; only place and decisions are used.
        kept: lanes that kept their place in it.
        d_parameters, d_state, d_left: tangents before it.
    """
    step, time = step_of(lanes, kept), time_of(grid, lanes)
    tile = tile_of(parameters)
    switches = bool(tile.guards(time, lanes.state, lanes.mode))

    def end(parameters, time, state, step):
        tile = tile_of(parameters)
        slope = tile.flow(time, state, lanes.mode)
        state, _ = rk4_step(lambda t, x: tile.flow(t, x, lanes.mode), time, state, step, slope)
        guard = pick(lanes.slot, tile.guards(time + step, state, lanes.mode)) if switches else None
        return state, guard

    at = (parameters, time, lanes.state)
    (state, _), (d_end, d_guard) = jax.jvp(lambda p, t, x: end(p, t, x, step), at, (d_parameters, -d_left, d_state))
    d_step = jnp.zeros_like(step)
    normal = lanes.doing == NORMAL
    if switches:
        _, (by_step, guard_by_step) = jax.jvp(lambda h: end(*at, h), (step,), (jnp.ones_like(step),))
        sound = (lanes.doing == CROSSING) & (guard_by_step > 0) & ~kept
        share = safe_divide(step, lanes.left, lanes.doing == PART, 1.0)
        onward = (lanes.doing <= NORMAL) & ~kept
        d_step = jnp.where(onward, share * d_left, safe_divide(-d_guard, guard_by_step, sound))
        d_end = jax.tree.map(lambda d, rate: d + rate * per_lane(d_step, rate), d_end, by_step)

    def transition(function, applies, state, d_state):
        """State and tangent after a jump or tick where it `applies`."""

        def applied(state, d_state, d_time):
            arguments = (parameters, time + step, state), (d_parameters, d_time, d_state)
            after, d_after = jax.jvp(function, *arguments)
            return tree_where(applies, after, state), tree_where(applies, d_after, d_state)

        return lax.cond(jnp.any(applies), applied, lambda s, d, _: (s, d), state, d_state, d_step - d_left)

    if switches:
        jumping = lanes.doing >= CROSSING
        state, d_end = transition(
            lambda p, t, x: tile_of(p).jump(t, x, lanes.mode, lanes.slot)[0], jumping, state, d_end
        )
    if tile.ticks:
        _, d_end = transition(lambda p, t, x: tile_of(p).tick(t, x, lanes.mode)[0], tile.ticking(lanes), state, d_end)
    d_left_after = jnp.where(normal, 0.0, d_left - d_step)
    d_landing = jnp.where(normal, 0.0, d_step)
    return tree_where(kept, d_state, d_end), jnp.where(kept, d_left, d_left_after), d_landing
