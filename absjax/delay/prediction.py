"""The predictor of the brake's second state, for controllers whose law follows the wheel acceleration offset.

    z1' = -(a/v) z1 z2 - b u(t - h),   z2' = (c z2 + z3) z1 / v,   z3 = c c3,   e1 = z1(t) - z1*(t - h)
    u = -(1/b) [(a/v) z1^P z2^P + z1*' - alpha e1]

    e1^P = e1 - alpha S - beta1 I1,   S' = e1(t) - e1(t - h),   I1' = e1^P(t - h) - e1(t),   z1^P = z1* + e1^P
    sigma' = (z1^P(t) - z1^P(t - h)) / v
    z2^P = e^{c sigma} z2 + (e^{c sigma} - 1) z3 / c - beta2 I2,   I2' = z2^P(t - h) - z2(t)

with z1 = x2 and z2 = XBS, told. sigma, the slip that is to come, has the sign of z1^P: the solution of z2' needs no
branches. All begin anew where a phase does: before it the error counts as zero, what was ahead as constant, and I1 and
I2 rest for h, until there is a prediction of that phase.
The estimate z2^P is kept to the physical range of XBS, as observers are (`absjax.observers.clamped`).
Source: Hoang 2014 (thesis), eq. 7.2 to 7.25; there z2^P has branches for the sign of z1.
"""

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import jax.numpy as jnp

from absjax.delay.ring import Ring
from absjax.parameters import model, parameter
from absjax.signals import Signals

KEPT = 3
"""Signals that are read again: e1, e1^P, z2^P."""


class Prediction(NamedTuple):
    """What a predicting controller keeps; scalars per lane but for the ring."""

    time: Any
    """of the entry of the phase, s"""
    offset: Any
    """x2 there, m/s^2"""
    integrals: tuple[Any, Any, Any, Any]
    """S, I1, sigma, I2"""
    then: tuple[Any, Any, Any]
    """the signals of h ago; zero where the phase had not begun"""
    defined: Any
    """1 where it had"""
    ring: Ring | None
    """of the last ticks in a control unit; None where switchings are located"""
    rates: tuple[Any, Any, Any, Any]
    """of the integrals at the last tick"""
    tick: Any
    """time of it, s"""


