"""A vehicle, its driver, and a channel of brake, controller and observer for each wheel, as one hybrid system.

The same as `absjax.loop.closed_loop` for several wheels: each channel switches on its own, two may switch in the same
step or in the same instant, all are located and differentiated through. A channel may command two wheels and go by the
worse of them, the one that turns slower (select-low): which one that is, is part of the mode, and its change located.
`absjax.loop.sampled_vehicle` has it under the clock of a control unit.
"""

from typing import Any

import jax
import jax.numpy as jnp

from absjax._numerics import pick, tree_where
from absjax.loop import pressure_limits, wheel_lock
from absjax.loop._modes import FREE, ON_PEDAL, Mode
from absjax.loop._vehicle_modes import VehicleMode
from absjax.loop.braked_vehicle import BrakedVehicle, VehicleLoopState
from absjax.loop.driver import NEVER, OFF, PRESSING
from absjax.loop.memory import Course, Memory, Sliding
from absjax.parameters import model
from absjax.results import FINISHED
from absjax.signals import Signals

SELECTION = 0.02
"""By how much the other wheel has to turn slower before a channel goes by it, rad/s: on one road both turn alike."""


@model
class VehicleLoop(BrakedVehicle):
    """A braked vehicle under anti-lock controllers, switchings located.

    Mode: see `parts`; `FINISHED` after the vehicle has fallen to `stop_speed`, `UNDEFINED` if a controller has come to
    where its law is not defined. A rollout from mode 0 begins with the pedal untouched.

    Raises:
        ValueError: at construction, if a part lacks what its contract asks for, a wheel has no channel or two, or the
            channels have more phases than an integer holds; names what.
    """

    def flow(self, time, state: VehicleLoopState, mode) -> VehicleLoopState:
        """d(state)/dt."""
        parts, slope = self.parts(mode), self.free(time, state)
        channels, told = self.informed(time, state, slope, parts)
        driven = self.driven(state, parts, slope, self.commands(channels, told, state, parts))
        return self.with_observers(channels, told, state, driven)

    def limits(self, time, state: VehicleLoopState, parts: VehicleMode, slope, rates) -> tuple[Any, ...]:
        """Guards that are no controller's: of wheels, pressures, choices of a wheel, and last of the end of the
        manoeuvre and the moves of the foot."""
        speeds = self.vehicle.wheel_speeds_of(state.vehicle)
        turning = self.vehicle.wheel_speeds_of(slope)
        guards = list(map(wheel_lock.guard, parts.wheels, speeds, turning, self._deep(time, state)))
        for own, pressure, rate in zip(state.channels, parts.pressures, rates):
            does = Mode(pressure, pressure, 0, parts.foot)
            guards.append(pressure_limits.guard(self.driver, own.brake, state.pedal, does, rate))
        for wheels, chosen in self._choosing(parts):
            first, second = (speeds[i] for i in wheels)
            guards.append(jnp.where(chosen == 0, first - second, second - first) - SELECTION)
        return (*guards, jnp.maximum(*self._ending(time, state, parts)))

    def _choosing(self, parts: VehicleMode):
        """Wheels and choice of the channels that go by one of two."""
        return [(wheels, chosen) for wheels, chosen in zip(self.wheels_of, parts.chosen) if len(wheels) == 2]

    def _ending(self, time, state: VehicleLoopState, parts: VehicleMode):
        """How far the vehicle is below the stop speed, and the guard of the foot."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        end = NEVER + 0.0 * speed if self.stop_speed is None else self.stop_speed - speed
        return end, self.driver.guard(time, state.pedal, parts.foot)

    def guards(self, time, state: VehicleLoopState, mode):
        """The controllers' slots, channel by channel, then the limits."""
        parts, slope = self.parts(mode), self.free(time, state)
        channels, told = self.informed(time, state, slope, parts)
        own = self.controller_guards(channels, told, state, parts)
        rates = self.commands(channels, told, state, parts)
        return tuple(g for guards in own for g in guards) + self.limits(time, state, parts, slope, rates)

    def jump(self, time, state: VehicleLoopState, mode, slot):
        """A controller switches, or one of the limits is met."""
        parts, slope = self.parts(mode), self.free(time, state)
        channels, told = self.informed(time, state, slope, parts)
        first = 0
        switched = []
        for channel in self.channels:
            switched.append((slot >= first) & (slot < first + channel.controller.slots))
            first += channel.controller.slots
        after, following = self.switch(channels, told, state, parts, switched, self._own_slots(slot))
        limited, other = self.meet_limit(time, state, parts, slot - first)
        own = slot < first
        return tree_where(own, after, limited), jnp.where(own, self.mode(following), self.mode(other))

    def _own_slots(self, slot):
        """For each channel the slot of its own controller."""
        own, first = [], 0
        for channel in self.channels:
            own.append(jnp.clip(slot - first, 0, channel.controller.slots - 1))
            first += channel.controller.slots
        return own

    def switch(self, channels, told: tuple[Signals, ...], state: VehicleLoopState, parts: VehicleMode, fires, slots):
        """State and mode after the guards `slots` of the channels that `fires` names have fired on what is `told`."""
        time = told[0].time
        speed = self.vehicle.speed_of(time, state.vehicle)
        owns, phases, pressures, memories = [], [], [], []
        everything = zip(
            channels, told, state.channels, parts.phases, parts.pressures, state.memory.control, fires, slots
        )
        for channel, signals, own, phase, pressure, memory, fired, slot in everything:
            after, following, cycles = channel.switch(signals, own, phase, slot)
            owns.append(tree_where(fired, after, own))
            phases.append(jnp.where(fired, following, phase))
            pressures.append(jnp.where(fired, FREE, pressure))
            memories.append(tree_where(fired, memory.switched(time, speed, cycles), memory))
        state = state._replace(channels=tuple(owns), memory=state.memory._replace(control=tuple(memories)))
        return state, parts._replace(phases=tuple(phases), pressures=tuple(pressures))

    def meet_limit(self, time, state: VehicleLoopState, parts: VehicleMode, slot):
        """State and mode after guard `slot` of `limits` has fired."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        speeds, slid, wheels_do = list(self.vehicle.wheel_speeds_of(state.vehicle)), [], []
        for i, (does, bound, wheel) in enumerate(zip(parts.wheels, self._deep(time, state), state.memory.wheels)):
            turning, after, follows = wheel_lock.met(does, speeds[i], bound, wheel, time, speed)
            speeds[i] = jnp.where(slot == i, turning, speeds[i])
            slid.append(tree_where(slot == i, after, wheel))
            wheels_do.append(jnp.where(slot == i, follows, does))
        first, owns, pressures = len(speeds), [], []
        for i, (own, pressure) in enumerate(zip(state.channels, parts.pressures)):
            brake, does = pressure_limits.met(own.brake, state.pedal, Mode(pressure, pressure))
            met = slot == first + i
            owns.append(own._replace(brake=tree_where(met, brake, own.brake)))
            pressures.append(jnp.where(met, does.pressure, pressure))
        first, chosen = first + len(owns), list(parts.chosen)
        for i, wheels in enumerate(self.wheels_of):
            if len(wheels) == 2:
                chosen[i] = jnp.where(slot == first, 1 - chosen[i], chosen[i])
                first += 1
        state = state._replace(
            vehicle=self.vehicle.with_wheel_speeds(state.vehicle, tuple(speeds)),
            channels=tuple(owns),
            memory=state.memory._replace(wheels=tuple(slid)),
        )
        parts = parts._replace(pressures=tuple(pressures), chosen=tuple(chosen), wheels=tuple(wheels_do))
        return tree_where(slot == first, self._end_or_move(time, state, parts), (state, parts))

    def _end_or_move(self, time, state: VehicleLoopState, parts: VehicleMode):
        end, foot = self._ending(time, state, parts)
        finished = parts._replace(phases=tuple(jnp.full_like(phase, FINISHED) for phase in parts.phases))
        return tree_where(end >= foot, (state, finished), self._moved(time, state, parts))

    def _moved(self, time, state: VehicleLoopState, parts: VehicleMode):
        """State and mode after the foot has moved, or the pedal has arrived where it rests."""
        pedal, does = self.driver.move(time, state.pedal, parts.foot)
        first = (does == PRESSING) & (state.pedal.moves == 0)
        memory = state.memory.pressed(first, time, self.vehicle.position(time, state.vehicle))
        moved, following = state._replace(pedal=pedal, memory=memory), parts._replace(foot=does)
        if not self.driver.changes:
            return moved, following
        # A lifted pedal is back at zero: control begins anew.
        released = (does == OFF) & (parts.foot != OFF)
        empty = tuple(own._replace(brake=own.brake._replace(commanded=pedal.level)) for own in moved.channels)
        anew = self.with_controllers(time, moved._replace(channels=empty), 0)
        begins = following._replace(
            phases=tuple(0 * phase for phase in parts.phases),
            pressures=tuple(0 * pressure + ON_PEDAL for pressure in parts.pressures),
        )
        return tree_where(released, (anew, begins), (moved, following))

    def _deep(self, time, state: VehicleLoopState) -> tuple[Any, ...]:
        """Of each wheel the speed below which it slides [rad/s]."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        return tuple(wheel_lock.deep(speed, wheel.radius) for wheel in self.vehicle.wheels)

    def sliding(self, time, state: VehicleLoopState) -> tuple[Sliding, ...]:
        """How each wheel slid until now, what lasts included."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        return tuple(wheel.until(time, speed) for wheel in state.memory.wheels)

    def course(self, time, state: VehicleLoopState, mode) -> Course:
        """What is known of the manoeuvre until now: of channels and wheels together the first switching, the fewest
        cycles, the longest cycle and the longest lock; of each wheel how long it slid."""
        memory, slid = state.memory, self.sliding(time, state)
        cycling = [
            control.longest_until(time, memory.pedal_time)
            for control, channel in zip(memory.control, self.channels)
            if channel.controller.cycle_phase is not None
        ]
        longest = jnp.stack(cycling).max(axis=0) if cycling else 0.0 * time
        onsets = [jnp.where(control.onset_time > 0, control.onset_time, jnp.inf) for control in memory.control]
        first = jnp.argmin(jnp.stack(onsets), axis=0)
        control = jax.tree.map(lambda *values: pick(first, values), *memory.control)
        control = control._replace(cycles=jnp.stack([own.cycles for own in memory.control]).min(axis=0))
        worst = jax.tree.map(lambda *values: jnp.stack(values).max(axis=0), *slid)
        worst = worst._replace(locks=worst.locks._replace(count=sum(wheel.locks.count for wheel in slid)))
        speed, position = self.vehicle.speed_of(time, state.vehicle), self.vehicle.position(time, state.vehicle)
        worst = Memory(memory.pedal_time, memory.pedal_position, control, worst)
        return Course(speed, position, worst, longest, tuple(wheel.slides.time for wheel in slid))

    def scales(self, state: VehicleLoopState) -> VehicleLoopState:
        """Those of the vehicle and the channels; of all else every share counts."""
        channels = tuple(channel.scales(own) for channel, own in zip(self.channels, state.channels))
        return jax.tree.map(lambda leaf: 0.0 * leaf, state)._replace(
            vehicle=self.vehicle.scales(state.vehicle), channels=channels
        )

    def importance(self, time, state: VehicleLoopState, mode):
        """Share (v / v0)^2 of the distance that is still ahead, with v0 the speed of the first switching."""
        first = state.memory.control[0].onset_speed
        for control in state.memory.control[1:]:
            first = jnp.maximum(first, control.onset_speed)
        return jnp.minimum((self.vehicle.speed_of(time, state.vehicle) / first) ** 2, 1.0)
