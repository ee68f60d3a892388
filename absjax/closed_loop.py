"""Plant, brake, observer and controller composed into one hybrid system for the rollout engine.

The same description runs under two semantics: `ClosedLoop` locates every switching inside the step;
`SampledLoop` tests the controller's guards every so many steps on the measured signals and holds the
command in between, as an electronic control unit does. An observer is integrated along in the first,
and advances from sample to sample in the second.
"""

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.actuator import Brake, BrakeState
from absjax.hybrid import FINISHED
from absjax.observers.sampled import Observer, Sample, advance
from absjax.parameters import model, parameter, part
from absjax.sensor import Sensor
from absjax.vehicle import Plant, Signals

LOCKED = -3
"""Mode of a lane whose wheel has locked."""
LOCK_RATIO = 0.02
"""A wheel whose rim is slower than this share of the vehicle has locked."""

LEAVING_RATE = 1.0
"""Rate, bar/s, that has to be asked for before the pressure leaves a limit: at 0 rounding would send it back."""


class Controller(Protocol):
    """An anti-lock controller: an automaton on signals that commands a pressure rate.

    `kept` is what it keeps from one switching to the next, a pytree of float scalars; () for nothing.
    `cycle_phase` is the phase whose entry counts a cycle; None for a controller that does not cycle.
    A phase of `absjax.hybrid.UNDEFINED` ends the lane: the law is not defined any more.
    """

    phases: tuple[str, ...]
    slots: int
    cycle_phase: int | None

    def at(self, signals: Signals) -> Any:
        """What it keeps at the start."""
        ...

    def rate(self, signals: Signals, kept: Any, mode) -> jax.Array:
        """Commanded dPb/dt [bar/s]."""
        ...

    def guards(self, signals: Signals, kept: Any, mode) -> tuple[jax.Array, ...]:
        """One value per slot; a slot fires when its value rises through zero."""
        ...

    def switch(self, signals: Signals, kept: Any, mode, slot) -> tuple[Any, jax.Array]:
        """What it keeps, and the phase, after the guard of `slot` has fired."""
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
    observer: Any
    """None without one"""
    controller: Any
    """what the controller keeps"""
    memory: Memory


