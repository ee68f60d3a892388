"""Continuous control of wheel slip that lets its wheel roll now and then, for those who estimate the speed.

| phase | dPb/dt | leaves when |
|---|---|---|
| 0 driver braking | the driver's | as for `absjax.controllers.slip` -> 1 |
| 1 control | as for `absjax.controllers.slip` | after rolls_every -> 2 |
| 2 rolls | the fastest release | after roll_time -> 1 |

Wheels held at a slip of an estimate say nothing against it: where that falls behind the speed, as an accelerometer has
it that reads a slope downhill as braking, they follow it down, and slide in the end. One that rolls now and then tells
the speed. By default none does within a stop: which wheels do, those behind say, is chosen with rolls_every.
Source: ours, after what control units do to refresh their reference speed (Aguado-Rojas 2019, section 2.2.3).
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.controllers.phases import OPEN_VALVE, TUNED, Entered
from absjax.controllers.slip import SlipControl
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class RollingSlip(SlipControl):
    """Control of wheel slip, and a wheel that is let roll every so often."""

    title: ClassVar[str] = "wheel slip, let roll"
    phases: ClassVar[tuple[str, ...]] = ("driver braking", "control", "rolls")

    rolls_every: Any = parameter("control between two rolls, s", default=60.0, span=(0.2, 60.0), **TUNED)
    roll_time: Any = parameter("of a roll, s", default=0.12, span=(0.05, 0.4), **TUNED)

    def initial_state(self, signals: Signals) -> Entered:
        """Entered here and now."""
        return Entered(signals.time)

    def rate(self, signals: Signals, state, phase):
        """Commanded dPb/dt [bar/s]."""
        return jnp.where(phase == 2, -OPEN_VALVE, super().rate(signals, state, phase))

    def guards(self, signals: Signals, state, phase):
        """The end of a phase: by deceleration or the clock; of driver braking by slip."""
        onward, sinks = super().guards(signals, state, phase)
        lasts = jnp.where(phase == 2, self.roll_time, self.rolls_every)
        return jnp.where(phase == 0, onward, signals.time - state.time - lasts), sinks

    def switch(self, signals: Signals, state, phase, slot):
        """Control after driver braking, then one after the other."""
        return self.initial_state(signals), jnp.where(phase == 1, 2, 1)
