"""Plant, brake and controller composed into one hybrid system for the rollout engine.

The same description runs under two semantics: `ClosedLoop` locates every switching inside the step;
`SampledLoop` tests the controller's guards every so many steps on the measured signals and holds the
command in between, as an electronic control unit does.
"""

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.actuator import Brake, BrakeState
from absjax.hybrid import FINISHED
from absjax.parameters import model, parameter, part
from absjax.vehicle import Plant, Signals

LOCKED = -3
"""Mode of a lane whose wheel has locked."""
LOCK_RATIO = 0.02
"""A wheel whose rim is slower than this share of the vehicle has locked."""


class Controller(Protocol):
    """An anti-lock controller: an automaton on signals that commands a pressure rate."""

    phases: tuple[str, ...]
    slots: int
    cycle_phase: int

    def rate(self, signals: Signals, mode) -> jax.Array:
        """Commanded dPb/dt [bar/s]."""
        ...

    def guards(self, signals: Signals, mode) -> tuple[jax.Array, ...]:
        """One value per slot; a slot fires when its value rises through zero."""
        ...

    def next_mode(self, mode, slot) -> jax.Array:
        """Phase after the guard of `slot` has fired."""
        ...


class Memory(NamedTuple):
    """What a manoeuvre remembers of its course; scalars per lane."""

    onset_time: jax.Array
    """when the controller first switched, s"""
    onset_speed: jax.Array
    """vehicle speed then, m/s"""
    onset_position: jax.Array
    """distance travelled until then, m"""
    cycles: jax.Array
    """times the controller has entered its cycle phase"""
    cycle_time: jax.Array
    """when it last did, s"""
    longest_cycle: jax.Array
    """longest time between two such entries, s"""


class LoopState(NamedTuple):
    """State of a closed loop."""

    plant: Any
    brake: BrakeState
    memory: Memory


