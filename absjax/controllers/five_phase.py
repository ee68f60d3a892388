"""The five-phase anti-lock algorithm on wheel acceleration thresholds, with given pressure rates.

| phase | 0 driver braking | 1 release | 2 hold | 3 fast apply | 4 slow apply | 5 hold |
|---|---|---|---|---|---|---|
| dPb/dt | the driver's | -u1 / (R w) | 0 | u3 / (R w) | u4 / (R w) | 0 |

The thresholds are in `absjax.controllers.acceleration_phases`.
Source: Pasillas-Lepine 2006; Hoang et al. 2014, Fig. 5; Aguado-Rojas 2019, Fig. 6.6.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.acceleration_phases import AccelerationPhases
from absjax.controllers.phases import OPEN_VALVE, TUNED, per_rim
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class FivePhase(AccelerationPhases):
    """Thresholds eps0..eps5 on x2 and pressure rates u1, u3, u4 of the five-phase algorithm."""

    title: ClassVar[str] = "five-phase"
    grid_step: ClassVar[float] = 2e-3
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (*AccelerationPhases.ordered, ("u4", "u3", 0.0))
    """the fast apply is no slower than the slow one"""

    u1: Any = parameter("u1, release, bar m/s^2", default=6000.0, **TUNED)
    u3: Any = parameter("u3, fast apply, bar m/s^2", default=4000.0, **TUNED)
    u4: Any = parameter("u4, slow apply, bar m/s^2", default=2000.0, **TUNED)

    def rate(self, signals: Signals, state, phase):
        """Commanded dPb/dt [bar/s]."""
        strength = pick(phase, (0.0, -self.u1, 0.0, self.u3, self.u4, 0.0))
        return jnp.where(phase == 0, OPEN_VALVE, per_rim(strength, signals))
