"""A vehicle, its driver, and a channel of brake, controller and observer for each wheel, as one hybrid system.

The same as `absjax.loop.closed_loop` for several wheels: each channel switches on its own, two may switch in the same
step or in the same instant, all are located and differentiated through. A channel may command two wheels and go by the
worse of them, the one that turns slower (select-low): which one that is, is part of the mode, and its change located.
`absjax.loop.sampled_vehicle` has it under the clock of a control unit.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import pick, tree_where
from absjax.contracts import require_contract
from absjax.controllers.base import Controller
from absjax.loop import pressure_limits, wheel_lock
from absjax.loop._modes import FREE, ON_PEDAL, Mode
from absjax.loop._vehicle_modes import WIDEST, Layout, VehicleMode, decoded
from absjax.loop.channel import Channel, ChannelState
from absjax.loop.driver import NEVER, OFF, PRESSING, Driver, Pedal
from absjax.loop.memory import Course, Locks, Memory, VehicleMemory
from absjax.observers.base import Observer
from absjax.parameters import model, parameter, part
from absjax.plant.base import Actuator
from absjax.plant.vehicle import Vehicle
from absjax.results import FINISHED
from absjax.signals import Signals

SELECTION = 0.02
"""By how much the other wheel has to turn slower before a channel goes by it, rad/s: on one road both turn alike."""


class VehicleLoopState(NamedTuple):
    """State of a vehicle's loop."""

    vehicle: Any
    channels: tuple[ChannelState, ...]
    pedal: Pedal
    memory: VehicleMemory


