"""The two-phase anti-lock algorithm on XBS.

| phase | z1* | leaves when |
|---|---|---|
| 0 driver braking | | x2 <= -eps0 -> 1 |
| 1 release | +zref | XBS >= chi_b -> 2 |
| 2 apply | -zref | XBS <= chi_a -> 1; slip <= slip_limit -> 3 |
| 3 recovery | +recovery zref | slip >= slip_limit / 2 -> 2 |

    u = (1/b) [-(a/v) z1 z2 + (kp/v) (z1 - z1*)],  hence  z1' = -(kp/v) (z1 - z1*)

with z1 the wheel acceleration offset and z2 = XBS, true or estimated. The algorithm assumes that it begins
with z1 < 0 and z2 < 0, where driver braking ends. The recovery is ours: where the estimate of XBS is off, as under
a brake of unknown efficiency, the apply may never end and the wheel lock. By default, slip_limit = -1, there is none.
Source: Aguado-Rojas 2019, section 4.2.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.driver_braking import DriverBraking
from absjax.controllers.phases import OPEN_VALVE
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from absjax.signals import Signals


@model
class TwoPhase(DriverBraking):
    """Thresholds on XBS, and the acceleration offset followed between them.

    Raises:
        ValueError: at construction, unless chi_a <= 0 < chi_b.
    """

    phases: ClassVar[tuple[str, ...]] = ("driver braking", "release", "apply", "recovery")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int] = 1
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("zref", "eps0")
    """the fields that noise of the measured acceleration keeps from being small"""

    wheel: Wheel = part("wheel and brake as the controller knows them", default=Wheel())
    zref: Any = parameter(
        "zref, acceleration offset to follow, m/s^2", default=20.0, low=0.0, open_low=True, trainable=True
    )
    gain: Any = parameter("kp, tracking gain, m/s^2", default=500.0, low=0.0, open_low=True, trainable=True)
    chi_a: Any = parameter(
        "chi_a, XBS that ends the apply; above -c3 of the road, or slip_limit ends it",
        default=-0.1,
        high=0.0,
        trainable=True,
    )
    chi_b: Any = parameter("chi_b, XBS that ends the release", default=1.0, low=0.0, open_low=True, trainable=True)

    slip_limit: Any = parameter("slip that ends the apply whatever XBS is", default=-1.0, low=-1.0, high=0.0)
    recovery: Any = parameter("zref of the recovery, as a multiple", default=3.0, low=0.0, open_low=True)

    def at(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, kept, mode):
        """Commanded dPb/dt [bar/s]."""
        offset = signals.acceleration_offset
        target = self.zref * pick(mode, (0.0, 1.0, -1.0, self.recovery))
        pull = self.gain * (offset - target) - self.wheel.slip_gain * offset * signals.stiffness
        follow = pull / (signals.vehicle_speed * self.wheel.pressure_gain)
        return jnp.where(mode == 0, OPEN_VALVE, follow)

    def guards(self, signals: Signals, kept, mode):
        """The threshold that leads on; the limit of the slip."""
        slip = self.wheel.slip(signals.wheel_speed, signals.vehicle_speed)
        release, apply = signals.stiffness - self.chi_b, self.chi_a - signals.stiffness
        onward = pick(mode, (self.driver_guard(signals), release, apply, slip - 0.5 * self.slip_limit))
        return onward, jnp.where(mode == 2, self.slip_limit - slip, -1.0)

    def switch(self, signals: Signals, kept, mode, slot):
        """Release after driver braking, then one after the other."""
        return kept, jnp.where(slot == 1, 3, pick(mode, (1, 2, 1, 2)))
