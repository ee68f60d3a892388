"""What a control unit measures instead of the truth.

`NoisySensor` has noise on the acceleration offset, and a radius that is off:

    y = (R^ / R) (x2 + v') - v' + sigma n(tick),  n white and normal

with R^ the radius the unit takes the wheel to have. Reproducible: the noise of a sample is drawn from seed and time.
"""

from typing import Any

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.sensors.white import white_noise
from absjax.signals import Signals


@model
class NoisySensor:
    """The true signals but for white noise and a wrong radius. It has no state."""

    noise: Any = parameter("sigma, standard deviation of a sample of x2, m/s^2; None: no noise", default=0.0, low=0.0)
    radius: Any = parameter("R^, m; None: the true one", default=None, low=0.0, open_low=True)
    seed: Any = parameter("of the noise, an integer", default=0, low=0.0)

    @property
    def period(self) -> float | None:
        """None: it is for any pace."""
        return None

    def begin(self, signals: Signals) -> tuple[Signals, tuple[()]]:
        """The signals as measured."""
        return self.measure(signals, ())

    def flow(self, state, signals: Signals) -> tuple[()]:
        """Nothing."""
        return ()

    def measure(self, signals: Signals, state) -> tuple[Signals, tuple[()]]:
        """The signals as measured."""
        x2, brakes = signals.acceleration_offset, signals.vehicle_acceleration
        known = signals.radius if self.radius is None else self.radius
        offset = known / signals.radius * (x2 + brakes) - brakes
        if self.noise is not None:
            offset = offset + self.noise * white_noise(self.seed, signals.time, jnp.asarray(x2).dtype)
        return signals._replace(acceleration_offset=offset, radius=known), state
