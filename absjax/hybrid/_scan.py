"""The scan over the iterations of a tile, cut into segments, and its derivative rule.

A segment in which no lane of the tile has anywhere to go is skipped. Derivatives, forward and reverse,
come from the record of the steps a segment has taken (see `absjax.hybrid._tangent`): the tangent of each step
is linear in the tangent before it, so no root finding, no rejected step and no chain of recomputation
is differentiated.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_derivatives import SymbolicZero

from absjax.hybrid import _step, _tangent
from absjax.hybrid._lanes import CROSSING, NORMAL, Grid, Lanes, is_active
from absjax.hybrid._step import Tile


class Plan(NamedTuple):
    """Static choices of a rollout."""

    segments: int
    """of the scan; `Grid.segments` of them are used"""
    length: int
    save: bool
    checkpoint: bool


class Record(NamedTuple):
    """What one iteration left behind: differentiable state and time left, and the decisions."""

    state: Any
    left: jax.Array
    index: jax.Array
    source: jax.Array
    mode: jax.Array
    arrived: jax.Array
    jumped: jax.Array


def _is_zero(tangent) -> bool:
    return isinstance(tangent, SymbolicZero)


def _zero_tangent(leaf):
    if jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
        return jnp.zeros_like(leaf)
    return np.zeros(jnp.shape(leaf), jax.dtypes.float0)


def _segment(system_axes, plan: Plan):
    """`(system, grid, lanes) -> (lanes, records)` over `plan.length` iterations, with its derivative rule."""

    def iterate(system, grid, lanes, keep_trace):
        def body(before, _):
            after, kept = _step.advance(Tile(system, system_axes), grid, before)
            record = None
            if plan.save:
                jumped = ~kept & (before.doing >= CROSSING)
                arrived = ~kept & (before.doing == NORMAL)
                record = Record(after.state, after.left, after.index, before.mode, after.mode, arrived, jumped)
            decisions = before._replace(
                local=None, landed_before=None, missed_before=None, strain=None, pace=None, spent=None
            )
            trace = (decisions, kept) if keep_trace else None
            return after, (record, trace)

        after, (records, trace) = lax.scan(body, lanes, None, length=plan.length)
        return after, records, trace

    @partial(jax.custom_jvp, nondiff_argnums=(3,))
    def segment(system, grid, lanes, keep_trace):
        return iterate(system, grid, lanes, keep_trace)

    def rule(keep_trace, primals, tangents):
        system, grid, lanes = primals
        if any(not _is_zero(dot) and dot.dtype != jax.dtypes.float0 for dot in tangents[1]):
            raise TypeError("a rollout has no derivative with respect to `step` and `start`")
        leaves, treedef = jax.tree.flatten(system)
        dots = jax.tree.leaves(tangents[0], is_leaf=_is_zero)
        live = [not _is_zero(dot) and dot.dtype != jax.dtypes.float0 for dot in dots]
        moving = [dot for dot, alive in zip(dots, live) if alive]
        after, records, trace = segment(system, grid, lanes, True)

        def tile_of(values):
            values = iter(values)
            system = treedef.unflatten([next(values) if alive else leaf for leaf, alive in zip(leaves, live)])
            return Tile(system, system_axes)

        def tangent(carry, trace):
            before, kept = trace
            values = [leaf for leaf, alive in zip(leaves, live) if alive]
            *following, d_step = _tangent.tangent(tile_of, values, grid, before, kept, moving, *carry)
            path = (tuple(following) if plan.save else None, (*carry, d_step) if keep_trace else None)
            return tuple(following), path

        def filled(t: Any):
            dtype: Any = t.dtype
            return jnp.zeros(t.shape, dtype) if _is_zero(t) else t

        dense = partial(jax.tree.map, filled)
        start = dense(tangents[2].state, is_leaf=_is_zero), dense(tangents[2].left, is_leaf=_is_zero)
        (d_state, d_left), (d_path, d_trace) = lax.scan(jax.checkpoint(tangent, prevent_cse=False), start, trace)
        d_after = jax.tree.map(_zero_tangent, after)._replace(state=d_state, left=d_left)
        d_records = jax.tree.map(_zero_tangent, records)
        if plan.save:
            d_records = d_records._replace(state=d_path[0], left=d_path[1])
        # The trace is what the tangent is computed from: its own tangent makes the second derivative.
        d_lanes = jax.tree.map(_zero_tangent, trace)
        if keep_trace:
            before, kept = d_lanes
            d_lanes = (before._replace(state=d_trace[0], left=d_trace[1], landing=d_trace[2]), kept)
        else:
            d_lanes = None
        return (after, records, trace if keep_trace else None), (d_after, d_records, d_lanes)

    segment.defjvp(rule, symbolic_zeros=True)

    def untraced(system, grid, lanes):
        return segment(system, grid, lanes, False)[:2]

    return jax.checkpoint(untraced, prevent_cse=False) if plan.checkpoint else untraced


def _no_records(lanes: Lanes, plan: Plan):
    """The records of a segment that is skipped."""
    if not plan.save:
        return None
    made = lanes.mode < 0
    record = Record(lanes.state, lanes.left, lanes.index, lanes.mode, lanes.mode, made, made)
    return jax.tree.map(lambda leaf: jnp.zeros((plan.length, *leaf.shape), leaf.dtype), record)


@jax.custom_jvp
def _with_tangents(system, lanes: Lanes):
    """The same lanes. If the system or they have a tangent, all their numbers have one from here on: a scan traces its
    body anew for each that it finds to have one later."""
    return lanes


def _all_tangents(primals, tangents):
    moving = [
        t for t in jax.tree.leaves(tangents, is_leaf=_is_zero) if not _is_zero(t) and t.dtype != jax.dtypes.float0
    ]

    def filled(t):
        if not _is_zero(t) or t.dtype == jax.dtypes.float0:
            return t
        # Zero, but as if it were a part of what moves.
        return jnp.where(False, jnp.sum(moving[0]).astype(t.dtype), jnp.zeros(t.shape, t.dtype))

    return primals[1], jax.tree.map(filled, tangents[1], is_leaf=_is_zero)


_with_tangents.defjvp(_all_tangents, symbolic_zeros=True)


def run_tile(system, state, mode, grid: Grid, system_axes, plan: Plan):
    """Final lanes and the records (segments * length, lanes) of one tile."""
    lanes = _step.enter(Tile(system, system_axes), grid, state, mode)
    # Jitted, so that the branch, which a derivative goes through twice, is differentiated once.
    segment = jax.jit(_segment(system_axes, plan))

    def skip(system, grid, lanes):
        return lanes, _no_records(lanes, plan)

    def body(lanes, number):
        under_way = jnp.any(is_active(grid, lanes)) & (number < grid.segments)
        return lax.cond(under_way, segment, skip, system, grid, lanes)

    lanes, records = lax.scan(body, _with_tangents(system, lanes), jnp.arange(plan.segments, dtype=jnp.int32))
    return lanes, jax.tree.map(lambda leaf: leaf.reshape((-1,) + leaf.shape[2:]), records)
