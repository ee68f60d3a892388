"""The brake actuator: from a commanded pressure rate to the pressure at the wheel.

Each piece is optional, and absent when None:

* rate limit: |dPb/dt| <= limit
* pure delay, by its second-order Pade approximant (1 - s h/2 + s^2 h^2/12) / (1 + s h/2 + s^2 h^2/12)
* first-order lag: tau Pb' = P - Pb

What bounds the pressure is the driver's, see `absjax.loop.driver`.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter

SMALL_PRESSURE = 10.0
"""bar"""


class BrakeState(NamedTuple):
    """State of the actuator; scalars per lane, None where a piece is absent."""

    commanded: Any
    """integral of the commanded rate, bar"""
    delay: Any
    """the two states of the Pade approximant, in controllable form"""
    lagged: Any
    """pressure behind the lag, bar"""


@model
class Brake:
    """A brake actuator; without arguments an ideal one, whose pressure is the integral of the command."""

    rate_limit: Any = parameter("largest |dPb/dt|, bar/s", default=None, low=0.0, open_low=True)
    lag: Any = parameter("tau, first-order lag, s", default=None, low=0.0, open_low=True)
    delay: Any = parameter("h, pure delay, s", default=None, low=0.0, open_low=True)

    def initial_state(self, pressure: Any = 0.0) -> BrakeState:
        """State of rest at `pressure` [bar]."""
        zero = 0.0 * pressure
        return BrakeState(
            pressure,
            None if self.delay is None else (pressure, zero),
            None if self.lag is None else pressure,
        )

    @property
    def lags(self) -> bool:
        """Whether the pressure at the wheel comes after the commanded one."""
        return self.lag is not None

    @property
    def overshoots(self) -> bool:
        """Whether the pressure at the wheel may leave the range of what was commanded: behind the approximant."""
        return self.delay is not None

    def scales(self, state: BrakeState) -> BrakeState:
        """Errors below `SMALL_PRESSURE` are shares of it: a released brake need not be right in its last millibar."""
        small = SMALL_PRESSURE + 0.0 * state.commanded
        delay = None if self.delay is None else (small, small / self.delay)
        return BrakeState(small, delay, None if self.lag is None else small)

    def limit(self, rate, state: BrakeState):
        """The commanded rate [bar/s] the actuator can follow."""
        return rate if self.rate_limit is None else jnp.clip(rate, -self.rate_limit, self.rate_limit)

    def flow(self, state: BrakeState, rate) -> BrakeState:
        """d(state)/dt under the commanded rate [bar/s], already limited."""
        delay = lagged = None
        if self.delay is not None:
            # x1' = x2, x2' = (12 (P - x1) - 6 h x2) / h^2: unit gain from P to x1.
            level, slope = state.delay
            delay = (slope, (12 * (state.commanded - level) - 6 * self.delay * slope) / self.delay**2)
        if self.lag is not None:
            lagged = (self._delayed(state, delay) - state.lagged) / self.lag
        return BrakeState(rate, delay, lagged)

    def _delayed(self, state: BrakeState, delay_flow):
        if delay_flow is None:
            return state.commanded
        level, slope = state.delay
        return level - 0.5 * self.delay * slope + self.delay**2 / 12 * delay_flow[1]

    def pressure(self, state: BrakeState):
        """Pressure at the wheel [bar]."""
        if self.lag is not None:
            return state.lagged
        if self.delay is None:
            return state.commanded
        return self._delayed(state, self.flow(state, jnp.zeros_like(state.commanded)).delay)
