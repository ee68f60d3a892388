"""The automaton of the five-phase algorithm: thresholds on the wheel acceleration offset x2.

| phase | leaves when |
|---|---|
| 0 driver braking | x2 <= -eps0 -> 1 |
| 1 release | x2 >= eps1 -> 2 |
| 2 hold | x2 >= eps2 -> 3; x2 falls back through fallback * eps1 -> 4 |
| 3 fast apply | x2 <= eps3 -> 4 |
| 4 slow apply | x2 <= -eps4 -> 5 |
| 5 hold | x2 <= -eps5 -> 1 |

Source: Pasillas-Lepine 2006; Hoang et al. 2014, Fig. 5; Aguado-Rojas 2019, Fig. 6.6.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from absjax.control.phases import by_phase
from absjax.parameters import model, parameter
from absjax.vehicle import Signals

Number = jax.Array | float
TUNED: dict[str, Any] = {"low": 0.0, "open_low": True, "trainable": True}


@model
class AccelerationPhases:
    """Thresholds eps0..eps5 on x2, and what follows which."""

    phases: ClassVar[tuple[str, ...]] = ("driver braking", "release", "hold", "fast apply", "slow apply", "hold")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int | None] = 1
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5")
    """the fields that are thresholds on a measured acceleration, which noise keeps from being small"""

    eps0: Number = parameter("eps0, deceleration that ends driver braking, m/s^2", default=50.0, **TUNED)
    eps1: Number = parameter("eps1, acceleration that ends the release, m/s^2", default=30.0, **TUNED)
    eps2: Number = parameter("eps2, acceleration that starts the fast apply, m/s^2", default=40.0, **TUNED)
    eps3: Number = parameter("eps3, acceleration that ends the fast apply, m/s^2", default=20.0, **TUNED)
    eps4: Number = parameter("eps4, deceleration that ends the slow apply, m/s^2", default=20.0, **TUNED)
    eps5: Number = parameter("eps5, deceleration that starts the release, m/s^2", default=30.0, **TUNED)
    fallback: Number = parameter("share of eps1 through which phase 2 falls back", default=0.9, low=0.0, high=0.999)

    def guards(self, signals: Signals, kept, mode):
        """Slot 0: the threshold that leads on; slot 1: the fall-back of phase 2."""
        x2 = signals.acceleration_offset
        rising = (mode == 1) | (mode == 2)
        threshold = by_phase(mode, (-self.eps0, self.eps1, self.eps2, self.eps3, -self.eps4, -self.eps5))
        onward = jnp.where(rising, x2 - threshold, threshold - x2)
        return onward, jnp.where(mode == 2, self.fallback * self.eps1 - x2, -1.0)

    def following(self, mode, slot):
        """Phase after the guard of `slot` has fired."""
        onward = jnp.where(mode == 5, 1, mode + 1)
        return jnp.where((mode == 2) & (slot == 1), 4, onward)
