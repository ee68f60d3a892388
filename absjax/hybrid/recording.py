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


class Kept(NamedTuple):
    """How much of its course a rollout keeps; static."""

    every: int
    """grid points from one of the trajectory to the next; 0: no trajectory"""
    points: int
    """of the trajectory, after the first"""
    switchings: int
    """in the log; 0: no log"""


def collect(grid: Grid, kept: Kept, start, lane: Lanes, records: Record):
    """Trajectory and switch log of one lane from its records (iterations,)."""
    iterations = jnp.arange(records.index.shape[0], dtype=jnp.int32)
    clock = grid.start + (records.index + 1) * grid.step - records.left
    trajectory = switches = None
    if kept.every:
        wanted = records.arrived & (records.index % kept.every == 0)
        place = jnp.where(wanted, records.index // kept.every - 1, kept.points)
        at = jnp.full(kept.points, -1, jnp.int32).at[place].set(iterations, mode="drop")
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
    if kept.switchings:
        place = jnp.where(records.jumped, jnp.cumsum(records.jumped) - 1, kept.switchings)
        at = jnp.full(kept.switchings, -1, jnp.int32).at[place].set(iterations, mode="drop")
        logged = at >= 0
        switches = SwitchLog(
            jnp.where(logged, clock[at], time_of(grid, lane)),
            jnp.where(logged, records.source[at], UNUSED),
            jnp.where(logged, records.mode[at], UNUSED),
        )
    return trajectory, switches
