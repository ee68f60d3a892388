"""Driver braking, phase 0 of every controller: the brake is left to the driver until the wheel decelerates too much.

    valve open  until  x2 <= -(eps0 + eps0_growth R w), while the pedal is pressed

Source: phase 0 of the five-phase algorithm, Hoang et al. 2014, Fig. 5. There the phase has a ramp of its own; here the
pressure is what the foot gives.
"""

from typing import Any

from absjax.controllers.base import Controller
from absjax.controllers.phases import onset_threshold, while_pressed
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class DriverBraking(Controller):
    """What controllers of XBS and slip begin with."""

    eps0: Any = parameter(
        "eps0, deceleration that ends driver braking, m/s^2", default=30.0, low=0.0, open_low=True, trainable=True
    )

    eps0_growth: Any = parameter(
        "by which eps0 grows with the rim's speed, 1/s; ours", default=0.0, low=0.0, trainable=True, span=(0.0, 4.0)
    )

    def driver_guard(self, signals: Signals):
        """Rises through zero where driver braking ends."""
        return while_pressed(
            -onset_threshold(self.eps0, self.eps0_growth, signals) - signals.acceleration_offset, signals
        )
