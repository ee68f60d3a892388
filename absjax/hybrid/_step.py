"""One iteration of a tile of lanes: the located-event scheme.

Every iteration takes one Runge-Kutta step per lane, of a size that depends on what the lane is doing:

* NORMAL: to the next grid point. If a guard has crossed on the way the step is rejected, and the lane
  will land on the crossing instead.
* PART: the same over a part of the way, where the flow is too fast for the whole (`absjax.hybrid._parts`).
* LANDING to LAST_LANDING: to where the guard's Hermite interpolant is zero, only to see how far that misses; the lane
  keeps its place, and the step is corrected by -g / g'. A landing that misses by more than `LANDING_TOLERANCE` grid
  steps is tried again. The first time g' is the rate of the guard along the flow; from then on it is the slope of the
  secant: where the flow is stiff, the guard at the end of a Runge-Kutta step of growing size rises at another rate.
  Where no landing finds the guard at zero, as on a hump that only the interpolant has, the step is taken in halves,
  whose interpolants are nearer.
* CROSSING: over the corrected step, which ends on the guard, and the jump. A guard that a jump has left at zero and
  that rises is crossed as well, in a step of size 0: one that another channel has reached in the same instant.
* TOUCHING: the same for a guard that only grazes zero.
* IMMEDIATE: the jump alone, of a guard that is open on entering a mode.

Slope of the state, guards and guard rates at the lane's present point are kept in the lane: a step
costs four evaluations of the flow, the guard test included.

XLA's CPU backend fuses by repeating cheap arithmetic in every consumer. Decisions have many consumers,
so they stand behind a `lax.cond`, which is never fused, and which a tile that is all NORMAL skips.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from absjax._numerics import first_open, pick, rk4_step, safe_divide, tree_where
from absjax.hybrid import _locate
from absjax.hybrid._lanes import (
    CROSSING,
    IMMEDIATE,
    LANDING,
    LANDING_TOLERANCE,
    LAST_LANDING,
    LATE_LANDING,
    NORMAL,
    PART,
    TOUCHING,
    Grid,
    Lanes,
    Local,
    is_active,
    step_of,
    time_of,
)
from absjax.hybrid._locate import Ends
from absjax.hybrid._parts import is_coarse, local_error, may_be_halved, parted
from absjax.lanes import mapped
from absjax.results import DIVERGED

LATE_TOLERANCE = 1e-4
"""From LATE_LANDING on: what is still further off is no rounding, but a flow too stiff for the tries before."""
SECANT_SHORTEST = 1e-6
"""Landings nearer to each other than this share of a grid step have no secant: rounding is in the way."""


@partial(jax.jit, static_argnums=(0, 1))
def _of_all_lanes(method: str, axes, system, *arguments):
    """A method of every lane's system. Jitted, so that it is traced and differentiated once for all calls of it."""
    leaves, treedef = axes
    axes = mapped(treedef.unflatten(leaves))
    return jax.vmap(lambda system, *arguments: getattr(system, method)(*arguments), (axes, *(0 for _ in arguments)))(
        system, *arguments
    )


class Tile:
    """A system of scalars as functions of (lanes,) arrays; `axes` tells which leaves carry lanes."""

    def __init__(self, system, axes):
        self.system = system
        leaves, treedef = jax.tree.flatten(axes)
        self._axes = tuple(leaves), treedef
        self.ticks = hasattr(system, "tick")

    def _of_all(self, method, *arguments):
        return _of_all_lanes(method, self._axes, self.system, *arguments)

    def flow(self, time, state, mode):
        return self._of_all("flow", time, state, mode)

    def guards(self, time, state, mode):
        values = self._of_all("guards", time, state, mode)
        return tuple(value.astype(time.dtype) for value in values)

    def jump(self, time, state, mode, slot):
        return self._of_all("jump", time, state, mode, slot)

    def tick(self, time, state, mode):
        return self._of_all("tick", time, state, mode)

    def importance(self, time, state, mode):
        if not hasattr(self.system, "importance"):
            return jnp.ones_like(time)
        return self._of_all("importance", time, state, mode)

    def scales(self, state):
        """Magnitudes below which a state counts as that large."""
        if not hasattr(self.system, "scales"):
            return jax.tree.map(lambda _: 0.0, state)
        return self._of_all("scales", state)

    def ticking(self, lanes: Lanes):
        return (lanes.doing == NORMAL) & ((lanes.index + 1) % self.system.tick_every == 0)

    def local(self, time, state, mode) -> Local:
        """Slope, guards and guard rates; the rates are d(guard)/dt along the flow."""
        slope = self.flow(time, state, mode)
        motion = jax.tree.map(lambda x, d: jnp.zeros_like(x) if d is None else d, state, slope)
        guards, rates = jax.jvp(lambda t, x: self.guards(t, x, mode), (time, state), (jnp.ones_like(time), motion))
        return Local(slope, guards, rates)


