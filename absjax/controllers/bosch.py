"""The textbook anti-lock logic: eight phases on wheel acceleration and slip.

| phase | number in the source | dPb/dt | leaves when |
|---|---|---|---|
| 0 | 1 initial apply | the driver's | acc <= -a -> 1 |
| 1 | 2 hold | 0 | R w <= (1 - lambda1) vRef -> 2; false alarm: acc >= -share a -> 0 |
| 2 | 3, and 8 in later cycles: release | -u_release / (R w) | acc >= -share a -> 3 |
| 3 | 4 hold, the wheel recovers | 0 | acc >= +a -> 5; acc <= -a -> 2; after the longest hold -> 6 |
| 4 | 5 apply | +u_apply / (R w) | acc <= +a + share (A - a) -> 5 |
| 5 | 4 and 6 hold, the wheel accelerates | 0 | acc <= share +a -> 6; acc >= +A -> 4 |
| 6 | 7 stepwise apply, pulse | +u_step / (R w) | acc <= -a -> 2; after the pulse -> 7 |
| 7 | 7 stepwise apply, pause | 0 | acc <= -a -> 2; after the pause -> 6 |

acc = R w' is the acceleration of the rim. The reference speed vRef falls with a given gradient, and is raised to
the rim's speed at a switching where it is below. Thresholds are left with a hysteresis, `share`, because no guard
may be open where its phase begins. The longest hold is ours: without it a wheel that never reaches +a, as on ice,
would stay released.
Source: Aguado-Rojas 2019, section 2.2.3; Hoang 2014 (thesis), section 1.3.
"""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.base import Controller
from absjax.controllers.phases import OPEN_VALVE, TUNED, per_rim, while_pressed
from absjax.parameters import model, parameter
from absjax.signals import Signals


class Reference(NamedTuple):
    """The last switching; scalars per lane."""

    time: jax.Array
    """s"""
    speed: jax.Array
    """reference speed then, m/s"""


@model
class BoschLogic(Controller):
    """Thresholds, rates and times of the eight phases.

    Raises:
        ValueError: at construction, unless plus_A is 2 m/s^2 above plus_a at least.
    """

    title: ClassVar[str] = "eight-phase"
    grid_step: ClassVar[float] = 2e-3
    phases: ClassVar[tuple[str, ...]] = (
        "initial apply",
        "hold",
        "release",
        "hold, recovering",
        "apply",
        "hold, accelerating",
        "stepwise apply, pulse",
        "stepwise apply, pause",
    )
    slots: ClassVar[int] = 3
    cycle_phase: ClassVar[int | None] = 2
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("minus_a", "plus_a", "plus_A")
    """the fields that noise of the measured acceleration keeps from being small"""
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("plus_a", "plus_A", 2.0),)
    """(lower, higher, by how much at least)"""

    minus_a: Any = parameter("a of -a, deceleration of the rim, m/s^2", default=30.0, **TUNED)
    plus_a: Any = parameter("+a, acceleration that ends the second hold, m/s^2", default=10.0, **TUNED)
    plus_A: Any = parameter("+A, acceleration that asks for more pressure, m/s^2", default=40.0, **TUNED)
    lambda1: Any = parameter("lambda1, slip on the reference speed", default=0.08, high=1.0, **TUNED)
    gradient: Any = parameter("at which the reference speed falls, m/s^2", default=8.0, **TUNED)
    release: Any = parameter("u_release, bar m/s^2", default=8000.0, **TUNED)
    apply: Any = parameter("u_apply, bar m/s^2", default=5000.0, **TUNED)
    step: Any = parameter("u_step, during a pulse, bar m/s^2", default=5000.0, **TUNED)
    pulse: Any = parameter("length of a pulse, s", default=0.01, **TUNED)
    pause: Any = parameter("length of a pause, s", default=0.02, **TUNED)
    longest_hold: Any = parameter("longest hold after the release, s", default=0.15, **TUNED)
    share: Any = parameter("of a threshold at which it is left again", default=0.9, low=0.0, high=0.999, open_low=True)

    def initial_state(self, signals: Signals) -> Reference:
        """The reference is the rim."""
        return Reference(signals.time, signals.radius * signals.wheel_speed)

    def reference_speed(self, signals: Signals, state: Reference):
        """vRef [m/s]."""
        return state.speed - self.gradient * (signals.time - state.time)

    def rate(self, signals: Signals, state: Reference, phase):
        """Commanded dPb/dt [bar/s]."""
        strength = pick(phase, (0.0, 0.0, -self.release, 0.0, self.apply, 0.0, self.step, 0.0))
        return jnp.where(phase == 0, OPEN_VALVE, per_rim(strength, signals))

    def guards(self, signals: Signals, state: Reference, phase):
        """One slot for each way on, in the order of the table."""
        acc = signals.acceleration_offset + signals.vehicle_acceleration
        spent = signals.time - state.time
        slower = (1 - self.lambda1) * self.reference_speed(signals, state) - signals.radius * signals.wheel_speed
        falls, recovers = -self.minus_a - acc, acc + self.share * self.minus_a
        rises, sinks = acc - self.plus_A, self.plus_a + self.share * (self.plus_A - self.plus_a) - acc
        first = (
            while_pressed(falls, signals),
            slower,
            recovers,
            acc - self.plus_a,
            sinks,
            self.share * self.plus_a - acc,
            falls,
            falls,
        )
        second = (-1.0, recovers, -1.0, falls, -1.0, rises, spent - self.pulse, spent - self.pause)
        third = jnp.where(phase == 3, spent - self.longest_hold, -1.0)
        return pick(phase, first), pick(phase, second), third

    def switch(self, signals: Signals, state: Reference, phase, slot):
        """The phase that follows, and the reference speed carried on."""
        first, second = pick(phase, (1, 2, 3, 5, 5, 6, 2, 2)), pick(phase, (0, 0, 2, 2, 4, 4, 7, 6))
        following = jnp.where(slot == 0, first, jnp.where(slot == 1, second, 6))
        rim = signals.radius * signals.wheel_speed
        return Reference(signals.time, jnp.maximum(rim, self.reference_speed(signals, state))), following
