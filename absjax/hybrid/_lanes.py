"""What a lane of a tile is doing, where it stands on the time grid, and how far its next step goes."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

PART, NORMAL, LANDING, LATE_LANDING, LAST_LANDING, CROSSING, TOUCHING, IMMEDIATE = -1, 0, 1, 6, 12, 13, 14, 15
"""What a lane is doing: see `absjax.hybrid._step`."""
LANDING_TOLERANCE = 1e-5
"""How far a landing may be off its guard, as a share of the grid step."""


class Grid(NamedTuple):
    """The time grid, `start + index * step`, how many switchings a lane may make on it, how many
    iterations more than those of the grid its parts may take, and how many segments of the scan all may take."""

    start: jax.Array
    step: jax.Array
    steps: jax.Array
    max_events: jax.Array
    spare: jax.Array
    segments: jax.Array


class Local(NamedTuple):
    """What is known at the lanes' present points: d(state)/dt, guard values, guard rates."""

    slope: Any
    guards: tuple[jax.Array, ...]
    rates: tuple[jax.Array, ...]


class Lanes(NamedTuple):
    """The lanes of a tile, arrays (lanes,). `index` grid points are behind, `left` seconds to the next."""

    index: jax.Array
    left: jax.Array
    state: Any
    mode: jax.Array
    doing: jax.Array
    landing: jax.Array
    landed_before: jax.Array
    """size of the last landing, s"""
    missed_before: jax.Array
    """guard at its end"""
    slot: jax.Array
    events: jax.Array
    grazes: jax.Array
    strain: jax.Array
    """local errors of the steps so far, added up; each as a share of the state"""
    pace: jax.Array
    """longest step to try, s"""
    spent: jax.Array
    """iterations on parts of grid steps"""
    local: Local


def is_active(grid: Grid, lanes: Lanes):
    """Whether a lane has somewhere to go, and may: a switching that is due beyond the last allowed is not made."""
    exhausted = (lanes.events >= grid.max_events) & (lanes.doing >= CROSSING)
    return (lanes.index < grid.steps) & (lanes.mode >= 0) & ~exhausted


def time_of(grid: Grid, lanes: Lanes):
    """Present time, from the integer index, never accumulated."""
    return grid.start + (lanes.index + 1) * grid.step - lanes.left


def step_of(lanes: Lanes, held):
    """Size of the step `Lanes.doing` asks for; lanes that are `held` stay where they are."""
    step = jnp.where(lanes.doing == NORMAL, lanes.left, jnp.where(lanes.doing == IMMEDIATE, 0.0, lanes.landing))
    return jnp.where(held, 0.0, step)
