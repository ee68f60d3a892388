"""A stop: from a speed down to the stop speed under an anti-lock controller, and how good it was."""

import enum
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.closed_loop import LOCKED, ClosedLoop, SampledLoop
from absjax.engine import Rollout, Status, rollout
from absjax.hybrid import UNDEFINED
from absjax.parameters import concrete
from absjax.vehicle import GRAVITY


class Outcome(enum.IntEnum):
    """How a stop ended."""

    STOPPED = 0
    """At the stop speed."""
    STILL_MOVING = 1
    """The horizon was too short."""
    LOCKED = 2
    """The wheel locked; distances count the rest of the way on the locked wheel."""
    BUDGET_EXHAUSTED = 3
    """More switchings than `max_events`."""
    DIVERGED = 4
    """The state left the finite numbers."""
    CONTROL_UNDEFINED = 5
    """The controller came to where its law is not defined; distances are those up to there."""


class Stop(NamedTuple):
    """Result of a stop; arrays (lanes,), or scalars without lanes.

    Attributes:
        distance: travelled from the first touch of the pedal to the stop speed [m].
        duration: time that took [s].
        mean_friction: mean deceleration over g from the controller's first switching on.
        efficiency: mean friction over the largest friction the road offers, in [0, 1] or so.
        equivalent_distance: v0^2 / (2 g mean friction) [m], as published distances are computed
            (Aguado-Rojas 2019, Table 4.1).
        ideal_distance: the same with the largest friction the road offers [m].
        cycles: cycles of the controller.
        longest_cycle: longest time between the starts of two cycles, or from the last one to the end [s]:
            a controller that sticks in a phase shows here. Differentiable. 0 for one that does not cycle.
        outcome: an `Outcome` code.
        rollout: the rollout behind it.
    """

    distance: jax.Array
    duration: jax.Array
    mean_friction: jax.Array
    efficiency: jax.Array
    equivalent_distance: jax.Array
    ideal_distance: jax.Array
    cycles: jax.Array
    longest_cycle: jax.Array
    outcome: jax.Array
    rollout: Rollout


def stop(
    loop: ClosedLoop | SampledLoop,
    speed: Any,
    *,
    horizon: float,
    step: float = 2e-3,
    max_events: int = 400,
    save_every: int = 0,
    save_switches: bool = False,
    checkpoint: bool | None = None,
    tile: int | None = None,
) -> Stop:
    """Brake from `speed` to the loop's stop speed.

    Args:
        loop: the closed loop; its `stop_speed` must be set. Leaves with a leading axis make an ensemble.
        speed: initial speed [m/s], scalar or (lanes,).
        horizon: longest time allowed [s].
        step, max_events, save_every, save_switches, checkpoint, tile: see `absjax.engine.rollout`.

    Returns:
        A `Stop`, differentiable with respect to loop and speed.

    Raises:
        ValueError: if the loop has no stop speed, `speed` is not above it, or `horizon` is not positive.
    """
    base = loop.loop if isinstance(loop, SampledLoop) else loop
    if base.stop_speed is None:
        raise ValueError("ClosedLoop.stop_speed is None; a stop needs a speed at which it ends")
    if not 0 < horizon < math.inf:
        raise ValueError(f"horizon = {horizon} must be a positive number of seconds")
    if concrete(speed) and concrete(base.stop_speed):
        if not bool(jnp.all(jnp.isfinite(speed) & (jnp.asarray(speed) > base.stop_speed))):
            raise ValueError(f"speed = {speed} must be finite and above the stop speed {base.stop_speed} m/s")
    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    result = rollout(
        loop,
        loop.at(speed),
        step=step,
        steps=math.ceil(horizon / step - 1e-9),
        max_events=max_events,
        save_every=save_every,
        save_switches=save_switches,
        checkpoint=checkpoint,
        tile=tile,
    )
    return _assess(base, speed, result)


def _assess(loop: ClosedLoop, speed, result: Rollout) -> Stop:
    state = result.state.loop if hasattr(result.state, "loop") else result.state
    memory, plant = state.memory, state.plant
    end_speed = loop.plant.speed_of(result.time, plant)
    position = loop.plant.position(result.time, plant)
    locked = result.mode == LOCKED

    # On a locked wheel the rest of the way is braked by mu(-1).
    sliding = GRAVITY * jnp.maximum(-loop.plant.road.friction(-jnp.ones_like(end_speed), result.time, position), 1e-3)
    rest = jnp.where(locked, end_speed - loop.stop_speed, 0.0)
    duration = result.time + rest / sliding
    distance = position + jnp.where(locked, (end_speed**2 - loop.stop_speed**2) / (2 * sliding), 0.0)
    final_speed = jnp.where(locked, loop.stop_speed, end_speed)

    active = duration - memory.onset_time
    mean_friction = safe_divide(memory.onset_speed - final_speed, GRAVITY * active, active > 0)
    peak = loop.plant.road.mean_peak_friction((memory.onset_time, memory.onset_position), (result.time, position))
    equivalent = safe_divide(speed**2, 2 * GRAVITY * mean_friction, mean_friction > 0, jnp.inf)
    outcome = jnp.select(
        [
            locked,
            result.mode == UNDEFINED,
            result.status == Status.FINISHED,
            result.status == Status.COMPLETED,
            result.status == Status.DIVERGED,
        ],
        [Outcome.LOCKED, Outcome.CONTROL_UNDEFINED, Outcome.STOPPED, Outcome.STILL_MOVING, Outcome.DIVERGED],
        Outcome.BUDGET_EXHAUSTED,
    )
    longest = jnp.maximum(memory.longest_cycle, result.time - memory.cycle_time)
    if loop.controller.cycle_phase is None:
        longest = 0.0 * longest
    return Stop(
        distance=distance,
        duration=duration,
        mean_friction=mean_friction,
        efficiency=mean_friction / peak,
        equivalent_distance=equivalent,
        ideal_distance=speed**2 / (2 * GRAVITY * peak),
        cycles=memory.cycles,
        longest_cycle=longest,
        outcome=outcome,
        rollout=result,
    )
