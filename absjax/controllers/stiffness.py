"""Continuous control of XBS to zero, the peak of any road.

    z1* = -kr z2 / (c z2 + d),  z1*' = -(kr/v) d z1 / (c z2 + d)
    u = (1/b) [-(a/v) z1 z2 + (kp/v) (z1 - z1*) - z1*']

with z1 the wheel acceleration offset, z2 = XBS, c = c2 and d = c2 c3 of the road. With the true XBS it leads
to z1 = z2 = 0. With an estimated one it fails: as z1 vanishes nothing excites the observer any more, and the
estimate may fall to -d/c, where the law is not defined. A loop whose controller gets there ends, `UNDEFINED`.
Source: Aguado-Rojas 2019, section 4.1.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.controllers.driver_braking import DriverBraking
from absjax.controllers.phases import OPEN_VALVE
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from absjax.results import UNDEFINED
from absjax.signals import Signals


@model
class StiffnessControl(DriverBraking):
    """Continuous feedback on the wheel acceleration offset and XBS, for a road of known c2 and c3."""

    title: ClassVar[str] = "continuous, true XBS"
    grid_step: ClassVar[float] = 1e-3
    phases: ClassVar[tuple[str, ...]] = ("driver braking", "control")
    slots: ClassVar[int] = 1
    cycle_phase: ClassVar[int | None] = None
    """it does not cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("eps0",)
    """the fields that noise of the measured acceleration keeps from being small"""

    wheel: Wheel = part("wheel and brake as the controller knows them", default=Wheel())
    rate_gain: Any = parameter("kr, at which XBS decays, m/s^2", default=100.0, low=0.0, open_low=True, trainable=True)
    gain: Any = parameter("kp, tracking gain, m/s^2", default=500.0, low=0.0, open_low=True, trainable=True)
    c: Any = parameter("c = c2 of the road", default=24.0, low=0.0, trainable=True)
    d: Any = parameter("d = c2 c3 of the road", default=12.5, low=0.0, open_low=True, trainable=True)
    margin: Any = parameter(
        "share of d under which c XBS + d counts as zero", default=0.01, low=0.0, high=1.0, open_low=True
    )

    def initial_state(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def _room(self, signals: Signals):
        return self.c * signals.stiffness + self.d

    def rate(self, signals: Signals, state, phase):
        """Commanded dPb/dt [bar/s]."""
        z1, z2, room = signals.acceleration_offset, signals.stiffness, self._room(signals)
        defined = room >= self.margin * self.d
        target = safe_divide(-self.rate_gain * z2, room, defined)
        slope = safe_divide(-self.rate_gain * self.d * z1, room, defined)
        pull = self.gain * (z1 - target) - slope - self.wheel.slip_gain * z1 * z2
        follow = pull / (signals.vehicle_speed * self.wheel.pressure_gain)
        return jnp.where(phase == 0, OPEN_VALVE, follow)

    def guards(self, signals: Signals, state, phase):
        """The end of driver braking; then the end of where the law is defined."""
        end = self.margin * self.d - self._room(signals)
        return (jnp.where(phase == 0, self.driver_guard(signals), end),)

    def switch(self, signals: Signals, state, phase, slot):
        """Control after driver braking; no more control where it is not defined."""
        return state, jnp.where(phase == 0, 1, UNDEFINED)
