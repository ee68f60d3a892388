"""Monitors of the excitation: whether the run tells the friction at present; where it does not, theta is drawn to 1.

    sN = f' / |[f', f]|,  f = f_y*, f' = df_y*/dvy       its variation: LP5[(sN - LP1 sN)^2],  LPn = 1 / (n s + 1)

Source: Grip et al. 2008, 8.1.2. The printed form mixes units and blocks the adaptation on low friction, where the
force looks linear while theta is 1; `ScaledMonitor`, ours, measures f' on the scale of the slip at which friction
saturates, and asks in addition for variation in the lateral acceleration.
"""

from typing import Any, ClassVar, NamedTuple, Protocol

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.sideslip.forces import Forces

TINY = 1e-12
"""N^2, where there is no force at all."""


class Monitor(Protocol):
    """Whether excitation is low: a class made by `absjax.parameters.model`."""

    title: ClassVar[str]
    """for tables and figures"""

    def initial_state(self, share: Any, acceleration: Any) -> Any:
        """State at the first sample."""
        ...

    def share(self, forces: Forces, speed: Any, stiffness: Any) -> Any:
        """sN, from the forces, the estimated speed [m/s] and C = mu'(0)."""
        ...

    def low(self, state: Any) -> Any:
        """Whether excitation is low, bool."""
        ...

    def step(self, state: Any, share: Any, acceleration: Any, period: Any) -> Any:
        """State after a period [s] with sN and the lateral acceleration [m/s^2]."""
        ...


class Variation(NamedTuple):
    """State of the monitors."""

    share: Any
    """LP1 sN"""
    share_variation: Any
    """LP5 of its deviation squared"""
    acceleration: Any
    """LP2 ay"""
    acceleration_variation: Any
    """LP5 of its deviation squared"""
    acceleration_power: Any
    """LP5 ay^2"""


@model
class PublishedMonitor:
    """As printed in 8.1.2: low while the variation of sN is below a threshold."""

    title: ClassVar[str] = "published monitor"

    threshold: Any = parameter("of the variation of sN", default=0.002, low=0.0)
    start: Any = parameter("variation of sN at the first sample", default=0.0, low=0.0)
    fast: Any = parameter("time constant of LP1, s", default=1.0, low=0.02)
    slow: Any = parameter("time constant of LP5, s", default=5.0, low=0.02)

    def initial_state(self, share, acceleration):
        """State at the first sample."""
        return Variation(share, self.start + 0.0 * share, acceleration, 0.0 * share, 0.0 * share)

    def share(self, forces, speed, stiffness):
        """sN."""
        return forces.lateral_slope / jnp.sqrt(forces.lateral_slope**2 + forces.lateral**2 + TINY)

    def low(self, state):
        """Whether excitation is low."""
        return state.share_variation < self.threshold

    def step(self, state, share, acceleration, period):
        """State after a period."""
        variation = (share - state.share) ** 2
        return state._replace(
            share=state.share + period / self.fast * (share - state.share),
            share_variation=state.share_variation + period / self.slow * (variation - state.share_variation),
        )


@model
class ScaledMonitor:
    """sN of k f', k = 0.5 max(vx, 3) / C; low also where the lateral acceleration hardly varies:

    LP5[(ay - LP2 ay)^2] < 0.2 (LP5[ay^2] + 0.05).
    """

    title: ClassVar[str] = "scaled monitor"

    threshold: Any = parameter("of the variation of sN", default=0.0005, low=0.0)
    start: Any = parameter("variation of sN at the first sample", default=0.0, low=0.0)
    fast: Any = parameter("time constant of LP1, s", default=1.0, low=0.02)
    slow: Any = parameter("time constant of LP5, s", default=5.0, low=0.02)
    middle: Any = parameter("time constant of LP2, s", default=2.0, low=0.02)
    varied: Any = parameter("share of ay^2 that has to be variation", default=0.2, low=0.0)
    floor: Any = parameter("added to ay^2, m^2/s^4", default=0.05, low=0.0)
    scale: Any = parameter("share of the saturating slip in k", default=0.5, low=0.0, open_low=True)
    slowest: Any = parameter("smallest speed in k, m/s", default=3.0, low=0.0, open_low=True)

    def initial_state(self, share, acceleration):
        """State at the first sample."""
        return Variation(share, self.start + 0.0 * share, acceleration, 0.0 * share, 0.0 * share)

    def share(self, forces, speed, stiffness):
        """sN."""
        slope = self.scale * jnp.maximum(speed, self.slowest) / stiffness * forces.lateral_slope
        return slope / jnp.sqrt(slope**2 + forces.lateral**2 + TINY)

    def low(self, state):
        """Whether excitation is low."""
        steady = state.acceleration_variation < self.varied * (state.acceleration_power + self.floor)
        return (state.share_variation < self.threshold) | steady

    def step(self, state, share, acceleration, period):
        """State after a period."""

        def towards(value, target, time):
            return value + period / time * (target - value)

        return Variation(
            towards(state.share, share, self.fast),
            towards(state.share_variation, (share - state.share) ** 2, self.slow),
            towards(state.acceleration, acceleration, self.middle),
            towards(state.acceleration_variation, (acceleration - state.acceleration) ** 2, self.slow),
            towards(state.acceleration_power, acceleration**2, self.slow),
        )


@model
class NoMonitor:
    """Theta is adapted throughout."""

    title: ClassVar[str] = "no monitor"

    def initial_state(self, share, acceleration):
        """Nothing is kept."""
        return ()

    def share(self, forces, speed, stiffness):
        """Not used."""
        return 0.0 * forces.lateral

    def low(self, state):
        """Never."""
        return jnp.asarray(False)

    def step(self, state, share, acceleration, period):
        """Nothing is kept."""
        return ()