def enter(tile: Tile, grid: Grid, state, mode) -> Lanes:
    """The lanes at the start of the grid."""
    zero = jnp.zeros_like(mode)
    clock = jnp.broadcast_to(grid.start, mode.shape)
    here = tile.local(clock, state, mode)
    opened, slot = first_open(here.guards) if here.guards else (zero > 0, zero)
    doing = jnp.where(opened, IMMEDIATE, NORMAL).astype(jnp.int32)
    left = jnp.broadcast_to(grid.step, mode.shape)
    none = jnp.zeros_like(left)
    return Lanes(zero, left, state, mode, doing, none, none, none, slot, zero, zero, none, left, zero, here)


def _move(tile: Tile, grid: Grid, lanes: Lanes, step):
    """State and mode after the step and its jump; the same after the tick, where one is due; the step's last slope."""
    time = time_of(grid, lanes)
    state, last = rk4_step(lambda t, x: tile.flow(t, x, lanes.mode), time, lanes.state, step, lanes.local.slope)
    mode = lanes.mode
    if lanes.local.guards:
        jumping = lanes.doing >= CROSSING
        after, next_mode = tile.jump(time + step, state, mode, lanes.slot)
        state = tree_where(jumping, after, state)
        mode = jnp.where(jumping, next_mode, mode).astype(jnp.int32)
    if not tile.ticks:
        return (state, mode), (state, mode), last
    ticking = tile.ticking(lanes)
    after, next_mode = tile.tick(time + step, state, mode)
    ticked = tree_where(ticking, after, state), jnp.where(ticking, next_mode, mode).astype(jnp.int32)
    return (state, mode), ticked, last


class Decision(NamedTuple):
    """What becomes of a step, and what the lane does next."""

    kept: jax.Array
    """the lane keeps its place: rejected, landing, idle or diverged"""
    doing: jax.Array
    slot: jax.Array
    landing: jax.Array
    missed: jax.Array
    """guard at the end of a landing"""
    grazed: jax.Array
    pace: jax.Array


def _left_behind(grid: Grid, lanes: Lanes, here: Local, i: int):
    """Whether guard `i` falls from where a jump has left it, its own or that of another in the same instant: at zero,
    but for rounding."""
    guard, rate = here.guards[i], here.rates[i]
    return (lanes.doing >= CROSSING) & (rate < 0) & (guard <= -LANDING_TOLERANCE * grid.step * rate)


def _arrived_at(grid: Grid, lanes: Lanes, here: Local, slot):
    """Whether the guard of `slot` stands at zero after a jump, but for rounding, and rises: its instant is its own."""
    guard, rate = pick(slot, here.guards), pick(slot, here.rates)
    return (lanes.doing >= CROSSING) & (rate > 0) & (guard <= LANDING_TOLERANCE * grid.step * rate)


