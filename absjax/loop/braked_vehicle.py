"""A vehicle with a channel of brake, controller and observer for each wheel: what they are told, and what they do.

A channel may command two wheels and go by the worse of them, the one that turns slower (select-low).
`absjax.loop.vehicle_loop` makes a hybrid system of it.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import computed_once, pick, tree_where
from absjax.contracts import require_contract
from absjax.controllers.base import Controller
from absjax.loop import pressure_limits, wheel_lock
from absjax.loop._modes import Mode
from absjax.loop._vehicle_modes import WIDEST, Layout, VehicleMode, decoded
from absjax.loop.channel import Channel, ChannelState
from absjax.loop.driver import OFF, Driver, Pedal
from absjax.loop.memory import VehicleMemory
from absjax.observers.base import Observer
from absjax.parameters import model, parameter, part
from absjax.plant.base import Actuator
from absjax.plant.vehicle import Vehicle
from absjax.signals import Signals


class VehicleLoopState(NamedTuple):
    """State of a vehicle's loop."""

    vehicle: Any
    channels: tuple[ChannelState, ...]
    pedal: Pedal
    memory: VehicleMemory


@model
class BrakedVehicle:
    """A braked vehicle and its channels.

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
        return tuple((jnp.asarray(mode) >= 0) & (wheel == wheel_lock.LOCKED) for wheel in self.parts(mode).wheels)

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
        return computed_once(self.vehicle.flow(time, state.vehicle, self.pressures(state)))

    def _measured(self, time, state: VehicleLoopState, slope, parts: VehicleMode) -> tuple[Signals, ...]:
        pressures = self.pressures(state)
        pedal = jnp.where(parts.foot == OFF, 0.0, jnp.ones_like(pressures[0]))
        measured = self.vehicle.signals(time, state.vehicle, slope, pressures)
        return tuple(
            signals._replace(
                acceleration_offset=jnp.where(
                    does == wheel_lock.LOCKED, -signals.vehicle_acceleration, signals.acceleration_offset
                ),
                pedal=pedal,
            )
            for signals, does in zip(measured, parts.wheels)
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

    def informed(self, time, state: VehicleLoopState, slope, parts: VehicleMode):
        """The channels as they know their load, and what each controller is told."""
        channels = self.fitted_to_load(self.vehicle.accelerations(time, state.vehicle, slope), parts)
        return channels, computed_once(self.told(self._measured(time, state, slope, parts), state, parts))

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
        turning = tuple(map(wheel_lock.held, parts.wheels, self.vehicle.wheel_speeds_of(slope)))
        nothing = jax.tree.map(lambda _: None, state)
        channels = tuple(
            held._replace(brake=channel.brake.flow(own.brake, rate))
            for channel, own, held, rate in zip(self.channels, state.channels, nothing.channels, granted)
        )
        return nothing._replace(
            vehicle=self.vehicle.with_wheel_speeds(slope, turning), channels=channels, pedal=Pedal(pedal_slope, None)
        )

    def with_observers(self, channels, told, state: VehicleLoopState, slope: VehicleLoopState) -> VehicleLoopState:
        """A d(state)/dt with that of the observers."""
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

    def controller_guards(self, channels, told, state: VehicleLoopState, parts: VehicleMode):
        """Of each channel the guards of its controller."""
        for i, (channel, signals, own, phase) in enumerate(zip(channels, told, state.channels, parts.phases)):
            guards = channel.controller.guards(signals, own.controller, phase)
            if self.begins is not None:
                waited = jnp.where(phase == 0, signals.time - self.begins[i], jnp.inf)
                guards = tuple(jnp.minimum(guard, waited) for guard in guards)
            yield guards
