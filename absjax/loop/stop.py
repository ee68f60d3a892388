"""A stop: from a speed and the first touch of the pedal down to the stop speed, and how good it was."""

import math
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from absjax._numerics import safe_divide
from absjax.hybrid.rollout import Rollout, Status, rollout
from absjax.loop.memory import Course
from absjax.loop.sampled_loop import loop_state, loop_time
from absjax.parameters import concrete
from absjax.plant.wheel import GRAVITY
from absjax.results import UNDEFINED, EndCode, raise_if_failed


class Stoppable(Protocol):
    """What a stop asks of a loop, located: what is braked, and how it went."""

    @property
    def stop_speed(self) -> Any:
        """Vehicle speed at which the manoeuvre ends [m/s]; None: never."""
        ...

    def initial_state(self, speed: Any) -> Any:
        """State of free rolling at `speed` [m/s] with the brake released."""
        ...

    def course(self, time: Any, state: Any, mode: Any) -> Course:
        """What is known of the manoeuvre until now; each entry (lanes,), or scalars."""
        ...


class Outcome(EndCode):
    """How a stop ended."""

    STOPPED = 0, "at the stop speed"
    STILL_MOVING = 1, "the horizon was too short", True
    BUDGET_EXHAUSTED = 2, "more switchings than max_events", True
    DIVERGED = 3, "the state left the finite numbers", True
    CONTROL_UNDEFINED = 4, "the controller came to where its law is not defined; distances are those up to there", True
    STEP_TOO_LARGE = 5, "at its end, but its flow is too fast for the grid step; take a shorter", True


class Stop(NamedTuple):
    """Result of a stop; arrays (lanes,), or scalars without lanes. Compare with `absjax.loop.ideal.ideal_distance`.

    Attributes:
        distance: travelled from the first touch of the pedal to the stop speed [m].
        duration: time that took [s].
        mean_friction: mean deceleration over g from the controller's first switching on, over time.
        published_quantity: v0^2 / (2 g mean friction) [m], as published distances are computed (Aguado-Rojas 2019,
            Table 4.1). What is lost before the first switching does not count in it.
        onset_time: of the first switching, from the first touch of the pedal [s]; 0 without one.
        onset_speed: vehicle speed then [m/s].
        events: switchings, those of the brake at its limits, of the wheel that slides or locks, and the end included.
        cycles: cycles of the controller.
        longest_cycle: longest time between the starts of two cycles, or from the last one to the end [s]:
            a controller that sticks in a phase shows here. Differentiable. 0 for one that does not cycle.
        lock_time: how long the wheel was locked above 15 km/h, and above 2.5 km/h [s]. Differentiable.
        longest_lock: longest lock above 15 km/h, and above 2.5 km/h [s]. Differentiable.
        locks: how often the wheel locked.
        slide_time: of each wheel how long it had a slip below -0.8 above 15 km/h, in all [s]. One that is let go of for
            a moment whenever it stands shows here, not in its locks. Differentiable.
        end_speed: vehicle speed at the end [m/s].
        outcome: an `Outcome` code.
        rollout: the rollout behind it.
    """

    distance: jax.Array
    duration: jax.Array
    mean_friction: jax.Array
    published_quantity: jax.Array
    onset_time: jax.Array
    onset_speed: jax.Array
    events: jax.Array
    cycles: jax.Array
    longest_cycle: jax.Array
    lock_time: tuple[jax.Array, jax.Array]
    longest_lock: tuple[jax.Array, jax.Array]
    locks: jax.Array
    slide_time: tuple[jax.Array, ...]
    end_speed: jax.Array
    outcome: jax.Array
    rollout: Rollout

    def raise_if_failed(self) -> "Stop":
        """Return self.

        Raises:
            RolloutError: if a stop did not end at the stop speed; names lanes and reason.
        """
        raise_if_failed(self.outcome, Outcome, "stops")
        return self


def stop(
    loop: Any,
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
        loop: a closed loop, of one wheel or of a vehicle, or a sampled one; its `stop_speed` must be set. Leaves with a
            leading axis make an ensemble.
        speed: initial speed [m/s], scalar or (lanes,).
        horizon: longest time allowed [s].
        step: grid step [s]; this and what follows as for `absjax.hybrid.rollout.rollout`.
        max_events: switchings a lane may make.
        save_every: keep every so many grid points; 0 keeps none.
        save_switches: keep the log of the switchings.
        checkpoint: recompute segments in the reverse pass.
        tile: lanes per batch.

    Returns:
        A `Stop`, differentiable with respect to loop and speed.

    Raises:
        ValueError: if the loop has no stop speed, `speed` is not above it, or `horizon` is not positive.
    """
    base: Stoppable = getattr(loop, "loop", loop)
    if base.stop_speed is None:
        raise ValueError(f"{type(base).__name__}.stop_speed is None; a stop needs a speed at which it ends")
    if not 0 < horizon < math.inf:
        raise ValueError(f"horizon = {horizon} must be a positive number of seconds")
    if concrete(speed) and concrete(base.stop_speed):
        if not np.all(np.isfinite(speed) & (np.asarray(speed) > np.asarray(base.stop_speed))):
            raise ValueError(f"speed = {speed} must be finite and above the stop speed {base.stop_speed} m/s")
    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    result = rollout(
        loop,
        loop.initial_state(speed),
        step=step,
        steps=math.ceil(horizon / step - 1e-9),
        max_events=max_events,
        save_every=save_every,
        save_switches=save_switches,
        checkpoint=checkpoint,
        tile=tile,
    )
    return _assessed(base, speed, result._replace(trajectory=None, switches=None))._replace(rollout=result)


@jax.jit
def _assessed(loop: Stoppable, speed, result: Rollout) -> Stop:
    time = loop_time(result.time, result.state)
    end = loop.course(time, loop_state(result.state), result.mode)
    control, locks = end.memory.control, end.memory.wheel.locks
    active = time - control.onset_time
    mean_friction = safe_divide(control.onset_speed - end.speed, GRAVITY * active, active > 0)
    outcome = jnp.select(
        [
            result.mode == UNDEFINED,
            result.status == Status.FINISHED,
            result.status == Status.COMPLETED,
            result.status == Status.DIVERGED,
            result.status == Status.STEP_TOO_LARGE,
        ],
        [
            Outcome.CONTROL_UNDEFINED,
            Outcome.STOPPED,
            Outcome.STILL_MOVING,
            Outcome.DIVERGED,
            Outcome.STEP_TOO_LARGE,
        ],
        Outcome.BUDGET_EXHAUSTED,
    )
    return Stop(
        distance=end.position - end.memory.pedal_position,
        duration=time - end.memory.pedal_time,
        mean_friction=mean_friction,
        published_quantity=safe_divide(speed**2, 2 * GRAVITY * mean_friction, mean_friction > 0, jnp.inf),
        onset_time=jnp.maximum(control.onset_time - end.memory.pedal_time, 0.0),
        onset_speed=control.onset_speed,
        events=result.events,
        cycles=control.cycles,
        longest_cycle=end.longest_cycle,
        lock_time=locks.time,
        longest_lock=locks.longest,
        locks=locks.count,
        slide_time=end.slide_time,
        end_speed=end.speed,
        outcome=outcome,
        rollout=result,
    )
