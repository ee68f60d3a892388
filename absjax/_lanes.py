"""One iteration of a tile of lanes: the located-event scheme.

Every iteration takes one Runge-Kutta step per lane, of a size that depends on what the lane is doing:

* NORMAL: to the next grid point. If a guard has crossed on the way the step is rejected, and the lane
  will land on the crossing instead.
* LANDING, RELANDING, GRAZING: to where the guard's Hermite interpolant is zero. A landing that misses
  by more than `LANDING_TOLERANCE` grid steps lands once more.
* CROSSING: the Newton correction dt = -g / g' along the flow, then the jump. Step sizes up to here are
  constants to differentiation; dt is not, so the switching instant carries the derivative that the
  implicit function theorem gives it, and the jump the saltation term.
* IMMEDIATE: the jump alone, of a guard that is open on entering a mode, or that grazes.

Slope of the state, guards and guard rates at the lane's present point are kept in the lane: a step
costs four evaluations of the flow, the guard test included.

XLA's CPU backend fuses by repeating cheap arithmetic in every consumer. Decisions have many consumers,
so they stand behind a `lax.cond`, which is never fused, and which a tile that is all NORMAL skips.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from absjax import _locate
from absjax._locate import Ends
from absjax._numerics import rk4_step, safe_divide, tree_where

NORMAL, LANDING, RELANDING, GRAZING, CROSSING, IMMEDIATE = range(6)
LANDING_TOLERANCE = 1e-5
DIVERGED = -2
"""Mode of a lane whose state has left the finite numbers; it keeps its last finite state."""


class Grid(NamedTuple):
    """The time grid: `start + index * step`."""

    start: jax.Array
    step: jax.Array
    steps: jax.Array


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
    slot: jax.Array
    events: jax.Array
    grazes: jax.Array
    local: Local


class Tile:
    """A system of scalars as functions of (lanes,) arrays; `axes` tells which leaves carry lanes."""

    def __init__(self, system, axes):
        self.system = system
        self.axes = jax.tree.map(lambda axis: None if axis < 0 else 0, axes)
        self.ticks = hasattr(system, "tick")

    def _over(self, function, *arguments):
        return jax.vmap(function, in_axes=(self.axes, *(0 for _ in arguments)))(self.system, *arguments)

    def flow(self, time, state, mode):
        return self._over(lambda s, t, x, m: s.flow(t, x, m), time, state, mode)

    def guards(self, time, state, mode):
        values = self._over(lambda s, t, x, m: s.guards(t, x, m), time, state, mode)
        return tuple(value.astype(time.dtype) for value in values)

    def jump(self, time, state, mode, slot):
        return self._over(lambda s, t, x, m, i: s.jump(t, x, m, i), time, state, mode, slot)

    def tick(self, time, state, mode):
        return self._over(lambda s, t, x, m: s.tick(t, x, m), time, state, mode)

    def ticking(self, lanes: Lanes):
        return (lanes.doing == NORMAL) & ((lanes.index + 1) % self.system.tick_every == 0)

    def local(self, time, state, mode) -> Local:
        """Slope, guards and guard rates; the rates are d(guard)/dt along the flow."""
        slope = self.flow(time, state, mode)
        motion = jax.tree.map(lambda x, d: jnp.zeros_like(x) if d is None else d, state, slope)
        guards, rates = jax.jvp(
            lambda t, x: self.guards(t, x, mode), (time, state), (jnp.ones_like(time), motion)
        )
        return Local(slope, guards, rates)


def _pick(values: tuple[jax.Array, ...], slot):
    picked = values[0]
    for i, value in enumerate(values[1:], start=1):
        picked = jnp.where(slot == i, value, picked)
    return picked


def _first_open(guards: tuple[jax.Array, ...]):
    slot = jnp.zeros(guards[0].shape, jnp.int32)
    found = guards[0] >= 0
    for i, guard in enumerate(guards[1:], start=1):
        slot = jnp.where((guard >= 0) & ~found, i, slot)
        found = found | (guard >= 0)
    return found, slot


def enter(tile: Tile, grid: Grid, state, mode) -> Lanes:
    """The lanes at the start of the grid."""
    zero = jnp.zeros_like(mode)
    clock = jnp.broadcast_to(grid.start, mode.shape)
    here = tile.local(clock, state, mode)
    opened, slot = _first_open(here.guards) if here.guards else (zero > 0, zero)
    doing = jnp.where(opened, IMMEDIATE, NORMAL).astype(jnp.int32)
    left = jnp.broadcast_to(grid.step, mode.shape)
    return Lanes(zero, left, state, mode, doing, jnp.zeros_like(left), slot, zero, zero, here)


def is_active(grid: Grid, lanes: Lanes):
    """Whether a lane has somewhere to go."""
    return (lanes.index < grid.steps) & (lanes.mode >= 0)


def time_of(grid: Grid, lanes: Lanes):
    """Present time, from the integer index, never accumulated."""
    return grid.start + (lanes.index + 1) * grid.step - lanes.left


class Move(NamedTuple):
    """A step as `Lanes.doing` asks for it, without any decision about it."""

    step: jax.Array
    reached: Any
    """state at the end of the step, the jump made"""
    reached_mode: jax.Array
    state: Any
    """the same after the tick"""
    mode: jax.Array
    unsound: jax.Array
    """a Newton correction was asked for that the guard rate cannot give"""


def move(tile: Tile, grid: Grid, lanes: Lanes, here: Local, held) -> Move:
    """Take the step, its jump and its tick; lanes that are `held` stay where they are."""
    time = time_of(grid, lanes)
    step = lanes.left
    unsound = held & ~held
    if here.guards:
        guard, rate = _pick(here.guards, lanes.slot), _pick(here.rates, lanes.slot)
        crossing = lanes.doing == CROSSING
        sound = crossing & (rate > 0) & (jnp.abs(guard) <= rate * grid.step)
        unsound = crossing & ~sound
        correction = safe_divide(-guard, rate, sound)
        step = jnp.where(lanes.doing == NORMAL, step, jnp.where(lanes.doing < CROSSING, lanes.landing, correction))
    step = jnp.where(held, 0.0, step)
    reached = rk4_step(lambda t, x: tile.flow(t, x, lanes.mode), time, lanes.state, step, here.slope)
    reached_mode = lanes.mode
    if here.guards:
        jumping = lanes.doing >= CROSSING
        after, mode = tile.jump(time + step, reached, lanes.mode, lanes.slot)
        reached = tree_where(jumping, after, reached)
        reached_mode = jnp.where(jumping, mode, lanes.mode).astype(jnp.int32)
    state, mode = reached, reached_mode
    if tile.ticks:
        ticking = tile.ticking(lanes)
        after, next_mode = tile.tick(time + step, reached, reached_mode)
        state = tree_where(ticking, after, reached)
        mode = jnp.where(ticking, next_mode, reached_mode).astype(jnp.int32)
    return Move(step, reached, reached_mode, state, mode, unsound)


class Decision(NamedTuple):
    """What becomes of a step, and what the lane does next."""

    kept: jax.Array
    """the lane keeps its place: rejected, idle or diverged"""
    doing: jax.Array
    slot: jax.Array
    landing: jax.Array
    grazed: jax.Array


def _decide(grid: Grid, lanes: Lanes, held, unsound, there: Local, opened_by, step) -> Decision:
    """The decision when some lane of the tile may have crossed, lands, or jumps."""
    normal = lanes.doing == NORMAL
    crossed, target = lax.cond(
        jnp.any(_humps_possible(lanes, there, step, normal) & ~held),
        partial(_crossing, humps=True), partial(_crossing, humps=False),
        lanes, there, step, normal,
    )
    crossed = crossed & (lanes.doing <= LANDING) & ~held
    rejected, target, fraction, grazing = lax.cond(
        jnp.any(crossed), _land, lambda lanes, there, step, target, crossed: (crossed, target, step, crossed),
        lanes, there, step, target, crossed,
    )
    opened, open_slot = _first_open(opened_by)
    miss, closing = _pick(there.guards, lanes.slot), _pick(there.rates, lanes.slot)
    again = (lanes.doing == LANDING) & (closing > 0) & (jnp.abs(miss) > LANDING_TOLERANCE * grid.step * closing)
    correction = safe_divide(-miss, closing, again)
    ahead = jnp.clip(correction, -step, jnp.maximum(lanes.left - step, 0.0))
    entering = normal | (lanes.doing >= CROSSING)
    following = jnp.where(
        entering,
        jnp.where(opened, IMMEDIATE, NORMAL),
        jnp.where(again, RELANDING, jnp.where(lanes.doing == GRAZING, IMMEDIATE, CROSSING)),
    )
    return Decision(
        kept=held | rejected,
        doing=jnp.where(rejected, jnp.where(grazing, GRAZING, LANDING), following).astype(jnp.int32),
        slot=jnp.where(rejected, target, jnp.where(entering, open_slot, lanes.slot)).astype(jnp.int32),
        landing=jnp.where(rejected, fraction * step, ahead),
        grazed=unsound | (rejected & grazing),
    )


def _humps_possible(lanes: Lanes, there: Local, step, normal):
    """Whether a guard may have risen above zero and fallen back within the step."""
    possible = step < -jnp.inf
    for i in range(len(there.guards)):
        ends = _ends(lanes, there, step, i)
        candidate = normal | ((lanes.doing == LANDING) & (lanes.slot != i))
        possible = possible | (_locate.may_cross(ends) & (ends.g1 < 0) & candidate)
    return possible


def _crossing(lanes: Lanes, there: Local, step, normal, humps: bool):
    """Whether a guard crossed in the step just taken, and the slot that did first."""
    target = jnp.zeros_like(lanes.slot)
    best = jnp.full_like(step, 2.0)
    found = step < -jnp.inf
    for i in range(len(there.guards)):
        crosses, _, start = _locate.detect(_ends(lanes, there, step, i), humps)
        crosses = crosses & (normal | (lanes.slot != i))
        start = jnp.where(crosses, start, 2.0)
        found = found | crosses
        target = jnp.where(start < best, i, target)
        best = jnp.minimum(start, best)
    return found, target


def _land(lanes: Lanes, there: Local, step, target, crossed):
    """Crossed, target, the fraction of the step at which its guard crossed, and whether it grazes."""
    all_ends = [_ends(lanes, there, step, i) for i in range(len(there.guards))]
    ends = jax.tree.map(lambda *values: _pick(values, target), *all_ends)
    _, last, start = _locate.detect(ends, humps=True)
    return crossed, target, *_locate.refine(ends, last, start)


def _ends(lanes: Lanes, there: Local, step, i: int) -> Ends:
    return Ends(lanes.local.guards[i], step * lanes.local.rates[i], there.guards[i], step * there.rates[i])


def advance(tile: Tile, grid: Grid, lanes: Lanes) -> tuple[Lanes, jax.Array]:
    """One iteration. Returns the lanes, and which of them have kept their place."""
    active = is_active(grid, lanes)
    moved = move(tile, grid, lanes, lanes.local, ~active)
    time = time_of(grid, lanes) + moved.step
    here = there = tile.local(time, moved.state, moved.mode)
    if tile.ticks and here.guards:
        there = tile.local(time, moved.reached, moved.reached_mode)
    finite = jnp.isfinite(sum(jax.tree.leaves((moved.state, here.slope))))
    held = ~(active & finite)
    grazed = moved.unsound
    if here.guards:
        busy = lanes.doing != NORMAL
        for i in range(len(here.guards)):
            busy = busy | _locate.may_cross(_ends(lanes, there, moved.step, i)) | (here.guards[i] >= 0)

        def calm(grid, lanes, held, unsound, *_):
            return Decision(held, lanes.doing, lanes.slot, lanes.landing, unsound)

        decision = lax.cond(
            jnp.any(busy), _decide, calm, grid, lanes, held, moved.unsound, there, here.guards, moved.step
        )
    else:
        decision = Decision(held, lanes.doing, lanes.slot, lanes.landing, grazed)
    kept = decision.kept
    normal = lanes.doing == NORMAL
    accepted = normal & ~kept
    failed = active & ~finite
    before, after = (lanes.state, lanes.local), (moved.state, here)
    if here.guards:
        state, present = tree_where(kept, before, after)
    else:
        state, present = lax.cond(jnp.any(kept), tree_where, lambda kept, old, new: new, kept, before, after)
    following = Lanes(
        index=lanes.index + accepted,
        left=jnp.where(accepted, grid.step, jnp.where(kept, lanes.left, lanes.left - moved.step)),
        state=state,
        mode=jnp.where(kept, jnp.where(failed, DIVERGED, lanes.mode), moved.mode),
        doing=jnp.where(active, decision.doing, lanes.doing),
        landing=decision.landing,
        slot=decision.slot,
        events=lanes.events + (~kept & (lanes.doing >= CROSSING)),
        grazes=lanes.grazes + (active & decision.grazed),
        local=present,
    )
    return following, kept


def replay(tile: Tile, grid: Grid, lanes: Lanes, kept, state, left):
    """State and time left after the iteration `advance` made from `lanes`: the same numbers, with every
    decision taken from the record. This is what is differentiated."""
    lanes = lanes._replace(state=state, left=left)
    here = tile.local(time_of(grid, lanes), state, lanes.mode)
    moved = move(tile, grid, lanes, here, kept)
    left_after = jnp.where(lanes.doing == NORMAL, grid.step, left - moved.step)
    return tree_where(kept, state, moved.state), jnp.where(kept, left, left_after)