@model
class ClosedLoop:
    """A braked plant under an anti-lock controller, switchings located.

    Mode: the controller's phase, plus the number of phases while the pressure rests on one of its
    limits; `FINISHED` after the vehicle has fallen to `stop_speed`, `LOCKED` if the wheel has locked
    before, `UNDEFINED` if the controller has come to where its law is not defined.
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
    observer: Observer | None = part("estimates XBS for the controller; None tells it the true one", default=None)

    def at(self, speed) -> LoopState:
        """State of free rolling at `speed` [m/s] with the brake released."""
        return self._begin(self.plant.at(speed), speed, 0.0 * speed)

    def braking(self, speed, slip, offset) -> LoopState:
        """State of braking at a slip lambda < 0 and an acceleration offset x2 [m/s^2].

        The pressure is what they need, commanded and at the wheel, be it outside the limits of the brake.
        """
        plant = self.plant.at(speed)._replace(wheel_speed=(1 + slip) * speed / self.plant.wheel.radius)
        released = self.plant.signals(0.0 * speed, plant, 0.0 * speed).acceleration_offset
        return self._begin(plant, speed, (released - offset) / self.plant.wheel.pressure_gain)

    def _begin(self, plant, speed, pressure) -> LoopState:
        zero = 0.0 * speed
        brake = self.brake.at(pressure)
        signals = self.plant.signals(zero, plant, pressure)
        observer = None if self.observer is None else self.observer.at(signals.acceleration_offset)
        state = LoopState(plant, brake, observer, (), Memory(zero, speed, zero, zero, zero, zero))
        return state._replace(controller=self.controller.at(self.told(signals, state)))

    def phase(self, mode):
        """The controller's phase in `mode`."""
        phases = len(self.controller.phases)
        return jnp.where(mode >= phases, mode - phases, mode)

    def _pressed(self, mode):
        return mode < len(self.controller.phases)

    def measured(self, time, state: LoopState) -> Signals:
        """What sensors without error see."""
        return self.plant.signals(time, state.plant, self.brake.pressure(state.brake))

    def told(self, signals: Signals, state: LoopState) -> Signals:
        """What the controller is told: XBS as the observer estimates it."""
        if self.observer is None:
            return signals
        return signals._replace(stiffness=self.observer.stiffness(state.observer, signals.acceleration_offset))

    def signals(self, time, state: LoopState) -> Signals:
        """What the controller is told, measured without error."""
        return self.told(self.measured(time, state), state)

    def command(self, signals: Signals, state: LoopState, mode):
        """The rate the actuator is asked for and can follow [bar/s]."""
        return self.brake.limit(self.controller.rate(signals, state.controller, self.phase(mode)))

    def driven(self, time, state: LoopState, mode, rate) -> LoopState:
        """d(state)/dt under a given rate [bar/s], the observer held."""
        if self.brake.driver_pressure is not None:
            rate = jnp.where(self._pressed(mode), rate, 0.0)
        plant = self.plant.flow(time, state.plant, self.brake.pressure(state.brake))
        observer, controller, memory = jax.tree.map(lambda _: None, (state.observer, state.controller, state.memory))
        return LoopState(plant, self.brake.flow(state.brake, rate), observer, controller, memory)

    def limits(self, time, state: LoopState, mode, rate) -> tuple[jax.Array, ...]:
        """Guards that are physical, not the controller's: the end (stop or lock), and the pressure coming to
        rest on one of its limits or, asked the other way, leaving it."""
        guards = ()
        if self.stop_speed is not None:
            speed = self.plant.speed_of(time, state.plant)
            rim = self.plant.wheel.radius * state.plant.wheel_speed
            guards += (jnp.maximum(self.stop_speed - speed, LOCK_RATIO * speed - rim),)
        if self.brake.driver_pressure is not None:
            pressure = state.brake.commanded
            excess = jnp.where(rate < 0, -pressure, pressure - self.brake.driver_pressure)
            inward = jnp.where(pressure > 0.5 * self.brake.driver_pressure, -rate, rate)
            guards += (jnp.where(self._pressed(mode), jnp.where(rate != 0, excess, -1.0), inward - LEAVING_RATE),)
        return guards

    def meet_limit(self, time, state: LoopState, mode, slot):
        """Mode after guard `slot` of `limits` has fired."""
        phases = len(self.controller.phases)
        turned = jnp.where(self._pressed(mode), mode + phases, mode - phases)
        if self.stop_speed is None:
            return turned
        speed = self.plant.speed_of(time, state.plant)
        rim = self.plant.wheel.radius * state.plant.wheel_speed
        locked = LOCK_RATIO * speed - rim > self.stop_speed - speed
        return jnp.where(slot == 0, jnp.where(locked, LOCKED, FINISHED), turned)

    def switch(self, signals: Signals, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after the controller's guard `slot` has fired on `signals`."""
        time = signals.time
        controller, following = self.controller.switch(signals, state.controller, self.phase(mode), slot)
        memory = state.memory
        first = memory.onset_time == 0
        phase = self.controller.cycle_phase
        cycles = jnp.zeros((), bool) if phase is None else following == phase
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
        return state._replace(controller=controller, memory=memory), following

    def flow(self, time, state: LoopState, mode) -> LoopState:
        """d(state)/dt."""
        signals = self.signals(time, state)
        slope = self.driven(time, state, mode, self.command(signals, state, mode))
        if self.observer is None:
            return slope
        _, pressure_rate = jax.jvp(self.brake.pressure, (state.brake,), (slope.brake,))
        observer = self.observer.flow(state.observer, signals.acceleration_offset, signals.vehicle_speed, pressure_rate)
        return slope._replace(observer=observer)

    def guards(self, time, state: LoopState, mode):
        """The controller's slots, then the limits."""
        signals = self.signals(time, state)
        own = self.controller.guards(signals, state.controller, self.phase(mode))
        return own + self.limits(time, state, mode, self.command(signals, state, mode))

    def jump(self, time, state: LoopState, mode, slot):
        """The controller switches, the manoeuvre ends, or the pressure comes to rest on a limit or leaves it."""
        slots = self.controller.slots
        switched, phase = self.switch(self.signals(time, state), state, mode, slot)
        own = slot < slots
        return tree_where(own, switched, state), jnp.where(own, phase, self.meet_limit(time, state, mode, slot - slots))


class SampledState(NamedTuple):
    """State of a sampled loop."""

    loop: LoopState
    rates: tuple[jax.Array, ...]
    """commanded rates on their way, newest first; the last one acts [bar/s]"""
    sampled: tuple[jax.Array, Sample] | None
    """time and values of the observer's last sample; None without an observer"""
    sensor: Any
    """state of the sensor; None without one"""


@model
class SampledLoop:
    """The same loop with the controller in an electronic control unit.

    Every `tick_every` grid steps the unit tests the guards on the measured signals, makes at most one
    switching, and holds the rate it commands until the next tick. `delay` ticks pass before a command
    acts. The stop and the limits of the pressure stay located events of the plant. The observer
    advances from one measured sample to the next, in `substeps` Runge-Kutta steps.
    """

    loop: ClosedLoop = part("the loop")
    sensor: Sensor | None = part("what is measured instead of the truth; None measures without error", default=None)
    tick_every: int = 1
    delay: int = 0
    substeps: int = 1

    def __post_init__(self):
        for name, least in (("tick_every", 1), ("delay", 0), ("substeps", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"SampledLoop.{name} = {getattr(self, name)} must be >= {least}")

    def require_step(self, step: float) -> None:
        """Check the grid step [s] of a rollout.

        Raises:
            ValueError: if the loop would not tick as often as its sensor expects.
        """
        expected, period = getattr(self.sensor, "period", None), step * self.tick_every
        if expected is not None and abs(period - expected) > 1e-6 * expected:
            raise ValueError(f"a tick every {period:g} s; the sensor's period is {expected:g} s")

    def at(self, speed) -> SampledState:
        """State of free rolling at `speed` [m/s], the first command given at once."""
        state, zero = self.loop.at(speed), 0.0 * speed
        signals, sensor = self.loop.measured(zero, state), None
        if self.sensor is not None:
            signals, sensor = self.sensor.at(signals)
        rate = self.loop.command(self.loop.told(signals, state), state, jnp.int32(0))
        sampled = None if self.loop.observer is None else (zero, Sample.of(signals))
        return SampledState(state, (rate,) * (self.delay + 1), sampled, sensor)

    def flow(self, time, state: SampledState, mode) -> SampledState:
        """d(state)/dt under the rate that acts."""
        held = jax.tree.map(lambda _: None, state._replace(sensor=None))
        if self.sensor is not None:
            held = held._replace(sensor=self.sensor.flow(state.sensor, self.loop.measured(time, state.loop)))
        return held._replace(loop=self.loop.driven(time, state.loop, mode, state.rates[-1]))

    def guards(self, time, state: SampledState, mode):
        """The limits."""
        return self.loop.limits(time, state.loop, mode, state.rates[-1])

    def jump(self, time, state: SampledState, mode, slot):
        """The manoeuvre ends, or the pressure comes to rest on a limit or leaves it."""
        return state, self.loop.meet_limit(time, state.loop, mode, slot)

    def tick(self, time, state: SampledState, mode):
        """One pass of the control unit."""
        loop, sampled = state.loop, state.sampled
        signals, sensor = self.loop.measured(time, loop), None
        if self.sensor is not None:
            signals, sensor = self.sensor.measure(signals, state.sensor)
        if sampled is not None:
            then, before = sampled
            sample = Sample.of(signals)
            observed = advance(self.loop.observer, loop.observer, before, sample, time - then, self.substeps)
            loop, sampled = loop._replace(observer=observed), (time, sample)
        signals = self.loop.told(signals, loop)
        guards = self.loop.controller.guards(signals, loop.controller, self.loop.phase(mode))
        fires, slot = jnp.zeros((), bool), jnp.zeros((), jnp.int32)
        for i, guard in enumerate(guards):
            slot = jnp.where((guard >= 0) & ~fires, i, slot)
            fires = fires | (guard >= 0)
        switched, phase = self.loop.switch(signals, loop, mode, slot)
        loop, mode = tree_where(fires, switched, loop), jnp.where(fires, phase, mode)
        rates = (self.loop.command(signals, loop, mode),) + state.rates[:-1]
        return SampledState(loop, rates, sampled, sensor), mode
