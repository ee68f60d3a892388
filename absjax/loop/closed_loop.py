"""Plant, driver, brake, observer and controller composed into one hybrid system for the rollout engine.

`ClosedLoop` locates every switching inside the step; `absjax.loop.sampled_loop` has the same under the clock of a
control unit.
Besides the controller's, three things switch: the pressure comes to rest on the pedal's or at zero, and leaves
(`absjax.loop.driver`); the foot moves; and the wheel locks and comes free:

    turning -> locked   where w falls to 0
    locked -> turning   where gamma_b Pb falls to what the tyre gives at slip -1, R |Fx(-1)|

While it is locked w = 0 and the tyre slides. All of it is located, and differentiated through.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import tree_where
from absjax.controllers.base import Controller
from absjax.controllers.phases import per_rim
from absjax.loop._modes import AT_ZERO, FREE, ON_PEDAL, Mode, decoded
from absjax.loop.driver import HELD, NEVER, OFF, PRESSING, Driver, FreeRamp, Pedal
from absjax.loop.memory import Locks, Memory
from absjax.observers.base import Observer
from absjax.parameters import model, parameter, part
from absjax.plant.base import Plant
from absjax.plant.brake import Brake, BrakeState
from absjax.results import FINISHED
from absjax.signals import Signals

SPIN_UP = 1e-6
"""Speed a wheel comes free with, rad/s: at 0 it would count as locked again."""
LEAVING_RATE = 1.0
"""Rate, bar/s, that has to be asked for before the pressure leaves a limit: at 0 rounding would send it back."""


class LoopState(NamedTuple):
    """State of a closed loop."""

    plant: Any
    brake: BrakeState
    pedal: Pedal | None
    """None without a driver"""
    observer: Any
    """None without one"""
    controller: Any
    """what the controller keeps"""
    memory: Memory


@model
class ClosedLoop:
    """A braked plant under an anti-lock controller, switchings located.

    Mode: see `mode` and `phase`; `FINISHED` after the vehicle has fallen to `stop_speed`, `UNDEFINED` if the controller
    has come to where its law is not defined. A rollout from mode 0 begins with the pedal untouched.
    """

    plant: Plant = part("what is braked")
    brake: Brake = part("the actuator")
    controller: Controller = part("the controller")
    stop_speed: jax.Array | float | None = parameter(
        "vehicle speed that ends the manoeuvre, m/s; None: it never ends", default=None, low=0.0, open_low=True
    )
    observer: Observer | None = part("estimates XBS for the controller; None tells it the true one", default=None)
    driver: Driver | FreeRamp = part("who presses the pedal", default=Driver())

    def at(self, speed) -> LoopState:
        """State of free rolling at `speed` [m/s] with the brake released."""
        pedal = self.driver.at(speed) if self.driver.limits else None
        return self._begin(self.plant.at(speed), speed, 0.0 * speed, pedal, 0)

    def braking(self, speed, slip, offset) -> LoopState:
        """State of braking at a slip lambda < 0 and an acceleration offset x2 [m/s^2], to begin in a mode of `mode`.

        The pressure is what they need, commanded and at the wheel; the pedal is held at its largest.
        """
        plant = self.plant.at(speed)._replace(wheel_speed=(1 + slip) * speed / self.plant.wheel.radius)
        released = self.plant.signals(0.0 * speed, plant, 0.0 * speed).acceleration_offset
        pressure = (released - offset) / self.plant.wheel.pressure_gain
        pedal = self.driver.pressed(speed) if self.driver.limits else None
        return self._begin(plant, speed, pressure, pedal, self.mode(0))

    def _begin(self, plant, speed, pressure, pedal, mode) -> LoopState:
        state = LoopState(plant, self.brake.at(pressure), pedal, None, (), Memory.blank(speed))
        return self.with_controllers(0.0 * speed, state, mode)

    def with_controllers(self, time, state: LoopState, mode) -> LoopState:
        """The state with observer and controller at their start."""
        measured = self.measured(time, state, mode)
        if self.observer is not None:
            state = state._replace(observer=self.observer.at(measured.acceleration_offset))
        return state._replace(controller=self.controller.at(self.told(measured, state)))

    def mode(self, phase):
        """Mode of a phase in the middle of braking: the pressure free, the wheel turning, the pedal held."""
        return Mode(phase, FREE, 0, HELD).encoded(self._phases) if self.driver.limits else phase

    def phase(self, mode):
        """The controller's phase in `mode`; an end is its own."""
        return jnp.where(jnp.asarray(mode) < 0, mode, self._parts(mode).phase)

    def locked(self, mode):
        """Whether the wheel is locked in `mode`."""
        return (jnp.asarray(mode) >= 0) & (self._parts(mode).locked == 1)

    def locks(self, time, state: LoopState, mode) -> Locks:
        """When the wheel was locked until now, one that lasts included."""
        locks = state.memory.locks
        return tree_where(self.locked(mode), locks.ended(time, self.plant.speed_of(time, state.plant)), locks)

    @property
    def _phases(self) -> int:
        return len(self.controller.phases)

    def _parts(self, mode) -> Mode:
        return decoded(jnp.asarray(mode), self._phases)

    def wheel_pressure(self, state: LoopState):
        """Pressure at the wheel [bar].

        Behind an approximant of a delay, or a lag that has not yet followed a lifted pedal, it is cut to between 0 and
        the pedal's: valves let the fluid back.
        """
        pressure = self.brake.pressure(state.brake)
        if not self.driver.limits or (self.brake.delay is None and (self.brake.lag is None or not self.driver.changes)):
            return pressure
        # At a tie, as at the first touch, the derivative is the pressure's own.
        level = state.pedal.level
        return jnp.where(pressure > level, level, jnp.where(pressure < 0, 0.0, pressure))

    def measured(self, time, state: LoopState, mode) -> Signals:
        """What sensors without error see."""
        signals = self.plant.signals(time, state.plant, self.wheel_pressure(state))
        parts = self._parts(mode)
        standing = -signals.vehicle_acceleration
        offset = jnp.where(parts.locked == 1, standing, signals.acceleration_offset)
        signals = signals._replace(acceleration_offset=offset)
        if not self.driver.limits:
            return signals
        return signals._replace(pedal=jnp.where(parts.foot == OFF, 0.0, jnp.ones_like(offset)))

    def told(self, signals: Signals, state: LoopState) -> Signals:
        """What the controller is told: XBS as the observer estimates it."""
        if self.observer is None:
            return signals
        return signals._replace(stiffness=self.observer.stiffness(state.observer, signals.acceleration_offset))

    def signals(self, time, state: LoopState, mode) -> Signals:
        """What the controller is told, measured without error."""
        return self.told(self.measured(time, state, mode), state)

    def command(self, signals: Signals, state: LoopState, mode):
        """The rate the actuator is asked for and can follow [bar/s]."""
        phase = self._parts(mode).phase
        rate = self.controller.rate(signals, state.controller, phase)
        if not self.driver.limits:
            rate = jnp.where(phase == 0, per_rim(self.driver.ramp, signals), rate)
        return self.brake.limit(rate)

    def driven(self, time, state: LoopState, mode, rate) -> LoopState:
        """d(state)/dt under a given rate [bar/s], the observer held."""
        parts, pedal = self._parts(mode), None
        if self.driver.limits:
            slope = self.driver.slope(parts.foot) + 0.0 * state.pedal.level
            rate = jnp.where(parts.pressure == FREE, rate, jnp.where(parts.pressure == ON_PEDAL, slope, 0.0))
            pedal = Pedal(slope, None)
        plant = self.plant.flow(time, state.plant, self.wheel_pressure(state))
        plant = plant._replace(wheel_speed=jnp.where(parts.locked == 1, 0.0, plant.wheel_speed))
        observer, controller, memory = jax.tree.map(lambda _: None, (state.observer, state.controller, state.memory))
        return LoopState(plant, self.brake.flow(state.brake, rate), pedal, observer, controller, memory)

    @property
    def _ends(self) -> bool:
        """Whether there is a slot for the end of the manoeuvre and the moves of the foot."""
        return self.stop_speed is not None or self.driver.limits

    def limits(self, time, state: LoopState, mode, rate) -> tuple[jax.Array, ...]:
        """Guards that are physical, not the controller's: the wheel locks or comes free; the stop, or a move of the
        foot; the pressure comes to rest on the pedal's or at zero or, asked the other way, leaves."""
        parts = self._parts(mode)
        torque = self.plant.flow(time, state.plant, self.wheel_pressure(state)).wheel_speed
        guards = (jnp.where(parts.locked == 1, torque, -state.plant.wheel_speed),)
        if self._ends:
            end, foot = self._ending(time, state, parts)
            guards += (jnp.maximum(end, foot),)
        if self.driver.limits:
            pressure, ahead = state.brake.commanded, rate - self.driver.slope(parts.foot)
            above = jnp.where(ahead > 0, pressure - state.pedal.level, NEVER)
            below = jnp.where(rate < 0, -pressure, NEVER)
            leaving = jnp.where(parts.pressure == ON_PEDAL, -ahead, rate) - LEAVING_RATE
            guards += (jnp.where(parts.pressure == FREE, jnp.maximum(above, below), leaving),)
        return guards

    def _ending(self, time, state: LoopState, parts: Mode):
        """How far the vehicle is below the stop speed, and the guard of the foot."""
        speed = self.plant.speed_of(time, state.plant)
        end = NEVER + 0.0 * speed if self.stop_speed is None else self.stop_speed - speed
        foot = self.driver.guard(time, state.pedal, parts.foot) if self.driver.limits else NEVER
        return end, foot

    def meet_limit(self, time, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after guard `slot` of `limits` has fired."""
        parts = self._parts(mode)
        cases = [self._lock_or_free(time, state, parts)]
        if self._ends:
            cases.append(self._end_or_move(time, state, parts))
        if self.driver.limits:
            cases.append(self._rest_or_leave(state, parts))
        chosen, following = cases[0]
        for i, (other, parts_then) in enumerate(cases[1:], start=1):
            chosen = tree_where(slot == i, other, chosen)
            following = tree_where(slot == i, parts_then, following)
        return chosen, following.encoded(self._phases)

    def _lock_or_free(self, time, state: LoopState, parts: Mode):
        speed, locks = self.plant.speed_of(time, state.plant), state.memory.locks
        free = parts.locked == 1
        wheel_speed = jnp.where(free, SPIN_UP, 0.0 * state.plant.wheel_speed)
        locks = tree_where(free, locks.ended(time, speed), locks.begun(time, speed))
        state = state._replace(
            plant=state.plant._replace(wheel_speed=wheel_speed), memory=state.memory._replace(locks=locks)
        )
        return state, parts._replace(locked=1 - parts.locked)

    def _end_or_move(self, time, state: LoopState, parts: Mode):
        end, foot = self._ending(time, state, parts)
        ends = end >= foot
        finished = parts._replace(phase=jnp.full_like(parts.phase, FINISHED))
        over = self.locks(time, state, parts.encoded(self._phases))
        last = state._replace(memory=state.memory._replace(locks=over))
        if not self.driver.limits:
            return last, finished
        pedal, does = self.driver.move(time, state.pedal, parts.foot)
        moved, following = state._replace(pedal=pedal), parts._replace(foot=does)
        memory, first = state.memory, (does == PRESSING) & (state.pedal.moves == 0)
        memory = memory._replace(
            pedal_time=jnp.where(first, time, memory.pedal_time),
            pedal_position=jnp.where(first, self.plant.position(time, state.plant), memory.pedal_position),
        )
        moved = moved._replace(memory=memory)
        if self.driver.changes:
            # A lifted pedal is back at zero: control begins anew.
            anew = self.with_controllers(time, moved._replace(brake=moved.brake._replace(commanded=pedal.level)), 0)
            released = (does == OFF) & (parts.foot != OFF)
            moved = tree_where(released, anew, moved)
            begins = following._replace(phase=0 * parts.phase, pressure=0 * parts.phase + ON_PEDAL)
            following = tree_where(released, begins, following)
        return tree_where(ends, last, moved), tree_where(ends, finished, following)

    def _rest_or_leave(self, state: LoopState, parts: Mode):
        free = parts.pressure == FREE
        pressure, level = state.brake.commanded, state.pedal.level
        full = level - pressure < pressure
        rest = jnp.where(full, level, 0.0)
        brake = state.brake._replace(commanded=jnp.where(free, rest, pressure))
        rests = jnp.where(full, ON_PEDAL, AT_ZERO)
        return state._replace(brake=brake), parts._replace(pressure=jnp.where(free, rests, FREE))

    def switch(self, signals: Signals, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after the controller's guard `slot` has fired on `signals`."""
        time, parts = signals.time, self._parts(mode)
        controller, following = self.controller.switch(signals, state.controller, parts.phase, slot)
        memory = state.memory
        first = memory.onset_time == 0
        phase = self.controller.cycle_phase
        cycles = jnp.zeros((), bool) if phase is None else following == phase
        memory = memory._replace(
            onset_time=jnp.where(first, time, memory.onset_time),
            onset_speed=jnp.where(first, self.plant.speed_of(time, state.plant), memory.onset_speed),
            onset_position=jnp.where(first, self.plant.position(time, state.plant), memory.onset_position),
            cycles=memory.cycles + cycles,
            cycle_time=jnp.where(cycles, time, memory.cycle_time),
            longest_cycle=jnp.where(
                cycles & ~first, jnp.maximum(memory.longest_cycle, time - memory.cycle_time), memory.longest_cycle
            ),
        )
        state = state._replace(controller=controller, memory=memory)
        pressure = FREE if self.driver.limits else ON_PEDAL
        return state, parts._replace(phase=following, pressure=pressure).encoded(self._phases)

    def flow(self, time, state: LoopState, mode) -> LoopState:
        """d(state)/dt."""
        signals = self.signals(time, state, mode)
        slope = self.driven(time, state, mode, self.command(signals, state, mode))
        if self.observer is None:
            return slope
        held = (slope.brake, Pedal(slope.pedal.level, 0.0 * slope.pedal.level) if self.driver.limits else None)
        _, pressure_rate = jax.jvp(
            lambda brake, pedal: self.wheel_pressure(state._replace(brake=brake, pedal=pedal)),
            (state.brake, state.pedal),
            held,
        )
        observer = self.observer.flow(state.observer, signals.acceleration_offset, signals.vehicle_speed, pressure_rate)
        return slope._replace(observer=observer)

    def guards(self, time, state: LoopState, mode):
        """The controller's slots, then the limits."""
        signals = self.signals(time, state, mode)
        own = self.controller.guards(signals, state.controller, self._parts(mode).phase)
        return own + self.limits(time, state, mode, self.command(signals, state, mode))

    def jump(self, time, state: LoopState, mode, slot):
        """The controller switches, or one of the limits is met."""
        slots = self.controller.slots
        switched, phase = self.switch(self.signals(time, state, mode), state, mode, slot)
        limited, other = self.meet_limit(time, state, mode, slot - slots)
        own = slot < slots
        return tree_where(own, switched, limited), jnp.where(own, phase, other)
