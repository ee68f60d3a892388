"""The notch filter at the wheel's frequency, for comparison.

    N(s) = ((s / wn)^2 + 2 zn s / wn + 1) / ((s / wn)^2 + 2 zd s / wn + 1),   wn = w

    z1' = f z2,   z2' = f (-z1 - 2 zd z2 + 2 (zn - zd) x),   y = x + z2,   f = w

is that filter at constant speed and stable at any: in the wheel's angle it is linear with constant coefficients, and
is integrated there by Tustin's rule, with 2 tan(f Ts / 2) in place of f Ts. It takes the first harmonic only, and lags.
Source: Hoang 2014, chapter 8, eq. 8.1 (8.40 with 2 zd; 8.5-8.9 hold at constant speed only).
"""

import dataclasses
from typing import Any, Literal

import jax
import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.encoder.time_stamping import Measured
from absjax.parameters import model, parameter

LARGEST_ANGLE = 2.8
"""What the wheel may turn in a sample, rad: at pi it would turn between two samples as often as they are."""


@model
class Notched:
    """State of the filter."""

    z1: Any = parameter("z1, unit of the signal")
    z2: Any = parameter("z2, unit of the signal")
    drive: Any = parameter("2 (zn - zd) x of the last sample, unit of the signal")
    begun: Any = parameter("1 if the last sample was valid")


@model
class NotchFilter:
    """A notch filter for one of the signals of the time-stamping algorithm."""

    signal: Literal["speed", "acceleration"]
    """what is filtered"""
    depth: Any = parameter("zn, damping of the numerator; 0 takes the frequency out", default=0.0, low=0.0)
    width: Any = parameter("zd, damping of the denominator", default=0.5, low=0.0, open_low=True, trainable=True)

    def __post_init__(self):
        if self.signal not in ("speed", "acceleration"):
            raise ValueError(f"NotchFilter.signal = {self.signal!r} must be speed or acceleration")

    @property
    def harmonics(self) -> int:
        """It takes the first off."""
        return 1

    def initial_state(self, dtype) -> Notched:
        """At rest."""
        zero = jnp.zeros((), dtype)
        return Notched(zero, zero, zero, zero)

    def clean(self, state: Notched, measured: Measured, period) -> tuple[Notched, jax.Array]:
        """The state after a sample, and the signal as filtered; `period` Ts [s].

        The filter begins in the steady state of its first valid sample.
        """
        value = getattr(measured.rotation, self.signal)
        turned = jnp.minimum(measured.rotation.speed * period, LARGEST_ANGLE)
        half = jnp.tan(0.5 * turned)
        drive = 2 * (self.depth - self.width) * value
        # z+ - z = half (A (z + z+) + 2 b (drive + drive+)), b = (0, 1/2)
        z1, z2 = state.z1, state.z2
        r1 = z1 + half * z2
        r2 = z2 - half * (z1 + 2 * self.width * z2) + half * (state.drive + drive)
        damped = 1 + 2 * self.width * half
        share = 1 / (damped + half**2)
        begun = jnp.ones_like(value)
        after = Notched((damped * r1 + half * r2) * share, (r2 - half * r1) * share, drive, begun)
        after = tree_where(state.begun > 0, after, Notched(drive, jnp.zeros_like(value), drive, begun))
        after = tree_where(measured.valid, after, dataclasses.replace(state, begun=jnp.zeros_like(value)))
        return after, jnp.where(measured.valid, value + after.z2, value)
