"""The reference speed of the eight-phase logic.

    v <- max(R w, v - T gradient)

of one wheel's rim, which that logic does at its switchings (`absjax.controllers.bosch`), and this at every sample.
Source: Aguado-Rojas 2019, section 2.2.3; Hoang 2014 (thesis), section 1.3.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.speed.base import LEAST, told


@model
class FixedGradient:
    """A reference that falls with a given gradient. A baseline; `wheel` is the place of the wheel.

    Raises:
        ValueError: at construction, if there is no such wheel.
    """

    title: ClassVar[str] = "fixed gradient"

    gradient: Any = parameter(
        "at which it falls, m/s^2", default=8.0, low=0.0, open_low=True, trainable=True, span=(0.5, 20.0)
    )
    least: Any = parameter("speed that the estimate is not below, m/s", default=0.1, **LEAST)
    wheel: int = 0

    def __post_init__(self):
        if self.wheel < 0:
            raise ValueError(f"FixedGradient.wheel = {self.wheel} must be 0 at least")

    def initial_state(self, speed, wheels):
        """The reference is the speed."""
        return speed

    def update(self, state, acceleration, rims, period, pressures=None):
        """State at a sample."""
        rim = told(self, rims, self.wheel + 1)[-1]
        return jnp.maximum(jnp.maximum(rim, state - period * self.gradient), self.least)

    def speed_of(self, state):
        """The reference [m/s]."""
        return state

    def acceleration_of(self, state, acceleration):
        """As it is told."""
        return acceleration