@model
class ClosedLoop:
    """A braked plant under an anti-lock controller, switchings located.

    Mode: the controller's phase, plus the number of phases while the pressure rests on one of its
    limits; `FINISHED` after the vehicle has fallen to `stop_speed`, `LOCKED` if the wheel has locked
    before.
    """

    plant: Plant = part("what is braked")
    brake: Brake = part("the actuator")
    controller: Controller = part("the controller")
    stop_speed: jax.Array | float | None = parameter(
        "vehicle speed that ends the manoeuvre, m/s; None: it never ends, nor is lock looked for",
        default=None,
        low=0.0,
        open_low=True,
    )

    def at(self, speed) -> LoopState:
        """State of free rolling at `speed` [m/s] with the brake released."""
        zero = 0.0 * speed
        return LoopState(self.plant.at(speed), self.brake.at(zero), Memory(zero, speed, zero, zero, zero, zero))

    def phase(self, mode):
        """The controller's phase in `mode`."""
        phases = len(self.controller.phases)
        return jnp.where(mode >= phases, mode - phases, mode)

    def _pressed(self, mode):
        return mode < len(self.controller.phases)

    def signals(self, time, state: LoopState) -> Signals:
        """What the controller is told."""
        return self.plant.signals(time, state.plant, self.brake.pressure(state.brake))

    def command(self, signals: Signals, mode):
        """The rate the actuator is asked for and can follow [bar/s]."""
        return self.brake.limit(self.controller.rate(signals, self.phase(mode)))

    def driven(self, time, state: LoopState, mode, rate) -> LoopState:
        """d(state)/dt under a given rate [bar/s]."""
        if self.brake.driver_pressure is not None:
            rate = jnp.where(self._pressed(mode), rate, 0.0)
        plant = self.plant.flow(time, state.plant, self.brake.pressure(state.brake))
        return LoopState(plant, self.brake.flow(state.brake, rate), Memory(*(None,) * len(Memory._fields)))

    def limits(self, time, state: LoopState, mode, rate) -> tuple[jax.Array, ...]:
        """Guards that are physical, not the controller's: the end (stop or lock), and the limits of the
        pressure."""
        guards = ()
        if self.stop_speed is not None:
            speed = self.plant.speed_of(time, state.plant)
            rim = self.plant.wheel.radius * state.plant.wheel_speed
            guards += (jnp.maximum(self.stop_speed - speed, LOCK_RATIO * speed - rim),)
        if self.brake.driver_pressure is not None:
            pressure = state.brake.commanded
            excess = jnp.where(rate < 0, -pressure, pressure - self.brake.driver_pressure)
            guards += (jnp.where(self._pressed(mode) & (rate != 0), excess, -1.0),)
        return guards

    def meet_limit(self, time, state: LoopState, mode, slot):
        """Mode after guard `slot` of `limits` has fired."""
        rests = mode + len(self.controller.phases)
        if self.stop_speed is None:
            return rests
        speed = self.plant.speed_of(time, state.plant)
        rim = self.plant.wheel.radius * state.plant.wheel_speed
        locked = LOCK_RATIO * speed - rim > self.stop_speed - speed
        return jnp.where(slot == 0, jnp.where(locked, LOCKED, FINISHED), rests)

    def switch(self, time, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after the controller's guard `slot` has fired."""
        phase = self.phase(mode)
        following = self.controller.next_mode(phase, slot)
        memory = state.memory
        first = memory.onset_time == 0
        cycles = following == self.controller.cycle_phase
        memory = Memory(
            jnp.where(first, time, memory.onset_time),
            jnp.where(first, self.plant.speed_of(time, state.plant), memory.onset_speed),
            jnp.where(first, self.plant.position(time, state.plant), memory.onset_position),
            memory.cycles + cycles,
            jnp.where(cycles, time, memory.cycle_time),
            jnp.where(
                cycles & ~first, jnp.maximum(memory.longest_cycle, time - memory.cycle_time), memory.longest_cycle
            ),
        )
        return state._replace(memory=memory), following

    def flow(self, time, state: LoopState, mode) -> LoopState:
        """d(state)/dt."""
        return self.driven(time, state, mode, self.command(self.signals(time, state), mode))

    def guards(self, time, state: LoopState, mode):
        """The controller's slots, then the limits."""
        signals = self.signals(time, state)
        return self.controller.guards(signals, self.phase(mode)) + self.limits(
            time, state, mode, self.command(signals, mode)
        )

    def jump(self, time, state: LoopState, mode, slot):
        """The controller switches, the manoeuvre ends, or the pressure comes to rest on a limit."""
        slots = self.controller.slots
        switched, phase = self.switch(time, state, mode, slot)
        own = slot < slots
        return tree_where(own, switched, state), jnp.where(own, phase, self.meet_limit(time, state, mode, slot - slots))


class SampledState(NamedTuple):
    """State of a sampled loop."""

    loop: LoopState
    rates: tuple[jax.Array, ...]
    """commanded rates on their way, newest first; the last one acts [bar/s]"""


@model
class SampledLoop:
    """The same loop with the controller in an electronic control unit.

    Every `tick_every` grid steps the unit tests the guards on the measured signals, makes at most one
    switching, and holds the rate it commands until the next tick. `delay` ticks pass before a command
    acts. The stop and the limits of the pressure stay located events of the plant.
    """

    loop: ClosedLoop = part("the loop")
    sensor: Any = part("`sensor.measure(time, signals)`; None measures without error", default=None)
    tick_every: int = 1
    delay: int = 0

    def __post_init__(self):
        if self.tick_every < 1 or self.delay < 0:
            raise ValueError(f"tick_every = {self.tick_every} must be >= 1 and delay = {self.delay} >= 0")

    def at(self, speed) -> SampledState:
        """State of free rolling at `speed` [m/s], the first command given at once."""
        state = self.loop.at(speed)
        zero = 0.0 * speed
        rate = self.loop.command(self._measured(zero, state), jnp.int32(0))
        return SampledState(state, (rate,) + (rate,) * self.delay)

    def _measured(self, time, state: LoopState) -> Signals:
        signals = self.loop.signals(time, state)
        return signals if self.sensor is None else self.sensor.measure(time, signals)

    def flow(self, time, state: SampledState, mode) -> SampledState:
        """d(state)/dt under the rate that acts."""
        driven = self.loop.driven(time, state.loop, mode, state.rates[-1])
        return SampledState(driven, (None,) * len(state.rates))

    def guards(self, time, state: SampledState, mode):
        """The limits."""
        return self.loop.limits(time, state.loop, mode, state.rates[-1])

    def jump(self, time, state: SampledState, mode, slot):
        """The manoeuvre ends, or the pressure comes to rest on a limit."""
        return state, self.loop.meet_limit(time, state.loop, mode, slot)

    def tick(self, time, state: SampledState, mode):
        """One pass of the control unit."""
        signals = self._measured(time, state.loop)
        guards = self.loop.controller.guards(signals, self.loop.phase(mode))
        fires, slot = jnp.zeros((), bool), jnp.zeros((), jnp.int32)
        for i, guard in enumerate(guards):
            slot = jnp.where((guard >= 0) & ~fires, i, slot)
            fires = fires | (guard >= 0)
        switched, phase = self.loop.switch(time, state.loop, mode, slot)
        loop, mode = tree_where(fires, switched, state.loop), jnp.where(fires, phase, mode)
        rates = (self.loop.command(signals, mode),) + state.rates[:-1]
        return SampledState(loop, rates), mode
