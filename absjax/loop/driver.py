"""Who presses the pedal: a driver, or a ramp as in the sources' simulations.

A driver's foot gives the pedal a pressure p(t): nothing until it presses, then `rate` up to `largest`, held there,
and where it is lifted down at `release_rate`. The pressure at the brake is never above it, whatever a controller
asks for:

    0 <= Pb(t) <= p(t) = min(largest, rate (t - delay))

A controller can only take away. When a lifted pedal is back at zero, control has ended and begins anew.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.phases import per_rim
from absjax.parameters import concrete, model, parameter
from absjax.signals import Signals

OFF, PRESSING, HELD, LIFTING = range(4)
"""What the foot does."""
NEVER = -1e6
"""Value of a guard that waits for nothing."""


class Pedal(NamedTuple):
    """State of the pedal; scalars per lane."""

    level: Any
    """what the foot has reached, bar"""
    moves: Any
    """how often the foot has pressed or begun to lift"""


@model
class Driver:
    """A foot on the brake pedal. A scenario of a stop: no controller knows it, no tuner may touch it."""

    rate: Any = parameter("pressure rate of the foot, bar/s; a panic stop by default", default=400.0, low=1e-3)
    delay: Any = parameter("time before the foot presses, s", default=0.0, low=0.0)
    largest: Any = parameter("largest pressure, bar", default=150.0, low=0.0, open_low=True)
    changes: tuple[Any, ...] = parameter(
        "instants at which the foot is lifted, pressed again, lifted ..., s, rising", default=()
    )
    release_rate: Any = parameter("pressure rate of the lifted foot, bar/s", default=1000.0, low=1e-3)

    def __post_init__(self):
        instants = (self.delay, *self.changes)
        if all(concrete(x) for x in instants) and not all(np.all(np.less(a, b)) for a, b in pairwise(instants)):
            raise ValueError(f"Driver.changes = {self.changes} must rise, from above the delay of {self.delay} s")

    def asked(self, rate, phase, signals: Signals):
        """The rate that is asked for [bar/s]: the controller's, in every phase."""
        return rate

    def initial_state(self, speed) -> Pedal:
        """A pedal at rest."""
        zero = 0.0 * speed
        return Pedal(zero, zero)

    def pressed(self, speed) -> Pedal:
        """A pedal held at the largest pressure."""
        zero = 0.0 * speed
        return Pedal(zero + self.largest, zero + 1.0)

    def slope(self, foot):
        """dp/dt of the pedal [bar/s] while the foot does `foot`."""
        return jnp.where(foot == PRESSING, self.rate, jnp.where(foot == LIFTING, -self.release_rate, 0.0))

    def _waiting(self, time, pedal: Pedal):
        """How long the next move is overdue [s]; `NEVER` without one."""
        overdue = NEVER
        for i, instant in reversed(list(enumerate((self.delay, *self.changes)))):
            overdue = jnp.where(pedal.moves == i, time - instant, overdue)
        return overdue

    def _arriving(self, pedal: Pedal, foot):
        """How far the pedal is beyond where its way ends [bar]."""
        return jnp.where(foot == PRESSING, pedal.level - self.largest, jnp.where(foot == LIFTING, -pedal.level, NEVER))

    def guard(self, time, pedal: Pedal, foot):
        """Rises through zero where the foot moves, or the pedal arrives at the largest pressure or at zero."""
        return jnp.maximum(self._waiting(time, pedal), self._arriving(pedal, foot))

    def move(self, time, pedal: Pedal, foot) -> tuple[Pedal, jax.Array]:
        """Pedal, and what the foot does, after the guard has fired."""
        moves = self._waiting(time, pedal) >= self._arriving(pedal, foot)
        lifts = pedal.moves % 2 == 1
        rests = jnp.where(foot == PRESSING, self.largest, 0.0)
        after = Pedal(jnp.where(moves, pedal.level, rests), pedal.moves + moves)
        arrived = jnp.where(foot == PRESSING, HELD, OFF)
        return after, jnp.where(moves, jnp.where(lifts, LIFTING, PRESSING), arrived).astype(jnp.int32)


@model
class FreeRamp:
    """A ramp as in the sources' simulations instead of a driver: dPb/dt = ramp / (R w) in phase 0, then free.

    Nobody drives this: the pressure may rise above any pedal's and fall below zero. It is for comparison with published
    calculations, and for runs that begin in the middle of braking. The strength of the ramp is ours.
    Source: phase 0 of the five-phase algorithm, Hoang et al. 2014, Fig. 5.
    """

    ramp: Any = parameter("dPb/dt R w in phase 0, bar m/s^2", default=6000.0, low=0.0, open_low=True)

    def asked(self, rate, phase, signals: Signals):
        """The rate that is asked for [bar/s]: the ramp's in phase 0, then the controller's."""
        return jnp.where(phase == 0, per_rim(self.ramp, signals), rate)

    def initial_state(self, speed) -> None:
        """There is no pedal."""

    def pressed(self, speed) -> None:
        """There is none."""
