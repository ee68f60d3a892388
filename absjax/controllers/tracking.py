"""The five-phase algorithm with closed-loop tracking of the wheel acceleration.

The phases and thresholds are those of `absjax.controllers.acceleration_phases`.
Where the pressure changes (phases 1, 3 and 4) the acceleration offset follows a cubic from its value at the entry, e_i,
to beyond the next threshold, e_j, level at both ends,

    x2*(tau) = e_i + (e_j - e_i) (3 (tau/T)^2 - 2 (tau/T)^3),  T = (3 / (2 b)) |e_j - e_i| / dPb_max
    u = -(1/b) [(a/v) XBS^ x2 + x2*' - alpha (x2 - x2*)]

so that the pressure finds the level the road can bear. T is the shortest time in which the cubic alone
asks for no more than dPb_max. Where nothing is followed the pressure is held, in phase 0 it is the driver's.
Source: Hoang et al. 2014, section V, eq. 21-22 (there b < 0 and + b u).
"""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import pick, safe_divide
from absjax.controllers.acceleration_phases import AccelerationPhases
from absjax.controllers.phases import OPEN_VALVE
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class Entry(NamedTuple):
    """When a phase was entered, and where; scalars per lane."""

    time: jax.Array
    """s"""
    offset: jax.Array
    """x2, m/s^2"""


@model
class AccelerationTracking(AccelerationPhases):
    """Five phases whose pressure changes follow the acceleration instead of a given rate."""

    title: ClassVar[str] = "five-phase, tracking"
    grid_step: ClassVar[float] = 1e-3

    wheel: Wheel = part("wheel and brake as the controller knows them", default=Wheel())
    gain: Any = parameter("alpha, tracking gain, 1/s", default=100.0, low=0.0, open_low=True, trainable=True)
    pressure_rate: Any = parameter("dPb_max, sets the pace, bar/s", default=750.0, low=0.0, open_low=True)
    beyond: Any = parameter(
        "the cubic ends beyond the threshold by this share of the way, so that it is crossed", default=0.2, low=0.0
    )

    def initial_state(self, signals: Signals) -> Entry:
        """An entry here and now."""
        return Entry(signals.time, signals.acceleration_offset)

    def target(self, time, state, phase) -> tuple[Any, Any]:
        """x2* at a time of a phase that follows it [m/s^2], and its rate [m/s^3]; before the phase x2 at the entry."""
        goal = pick(phase, (0.0, self.eps1, 0.0, self.eps3, -self.eps4, 0.0))
        way = (1 + self.beyond) * (goal - state.offset)
        duration = 1.5 / self.wheel.pressure_gain * jnp.abs(way) / self.pressure_rate
        share = jnp.clip(safe_divide(time - state.time, duration, duration > 0, 1.0), 0.0, 1.0)
        slope = safe_divide(way * 6 * share * (1 - share), duration, duration > 0)
        return state.offset + way * share**2 * (3 - 2 * share), slope

    def rate(self, signals: Signals, state: Entry, phase):
        """Commanded dPb/dt [bar/s]."""
        a, b, x2 = self.wheel.slip_gain, self.wheel.pressure_gain, signals.acceleration_offset
        target, slope = self.target(signals.time, state, phase)
        tracking = -(a / signals.vehicle_speed * signals.stiffness * x2 + slope - self.gain * (x2 - target)) / b
        return pick(phase, (OPEN_VALVE, tracking, 0.0, tracking, tracking, 0.0))