def _decide(grid: Grid, lanes: Lanes, held, coarse, share, there: Local, here: Local, step) -> Decision:
    """The decision when some lane of the tile may have crossed, lands, jumps, or takes parts of a step."""
    normal = lanes.doing <= NORMAL
    crossed, target = lax.cond(
        jnp.any(_humps_possible(lanes, there, step, normal) & ~held),
        partial(_crossing, humps=True),
        partial(_crossing, humps=False),
        *(grid, lanes, there, step, normal),
    )
    crossed = crossed & (lanes.doing <= LANDING) & ~held & ~coarse
    rejected, target, fraction, grazing = lax.cond(
        jnp.any(crossed),
        _land,
        lambda lanes, there, step, target, crossed: (crossed, target, step, crossed),
        *(lanes, there, step, target, crossed),
    )
    trying = (lanes.doing >= LANDING) & (lanes.doing <= LAST_LANDING)
    miss, closing = pick(lanes.slot, there.guards), pick(lanes.slot, there.rates)
    apart, risen = lanes.landing - lanes.landed_before, miss - lanes.missed_before
    secant = safe_divide(risen, apart, (lanes.doing > LANDING) & (apart != 0))
    closing = jnp.where((secant > 0) & (jnp.abs(apart) > SECANT_SHORTEST * grid.step), secant, closing)
    sound = (closing > 0) & (jnp.abs(miss) <= closing * grid.step)
    tolerance = jnp.where(lanes.doing < LATE_LANDING, LANDING_TOLERANCE, LATE_TOLERANCE)
    again = (lanes.doing < LAST_LANDING) & (jnp.abs(miss) > tolerance * grid.step * closing)
    corrected = jnp.clip(lanes.landing - safe_divide(miss, closing, sound), 0.0, lanes.left)
    landed = jnp.where(sound, jnp.where(again, lanes.doing + 1, CROSSING), TOUCHING)
    tried = jnp.minimum(lanes.pace, lanes.left)
    short = trying & ~sound & (miss < 0) & ~rejected & may_be_halved(grid, lanes, tried)
    halved = coarse | short
    opened_by = (jnp.where(_left_behind(grid, lanes, here, i), -1.0, g) for i, g in enumerate(here.guards))
    opened, open_slot = first_open(tuple(opened_by))
    at_once = opened & _arrived_at(grid, lanes, here, open_slot)
    doing = jnp.where(trying, landed, jnp.where(at_once, CROSSING, jnp.where(opened, IMMEDIATE, NORMAL)))
    slot = jnp.where(trying, lanes.slot, open_slot)
    kept = held | rejected | trying | coarse
    doing = jnp.where(rejected, jnp.where(grazing, TOUCHING, LANDING), jnp.where(halved, NORMAL, doing))
    pace, part = parted(grid, lanes, kept, halved, share, jnp.where(short, tried, step))
    doing = jnp.where((doing == NORMAL) & (part > 0), PART, doing)
    return Decision(
        kept=kept,
        doing=doing.astype(jnp.int32),
        slot=jnp.where(rejected, target, slot).astype(jnp.int32),
        landing=jnp.where(
            rejected, fraction * step, jnp.where(trying & ~short, corrected, jnp.where(doing == PART, part, 0.0))
        ),
        missed=jnp.where(trying, miss, lanes.missed_before),
        grazed=jnp.where(rejected, grazing, trying & ~sound & ~short),
        pace=pace,
    )


def _humps_possible(lanes: Lanes, there: Local, step, normal):
    """Whether a guard may have risen above zero and fallen back within the step."""
    possible = step < -jnp.inf
    for i in range(len(there.guards)):
        ends = _ends(lanes, there, step, i)
        candidate = normal | ((lanes.doing == LANDING) & (lanes.slot != i))
        possible = possible | (_locate.may_cross(ends) & (ends.g1 < 0) & candidate)
    return possible


def _crossing(grid: Grid, lanes: Lanes, there: Local, step, normal, humps: bool):
    """Whether a guard crossed in the step just taken, and the slot that did first.

    In a landing another guard counts where it crosses before the end. One that crosses there, as two that mean the
    same do, has its turn after the jump: else each would send the lane back to the other for ever.
    """
    target = jnp.zeros_like(lanes.slot)
    at_the_end = 1 - safe_divide(LANDING_TOLERANCE * grid.step, step, step > 0, 1.0)
    best = jnp.full_like(step, 2.0)
    found = step < -jnp.inf
    for i in range(len(there.guards)):
        crosses, _, start = _locate.detect(_ends(lanes, there, step, i), humps)
        crosses = crosses & (normal | ((lanes.slot != i) & (start < at_the_end)))
        start = jnp.where(crosses, start, 2.0)
        found = found | crosses
        target = jnp.where(start < best, i, target)
        best = jnp.minimum(start, best)
    return found, target