@model
class VehicleLoop:
    """A braked vehicle under anti-lock controllers, switchings located.

    Mode: see `parts`; `FINISHED` after the vehicle has fallen to `stop_speed`, `UNDEFINED` if a controller has come to
    where its law is not defined. A rollout from mode 0 begins with the pedal untouched.

    Raises:
        ValueError: at construction, if a part lacks what its contract asks for, a wheel has no channel or two, or the
            channels have more phases than an integer holds; names what.
    """

    vehicle: Vehicle = part("what is braked")
    channels: tuple[Channel, ...] = part("brake, controller and observer of each wheel, or of two")
    stop_speed: Any = parameter(
        "vehicle speed that ends the manoeuvre, m/s; None: it never ends", default=None, low=0.0, open_low=True
    )
    driver: Driver = part("who presses the pedal", default=Driver())
    begins: tuple[Any, ...] | None = parameter(
        "instants before which the controllers do not switch, s; None: none", default=None, low=0.0
    )
    wiring: tuple[tuple[int, ...], ...] | None = None
    """for each channel the wheels it commands, one or two; None: each its own"""
    follows_load: bool = False
    """whether controllers and observers are told the loads that the accelerations make (`Vehicle.known_loads`)"""

    def __post_init__(self):
        require_contract(self.vehicle, Vehicle)
        for channel in self.channels:
            parts = (channel.brake, Actuator), (channel.controller, Controller), (channel.observer, Observer)
            for component, contract in parts:
                if component is not None:
                    require_contract(component, contract)
        braked = sorted(wheel for wheels in self.wheels_of for wheel in wheels)
        if braked != list(range(len(self.vehicle.places))) or len(self.wheels_of) != len(self.channels):
            raise ValueError(
                f"VehicleLoop.wiring = {self.wheels_of} of {len(self.channels)} channels must name each of the "
                f"{len(self.vehicle.places)} wheels once"
            )
        if any(len(wheels) > 2 for wheels in self.wheels_of):
            raise ValueError(f"VehicleLoop.wiring = {self.wheels_of}: a channel goes by one wheel or the worse of two")
        if self.begins is not None and len(self.begins) != len(self.channels):
            raise ValueError(f"VehicleLoop.begins has {len(self.begins)} entries for {len(self.channels)} channels")
        if self._layout.width > WIDEST:
            raise ValueError(f"the phases of {len(self.channels)} channels take {self._layout.width} bits of {WIDEST}")

    @property
    def wheels_of(self) -> tuple[tuple[int, ...], ...]:
        """For each channel the wheels it commands."""
        return tuple((i,) for i in range(len(self.channels))) if self.wiring is None else self.wiring

    @property
    def names(self) -> tuple[str, ...]:
        """What the channels are called: by the wheels they command."""
        return tuple(" and ".join(self.vehicle.places[i] for i in wheels) for wheels in self.wheels_of)

    @property
    def _layout(self) -> Layout:
        return Layout(
            tuple((len(channel.controller.phases) - 1).bit_length() for channel in self.channels),
            tuple(len(wheels) - 1 for wheels in self.wheels_of),
            len(self.vehicle.places),
        )

    def parts(self, mode) -> VehicleMode:
        """What channels, wheels and foot do in `mode`."""
        return decoded(mode, self._layout)

    def mode(self, parts: VehicleMode):
        """The mode of what they do."""
        return parts.encoded(self._layout)

    def phases(self, mode) -> tuple[Any, ...]:
        """The phase of each channel in `mode`; an end is its own."""
        return tuple(jnp.where(jnp.asarray(mode) < 0, mode, phase) for phase in self.parts(mode).phases)

    def locked(self, mode) -> tuple[Any, ...]:
        """Whether each wheel is locked in `mode`."""
        return tuple((jnp.asarray(mode) >= 0) & (locked == 1) for locked in self.parts(mode).locked)

    def initial_state(self, speed) -> VehicleLoopState:
        """State of free rolling at `speed` [m/s] with the brakes released."""
        zero = 0.0 * speed
        blank = VehicleMemory.blank(speed, len(self.channels), len(self.vehicle.places))
        brakes = tuple(ChannelState(channel.brake.initial_state(zero), None, ()) for channel in self.channels)
        state = VehicleLoopState(self.vehicle.initial_state(speed), brakes, self.driver.initial_state(speed), blank)
        return self.with_controllers(zero, state, 0)

    def with_controllers(self, time, state: VehicleLoopState, mode) -> VehicleLoopState:
        """The state with observers and controllers at their start."""
        parts = self.parts(mode)
        slope = self.free(time, state)
        measured = self.of_channels(self._measured(time, state, slope, parts), parts)
        begun = (c.begun(s, m) for c, s, m in zip(self.channels, state.channels, measured))
        return state._replace(channels=tuple(begun))

    def channel_pressures(self, state: VehicleLoopState) -> tuple[Any, ...]:
        """Pressure at the wheels of each channel [bar]."""
        return tuple(
            pressure_limits.at_the_wheel(self.driver, channel.brake, own.brake, state.pedal)
            for channel, own in zip(self.channels, state.channels)
        )

    def pressures(self, state: VehicleLoopState) -> tuple[Any, ...]:
        """Pressure at each wheel [bar]."""
        by_channel, at_wheel = self.channel_pressures(state), {}
        for pressure, wheels in zip(by_channel, self.wheels_of):
            at_wheel.update(dict.fromkeys(wheels, pressure))
        return tuple(at_wheel[i] for i in range(len(at_wheel)))

    def free(self, time, state: VehicleLoopState):
        """d(state)/dt of the vehicle, its wheels free to turn."""
        return self.vehicle.flow(time, state.vehicle, self.pressures(state))

    def _measured(self, time, state: VehicleLoopState, slope, parts: VehicleMode) -> tuple[Signals, ...]:
        pressures = self.pressures(state)
        pedal = jnp.where(parts.foot == OFF, 0.0, jnp.ones_like(pressures[0]))
        measured = self.vehicle.signals(time, state.vehicle, slope, pressures)
        return tuple(
            signals._replace(
                acceleration_offset=jnp.where(locked == 1, -signals.vehicle_acceleration, signals.acceleration_offset),
                pedal=pedal,
            )
            for signals, locked in zip(measured, parts.locked)
        )

    def measured(self, time, state: VehicleLoopState, mode) -> tuple[Signals, ...]:
        """What sensors without error see at each wheel."""
        return self._measured(time, state, self.free(time, state), self.parts(mode))

    def of_channels(self, measured: tuple[Signals, ...], parts: VehicleMode) -> tuple[Signals, ...]:
        """Of each channel the signals it goes by."""
        return tuple(
            measured[wheels[0]]
            if len(wheels) == 1
            else tree_where(chosen == 0, measured[wheels[0]], measured[wheels[1]])
            for wheels, chosen in zip(self.wheels_of, parts.chosen)
        )

    def told(self, measured: tuple[Signals, ...], state: VehicleLoopState, parts: VehicleMode) -> tuple[Signals, ...]:
        """What each controller is told of what is measured at the wheels: XBS as its observer estimates it."""
        signals = self.of_channels(measured, parts)
        return tuple(c.with_estimate(m, own) for c, m, own in zip(self.channels, signals, state.channels))

    def accelerations(self, time, state: VehicleLoopState):
        """ax and ay, what accelerometers without error tell of the body [m/s^2]."""
        return self.vehicle.accelerations(time, state.vehicle, self.free(time, state))

    def fitted_to_load(self, accelerations, parts: VehicleMode) -> tuple[Channel, ...]:
        """The channels, where they follow the load, that (ax, ay) make, with a = R^2 Fz / J of the wheel they go by."""
        if not self.follows_load:
            return self.channels
        loads = self.vehicle.known_loads(*accelerations)
        shares = [load / wheel.load for load, wheel in zip(loads, self.vehicle.wheels)]
        return tuple(
            channel.at_load(shares[wheels[0]] if len(wheels) == 1 else pick(chosen, [shares[i] for i in wheels]))
            for channel, wheels, chosen in zip(self.channels, self.wheels_of, parts.chosen)
        )

    def commands(self, channels, told: tuple[Signals, ...], state: VehicleLoopState, parts: VehicleMode):
        """The rates the actuators are asked for and can follow [bar/s]."""
        return tuple(
            channel.brake.limit(channel.controller.rate(signals, own.controller, phase), own.brake)
            for channel, signals, own, phase in zip(channels, told, state.channels, parts.phases)
        )

    def driven(self, state: VehicleLoopState, parts: VehicleMode, slope, rates) -> VehicleLoopState:
        """d(state)/dt under given rates [bar/s], the observers held."""
        pedal_slope = self.driver.slope(parts.foot) + 0.0 * state.pedal.level
        granted = [
            pressure_limits.granted(Mode(pressure, pressure), rate, pedal_slope)
            for pressure, rate in zip(parts.pressures, rates)
        ]
        turning = tuple(map(wheel_lock.held, parts.locked, self.vehicle.wheel_speeds_of(slope)))
        nothing = jax.tree.map(lambda _: None, state)
        channels = tuple(
            held._replace(brake=channel.brake.flow(own.brake, rate))
            for channel, own, held, rate in zip(self.channels, state.channels, nothing.channels, granted)
        )
        return nothing._replace(
            vehicle=self.vehicle.with_wheel_speeds(slope, turning), channels=channels, pedal=Pedal(pedal_slope, None)
        )

    def _observers(self, channels, told, state: VehicleLoopState, slope: VehicleLoopState) -> VehicleLoopState:
        """The slope with that of the observers."""
        advanced = []
        for channel, signals, own, flowing in zip(channels, told, state.channels, slope.channels):
            if channel.observer is None:
                advanced.append(flowing)
                continue
            _, rate = jax.jvp(
                lambda brake, level, brake_=channel.brake: pressure_limits.at_the_wheel(
                    self.driver, brake_, brake, state.pedal._replace(level=level)
                ),
                (own.brake, state.pedal.level),
                (flowing.brake, slope.pedal.level),
            )
            offset, speed = signals.acceleration_offset, signals.vehicle_speed
            advanced.append(flowing._replace(observer=channel.observer.flow(own.observer, offset, speed, rate)))
        return slope._replace(channels=tuple(advanced))

    def flow(self, time, state: VehicleLoopState, mode) -> VehicleLoopState:
        """d(state)/dt."""
        parts, slope = self.parts(mode), self.free(time, state)
        measured = self._measured(time, state, slope, parts)
        told = self.told(measured, state, parts)
        channels = self.fitted_to_load(self.vehicle.accelerations(time, state.vehicle, slope), parts)
        driven = self.driven(state, parts, slope, self.commands(channels, told, state, parts))
        return self._observers(channels, told, state, driven)

    def controller_guards(self, channels, told, state: VehicleLoopState, parts: VehicleMode):
        """Of each channel the guards of its controller."""
        for i, (channel, signals, own, phase) in enumerate(zip(channels, told, state.channels, parts.phases)):
            guards = channel.controller.guards(signals, own.controller, phase)
            if self.begins is not None:
                waited = jnp.where(phase == 0, signals.time - self.begins[i], jnp.inf)
                guards = tuple(jnp.minimum(guard, waited) for guard in guards)
            yield guards

    def limits(self, time, state: VehicleLoopState, parts: VehicleMode, slope, rates) -> tuple[Any, ...]:
        """Guards that are no controller's: the wheels' locks, the pressures' limits, the choices of a wheel, and last
        the end of the manoeuvre and the moves of the foot."""
        speeds = self.vehicle.wheel_speeds_of(state.vehicle)
        guards = list(map(wheel_lock.guard, parts.locked, speeds, self.vehicle.wheel_speeds_of(slope)))
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
        measured = self._measured(time, state, slope, parts)
        told = self.told(measured, state, parts)
        channels = self.fitted_to_load(self.vehicle.accelerations(time, state.vehicle, slope), parts)
        own = self.controller_guards(channels, told, state, parts)
        rates = self.commands(channels, told, state, parts)
        return tuple(g for guards in own for g in guards) + self.limits(time, state, parts, slope, rates)

    def jump(self, time, state: VehicleLoopState, mode, slot):
        """A controller switches, or one of the limits is met."""
        parts, slope = self.parts(mode), self.free(time, state)
        told = self.told(self._measured(time, state, slope, parts), state, parts)
        channels = self.fitted_to_load(self.vehicle.accelerations(time, state.vehicle, slope), parts)
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
        speed, position = self.vehicle.speed_of(time, state.vehicle), self.vehicle.position(time, state.vehicle)
        owns, phases, pressures, memories = [], [], [], []
        everything = zip(
            channels, told, state.channels, parts.phases, parts.pressures, state.memory.control, fires, slots
        )
        for channel, signals, own, phase, pressure, memory, fired, slot in everything:
            after, following, cycles = channel.switch(signals, own, phase, slot)
            owns.append(tree_where(fired, after, own))
            phases.append(jnp.where(fired, following, phase))
            pressures.append(jnp.where(fired, FREE, pressure))
            memories.append(tree_where(fired, memory.switched(time, speed, position, cycles), memory))
        state = state._replace(channels=tuple(owns), memory=state.memory._replace(control=tuple(memories)))
        return state, parts._replace(phases=tuple(phases), pressures=tuple(pressures))

    def meet_limit(self, time, state: VehicleLoopState, parts: VehicleMode, slot):
        """State and mode after guard `slot` of `limits` has fired."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        speeds, all_locks, locked = list(self.vehicle.wheel_speeds_of(state.vehicle)), [], []
        for i, (lock, locks) in enumerate(zip(parts.locked, state.memory.locks)):
            turning, after, follows = wheel_lock.met(lock, speeds[i], locks, time, speed)
            speeds[i] = jnp.where(slot == i, turning, speeds[i])
            all_locks.append(tree_where(slot == i, after, locks))
            locked.append(jnp.where(slot == i, follows, lock))
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
            memory=state.memory._replace(locks=tuple(all_locks)),
        )
        parts = parts._replace(pressures=tuple(pressures), chosen=tuple(chosen), locked=tuple(locked))
        return tree_where(slot == first, self._end_or_move(time, state, parts), (state, parts))

    def _end_or_move(self, time, state: VehicleLoopState, parts: VehicleMode):
        end, foot = self._ending(time, state, parts)
        finished = parts._replace(phases=tuple(jnp.full_like(phase, FINISHED) for phase in parts.phases))
        last = state._replace(memory=state.memory._replace(locks=self._locks(time, state, parts)))
        return tree_where(end >= foot, (last, finished), self._moved(time, state, parts))

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

    def _locks(self, time, state: VehicleLoopState, parts: VehicleMode) -> tuple[Locks, ...]:
        """Of each wheel when it was locked until now, a lock that lasts included."""
        speed = self.vehicle.speed_of(time, state.vehicle)
        return tuple(
            tree_where(locked == 1, locks.ended(time, speed), locks)
            for locked, locks in zip(parts.locked, state.memory.locks)
        )

    def course(self, time, state: VehicleLoopState, mode) -> Course:
        """What is known of the manoeuvre until now: of channels and wheels together the first switching, the fewest
        cycles, the longest cycle and the longest lock."""
        memory, going = state.memory, jnp.asarray(mode) >= 0
        current = self._locks(time, state, self.parts(mode))
        locks = [tree_where(going, now, before) for now, before in zip(current, memory.locks)]
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
        worst = jax.tree.map(lambda *values: jnp.stack(values).max(axis=0), *locks)
        worst = worst._replace(count=sum(own.count for own in locks))
        speed, position = self.vehicle.speed_of(time, state.vehicle), self.vehicle.position(time, state.vehicle)
        return Course(speed, position, Memory(memory.pedal_time, memory.pedal_position, control, worst), longest)

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
