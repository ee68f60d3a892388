"""Driver braking, phase 0 of the controllers on XBS and slip: a pressure ramp until the wheel decelerates too much.

    dPb/dt = ramp / (R w)  until  x2 <= -eps0

Source: phase 0 of the five-phase algorithm, Hoang et al. 2014, Fig. 5.
"""

from typing import Any

from absjax.parameters import model, parameter
from absjax.vehicle import Signals


@model
class DriverBraking:
    """What controllers share that begin with phase 0, driver braking."""

    eps0: Any = parameter(
        "eps0, deceleration that ends driver braking, m/s^2", default=30.0, low=0.0, open_low=True, trainable=True
    )
    ramp: Any = parameter("driver's ramp, bar m/s^2", default=6000.0, low=0.0, open_low=True, trainable=True)

    def driver_rate(self, signals: Signals):
        """dPb/dt of the driver [bar/s]."""
        return self.ramp / (signals.radius * signals.wheel_speed)

    def driver_guard(self, signals: Signals):
        """Rises through zero where driver braking ends."""
        return -self.eps0 - signals.acceleration_offset
