"""The fastest rim: what is nearest to the speed while some wheel rolls."""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.speed.base import LEAST, told


@model
class LargestRim:
    """v^ = max R w_i. A baseline."""

    title: ClassVar[str] = "largest rim"

    least: Any = parameter("speed that the estimate is not below, m/s", default=0.1, **LEAST)

    def initial_state(self, speed, wheels):
        """The speed."""
        return speed

    def update(self, state, acceleration, rims, period, pressures=None):
        """State at a sample."""
        told(self, rims, 1)
        return jnp.maximum(jnp.max(jnp.stack(rims)), self.least)

    def speed_of(self, state):
        """v^ [m/s]."""
        return state

    def acceleration_of(self, state, acceleration):
        """As it is told."""
        return acceleration
