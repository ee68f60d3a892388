"""The rollout engine: a hybrid system through one `jax.lax.scan`, differentiable through its switchings.

Lanes run at their own pace (see `absjax._lanes`); the scan is cut into segments, and a segment in which
no lane of the tile has anywhere to go is skipped. Derivatives, forward and reverse, come from the record
of the steps a segment has taken (see `absjax._tangent`): the tangent of each step is linear in the
tangent before it, so no root finding, no rejected step and no chain of recomputation is differentiated.
"""

import enum
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_derivatives import SymbolicZero
from jax.sharding import Mesh, PartitionSpec

from absjax import _lanes, _tangent
from absjax._lanes import DIVERGED, Grid, Lanes, Tile
from absjax.hybrid import HybridSystem
from absjax.parameters import lane_axes

SEGMENT = 64
"""Iterations of the scan between two looks whether any lane is still under way."""
TILE = 256
"""Most lanes that run as one batch; larger ensembles are cut into tiles."""
SMALLEST_TILE = 32
"""An ensemble is spread over devices as long as tiles stay this large."""
REPLAY_BYTES = 2**28
"""Above this size of the record of all lanes, `checkpoint=None` recomputes segments instead."""


class Status(enum.IntEnum):
    """How a lane ended."""

    COMPLETED = 0
    """It reached the end of the grid."""
    FINISHED = 1
    """A jump ended the manoeuvre."""
    BUDGET_EXHAUSTED = 2
    """It was still under way when the scan ended: more switchings than `max_events` allows for."""
    DIVERGED = 3
    """Its state left the finite numbers; it keeps the last finite state."""


class RolloutError(RuntimeError):
    """A lane did not end as it should."""


class Trajectory(NamedTuple):
    """Grid points of every lane: arrays (lanes, points). Points beyond the end of a lane repeat its end."""

    time: jax.Array
    state: Any
    mode: jax.Array
    valid: jax.Array


class SwitchLog(NamedTuple):
    """Switchings of every lane: arrays (lanes, max_events). Entries past the count have source = target = -9."""

    time: jax.Array
    source: jax.Array
    target: jax.Array


class Rollout(NamedTuple):
    """Result of a rollout. Every array has a leading axis of lanes unless the system had none.

    Attributes:
        time: time at the end [s]; differentiable where a jump ended the lane.
        state, mode: at the end.
        status: a `Status` code.
        events: switchings made.
        grazes: switchings whose guard only touched zero: no derivative of the instant is taken there.
        trajectory: grid points, if asked for.
        switches: log of the switchings, if asked for.
    """

    time: jax.Array
    state: Any
    mode: jax.Array
    status: jax.Array
    events: jax.Array
    grazes: jax.Array
    trajectory: Trajectory | None
    switches: SwitchLog | None

    def raise_if_failed(self) -> "Rollout":
        """Return self.

        Raises:
            RolloutError: if a lane ran out of its event budget or diverged; names lanes and reason.
        """
        status = np.atleast_1d(np.asarray(self.status))
        for code in (Status.DIVERGED, Status.BUDGET_EXHAUSTED):
            lanes = np.flatnonzero(status == code)
            if lanes.size:
                raise RolloutError(f"{lanes.size} of {status.size} lanes {code.name}, the first is lane {lanes[0]}")
        return self


class _Plan(NamedTuple):
    """Static choices of a rollout."""

    segments: int
    length: int
    save: bool
    checkpoint: bool


class _Record(NamedTuple):
    """What one iteration left behind: differentiable state and time left, and the decisions."""

    state: Any
    left: jax.Array
    index: jax.Array
    source: jax.Array
    mode: jax.Array
    arrived: jax.Array
    jumped: jax.Array


def _zero_tangent(leaf):
    if jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
        return jnp.zeros_like(leaf)
    return np.zeros(jnp.shape(leaf), jax.dtypes.float0)


