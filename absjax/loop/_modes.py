"""The mode of a closed loop: the controller's phase, the pressure's limits, the wheel, the foot, in one integer.

Bits from the lowest: the phase, as many as it takes; two for the pressure, for the wheel, and for the foot.
The number of a phase alone is that phase with the pressure on the pedal, the wheel turning and the foot off: how a
manoeuvre begins. Modes below zero are ends.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

ON_PEDAL, FREE, AT_ZERO = range(3)
"""What the pressure does: follow the pedal, follow the command, rest at zero."""


class Mode(NamedTuple):
    """The parts of a mode; int arrays."""

    phase: jax.Array
    pressure: jax.Array | int = ON_PEDAL
    wheel: jax.Array | int = 0
    """TURNING, SLIDING or LOCKED of `absjax.loop.wheel_lock`"""
    foot: jax.Array | int = 0

    def encoded(self, phases: int):
        """The integer; of a phase below zero, which is an end, that phase."""
        bits = (phases - 1).bit_length()
        upper = self.pressure + 4 * self.wheel + 16 * self.foot
        return jnp.where(jnp.asarray(self.phase) < 0, self.phase, self.phase + (upper << bits))


def decoded(mode, phases: int) -> Mode:
    """The parts of an integer."""
    bits = (phases - 1).bit_length()
    upper = mode >> bits
    return Mode(mode & ((1 << bits) - 1), upper & 3, (upper >> 2) & 3, upper >> 4)
