"""The shortest stop a pedal allows a vehicle: what every set of controllers on it is measured against.

Every wheel uses its road to the peak as soon as the pedal asks for that much, without lag, relaxation or inertia, at
the load the deceleration makes; the vehicle goes straight on:

    m v' = -sum min(gamma_b,i p(t) / R_i, mu_max,i Fz_i(v')),   x' = v

Fz_i(v') is linear, so the sum is linear in v' between the kinks, and Newton's method finds its root in a few steps. The
instants at which pedal and road take turns are not located: at a step of 2 ms that is worth 10^-5 m.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp

from absjax.hybrid.rollout import Status, rollout
from absjax.loop.driver import Driver, Pedal
from absjax.loop.ideal import Point
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.parameters import model, parameter, part
from absjax.plant.vehicle import Vehicle
from absjax.results import FINISHED

NEWTON_STEPS = 4


@model
class _Ideal:
    """The vehicle as a point, as a system for the rollout engine. Mode: what the foot does."""

    vehicle: Vehicle = part("the vehicle")
    driver: Driver = part("who presses the pedal")
    stop_speed: Any = parameter("m/s")

    def _deceleration(self, time, state: Point):
        peaks = [road.peak_friction(time, state.distance) for road in self.vehicle.roads]
        asked = [wheel.brake_efficiency * state.pedal.level / wheel.radius for wheel in self.vehicle.wheels]

        def given(deceleration):
            loads = self.vehicle.known_loads(-deceleration, 0.0 * deceleration)
            forces = [jnp.minimum(a, peak * jnp.maximum(load, 0.0)) for a, peak, load in zip(asked, peaks, loads)]
            return sum(forces) / self.vehicle.mass

        deceleration = given(0.0 * state.speed)
        for _ in range(NEWTON_STEPS):
            reached, slope = jax.jvp(given, (deceleration,), (jnp.ones_like(deceleration),))
            deceleration = deceleration + (reached - deceleration) / (1 - slope)
        return deceleration

    def flow(self, time, state: Point, mode) -> Point:
        slowing = self._deceleration(time, state)
        pedal = Pedal(self.driver.slope(mode) + 0.0 * slowing, None)
        return Point(-slowing, state.speed, pedal)

    def guards(self, time, state: Point, mode):
        return (jnp.maximum(self.stop_speed - state.speed, self.driver.guard(time, state.pedal, mode)),)

    def jump(self, time, state: Point, mode, slot):
        ends = self.stop_speed - state.speed >= self.driver.guard(time, state.pedal, mode)
        pedal, foot = self.driver.move(time, state.pedal, mode)
        pedal = jax.tree.map(lambda new, old: jnp.where(ends, old, new), pedal, state.pedal)
        return state._replace(pedal=pedal), jnp.where(ends, FINISHED, foot)


def vehicle_ideal_distance(loop: VehicleLoop, speed: Any, *, horizon: float, step: float = 2e-3) -> jax.Array:
    """The shortest distance from the first touch of the pedal to the stop speed [m].

    Args:
        loop: a vehicle's loop; leaves with a leading axis make an ensemble. Its controllers do not matter.
        speed: initial speed [m/s], scalar or (lanes,).
        horizon: longest time allowed [s].
        step: grid step [s].

    Returns:
        Distances [m], (lanes,) or a scalar, infinite where the vehicle has not stopped by then; differentiable with
        respect to vehicle, driver and speed.

    Raises:
        ValueError: if the loop has no stop speed, or the horizon is not positive.
    """
    if loop.stop_speed is None:
        raise ValueError("an ideal distance needs a loop with a stop_speed")
    if not 0 < horizon < math.inf:
        raise ValueError(f"horizon = {horizon} must be a positive number of seconds")
    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    start = Point(speed, 0.0 * speed, loop.driver.initial_state(speed))
    system = _Ideal(loop.vehicle, loop.driver, loop.stop_speed)
    end = rollout(system, start, step=step, steps=math.ceil(horizon / step - 1e-9), max_events=24)
    return jnp.where(end.status == Status.FINISHED, end.state.distance - loop.driver.delay * speed, jnp.inf)
