"""What sensors see and controllers use."""

from typing import Any, NamedTuple


class Signals(NamedTuple):
    """What sensors see and controllers use; scalars per lane."""

    vehicle_speed: Any
    """v [m/s]"""
    vehicle_acceleration: Any
    """v' [m/s^2]"""
    wheel_speed: Any
    """w [rad/s]"""
    acceleration_offset: Any
    """x2 = R w' - v' [m/s^2]"""
    radius: Any
    """R [m], which a controller knows"""
    pressure: Any
    """Pb at the wheel [bar]"""
    stiffness: Any
    """XBS = mu'(lambda): the true one of a plant, the estimate where a loop has an observer"""
    time: Any
    """of a clock that starts with the manoeuvre [s]"""
    pedal: Any = 1.0
    """1 while the driver presses the pedal, else 0: all that a controller knows of the foot"""
