"""A smooth stand-in for the encoder and its chain: what they do to the acceleration, without the edges.

Time-stamping fits a parabola to the edges of a window; its curvature is the acceleration in the middle of it, smoothed
over it. What is told lags half the window and the age of the newest edge,

    delay(w) = (W(w) + p / w) / 2,   W(w) = p / w max(min(n - 1, memory w / p), m + 1)

with p the pitch, n edges of order m = 2 at most, none older than the memory but the newest m + 2. Here it is a chain of
first-order lags whose time constants follow the wheel's speed; what of the encoder's errors is left after compensation
is one harmonic of the wheel's angle, ripple w^2 sin(k th + phase). The speed is told as it is. It is smooth in state
and parameters: a loop is differentiated through it as if it were part of the plant.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.parameters import model, parameter
from absjax.signals import Signals

LAGS = 3
"""In a row: one alone spreads an edge of the acceleration over much longer than the window."""
SLOWEST = 1.0
"""Wheel speed below which the window grows no more, rad/s."""


class Delayed(NamedTuple):
    """State of the sensor."""

    told: tuple[Any, ...]
    """w', and behind each of the lags, rad/s^2; of the last sample"""
    time: Any
    """of the last sample, s"""
    angle: Any
    """th, rad"""


@model
class DelayedSensor:
    """What a chain from edges tells, as lags and a ripple; of one lane, or of many."""

    teeth: Any = parameter("N", default=60.0, low=3.0)
    events: Any = parameter("n, edges of the window", default=12.0, low=4.0)
    memory: Any = parameter("age beyond which an edge is not used, s", default=10.0, low=0.0, open_low=True)
    left: Any = parameter("sigma, of the edges' errors, encoder cycles", default=0.0, low=0.0)
    taken_off: Any = parameter("share of their variance that compensation takes off", default=0.0, low=0.0, high=1.0)
    harmonic: Any = parameter("k, of the error", default=18.0, low=1.0)
    phase: Any = parameter("of the error, rad", default=0.0)

    @property
    def period(self) -> float | None:
        """None: it is for any pace."""
        return None

    def window(self, wheel_speed):
        """Teeth that the window spans, and the time from one to the next [s], at a wheel speed [rad/s]."""
        tooth = 2 * np.pi / self.teeth / jnp.maximum(wheel_speed, SLOWEST)
        return jnp.maximum(jnp.minimum(self.events - 1, self.memory / tooth), 3.0), tooth

    def delay(self, wheel_speed):
        """By which w' is told late [s], at a wheel speed [rad/s]."""
        spanned, tooth = self.window(wheel_speed)
        return 0.5 * (spanned + 1) * tooth

    def error(self, wheel_speed):
        """Effective value of the error of w' [rad/s^2]."""
        spanned, tooth = self.window(wheel_speed)
        left = self.left * jnp.sqrt(1 - self.taken_off)
        return left * 2 * np.pi / self.teeth * np.sqrt(720.0) / (tooth**2 * (spanned + 1) ** 2.5)

    def begin(self, signals: Signals) -> tuple[Signals, Delayed]:
        """The signals as measured, the wheel having turned as it does now."""
        turning = _turning(signals)
        zero = 0.0 * turning
        return self.measure(signals, Delayed((turning,) * (LAGS + 1), zero + signals.time, zero))

    def flow(self, state: Delayed, signals: Signals) -> Delayed:
        """The wheel turns."""
        return Delayed((None,) * (LAGS + 1), None, signals.wheel_speed)

    def measure(self, signals: Signals, state: Delayed) -> tuple[Signals, Delayed]:
        """The acceleration offset as told; a lag of time constant tau follows the mean of its input since the last
        sample, T ago, by 1 - exp(-T / tau) of what it is behind."""
        told = [_turning(signals)]
        follows = -jnp.expm1(-LAGS * (signals.time - state.time) / self.delay(signals.wheel_speed))
        for i in range(LAGS):
            ahead = 0.5 * (state.told[i] + told[i])
            told.append(state.told[i + 1] + follows * (ahead - state.told[i + 1]))
        ripple = jnp.sin(self.harmonic * state.angle + self.phase)
        error = np.sqrt(2.0) * self.error(signals.wheel_speed) * ripple
        offset = signals.radius * (told[-1] + error) - signals.vehicle_acceleration
        return signals._replace(acceleration_offset=offset), Delayed(tuple(told), signals.time, state.angle)


def _turning(signals: Signals):
    """w' of the wheel."""
    return (signals.acceleration_offset + signals.vehicle_acceleration) / signals.radius
