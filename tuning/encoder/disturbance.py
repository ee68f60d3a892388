"""A sensor whose wheel acceleration oscillates with the wheel's angle, and the notch filter that takes that off.

    y = x2 + A sin(th),    th' = w

as tyres that are not round add it. The filter is that of `absjax.encoder.notch`, its frequency the wheel speed, or the
speed of the vehicle over R, as published.
Source: Hoang 2014 (thesis), sections 8.1 to 8.3.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.encoder.notch import NotchFilter
from absjax.encoder.rotation import Rotation
from absjax.encoder.time_stamping import Measured
from absjax.parameters import model, parameter
from absjax.signals import Signals


class Oscillating(NamedTuple):
    """State of the sensor."""

    angle: Any
    """of the wheel, rad"""
    filtered: Any
    """state of the notch filter"""
    told: Any
    """x2 at the last sample, m/s^2"""


@model
class OscillatingSensor:
    """The true signals but for an oscillation of x2 with the wheel's angle, and a filter against it."""

    amplitude: Any = parameter("A, m/s^2", default=10.0, low=0.0)
    width: Any = parameter("zd of the notch filter", default=0.1, low=0.0, open_low=True)
    filtered: bool = True
    """whether there is a filter"""
    by_vehicle: bool = False
    """whether the filter's frequency is v / R instead of the wheel speed"""
    period: float = 1e-3
    """between the ticks, s"""

    @property
    def notch(self) -> NotchFilter:
        """The filter."""
        return NotchFilter("acceleration", width=self.width)

    def begin(self, signals: Signals) -> tuple[Signals, Oscillating]:
        """The wheel at angle 0."""
        zero = 0.0 * jnp.asarray(signals.wheel_speed)
        filtered = jax.tree.map(lambda x: x + zero, self.notch.initial_state(zero.dtype))
        return self.measure(signals, Oscillating(zero, filtered, zero))

    def flow(self, state: Oscillating, signals: Signals) -> Oscillating:
        """The wheel turns."""
        return jax.tree.map(lambda _: None, state)._replace(angle=signals.wheel_speed)

    def measure(self, signals: Signals, state: Oscillating) -> tuple[Signals, Oscillating]:
        """x2 as it is told."""
        told = signals.acceleration_offset + self.amplitude * jnp.sin(state.angle)
        if not self.filtered:
            return signals._replace(acceleration_offset=told), state._replace(told=told)
        speed = signals.vehicle_speed / signals.radius if self.by_vehicle else signals.wheel_speed
        sound = jnp.ones_like(told, bool)
        filtered, told = self.notch.clean(
            state.filtered, Measured(Rotation(state.angle, speed, told), None, sound, sound), self.period
        )
        return signals._replace(acceleration_offset=told), Oscillating(state.angle, filtered, told)
