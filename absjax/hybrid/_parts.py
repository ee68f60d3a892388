"""Steps in parts, where the flow is too fast for a whole grid step.

A step whose local error is above `LARGEST_SHARE` of the state is rejected and halved; the parts grow again as errors
allow. A lane has `Grid.spare` iterations for that, and takes steps as they are from then on. For x' = s x parts are
those with |h s| below 1 or so, where x at the end of a step rises and falls with its size: landings converge, and
nothing is crossed by overshooting.
"""

import jax
import jax.numpy as jnp

from absjax._numerics import per_lane, safe_divide
from absjax.hybrid._lanes import LANDING_TOLERANCE, NORMAL, Grid, Lanes

LARGEST_SHARE = 1e-4
"""Local error, as a share of the state, above which a step is halved."""
GROWTH = 32.0
"""How far below it an error has to be for the next step to be twice as long: the error goes with its fourth power."""
SMALLEST_PART = 1 / 128
"""of a grid step that is made"""


def local_error(state, reached, last, slope, step, scales):
    """Local error of a step as a share of the state, that of the worst of its numbers.

    What the last of the four slopes, k4, is off the slope at the end of the step, f(x1), makes h/6 (k4 - f(x1)) of it.
    For x' = s x it is (h s)^4 / 72 of x: 0.001 at h s = 1/2, beyond all bounds where h s nears 3.
    """

    def share(before, after, k4, k, least):
        if k is None:
            return jnp.zeros_like(step)
        change = per_lane(step, k) * (jnp.abs(k4) + jnp.abs(k))
        scale = jnp.abs(before) + jnp.abs(after) + change + per_lane(least, k)
        error = safe_divide(per_lane(step, k) / 6 * jnp.abs(k4 - k), scale, scale > 0)
        return error.max(axis=range(1, error.ndim))

    worst = jnp.zeros_like(step)
    shares = jax.tree.map(share, state, reached, last, slope, scales, is_leaf=lambda leaf: leaf is None)
    for error in jax.tree.leaves(shares):
        worst = jnp.maximum(worst, error)
    return worst


def is_coarse(grid: Grid, lanes: Lanes, share, step):
    """Whether a step is too long for the flow, and may be halved."""
    return (lanes.doing <= NORMAL) & (share > LARGEST_SHARE) & may_be_halved(grid, lanes, step)


def may_be_halved(grid: Grid, lanes: Lanes, step):
    """Whether a step is long enough for it, and the lane has iterations to spare."""
    return (step > SMALLEST_PART * grid.step) & (lanes.spent < grid.spare)


def parted(grid: Grid, lanes: Lanes, kept, halved, share, step):
    """Longest step to try next, and the part of the way to the next grid point that it is; 0 for the whole."""
    eased = (lanes.doing <= NORMAL) & ~kept & (share < LARGEST_SHARE / GROWTH)
    pace = jnp.where(halved, 0.5 * step, jnp.where(eased, 2 * lanes.pace, lanes.pace))
    pace = jnp.minimum(pace, grid.step)
    ahead = jnp.where(kept, lanes.left, jnp.where(lanes.doing == NORMAL, grid.step, lanes.left - step))
    parts = jnp.ceil((1 - LANDING_TOLERANCE) * ahead / pace)
    return pace, jnp.where((parts > 1) & (lanes.spent < grid.spare), ahead / jnp.maximum(parts, 1.0), 0.0)