@model
class Predicting:
    """What a predicting controller has beside its thresholds; to be mixed into one that follows x2.

    The controller has a `target(time, state, phase)`, z1* and its rate, `pull(signals)`, alpha, and
    `follows(phase)`.
    """

    delay: Any = parameter("h, as the controller knows it, s", default=0.01, low=0.0, open_low=True)
    beta1: Any = parameter(
        "beta1, of the acceleration, 1/s", default=31.4, low=0.0, open_low=True, trainable=True, span=(1.0, 200.0)
    )
    beta2: Any = parameter(
        "beta2, of XBS, 1/s", default=31.4, low=0.0, open_low=True, trainable=True, span=(1.0, 200.0)
    )
    c2: Any = parameter("c2 of the road, as it is known", default=23.99, low=0.0, open_low=True)
    c3: Any = parameter("c3 of the road, as it is known", default=0.52, low=0.0)
    stiffest: Any = parameter("largest XBS that is predicted", default=35.0, low=0.0, open_low=True)
    trust: Any = parameter(
        "share of the prediction in the law; 0: x2 and XBS as they are", default=1.0, low=0.0, high=1.0
    )
    ticks: int = 0
    """of the delay in a control unit; 0 where switchings are located"""

    if TYPE_CHECKING:
        wheel: ClassVar[Any]

        def target(self, time, state, phase) -> tuple[Any, Any]: ...
        def pull(self, signals: Signals) -> Any: ...
        def follows(self, phase) -> Any: ...

    def in_unit(self, ticks: int) -> Any:
        """The controller for a control unit in which the delay it knows is so many ticks."""
        return dataclasses.replace(self, ticks=ticks)  # pyright: ignore[reportArgumentType]

    def initial_state(self, signals: Signals) -> Prediction:
        """A phase begins here and now."""
        zero = 0.0 * signals.acceleration_offset
        ring = Ring.empty(self.ticks, KEPT, zero) if self.ticks else None
        time, nothing = signals.time + zero, (zero,) * 4
        return Prediction(time, signals.acceleration_offset, nothing, nothing[1:], zero, ring, nothing, time)

    def begun(self, signals: Signals, state: Prediction, phase) -> Prediction:
        """The state in which a phase begins: what is ahead is constant."""
        ahead = self.target(state.time, state, phase)[0] + self._entry_error(state, phase)
        state = state._replace(
            integrals=(*state.integrals[:2], self.delay * ahead / signals.vehicle_speed, state.integrals[3])
        )
        if state.ring is None:
            return state
        rates = self.integral_rates(signals, state, phase)
        return state._replace(ring=state.ring.pushed(jnp.stack(self.kept(signals, state, phase))), rates=rates)

    def _entry_error(self, state: Prediction, phase):
        """e1 where the phase began."""
        return state.offset - self.target(state.time - self.delay, state, phase)[0]

    def _error(self, signals: Signals, state: Prediction, phase):
        """e1."""
        return signals.acceleration_offset - self.target(signals.time - self.delay, state, phase)[0]

    def predicted(self, signals: Signals, state: Prediction, phase) -> tuple[Any, Any]:
        """z1^P and z2^P."""
        S, I1, sigma, I2 = state.integrals
        ahead = self._error(signals, state, phase) - self.pull(signals) * S - self.beta1 * I1
        offset = self.target(signals.time, state, phase)[0] + ahead
        growth = jnp.expm1(self.c2 * sigma)
        stiffness = signals.stiffness + growth * (signals.stiffness + self.c3) - self.beta2 * I2
        return offset, jnp.clip(stiffness, -self.c3, self.stiffest)

    def kept(self, signals: Signals, state: Prediction, phase) -> tuple[Any, Any, Any]:
        """What is read again one delay later."""
        offset, stiffness = self.predicted(signals, state, phase)
        target = self.target(signals.time, state, phase)[0]
        return self._error(signals, state, phase), offset - target, stiffness

    def integral_rates(self, signals: Signals, state: Prediction, phase) -> tuple[Any, Any, Any, Any]:
        """S', I1', sigma', I2'; zero in phases in which nothing is followed."""
        error, stiffness = self._error(signals, state, phase), signals.stiffness
        then_error, then_ahead, then_stiffness = state.then
        offset = self.predicted(signals, state, phase)[0]
        ahead = jnp.where(state.defined > 0, then_ahead, self._entry_error(state, phase))
        before = self.target(signals.time - self.delay, state, phase)[0] + ahead
        rates = (
            error - then_error,
            state.defined * (then_ahead - error),
            (offset - before) / signals.vehicle_speed,
            state.defined * (then_stiffness - stiffness),
        )
        return tuple(jnp.where(self.follows(phase), rate, 0.0) for rate in rates)  # pyright: ignore[reportReturnType]

    def remembering(self, state: Prediction, row, defined) -> Prediction:
        """The state with the signals (3,) of one delay ago; `defined`: 1 where the phase had begun."""
        then = tuple(defined * row[i] for i in range(KEPT))
        return state._replace(then=then, defined=defined)  # pyright: ignore[reportArgumentType]

    def advance(self, signals: Signals, state: Prediction, phase) -> Prediction:
        """The state at a tick, the integrals advanced by the trapezoidal rule."""
        if state.ring is None:
            raise ValueError(f"{type(self).__name__}.ticks = 0: a control unit needs the ticks of its delay")
        half = 0.5 * (signals.time - state.tick)
        now = self.remembering(state, state.ring.rows[-1], state.ring.known[-1])
        rates = state.rates
        for _ in range(2):  # sigma' waits for S and I1 of this tick
            rates = self.integral_rates(signals, now, phase)
            sums = (s + half * (a + b) for s, a, b in zip(state.integrals, rates, state.rates))
            now = now._replace(integrals=tuple(sums))
        ring = state.ring.pushed(jnp.stack(self.kept(signals, now, phase)))
        return now._replace(ring=ring, rates=rates, tick=signals.time + 0.0 * state.tick)

    def following(self, signals: Signals, state: Prediction, phase):
        """The law, dPb/dt [bar/s]."""
        ahead = self.predicted(signals, state, phase)
        here = signals.acceleration_offset, signals.stiffness
        offset, stiffness = (now + self.trust * (then - now) for now, then in zip(here, ahead))
        slope = self.target(signals.time, state, phase)[1]
        error = self._error(signals, state, phase)
        a, b = self.wheel.slip_gain, self.wheel.pressure_gain
        return -(a / signals.vehicle_speed * stiffness * offset + slope - self.pull(signals) * error) / b
