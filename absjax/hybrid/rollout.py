"""The rollout engine: a hybrid system through one `jax.lax.scan`, differentiable through its switchings.

Lanes run at their own pace (`absjax.hybrid._step`), in a scan with a derivative rule of its own
(`absjax.hybrid._scan`, `absjax.hybrid._tangent`), in tiles shared out over devices (`absjax.hybrid._tiles`).
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.hybrid._lanes import Grid, time_of
from absjax.hybrid._scan import Plan, run_tile
from absjax.hybrid._tiles import over_tiles
from absjax.hybrid.recording import Kept, SwitchLog, Trajectory, collect
from absjax.hybrid.system import HybridSystem
from absjax.lanes import lane_axes, lane_count
from absjax.parameters import concrete
from absjax.results import DIVERGED, EndCode, raise_if_failed

SEGMENT = 64
"""Iterations of the scan between two looks whether any lane is still under way."""
TILE = 256
"""Most lanes that run as one batch; larger ensembles are cut into tiles."""
SMALLEST_TILE = 32
"""An ensemble is spread over devices as long as tiles stay this large."""
RECORD_BYTES = 2**28
"""Above this size of the record of all lanes, `checkpoint=None` recomputes segments instead."""


LARGEST_STRAIN = 0.1
"""Of 500 random stops at 2 ms, 95 % below it are right to 1 in 10^4; above, errors of some percent begin."""


class Status(EndCode):
    """How a lane ended."""

    COMPLETED = 0, "it reached the end of the grid"
    FINISHED = 1, "a jump ended the manoeuvre"
    BUDGET_EXHAUSTED = 2, "it was still under way when the scan ended: more switchings than max_events allows for", True
    DIVERGED = 3, "its state left the finite numbers; it keeps the last finite state", True
    STEP_TOO_LARGE = 4, "it reached its end, but its flow is too fast for the step: errors add up; take a shorter", True


class Rollout(NamedTuple):
    """Result of a rollout. Every array has a leading axis of lanes unless the system had none.

    Attributes:
        time: time at the end [s]; differentiable where a jump ended the lane.
        state, mode: at the end.
        status: a `Status` code.
        events: switchings made.
        grazes: switchings whose guard only touched zero: no derivative of the instant is taken there.
        strain: local errors of the steps, each as a share of the state, added up with the weight the system gives them
            (`importance`): an estimate. Above `LARGEST_STRAIN` the lane counts as `Status.STEP_TOO_LARGE`, and so does
            one that would take more parts of steps than it may.
        trajectory: grid points, if asked for.
        switches: log of the switchings, if asked for.
    """

    time: jax.Array
    state: Any
    mode: jax.Array
    status: jax.Array
    events: jax.Array
    grazes: jax.Array
    strain: jax.Array
    trajectory: Trajectory | None
    switches: SwitchLog | None

    @property
    def path(self) -> Trajectory:
        """The trajectory.

        Raises:
            ValueError: if none was kept.
        """
        if self.trajectory is None:
            raise ValueError("no trajectory was kept; roll out with save_every")
        return self.trajectory

    @property
    def log(self) -> SwitchLog:
        """The log of the switchings.

        Raises:
            ValueError: if none was kept.
        """
        if self.switches is None:
            raise ValueError("no log of the switchings was kept; roll out with save_switches")
        return self.switches

    def raise_if_failed(self) -> "Rollout":
        """Return self.

        Raises:
            RolloutError: if a lane ran out of its event budget or diverged; names lanes and reason.
        """
        raise_if_failed(self.status, Status)
        return self


def _scan_of(iterations: int) -> tuple[int, int]:
    """Segments, and iterations of each."""
    length = min(SEGMENT, iterations)
    return -(-iterations // length), length


def _with_room(segments: int, length: int) -> tuple[int, int]:
    """The same with a number of segments that others have too, one of four an octave: another horizon or budget of
    switchings then finds its program compiled. What is too much is skipped (`Grid.segments`)."""
    unit = 1 << max(segments.bit_length() - 3, 0)
    return -(-segments // unit) * unit, length


def _spare(steps: int) -> int:
    """Iterations a lane may spend on parts of grid steps: 9 of 10 random stops to walking pace need a quarter of it."""
    return SEGMENT + steps // 2


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

    A step over which the flow of a system that switches is too fast is taken in parts (`absjax.hybrid._parts`).

    One lane or an ensemble: wherever `system`, `state` or `mode` has a leaf with one leading axis more
    than a single lane needs, that axis counts lanes (`absjax.lanes.lane_axes`); other leaves are
    shared. Lanes run in tiles, the tiles spread over all local devices. Differentiable in forward and
    reverse mode with respect to system and state, not to `step` and `start`; dtype follows `state`.
    Where nothing is kept of the course, `steps` and `max_events` that differ by little share a compiled program.

    Args:
        system: see `absjax.hybrid.system.HybridSystem`.
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
        TypeError: if a derivative with respect to `step` or `start` is asked for.
    """
    least_of = {
        "steps": (steps, 1),
        "max_events": (max_events, 0),
        "save_every": (save_every, 0),
        "tile": (tile or 1, 1),
    }
    for name, (value, least) in least_of.items():
        if int(value) != value or value < least:
            raise ValueError(f"{name} = {value} must be an integer >= {least}")
    if concrete(step) and not 0 < float(step) < np.inf:
        raise ValueError(f"step = {step} must be a positive number of seconds")
    check = getattr(system, "require_step", None)
    if concrete(step) and check is not None:
        check(float(step))
    if save_every > steps:
        raise ValueError(f"save_every = {save_every} exceeds steps = {steps}")
    # Types are settled here, weak ones too, so that equal shapes never compile twice.
    dtype = jnp.result_type(*(jnp.asarray(leaf).dtype for leaf in jax.tree.leaves(state)), jnp.float32)
    cast = _as_float(dtype)
    system, state = jax.tree.map(cast, system), jax.tree.map(cast, state)
    steps, max_events, save_every, spare = int(steps), int(max_events), int(save_every), _spare(int(steps))
    kept = Kept(save_every, steps // save_every if save_every else 0, max_events if save_switches else 0)
    smooth, switching = (_scan_of(most) for most in (steps, steps + 5 * max_events + spare))
    whole = (jnp.asarray(number, jnp.int32) for number in (steps, max_events, spare, switching[0]))
    grid = Grid(jnp.asarray(start, dtype), jnp.asarray(step, dtype), *whole)
    if not any(kept):
        smooth, switching = (_with_room(*scan) for scan in (smooth, switching))
    mode = jnp.asarray(mode, jnp.int32)
    return _rollout(system, state, mode, grid, smooth, switching, kept, checkpoint, tile)


@partial(jax.jit, static_argnums=(4, 5, 6, 7, 8))
def _rollout(system, state, mode, grid, smooth, switching, kept, checkpoint, tile):
    """`smooth`, `switching`: segments and their length for a system that never switches, and for one that does."""
    axes = lane_axes(system)
    lanes = lane_count(system, "system")
    lanes = lane_count(state, "state", lanes)
    lanes = lane_count(mode, "mode", lanes)
    single = lanes is None
    lanes = 1 if single else lanes

    # Scalars shared by all lanes are spread over them: their derivatives then add up lane by lane,
    # and are summed once.
    def spread(leaf, shared):
        return jnp.broadcast_to(leaf, (lanes, *jnp.shape(leaf))) if shared else leaf

    shared = jax.tree.map(lambda leaf: jnp.ndim(leaf) == 0, system)
    axes = jax.tree.map(lambda axis, scalar: 0 if scalar else axis, axes, shared)
    system = jax.tree.map(spread, system, shared)
    state, mode = jax.tree.map(lambda leaf, axis: spread(leaf, axis < 0), (state, mode), lane_axes((state, mode)))

    switches = bool(jax.eval_shape(lambda: _one_lane_guards(system, axes, state, grid)))
    segments, length = switching if switches else smooth
    words = sum(leaf.size for leaf in jax.tree.leaves(state)) // lanes + 4
    if checkpoint is None:
        checkpoint = lanes * segments * length * words * grid.step.dtype.itemsize > RECORD_BYTES
    plan = Plan(segments, length, any(kept), bool(checkpoint))

    def roll(system, state, mode):
        final, records = run_tile(system, state, mode, grid, axes, plan)
        collected = (None, None)
        if plan.save:
            gather = jax.vmap(partial(collect, grid, kept), in_axes=(0, 0, 1))
            collected = gather((state, mode), final, records)
        ended = (final.mode < 0) | (final.index >= grid.steps)
        at_end = jnp.where(final.mode < 0, Status.FINISHED, jnp.where(ended, Status.COMPLETED, Status.BUDGET_EXHAUSTED))
        too_fast = (final.strain > LARGEST_STRAIN) | (final.spent >= grid.spare)
        status = jnp.where(
            final.mode == DIVERGED,
            Status.DIVERGED,
            jnp.where(ended & too_fast, Status.STEP_TOO_LARGE, at_end),
        ).astype(jnp.int32)
        time = time_of(grid, final)
        return Rollout(time, final.state, final.mode, status, final.events, final.grazes, final.strain, *collected)

    tile = tile or min(TILE, max(SMALLEST_TILE, -(-lanes // len(jax.local_devices()))))
    result = over_tiles(roll, axes, lanes, tile)(system, state, mode)
    return jax.tree.map(lambda leaf: leaf[0], result) if single else result


def _one_lane_guards(system, axes, state, grid):
    first = jax.tree.map(lambda leaf, axis: leaf if axis < 0 else leaf[0], system, axes)
    return first.guards(grid.start, jax.tree.map(lambda leaf: leaf[0], state), jnp.int32(0))
