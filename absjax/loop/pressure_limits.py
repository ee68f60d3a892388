"""The pressure between zero and the pedal's: where it comes to rest on a limit, and where it leaves.

    0 <= Pb <= p(t), what the foot has reached (`absjax.loop.driver`)

What the pressure does is part of the mode: it follows the pedal, follows the command, or rests at zero.
"""

import jax.numpy as jnp

from absjax.loop._modes import AT_ZERO, FREE, ON_PEDAL, Mode
from absjax.loop.driver import NEVER, OFF, Driver, Pedal
from absjax.plant.base import Actuator

LEAVING_RATE = 1.0
"""Rate, bar/s, that has to be asked for before the pressure leaves a limit: at 0 rounding would send it back."""

AT_LIMIT = 1e-3
"""bar; a pressure nearer to a limit than this is at it, but for rounding."""


def granted(parts: Mode, rate, slope):
    """The rate [bar/s] of the commanded pressure where `rate` is asked for and the pedal moves with `slope`."""
    return jnp.where(parts.pressure == FREE, rate, jnp.where(parts.pressure == ON_PEDAL, slope, 0.0))


def _beyond(excess, outwards):
    """How far the pressure is beyond a limit [bar]. One that has left it inwards stands at it, but is not beyond.

    Elsewhere this does not depend on where the command goes, and is smooth: a pressure that touches a limit and turns
    back within a step is seen by its course.
    """
    return jnp.where(outwards | (jnp.abs(excess) > AT_LIMIT), excess, -AT_LIMIT)


def guard(driver: Driver, brake, pedal: Pedal, parts: Mode, rate):
    """Rises through zero where the pressure comes to rest on a limit or, asked the other way, leaves."""
    pressure, ahead = brake.commanded, rate - driver.slope(parts.foot)
    above, below = _beyond(pressure - pedal.level, ahead > 0), _beyond(-pressure, rate < 0)
    leaving = jnp.where(parts.pressure == ON_PEDAL, -ahead, rate) - LEAVING_RATE
    # Under a foot that is off both limits are zero, and a command still held from before has nowhere to go.
    leaving = jnp.where(parts.foot == OFF, NEVER, leaving)
    return jnp.where(parts.pressure == FREE, jnp.maximum(above, below), leaving)


def met(brake, pedal: Pedal, parts: Mode):
    """State of the brake and mode after it has fired."""
    free = parts.pressure == FREE
    pressure, level = brake.commanded, pedal.level
    full = level - pressure < pressure
    rest = jnp.where(full, level, 0.0)
    brake = brake._replace(commanded=jnp.where(free, rest, pressure))
    rests = jnp.where(full, ON_PEDAL, AT_ZERO)
    return brake, parts._replace(pressure=jnp.where(free, rests, FREE))


def at_the_wheel(driver: Driver, brake: Actuator, state, pedal: Pedal):
    """Pressure at the wheel [bar].

    Behind an approximant of a delay, or a lag that has not yet followed a lifted pedal, it is cut to between 0 and
    the pedal's: valves let the fluid back.
    """
    pressure = brake.pressure(state)
    if not brake.overshoots and not (brake.lags and driver.changes):
        return pressure
    # At a tie, as at the first touch, the derivative is the pressure's own.
    return jnp.where(pressure > pedal.level, pedal.level, jnp.where(pressure < 0, 0.0, pressure))
