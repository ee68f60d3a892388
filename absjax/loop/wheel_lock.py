"""A wheel that slides, locks and comes free.

    turning -> sliding   where the slip falls to `DEEP_SLIP`
    sliding -> turning   where it rises to it, and a little further (`RISES`)
    sliding -> locked    where w falls to 0
    locked -> sliding    where gamma_b Pb falls to what the tyre gives at slip -1, R |Fx(-1)|

While it is locked w = 0. That it slides changes nothing but what is remembered.
"""

import jax.numpy as jnp

from absjax.loop.memory import DEEP_SLIP, Sliding

TURNING, SLIDING, LOCKED = range(3)
"""What a wheel does."""
RISES = 1.001
"""Times the wheel speed below which it slides: where it turns again. One bound for both would be crossed to and fro in
one instant, without end, by a wheel whose slip just touches it."""
SPIN_UP = 1e-6
"""Speed a wheel comes free with, rad/s: at 0 it would count as locked again."""


def deep(speed, radius):
    """Wheel speed below which a wheel of a `radius` [m] slides at a vehicle speed [m/s], rad/s."""
    return (1 + DEEP_SLIP) / radius * speed


def guard(does, wheel_speed, acceleration, bound):
    """Rises through zero where a wheel begins to do something else.

    Args:
        does: TURNING, SLIDING or LOCKED.
        wheel_speed: w [rad/s].
        acceleration: w' if it may turn [rad/s^2].
        bound: wheel speed below which it slides [rad/s].
    """
    slides = jnp.where(does == SLIDING, jnp.maximum(wheel_speed - RISES * bound, -wheel_speed), bound - wheel_speed)
    return jnp.where(does == LOCKED, acceleration, slides)


def met(does, wheel_speed, bound, wheel: Sliding, time, speed):
    """Wheel speed, what is remembered of its slides, and what it does, after the guard has fired.

    Args:
        speed: of the vehicle [m/s].
    """
    slides, nearly_stands = does == SLIDING, wheel_speed < bound / 2
    frees, stands, turns = does == LOCKED, slides & nearly_stands, slides & ~nearly_stands
    after = jnp.where(frees, SPIN_UP, jnp.where(stands, 0.0 * wheel_speed, wheel_speed))
    remembered = Sliding(
        wheel.slides.after(does == TURNING, turns, time, speed), wheel.locks.after(stands, frees, time, speed)
    )
    return after, remembered, jnp.where(stands, LOCKED, jnp.where(turns, TURNING, SLIDING))


def held(does, acceleration):
    """w' [rad/s^2]: a locked wheel does not turn."""
    return jnp.where(does == LOCKED, 0.0, acceleration)
