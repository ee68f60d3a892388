"""The shortest stop a pedal allows: what every controller is measured against.

The road is used to its peak as soon as the pedal asks for that much, without lag of the brake or inertia of the wheel:

    v' = -g min(gamma_b p(t) / (R Fz), mu_max(t, x)),   x' = v

with p(t) what the foot has reached and mu_max the largest friction to be had then and there. The instants at which
pedal and road take turns are located.

No stop is shorter as long as the foot, once the road is the limit, asks for more than any later part of it offers. A
timid foot on a road that gets better can be beaten by a few percent: a wheel that has lost its speed on ice spins up
again on the dry, and its inertia, J / (m R^2) of the car's, brakes along with the pedal.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.hybrid.rollout import Status, rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver, Pedal
from absjax.parameters import concrete, model, parameter, part
from absjax.plant.base import Plant
from absjax.plant.wheel import GRAVITY
from absjax.results import FINISHED

BY_PEDAL, BY_ROAD = range(2)
"""What limits the deceleration; the foot is in the bits above."""
TURN = 1e-9
"""Friction by which the pedal has to be below the road before it limits again."""


class Point(NamedTuple):
    """State; scalars per lane."""

    speed: jax.Array
    """m/s"""
    distance: jax.Array
    """since the start, m"""
    pedal: Pedal


@model
class _Ideal:
    """The car as a point, as a system for the rollout engine."""

    plant: Plant = part("for wheel and road")
    driver: Driver = part("who presses the pedal")
    stop_speed: Any = parameter("m/s")

    def _asked(self, state: Point):
        wheel = self.plant.wheel
        return wheel.brake_efficiency * state.pedal.level / (wheel.radius * wheel.load)

    def flow(self, time, state: Point, mode) -> Point:
        by_road = self.plant.road.peak_friction(time, state.distance)
        friction = jnp.where(mode & 1 == BY_ROAD, by_road, self._asked(state))
        return Point(-GRAVITY * friction, state.speed, Pedal(self.driver.slope(mode >> 1) + 0.0 * friction, None))

    def guards(self, time, state: Point, mode):
        short = self._asked(state) - self.plant.road.peak_friction(time, state.distance)
        foot = self.driver.guard(time, state.pedal, mode >> 1)
        turn = jnp.where(mode & 1 == BY_ROAD, -short - TURN, short)
        return jnp.maximum(self.stop_speed - state.speed, foot), turn

    def jump(self, time, state: Point, mode, slot):
        pedal, foot = self.driver.move(time, state.pedal, mode >> 1)
        ends = self.stop_speed - state.speed >= self.driver.guard(time, state.pedal, mode >> 1)
        moves = (slot == 0) & ~ends
        pedal = jax.tree.map(lambda new, old: jnp.where(moves, new, old), pedal, state.pedal)
        following = jnp.where(slot == 0, jnp.where(ends, FINISHED, (mode & 1) + 2 * foot), mode ^ 1)
        return state._replace(pedal=pedal), following


def ideal_distance(loop: ClosedLoop, speed: Any, *, horizon: float, step: float = 2e-3) -> jax.Array:
    """The shortest distance from the first touch of the pedal to the stop speed [m].

    Args:
        loop: a closed loop whose plant is a car; leaves with a leading axis make an ensemble.
        speed: initial speed [m/s], scalar or (lanes,).
        horizon: longest time allowed [s].
        step: grid step [s].

    Returns:
        Distances [m], (lanes,) or a scalar, infinite where the car has not stopped by then; differentiable with respect
        to plant, driver and speed.

    Raises:
        ValueError: if the loop has no stop speed or no `absjax.loop.driver.Driver`, or the horizon is not positive.
    """
    driver = loop.foot
    if loop.stop_speed is None or driver is None:
        raise ValueError("an ideal distance needs a loop with a stop_speed and a Driver")
    if not 0 < horizon < math.inf:
        raise ValueError(f"horizon = {horizon} must be a positive number of seconds")
    if concrete(speed) and concrete(loop.stop_speed) and not np.all(np.asarray(speed) > np.asarray(loop.stop_speed)):
        raise ValueError(f"speed = {speed} must be above the stop speed {loop.stop_speed} m/s")
    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    start = Point(speed, 0.0 * speed, driver.initial_state(speed))
    system = _Ideal(loop.plant, driver, loop.stop_speed)
    end = rollout(system, start, step=step, steps=math.ceil(horizon / step - 1e-9), max_events=24)
    waited = driver.delay * speed
    return jnp.where(end.status == Status.FINISHED, end.state.distance - waited, jnp.inf)
