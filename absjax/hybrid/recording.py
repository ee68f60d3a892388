"""What a rollout keeps of its course: points of the time grid, and the switchings."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.hybrid._lanes import Grid, Lanes, time_of
from absjax.hybrid._scan import Record
from absjax.results import UNUSED


class Trajectory(NamedTuple):
    """Grid points of every lane: arrays (lanes, points). Points beyond the end of a lane repeat its end."""

    time: jax.Array
    state: Any
    mode: jax.Array
    valid: jax.Array


class SwitchLog(NamedTuple):
    """Switchings of every lane: arrays (lanes, max_events). Entries past the count are `UNUSED`."""

    time: jax.Array
    source: jax.Array
    target: jax.Array


def collect(grid: Grid, steps: int, start, lane: Lanes, records: Record, save_every: int, max_logged: int):
    """Trajectory and switch log of one lane from its records (iterations,)."""
    iterations = jnp.arange(records.index.shape[0], dtype=jnp.int32)
    clock = grid.start + (records.index + 1) * grid.step - records.left
    trajectory = switches = None
    if save_every:
        points = steps // save_every
        wanted = records.arrived & (records.index % save_every == 0)
        place = jnp.where(wanted, records.index // save_every - 1, points)
        at = jnp.full(points, -1, jnp.int32).at[place].set(iterations, mode="drop")
        valid = at >= 0
        end_time = time_of(grid, lane)

        def series(first, path, last):
            return jnp.concatenate([first[None], tree_where(valid, path[at], jnp.broadcast_to(last, path[at].shape))])

        trajectory = Trajectory(
            series(grid.start, clock, end_time),
            jax.tree.map(series, start[0], records.state, lane.state),
            series(start[1], records.mode, lane.mode),
            jnp.concatenate([jnp.ones(1, bool), valid]),
        )
    if max_logged:
        place = jnp.where(records.jumped, jnp.cumsum(records.jumped) - 1, max_logged)
        at = jnp.full(max_logged, -1, jnp.int32).at[place].set(iterations, mode="drop")
        logged = at >= 0
        switches = SwitchLog(
            jnp.where(logged, clock[at], time_of(grid, lane)),
            jnp.where(logged, records.source[at], UNUSED),
            jnp.where(logged, records.mode[at], UNUSED),
        )
    return trajectory, switches