def _segment(system_axes, plan: _Plan):
    """`(system, grid, lanes) -> (lanes, records)` over `plan.length` iterations, with its derivative rule."""

    def iterate(system, grid, lanes, keep_lanes):
        def body(before, _):
            after, kept = _lanes.advance(Tile(system, system_axes), grid, before)
            record = None
            if plan.save:
                jumped = ~kept & (before.doing >= _lanes.CROSSING)
                arrived = ~kept & (before.doing == _lanes.NORMAL)
                record = _Record(after.state, after.left, after.index, before.mode, after.mode, arrived, jumped)
            trace = (before._replace(local=None), kept) if keep_lanes else None
            return after, (record, trace)

        return lax.scan(body, lanes, None, length=plan.length)

    @jax.custom_jvp
    def segment(system, grid, lanes):
        after, (records, _) = iterate(system, grid, lanes, keep_lanes=False)
        return after, records

    def rule(primals, tangents):
        system, grid, lanes = primals
        leaves, treedef = jax.tree.flatten(system)
        dots = jax.tree.leaves(tangents[0], is_leaf=lambda t: isinstance(t, SymbolicZero))
        live = [not isinstance(dot, SymbolicZero) and dot.dtype != jax.dtypes.float0 for dot in dots]
        moving = [dot for dot, alive in zip(dots, live) if alive]
        after, (records, (befores, kepts)) = iterate(system, grid, lanes, keep_lanes=True)

        def tile_of(values):
            values = iter(values)
            system = treedef.unflatten([next(values) if alive else leaf for leaf, alive in zip(leaves, live)])
            return Tile(system, system_axes)

        def tangent(carry, trace):
            before, kept = trace
            values = [leaf for leaf, alive in zip(leaves, live) if alive]
            carry = _tangent.tangent(tile_of, values, grid, before, kept, moving, *carry)
            return carry, carry if plan.save else None

        dense = partial(jax.tree.map, lambda t: jnp.zeros(t.shape, t.dtype) if isinstance(t, SymbolicZero) else t)
        is_zero = {"is_leaf": lambda t: isinstance(t, SymbolicZero)}
        start = (dense(tangents[2].state, **is_zero), dense(tangents[2].left, **is_zero))
        (d_state, d_left), d_path = lax.scan(jax.checkpoint(tangent, prevent_cse=False), start, (befores, kepts))
        d_after = jax.tree.map(_zero_tangent, after)._replace(state=d_state, left=d_left)
        d_records = jax.tree.map(_zero_tangent, records)
        if plan.save:
            d_records = d_records._replace(state=d_path[0], left=d_path[1])
        return (after, records), (d_after, d_records)

    segment.defjvp(rule, symbolic_zeros=True)
    return jax.checkpoint(segment, prevent_cse=False) if plan.checkpoint else segment


def _run_tile(system, state, mode, grid: Grid, system_axes, plan: _Plan):
    """Final lanes and the records (segments * length, lanes) of one tile."""
    lanes = _lanes.enter(Tile(system, system_axes), grid, state, mode)
    segment = _segment(system_axes, plan)

    def skip(system, grid, lanes):
        shape = jax.eval_shape(segment, system, grid, lanes)[1]
        return lanes, jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)

    def body(lanes, _):
        under_way = jnp.any(_lanes.is_active(grid, lanes))
        return lax.cond(under_way, segment, skip, system, grid, lanes)

    lanes, records = lax.scan(body, lanes, None, length=plan.segments)
    return lanes, jax.tree.map(lambda leaf: leaf.reshape((-1,) + leaf.shape[2:]), records)


def _collect(grid: Grid, steps: int, start, lane: Lanes, records: _Record, save_every: int, max_logged: int):
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
        end_time = _lanes.time_of(grid, lane)

        def series(first, path, last):
            return jnp.concatenate([first[None], jnp.where(valid, path[at], last)])

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
            jnp.where(logged, clock[at], _lanes.time_of(grid, lane)),
            jnp.where(logged, records.source[at], -9),
            jnp.where(logged, records.mode[at], -9),
        )
    return trajectory, switches


def _lane_count(axes, tree, what: str, lanes: int | None) -> int | None:
    for (path, leaf), axis in zip(jax.tree_util.tree_leaves_with_path(tree), jax.tree.leaves(axes)):
        if axis < 0:
            continue
        size = jnp.shape(leaf)[0]
        if lanes is not None and size != lanes:
            name = what + jax.tree_util.keystr(path)
            raise ValueError(f"{name} has {size} lanes, others have {lanes}; all ensembles must have one size")
        lanes = size
    return lanes


