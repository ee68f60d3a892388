"""A square wave through a filter of an order above the system's, so that the derivatives the law asks for are states.

(Tf s + 1)^(n+1) x* = level
"""

from math import comb
from typing import Any

import jax.numpy as jnp

from absjax.parameters import model, parameter


@model
class SquareWave:
    """Level between `low` and `high`, `high` first, half a period each."""

    low: Any = parameter("lower level", default=0.0)
    high: Any = parameter("upper level", default=0.0)
    half_period: Any = parameter("time at a level, s", default=4.0, low=0.0, open_low=True)
    time_constant: Any = parameter("Tf, s", default=0.25, low=0.0, open_low=True)

    def level(self, time):
        """What the filter is given."""
        return jnp.where(jnp.floor(time / self.half_period) % 2 == 0, self.high, self.low)

    def rates(self, derivatives: tuple[Any, ...], level) -> tuple[Any, ...]:
        """Rates of x* and its derivatives, of which there are n besides."""
        order, Tf = len(derivatives), self.time_constant
        held = sum(comb(order, k) * Tf**k * d for k, d in enumerate(derivatives))
        return (*derivatives[1:], (level - held) / Tf**order)