def _land(lanes: Lanes, there: Local, step, target, crossed):
    """Crossed, target, the fraction of the step at which its guard crossed, and whether it grazes."""
    all_ends = [_ends(lanes, there, step, i) for i in range(len(there.guards))]
    ends = jax.tree.map(lambda *values: pick(target, values), *all_ends)
    _, last, start = _locate.detect(ends, humps=True)
    return crossed, target, *_locate.refine(ends, last, start)


def _finite(tree):
    """Whether every number of a lane is finite; of an array its sum counts."""
    leaves = jax.tree.leaves(tree)
    return jnp.isfinite(sum(leaf if leaf.ndim == 1 else leaf.sum(axis=range(1, leaf.ndim)) for leaf in leaves))


def _ends(lanes: Lanes, there: Local, step, i: int) -> Ends:
    return Ends(lanes.local.guards[i], step * lanes.local.rates[i], there.guards[i], step * there.rates[i])


def advance(tile: Tile, grid: Grid, lanes: Lanes) -> tuple[Lanes, jax.Array]:
    """One iteration. Returns the lanes, and which of them have kept their place."""
    active = is_active(grid, lanes)
    step = step_of(lanes, ~active)
    (reached, reached_mode), (state, mode), last = _move(tile, grid, lanes, step)
    time = time_of(grid, lanes) + step
    here = there = tile.local(time, state, mode)
    if tile.ticks:
        there = tile.local(time, reached, reached_mode)
    finite = _finite((state, here.slope))
    held = ~(active & finite)
    share = lax.cond(
        jnp.any(lanes.doing <= NORMAL),
        lambda before, after, last, slope: local_error(before, after, last, slope, step, tile.scales(before)),
        lambda *_: jnp.zeros_like(step),
        *(lanes.state, reached, last, there.slope),
    )

    def calm(grid, lanes, held, *_):
        return Decision(held, lanes.doing, lanes.slot, lanes.landing, lanes.missed_before, held & ~held, lanes.pace)

    if here.guards:
        busy = lanes.doing != NORMAL
        for i in range(len(here.guards)):
            busy = busy | _locate.may_cross(_ends(lanes, there, step, i)) | (here.guards[i] >= 0)
        coarse = is_coarse(grid, lanes, share, step) & ~held
        busy = busy | coarse | ((lanes.pace < grid.step) & ~held)
        decision = lax.cond(jnp.any(busy), _decide, calm, grid, lanes, held, coarse, share, there, here, step)
    else:
        coarse, decision = held & ~held, calm(grid, lanes, held)
    kept = decision.kept
    arrived, moved = (lanes.doing == NORMAL) & ~kept, (lanes.doing <= NORMAL) & ~kept
    strain = share * tile.importance(time, state, mode)
    failed = active & ~finite
    before, after = (lanes.state, lanes.local), (state, here)
    if here.guards:
        state, local = tree_where(kept, before, after)
    else:
        state, local = lax.cond(jnp.any(kept), tree_where, lambda kept, old, new: new, kept, before, after)
    following = Lanes(
        index=lanes.index + arrived,
        left=jnp.where(arrived, grid.step, jnp.where(kept, lanes.left, lanes.left - step)),
        state=state,
        mode=jnp.where(kept, jnp.where(failed, DIVERGED, lanes.mode), mode),
        doing=jnp.where(active, decision.doing, lanes.doing),
        landing=decision.landing,
        landed_before=lanes.landing,
        missed_before=decision.missed,
        slot=decision.slot,
        events=lanes.events + (~kept & (lanes.doing >= CROSSING)),
        grazes=lanes.grazes + (active & decision.grazed),
        strain=lanes.strain + jnp.where(moved, strain, 0.0),
        pace=decision.pace,
        spent=lanes.spent + (coarse | (active & (lanes.doing == PART))),
        local=local,
    )
    return following, kept
