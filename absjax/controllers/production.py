"""The logic of production cars: thresholds -a1, -a2, a3 and a4 on the acceleration of the rim, and none on slip.

| phase | dPb/dt | leaves when |
|---|---|---|
| 0 driver braking | the driver's | acc <= -a1 -> 1 |
| 1 hold | 0 | acc <= -a2 -> 2; false alarm: acc >= -share a1 -> 0 |
| 2 release | -u_release / (R w) | acc >= -share a1 -> 3 |
| 3 hold, the wheel recovers | 0 | acc >= a3 -> 5; acc <= -a1 -> 2; after the longest hold -> 6 |
| 4 apply | +u_apply / (R w) | acc <= a3 + share (a4 - a3) -> 5 |
| 5 hold, the wheel accelerates | 0 | acc <= share a3 -> 6; acc >= a4 -> 4 |
| 6 the driver's pressure again | +u_through / (R w) | acc <= -a1 -> 2 |

acc = R w'. From the second cycle on the hold of phase 1 is left out, as 6 leads to 2. It needs neither a reference
speed nor that of the vehicle, for which -a2 takes the place of the slip threshold of `absjax.controllers.bosch`.

Ours: how fast the pressure comes back in phase 6, which the source leaves to the hydraulics; `share`, because no guard
may be open where its phase begins; the way out of a false alarm; and the longest hold, without which a wheel that
never reaches a3, as on ice, would stay released.
Source: Hoang 2014 (thesis), section 1.3.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.base import Controller
from absjax.controllers.phases import OPEN_VALVE, TUNED, Entered, per_rim, while_pressed
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class ProductionLogic(Controller):
    """Thresholds, rates and the longest hold of the logic of production cars.

    Raises:
        ValueError: at construction, unless a2 is 2 m/s^2 above a1, and a4 above a3, at least.
    """

    title: ClassVar[str] = "production logic"
    grid_step: ClassVar[float] = 2e-3
    phases: ClassVar[tuple[str, ...]] = (
        "driver braking",
        "hold",
        "release",
        "hold, recovering",
        "apply",
        "hold, accelerating",
        "driver's pressure again",
    )
    slots: ClassVar[int] = 3
    cycle_phase: ClassVar[int | None] = 2
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("a1", "a2", "a3", "a4")
    """the fields that noise of the measured acceleration keeps from being small"""
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("a1", "a2", 2.0), ("a3", "a4", 2.0))
    """(lower, higher, by how much at least)"""

    a1: Any = parameter("a1 of -a1, deceleration that holds the pressure, m/s^2", default=35.0, **TUNED)
    a2: Any = parameter("a2 of -a2, deceleration that releases it, m/s^2", default=45.0, **TUNED)
    a3: Any = parameter("a3, acceleration below which the driver is let through again, m/s^2", default=10.0, **TUNED)
    a4: Any = parameter("a4, acceleration that asks for more pressure, m/s^2", default=30.0, **TUNED)
    release: Any = parameter("u_release, bar m/s^2", default=10000.0, **TUNED)
    apply: Any = parameter("u_apply, bar m/s^2", default=5000.0, **TUNED)
    through: Any = parameter("u_through, of the driver's pressure coming back, bar m/s^2", default=2000.0, **TUNED)
    longest_hold: Any = parameter("longest hold after the release, s", default=0.1, **TUNED)
    share: Any = parameter("of a threshold at which it is left again", default=0.5, low=0.0, high=0.999, open_low=True)

    def initial_state(self, signals: Signals) -> Entered:
        """Entered here and now."""
        return Entered(signals.time)

    def rate(self, signals: Signals, state: Entered, phase):
        """Commanded dPb/dt [bar/s]."""
        strength = pick(phase, (0.0, 0.0, -self.release, 0.0, self.apply, 0.0, self.through))
        return jnp.where(phase == 0, OPEN_VALVE, per_rim(strength, signals))

    def guards(self, signals: Signals, state: Entered, phase):
        """One slot for each way on, in the order of the table."""
        acc = signals.acceleration_offset + signals.vehicle_acceleration
        falls, recovers = -self.a1 - acc, acc + self.share * self.a1
        sinks = self.a3 + self.share * (self.a4 - self.a3) - acc
        first = (
            while_pressed(falls, signals),
            -self.a2 - acc,
            recovers,
            acc - self.a3,
            sinks,
            self.share * self.a3 - acc,
            falls,
        )
        second = (-1.0, recovers, -1.0, falls, -1.0, acc - self.a4, -1.0)
        overdue = jnp.where(phase == 3, signals.time - state.time - self.longest_hold, -1.0)
        return pick(phase, first), pick(phase, second), overdue

    def switch(self, signals: Signals, state: Entered, phase, slot):
        """The phase that follows, entered now."""
        first, second = pick(phase, (1, 2, 3, 5, 5, 6, 2)), pick(phase, (0, 0, 2, 2, 4, 4, 6))
        return Entered(signals.time), jnp.where(slot == 0, first, jnp.where(slot == 1, second, 6))
