"""What the automata of controllers share."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.signals import Signals

OPEN_VALVE = 1e4
"""Rate asked for by a controller that leaves the brake to the driver, bar/s: pedal or actuator set the pace."""
SLOWEST_RIM = 0.5
"""Speed of the rim below which rates in bar m/s^2 are divided by this one, m/s: a locked wheel divides by nothing."""
TUNED: dict[str, Any] = {"low": 0.0, "open_low": True, "trainable": True}
"""Of a positive parameter that may be tuned."""


class Entered(NamedTuple):
    """What is kept of the last switching; scalars per lane."""

    time: Any
    """s"""


def per_rim(strength, signals: Signals):
    """dPb/dt [bar/s] of a strength u [bar m/s^2]: u / (R w)."""
    return strength / jnp.maximum(signals.radius * signals.wheel_speed, SLOWEST_RIM)


def onset_threshold(least, growth, signals: Signals):
    """Deceleration that ends driver braking [m/s^2]: least + growth R w."""
    return least + growth * signals.radius * signals.wheel_speed


def while_pressed(guard, signals: Signals):
    """A guard that control begins with: it fires only while the driver presses the pedal."""
    return jnp.where(signals.pedal > 0.5, guard, -1.0)
