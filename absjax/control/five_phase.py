"""The five-phase anti-lock algorithm on wheel acceleration thresholds, with given pressure rates.

| phase | 0 driver braking | 1 release | 2 hold | 3 fast apply | 4 slow apply | 5 hold |
|---|---|---|---|---|---|---|
| dPb/dt | ramp u4 / (R w) | -u1 / (R w) | 0 | u3 / (R w) | u4 / (R w) | 0 |

The thresholds are in `absjax.control.acceleration_phases`.
Source: Pasillas-Lepine 2006; Hoang et al. 2014, Fig. 5; Aguado-Rojas 2019, Fig. 6.6.
"""

from absjax.control.acceleration_phases import TUNED, AccelerationPhases, Number
from absjax.control.phases import by_phase
from absjax.parameters import model, parameter
from absjax.vehicle import Signals


@model
class FivePhase(AccelerationPhases):
    """Thresholds eps0..eps5 on x2 and pressure rates u1, u3, u4 of the five-phase algorithm."""

    u1: Number = parameter("u1, release, bar m/s^2", default=6000.0, **TUNED)
    u3: Number = parameter("u3, fast apply, bar m/s^2", default=4000.0, **TUNED)
    u4: Number = parameter("u4, slow apply, bar m/s^2", default=2000.0, **TUNED)
    ramp: Number = parameter("driver's ramp as a multiple of the slow apply", default=3.0, low=0.0, open_low=True)

    def at(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, kept, mode):
        """Commanded dPb/dt [bar/s]."""
        strength = by_phase(mode, (self.ramp * self.u4, -self.u1, 0.0, self.u3, self.u4, 0.0))
        return strength / (signals.radius * signals.wheel_speed)

    def switch(self, signals: Signals, kept, mode, slot):
        """The phase that follows."""
        return kept, self.following(mode, slot)