def _as_float(dtype):
    def cast(leaf):
        return leaf if jnp.issubdtype(jnp.result_type(leaf), jnp.integer) else jnp.asarray(leaf, dtype)

    return cast


def rollout(
    system: HybridSystem,
    state: Any,
    mode: Any = 0,
    *,
    step: float,
    steps: int,
    start: float = 0.0,
    max_events: int = 200,
    save_every: int = 0,
    save_switches: bool = False,
    checkpoint: bool | None = None,
    tile: int | None = None,
) -> Rollout:
    """Roll a hybrid system out over `steps` grid steps, every switching located inside its step.

    One lane or an ensemble: wherever `system`, `state` or `mode` has a leaf with one leading axis more
    than a single lane needs, that axis counts lanes (`absjax.parameters.lane_axes`); other leaves are
    shared. Lanes run in tiles, the tiles spread over all local devices. Differentiable in forward and
    reverse mode with respect to system and state; dtype follows `state`.

    Args:
        system: see `absjax.hybrid.HybridSystem`.
        state: pytree of float scalars at `start`, or of (lanes,) arrays.
        mode: int at `start`, or a (lanes,) array.
        step: grid step [s], > 0.
        steps: number of grid steps.
        start: time of the first grid point [s].
        max_events: switchings a lane may make; more end it with `Status.BUDGET_EXHAUSTED`.
        save_every: keep every so many grid points in `trajectory`; 0 keeps none.
        save_switches: keep the log of the switchings.
        checkpoint: recompute segments in the reverse pass instead of keeping the record of their
            steps. None decides by the size of that record.
        tile: lanes per batch. Lanes that run long together belong together: a tile ends with its last lane.
            None decides by the number of lanes and devices.

    Returns:
        A `Rollout`; without lanes its arrays are scalars.

    Raises:
        ValueError: if `steps`, `step`, `max_events`, `save_every` or `tile` is not admissible, or
            two ensembles differ in size.
    """
    least_of = {"steps": (steps, 1), "max_events": (max_events, 0), "save_every": (save_every, 0), "tile": (tile or 1, 1)}
    for name, (value, least) in least_of.items():
        if int(value) != value or value < least:
            raise ValueError(f"{name} = {value} must be an integer >= {least}")
    if not isinstance(step, jax.core.Tracer) and not 0 < float(step) < np.inf:
        raise ValueError(f"step = {step} must be a positive number of seconds")
    if save_every > steps:
        raise ValueError(f"save_every = {save_every} exceeds steps = {steps}")
    # Types are settled here, weak ones too, so that equal shapes never compile twice.
    dtype = jnp.result_type(*(jnp.asarray(leaf).dtype for leaf in jax.tree.leaves(state)), jnp.float32)
    cast = _as_float(dtype)
    system, state = jax.tree.map(cast, system), jax.tree.map(cast, state)
    grid = Grid(jnp.asarray(start, dtype), jnp.asarray(step, dtype), jnp.asarray(steps, jnp.int32))
    mode = jnp.asarray(mode, jnp.int32)
    return _rollout(system, state, mode, grid, int(steps), int(max_events), int(save_every), save_switches, checkpoint, tile)


