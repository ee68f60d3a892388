"""A wheel that locks and comes free.

    turning -> locked   where w falls to 0
    locked -> turning   where gamma_b Pb falls to what the tyre gives at slip -1, R |Fx(-1)|

While it is locked w = 0 and the tyre slides.
"""

import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.loop._modes import Mode
from absjax.loop.memory import Memory
from absjax.plant.base import Plant

SPIN_UP = 1e-6
"""Speed a wheel comes free with, rad/s: at 0 it would count as locked again."""


def guard(plant: Plant, time, state, parts: Mode, pressure):
    """Rises through zero where the wheel of `plant` locks or comes free, under the pressure at the wheel [bar]."""
    torque = plant.wheel_speed_of(plant.flow(time, state, pressure))
    return jnp.where(parts.locked == 1, torque, -plant.wheel_speed_of(state))


def met(plant: Plant, time, state, memory: Memory, parts: Mode):
    """Plant state, memory and mode after it has fired."""
    speed, free = plant.speed_of(time, state), parts.locked == 1
    wheel_speed = jnp.where(free, SPIN_UP, 0.0 * plant.wheel_speed_of(state))
    locks = tree_where(free, memory.locks.ended(time, speed), memory.locks.begun(time, speed))
    state = plant.with_wheel_speed(state, wheel_speed)
    return state, memory._replace(locks=locks), parts._replace(locked=1 - parts.locked)


def held(plant: Plant, flow, parts: Mode):
    """d(state)/dt of the plant: a locked wheel does not turn."""
    return plant.with_wheel_speed(flow, jnp.where(parts.locked == 1, 0.0, plant.wheel_speed_of(flow)))
