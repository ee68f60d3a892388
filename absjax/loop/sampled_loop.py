"""A closed loop whose controller sits in an electronic control unit with a clock.

Every so many steps the unit tests the controller's guards on the measured signals, and holds the command in between.
The observer advances from sample to sample. Lock, the limits of the pressure and the stop stay located.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import first_open, tree_where
from absjax.contracts import require_contract
from absjax.loop.closed_loop import ClosedLoop, LoopState
from absjax.observers.base import Sample
from absjax.observers.run import advance
from absjax.parameters import model, part
from absjax.sensors.base import Sensor
from absjax.signals import Signals


class SampledState(NamedTuple):
    """State of a sampled loop."""

    loop: LoopState
    rates: tuple[jax.Array, ...]
    """commanded rates on their way, newest first; the last one acts [bar/s]"""
    sampled: tuple[jax.Array, Sample] | None
    """time and values of the observer's last sample; None without an observer"""
    sensor: Any
    """state of the sensor; None without one"""
    clock: Any = None
    """`absjax.loop.ticking_loop.Clock` of a ticking loop; None without"""


def loop_state(state: Any) -> Any:
    """The state of the loop within that of a sampled or delayed one; that of a located one is its own."""
    return getattr(state, "loop", state)


def loop_time(time, state: Any):
    """The time of a state [s]; that of a ticking loop has moved with its clock, in its derivative."""
    clock = getattr(state, "clock", None)
    return time if clock is None else time + clock.shift


@model
class SampledLoop:
    """The same loop with the controller in an electronic control unit.

    Every `tick_every` grid steps the unit tests the guards on the measured signals, makes at most one
    switching, and holds the rate it commands until the next tick. `delay` ticks pass before a command
    acts. The observer
    advances from one measured sample to the next, in `substeps` Runge-Kutta steps.
    """

    loop: ClosedLoop = part("the loop")
    sensor: Sensor | None = part("what is measured instead of the truth; None measures without error", default=None)
    tick_every: int = 1
    delay: int = 0
    substeps: int = 1

    def __post_init__(self):
        if self.sensor is not None:
            require_contract(self.sensor, Sensor)
        for name, least in (("tick_every", 1), ("delay", 0), ("substeps", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"SampledLoop.{name} = {getattr(self, name)} must be >= {least}")

    def require_step(self, step: float) -> None:
        """Check the grid step [s] of a rollout.

        Raises:
            ValueError: if the loop would not tick as often as its sensor expects.
        """
        expected = None if self.sensor is None else self.sensor.period
        period = step * self.tick_every
        if expected is not None and abs(period - expected) > 1e-6 * expected:
            raise ValueError(f"a tick every {period:g} s; the sensor's period is {expected:g} s")

    def initial_state(self, speed) -> SampledState:
        """State of free rolling at `speed` [m/s], the first command given at once."""
        state, zero = self.loop.initial_state(speed), 0.0 * speed
        signals, sensor = self.loop.measured(zero, state, 0), None
        if self.sensor is not None:
            signals, sensor = self.sensor.begin(signals)
        rate = self.loop.command(self.loop.with_estimate(signals, state), state, jnp.int32(0))
        sampled = None if self.loop.observer is None else (zero, Sample.of(signals))
        return SampledState(state, (rate,) * (self.delay + 1), sampled, sensor)

    def importance(self, time, state: SampledState, mode):
        """That of the loop."""
        return self.loop.importance(time, state.loop, mode)

    def scales(self, state: SampledState) -> SampledState:
        """Those of the loop."""
        return jax.tree.map(lambda leaf: 0.0 * leaf, state)._replace(loop=self.loop.scales(state.loop))

    def flow(self, time, state: SampledState, mode) -> SampledState:
        """d(state)/dt under the rate that acts."""
        held = jax.tree.map(lambda _: None, state._replace(sensor=None))
        if self.sensor is not None:
            held = held._replace(sensor=self.sensor.flow(state.sensor, self.loop.measured(time, state.loop, mode)))
        return held._replace(loop=self.loop.driven(time, state.loop, mode, state.rates[-1]))

    def guards(self, time, state: SampledState, mode):
        """The limits."""
        return self.loop.limits(time, state.loop, mode, state.rates[-1])

    def jump(self, time, state: SampledState, mode, slot):
        """One of the limits is met."""
        loop, following = self.loop.meet_limit(time, state.loop, mode, slot)
        return state._replace(loop=loop), following

    def _advanced(self, signals, kept, mode):
        """What the controller keeps, at this tick: one that predicts has something that goes on between switchings."""
        advance = getattr(self.loop.controller, "advance", None)
        return kept if advance is None else advance(signals, kept, self.loop.phase(mode))

    def hear(self, time, state: SampledState, mode) -> tuple[Signals, SampledState]:
        """What the controller is told at a tick, and the state with sensor and observer advanced to it."""
        loop, sampled = state.loop, state.sampled
        signals, sensor = self.loop.measured(time, loop, mode), None
        if self.sensor is not None:
            signals, sensor = self.sensor.measure(signals, state.sensor)
        if sampled is not None and self.loop.observer is not None:
            then, before = sampled
            sample = Sample.of(signals)
            observed = advance(self.loop.observer, loop.observer, before, sample, time - then, self.substeps)
            loop, sampled = loop._replace(observer=observed), (time, sample)
        signals = self.loop.with_estimate(signals, loop)
        loop = loop._replace(controller=self._advanced(signals, loop.controller, mode))
        return signals, state._replace(loop=loop, sampled=sampled, sensor=sensor)

    def own_guards(self, signals: Signals, state: SampledState, mode) -> tuple[jax.Array, ...]:
        """The controller's slots on what it is told."""
        return self.loop.controller.guards(signals, state.loop.controller, self.loop.phase(mode))

    def tick(self, time, state: SampledState, mode):
        """One pass of the control unit."""
        return self.act(*self.hear(time, state, mode), mode)

    def act(self, signals: Signals, state: SampledState, mode):
        """State and mode after the controller has been told `signals`: one switching at most, and a command."""
        loop = state.loop
        fires, slot = first_open(self.own_guards(signals, state, mode))
        switched, phase = self.loop.switch(signals, loop, mode, slot)
        loop, mode = tree_where(fires, switched, loop), jnp.where(fires, phase, mode)
        rates = (self.loop.command(signals, loop, mode),) + state.rates[:-1]
        return state._replace(loop=loop, rates=rates), mode
