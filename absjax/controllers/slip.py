"""Continuous control of wheel slip to a set point.

    x2* = -gamma (lambda - lambda*) + v' lambda,  v (R/J) dT/dt = -K (x2 - x2*),  T = -gamma_b Pb

which leads to exactly lambda*, whatever the road, if K is large enough. It has to know vehicle speed and
acceleration, and what slip to aim at. Driver braking ends by the deceleration of the wheel, as it does for others, or
where the slip is half as large again as lambda*: where friction hardly falls behind its peak, a wheel under all that
the driver gives sinks slowly, and never decelerates much.
Source: Hoang 2014 (thesis), section 8.3.2; the second end of driver braking is ours.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.controllers.driver_braking import DriverBraking
from absjax.controllers.phases import OPEN_VALVE, while_pressed
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from absjax.signals import Signals

BEYOND = 1.5
"""Times the set point: the slip that ends driver braking."""


@model
class SlipControl(DriverBraking):
    """Continuous feedback on wheel slip and the wheel acceleration offset."""

    title: ClassVar[str] = "wheel slip"
    grid_step: ClassVar[float] = 1e-3
    phases: ClassVar[tuple[str, ...]] = ("driver braking", "control")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int | None] = None
    """it does not cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("eps0",)
    """the fields that noise of the measured acceleration keeps from being small"""

    wheel: Wheel = part("wheel and brake as the controller knows them", default=Wheel())
    slip: Any = parameter("lambda*, set point", default=-0.16, low=-1.0, high=0.0, trainable=True, span=(-0.5, -0.02))
    pull: Any = parameter("gamma, from slip to acceleration, m/s^2", default=200.0, low=0.0, trainable=True)
    gain: Any = parameter("K, on acceleration, m/s^2", default=500.0, low=0.0, open_low=True, trainable=True)

    def initial_state(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, state, phase):
        """Commanded dPb/dt [bar/s]."""
        speed = signals.vehicle_speed
        slip = self.wheel.slip(signals.wheel_speed, speed)
        target = signals.vehicle_acceleration * slip - self.pull * (slip - self.slip)
        follow = self.gain * (signals.acceleration_offset - target) / (speed * self.wheel.pressure_gain)
        return jnp.where(phase == 0, OPEN_VALVE, follow)

    def guards(self, signals: Signals, state, phase):
        """The end of driver braking: by deceleration, and by slip."""
        slip = self.wheel.slip(signals.wheel_speed, signals.vehicle_speed)
        sinks = while_pressed(BEYOND * self.slip - slip, signals)
        return jnp.where(phase == 0, self.driver_guard(signals), -1.0), jnp.where(phase == 0, sinks, -1.0)

    def switch(self, signals: Signals, state, phase, slot):
        """Control after driver braking."""
        return state, jnp.ones_like(phase)
