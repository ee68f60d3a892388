"""A wheel that locks and comes free.

    turning -> locked   where w falls to 0
    locked -> turning   where gamma_b Pb falls to what the tyre gives at slip -1, R |Fx(-1)|

While it is locked w = 0 and the tyre slides.
"""

import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.loop.memory import Locks

SPIN_UP = 1e-6
"""Speed a wheel comes free with, rad/s: at 0 it would count as locked again."""


def guard(locked, wheel_speed, acceleration):
    """Rises through zero where a wheel locks or comes free; `acceleration`: w' of a wheel that may turn [rad/s^2]."""
    return jnp.where(locked == 1, acceleration, -wheel_speed)


def met(locked, wheel_speed, locks: Locks, time, speed):
    """Wheel speed, what is remembered of its locks, and whether it is locked, after the guard has fired.

    Args:
        speed: of the vehicle [m/s].
    """
    free = locked == 1
    after = jnp.where(free, SPIN_UP, 0.0 * wheel_speed)
    return after, tree_where(free, locks.ended(time, speed), locks.begun(time, speed)), 1 - locked


def held(locked, acceleration):
    """w' [rad/s^2]: a locked wheel does not turn."""
    return jnp.where(locked == 1, 0.0, acceleration)
