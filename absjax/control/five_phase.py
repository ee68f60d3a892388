"""The five-phase anti-lock algorithm on wheel acceleration thresholds.

| phase | dPb/dt | leaves when |
|---|---|---|
| 0 driver braking | ramp u4 / (R w) | x2 <= -eps0 -> 1 |
| 1 release | -u1 / (R w) | x2 >= eps1 -> 2 |
| 2 hold | 0 | x2 >= eps2 -> 3; x2 falls back through fallback * eps1 -> 4 |
| 3 fast apply | u3 / (R w) | x2 <= eps3 -> 4 |
| 4 slow apply | u4 / (R w) | x2 <= -eps4 -> 5 |
| 5 hold | 0 | x2 <= -eps5 -> 1 |

Source: Pasillas-Lepine 2006; Hoang et al. 2014, Fig. 5; Aguado-Rojas 2019, Fig. 6.6.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from absjax.control.phases import by_phase
from absjax.parameters import model, parameter
from absjax.vehicle import Signals

Number = jax.Array | float
_TUNED: dict[str, Any] = {"low": 0.0, "open_low": True, "trainable": True}


@model
class FivePhase:
    """Thresholds eps0..eps5 on x2 and pressure rates u1, u3, u4 of the five-phase algorithm."""

    phases: ClassVar[tuple[str, ...]] = ("driver braking", "release", "hold", "fast apply", "slow apply", "hold")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int] = 1
    """the phase whose entry counts a cycle"""

    thresholds: ClassVar[tuple[str, ...]] = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5")
    """the fields that are thresholds on a measured acceleration, which noise keeps from being small"""

    eps0: Number = parameter("eps0, deceleration that ends driver braking, m/s^2", default=50.0, **_TUNED)
    eps1: Number = parameter("eps1, acceleration that ends the release, m/s^2", default=30.0, **_TUNED)
    eps2: Number = parameter("eps2, acceleration that starts the fast apply, m/s^2", default=40.0, **_TUNED)
    eps3: Number = parameter("eps3, acceleration that ends the fast apply, m/s^2", default=20.0, **_TUNED)
    eps4: Number = parameter("eps4, deceleration that ends the slow apply, m/s^2", default=20.0, **_TUNED)
    eps5: Number = parameter("eps5, deceleration that starts the release, m/s^2", default=30.0, **_TUNED)
    u1: Number = parameter("u1, release, bar m/s^2", default=6000.0, **_TUNED)
    u3: Number = parameter("u3, fast apply, bar m/s^2", default=4000.0, **_TUNED)
    u4: Number = parameter("u4, slow apply, bar m/s^2", default=2000.0, **_TUNED)
    ramp: Number = parameter("driver's ramp as a multiple of the slow apply", default=3.0, low=0.0, open_low=True)
    fallback: Number = parameter("share of eps1 through which phase 2 falls back", default=0.9, low=0.0, high=1.0)

    def at(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, kept, mode):
        """Commanded dPb/dt [bar/s]."""
        strength = by_phase(mode, (self.ramp * self.u4, -self.u1, 0.0, self.u3, self.u4, 0.0))
        return strength / (signals.radius * signals.wheel_speed)

    def guards(self, signals: Signals, kept, mode):
        """Slot 0: the threshold that leads on; slot 1: the fall-back of phase 2."""
        x2 = signals.acceleration_offset
        rising = (mode == 1) | (mode == 2)
        threshold = by_phase(mode, (-self.eps0, self.eps1, self.eps2, self.eps3, -self.eps4, -self.eps5))
        onward = jnp.where(rising, x2 - threshold, threshold - x2)
        return onward, jnp.where(mode == 2, self.fallback * self.eps1 - x2, -1.0)

    def switch(self, signals: Signals, kept, mode, slot):
        """Phase after the guard of `slot` has fired."""
        following = jnp.where(mode == 5, 1, mode + 1)
        return kept, jnp.where((mode == 2) & (slot == 1), 4, following)