@partial(jax.jit, static_argnums=(4, 5, 6, 7, 8, 9))
def _rollout(system, state, mode, grid, steps, max_events, save_every, save_switches, checkpoint, tile):
    axes = lane_axes(system)
    lanes = _lane_count(axes, system, "system", None)
    lanes = _lane_count(lane_axes(state), state, "state", lanes)
    lanes = _lane_count(lane_axes(mode), mode, "mode", lanes)
    single = lanes is None
    lanes = 1 if single else lanes

    # Scalars shared by all lanes are spread over them: their derivatives then add up lane by lane,
    # and are summed once.
    def spread(leaf, axis):
        return jnp.broadcast_to(leaf, (lanes,)) if axis < 0 and jnp.ndim(leaf) == 0 else leaf

    axes = jax.tree.map(lambda axis, leaf: 0 if jnp.ndim(leaf) == 0 else axis, axes, system)
    system, state, mode = jax.tree.map(lambda leaf: spread(leaf, -1), (system, state, mode))

    smooth = not jax.eval_shape(lambda: _one_lane_guards(system, axes, state, grid))
    iterations = steps if smooth else steps + 4 * max_events
    length = min(SEGMENT, iterations)
    segments = -(-iterations // length)
    words = len(jax.tree.leaves(state)) + 4
    if checkpoint is None:
        checkpoint = lanes * iterations * words * grid.step.dtype.itemsize > REPLAY_BYTES
    plan = _Plan(segments, length, bool(save_every or save_switches), bool(checkpoint))

    def run_tile(system, state, mode):
        final, records = _run_tile(system, state, mode, grid, axes, plan)
        kept = (None, None)
        if plan.save:
            collect = partial(_collect, grid, steps, save_every=save_every, max_logged=max_events * save_switches)
            kept = jax.vmap(lambda x, m, lane, r: collect(start=(x, m), lane=lane, records=r), in_axes=(0, 0, 0, 1))(
                state, mode, final, records
            )
        status = jnp.where(
            final.mode == DIVERGED,
            Status.DIVERGED,
            jnp.where(
                final.mode < 0,
                Status.FINISHED,
                jnp.where(final.index >= steps, Status.COMPLETED, Status.BUDGET_EXHAUSTED),
            ),
        ).astype(jnp.int32)
        time = _lanes.time_of(grid, final)
        return Rollout(time, final.state, final.mode, status, final.events, final.grazes, *kept)

    tile = tile or min(TILE, max(SMALLEST_TILE, -(-lanes // len(jax.local_devices()))))
    result = _over_tiles(run_tile, axes, lanes, tile)(system, state, mode)
    return jax.tree.map(lambda leaf: leaf[0], result) if single else result


def _one_lane_guards(system, axes, state, grid):
    first = jax.tree.map(lambda leaf, axis: leaf if axis < 0 else leaf[0], system, axes)
    return first.guards(grid.start, jax.tree.map(lambda leaf: leaf[0], state), jnp.int32(0))


def _over_tiles(run_tile, axes, lanes: int, tile: int):
    """Cut the lanes into tiles, map over them, and share the tiles out over the local devices."""
    if lanes <= tile:
        return run_tile
    devices = np.array(jax.local_devices())
    per_device = -(-lanes // (tile * devices.size))
    padded = tile * devices.size * per_device

    # Tiles are dealt out to the devices in turn, so that each gets its share of the long ones.
    def deal(leaf):
        leaf = jnp.concatenate([leaf, jnp.broadcast_to(leaf[-1:], (padded - lanes, *leaf.shape[1:]))])
        return leaf.reshape(per_device, devices.size, tile, *leaf.shape[1:]).swapaxes(0, 1).reshape(leaf.shape)

    def collect(leaf):
        tiles = leaf.reshape(devices.size, per_device, tile, *leaf.shape[1:])
        return tiles.swapaxes(0, 1).reshape(leaf.shape)[:lanes]

    def on_device(system, state, mode):
        def cut(leaf):
            return leaf.reshape((per_device, tile) + leaf.shape[1:])

        leaves, treedef = jax.tree.flatten(system)
        batched = [axis >= 0 for axis in jax.tree.leaves(axes)]
        moving = [cut(leaf) for leaf, many in zip(leaves, batched) if many]

        def one(args):
            moving, state, mode = args
            values = iter(moving)
            whole = treedef.unflatten([next(values) if many else leaf for leaf, many in zip(leaves, batched)])
            return run_tile(whole, state, mode)

        result = lax.map(one, (moving, *jax.tree.map(cut, (state, mode))))
        return jax.tree.map(lambda leaf: leaf.reshape((-1,) + leaf.shape[2:]), result)

    def run(system, state, mode):
        system = jax.tree.map(lambda leaf, axis: leaf if axis < 0 else deal(leaf), system, axes)
        state, mode = jax.tree.map(deal, (state, mode))
        over = PartitionSpec("lanes")
        specs = jax.tree.map(lambda axis: PartitionSpec() if axis < 0 else over, axes)
        program = on_device
        if devices.size > 1:
            mesh = Mesh(devices, ("lanes",))
            program = jax.shard_map(
                on_device, mesh=mesh, in_specs=(specs, over, over), out_specs=over, check_vma=False
            )
        return jax.tree.map(collect, program(system, state, mode))

    return run
