"""What a longitudinal accelerometer tells.

    a = (1 + e) v' + bias + slope (t > 0) + sigma n,  n white and normal

with the bias it has had since it was turned on, and what is added to it where a manoeuvre begins on a road that rises
otherwise than before: g times the change of its slope; the plants do not know of it. e is an error of its scale, and
what is left of the body's pitch: a body that dives by k v' turns the sensor into gravity, which adds g k to the scale.
Rolling tells the bias, neither e nor slope.
Reproducible: the noise of a sample is drawn from seed and time.
Source of the bias: Aguado-Rojas 2019, section 3.6; all else is ours.
"""

from typing import Any

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.sensors.white import white_noise

CHANNEL = 1
"""Of its noise, so that wheel sensors of the same seed have another."""


@model
class Accelerometer:
    """A longitudinal accelerometer."""

    bias: Any = parameter("turn-on bias, m/s^2", default=0.5)
    noise: Any = parameter("sigma, standard deviation of a sample, m/s^2", default=0.1, low=0.0)
    seed: Any = parameter("of the noise, an integer", default=0, low=0.0)
    gain: Any = parameter("e, share by which it tells more than there is", default=0.0, low=-1.0, open_low=True)
    slope: Any = parameter("by which it tells more from the time 0 on, m/s^2", default=0.0)

    def measure(self, acceleration, time):
        """The acceleration [m/s^2] as it tells it at `time` [s]; arrays broadcast."""
        acceleration = jnp.asarray(acceleration)
        noise = self.noise * white_noise(self.seed, time, acceleration.dtype, CHANNEL)
        offset = self.bias + jnp.where(jnp.asarray(time) > 0, self.slope, 0.0)
        return (1 + self.gain) * acceleration + offset + noise
