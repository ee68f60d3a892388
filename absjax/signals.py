"""What sensors see and controllers use."""

from typing import NamedTuple

import jax


class Signals(NamedTuple):
    """What sensors see and controllers use; scalars per lane."""

    vehicle_speed: jax.Array
    """v [m/s]"""
    vehicle_acceleration: jax.Array
    """v' [m/s^2]"""
    wheel_speed: jax.Array
    """w [rad/s]"""
    acceleration_offset: jax.Array
    """x2 = R w' - v' [m/s^2]"""
    radius: jax.Array
    """R [m], which a controller knows"""
    pressure: jax.Array
    """Pb at the wheel [bar]"""
    stiffness: jax.Array
    """XBS = mu'(lambda): the true one of a plant, the estimate where a loop has an observer"""
    time: jax.Array
    """of a clock that starts with the manoeuvre [s]"""
    pedal: jax.Array | float = 1.0
    """1 while the driver presses the pedal, else 0: all that a controller knows of the foot"""
