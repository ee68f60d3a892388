"""A vehicle's loop whose controllers sit in an electronic control unit with a clock.

The same as `absjax.loop.sampled_loop` for several channels: every so many steps the unit measures at every wheel, tests
the guards of every channel, makes at most one switching in each, and holds the commands in between. Where it has to
estimate the speed, controllers and observers are told that, and the acceleration that the accelerometer tells, instead
of the true ones, and the acceleration offsets are reckoned with them. Lock, limits of the pressures and the stop stay
located.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import first_open
from absjax.contracts import require_contract
from absjax.loop.braked_vehicle import VehicleLoopState
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.observers.base import Sample
from absjax.observers.run import advance
from absjax.parameters import model, part
from absjax.sensors.base import Sensor
from absjax.signals import Signals
from absjax.speed.base import SpeedEstimator
from absjax.speed.run import after_rolling


class Unit(NamedTuple):
    """What the control unit keeps; scalars per lane."""

    time: jax.Array
    """of the last tick, s"""
    samples: tuple[Sample, ...]
    """what the observers were told then, of each channel"""
    sensors: tuple[Any, ...]
    """state of the sensor of each wheel; empty without sensors"""
    speed: Any
    """state of the speed estimator; None without one"""


class SampledVehicleState(NamedTuple):
    """State of a sampled loop of a vehicle."""

    loop: VehicleLoopState
    rates: tuple[jax.Array, ...]
    """commanded rates, of each channel, that act [bar/s]"""
    unit: Unit


@model
class SampledVehicle:
    """The loop of a vehicle with the controllers in an electronic control unit.

    Raises:
        ValueError: at construction, if a part lacks what its contract asks for, or the numbers of sensors and wheels
            differ; names what.
    """

    loop: VehicleLoop = part("the loop")
    sensors: tuple[Sensor, ...] = part(
        "what is measured at each wheel instead of the truth; none: no error", default=()
    )
    speed: SpeedEstimator | None = part("estimates the vehicle's speed; None tells the true one", default=None)
    accelerometer: Any = part(
        "tells the body's acceleration along it, and nothing across it; None tells both without error", default=None
    )
    tick_every: int = 1
    substeps: int = 1
    rolling: int = 0
    """ticks of free rolling before it begins, which the speed estimator has been told of, its rims without error"""
    period: float | None = None
    """of the ticks, s; needed where there was rolling"""

    def __post_init__(self):
        if self.sensors and len(self.sensors) != len(self.loop.vehicle.places):
            raise ValueError(
                f"SampledVehicle.sensors has {len(self.sensors)} entries for {len(self.loop.vehicle.places)} wheels"
            )
        for sensor in self.sensors:
            require_contract(sensor, Sensor)
        if self.speed is not None:
            require_contract(self.speed, SpeedEstimator)
        for name in ("tick_every", "substeps"):
            if getattr(self, name) < 1:
                raise ValueError(f"SampledVehicle.{name} = {getattr(self, name)} must be >= 1")
        if self.rolling < 0 or (self.rolling and self.period is None):
            raise ValueError(f"SampledVehicle.rolling = {self.rolling} must be >= 0, and needs the period of the ticks")

    def require_step(self, step: float) -> None:
        """Check the grid step [s] of a rollout.

        Raises:
            ValueError: if the loop would not tick as often as it has it, or as a sensor expects.
        """
        named = [("the loop", self.period), *(("the sensor", sensor.period) for sensor in self.sensors)]
        for whose, expected in named:
            if expected is not None and abs(step * self.tick_every - expected) > 1e-6 * expected:
                raise ValueError(f"a tick every {step * self.tick_every:g} s; {whose}'s period is {expected:g} s")

    def initial_state(self, speed) -> SampledVehicleState:
        """State of free rolling at `speed` [m/s], the first commands given at once."""
        state, zero = self.loop.initial_state(speed), 0.0 * speed
        parts = self.loop.parts(jnp.int32(0))
        measured, sensors = self.loop.measured(zero, state, 0), ()
        if self.sensors:
            measured, sensors = zip(*(s.begin(signals) for s, signals in zip(self.sensors, measured)))
        estimator = None
        if self.speed is not None:
            estimator = after_rolling(
                self.speed, self.accelerometer, speed, len(self.loop.vehicle.places), self.period or 0.0, self.rolling
            )
        accelerations = self._told_accelerations(zero, state)
        measured, accelerations = self._with_speed(measured, accelerations, estimator)
        told = self.loop.told(measured, state, parts)
        rates = self.loop.commands(self.loop.fitted_to_load(accelerations, parts), told, state, parts)
        unit = Unit(zero, tuple(map(Sample.of, told)), tuple(sensors), estimator)
        return SampledVehicleState(state, rates, unit)

    def _told_accelerations(self, time, state: VehicleLoopState):
        """ax and ay of the body as the unit is told them [m/s^2]."""
        along, across = self.loop.accelerations(time, state)
        if self.accelerometer is None:
            return along, across
        return self.accelerometer.measure(along, time), 0.0 * across

    def _with_speed(self, measured: tuple[Signals, ...], accelerations, estimator):
        """The signals with the estimated speed and the acceleration as the unit knows it, where it estimates, and the
        accelerations."""
        if self.speed is None and self.accelerometer is None:
            return measured, accelerations
        acceleration, across = accelerations
        if self.speed is not None:
            acceleration = self.speed.acceleration_of(estimator, acceleration)
        changed = []
        for signals in measured:
            speed = signals.vehicle_speed if self.speed is None else self.speed.speed_of(estimator)
            # x2 = R w' - v' with the v' that is told.
            offset = signals.acceleration_offset + signals.vehicle_acceleration - acceleration
            changed.append(
                signals._replace(vehicle_speed=speed, vehicle_acceleration=acceleration, acceleration_offset=offset)
            )
        return tuple(changed), (acceleration, across)

    def importance(self, time, state: SampledVehicleState, mode):
        """That of the loop."""
        return self.loop.importance(time, state.loop, mode)

    def scales(self, state: SampledVehicleState) -> SampledVehicleState:
        """Those of the loop."""
        return jax.tree.map(lambda leaf: 0.0 * leaf, state)._replace(loop=self.loop.scales(state.loop))

    def flow(self, time, state: SampledVehicleState, mode) -> SampledVehicleState:
        """d(state)/dt under the rates that act."""
        parts, slope = self.loop.parts(mode), self.loop.free(time, state.loop)
        held = jax.tree.map(lambda _: None, state)
        if self.sensors:
            measured = self.loop.measured(time, state.loop, mode)
            moving = (s.flow(own, signals) for s, own, signals in zip(self.sensors, state.unit.sensors, measured))
            held = held._replace(unit=held.unit._replace(sensors=tuple(moving)))
        return held._replace(loop=self.loop.driven(state.loop, parts, slope, state.rates))

    def guards(self, time, state: SampledVehicleState, mode):
        """The limits."""
        parts = self.loop.parts(mode)
        return self.loop.limits(time, state.loop, parts, self.loop.free(time, state.loop), state.rates)

    def jump(self, time, state: SampledVehicleState, mode, slot):
        """One of the limits is met."""
        loop, parts = self.loop.meet_limit(time, state.loop, self.loop.parts(mode), slot)
        return state._replace(loop=loop), self.loop.mode(parts)

    def tick(self, time, state: SampledVehicleState, mode):
        """One pass of the control unit."""
        loop, unit, parts = state.loop, state.unit, self.loop.parts(mode)
        period = time - unit.time
        measured, sensors = self.loop.measured(time, loop, mode), ()
        if self.sensors:
            pairs = (s.measure(signals, own) for s, signals, own in zip(self.sensors, measured, unit.sensors))
            measured, sensors = zip(*pairs)
        estimator, accelerations = unit.speed, self._told_accelerations(time, loop)
        if self.speed is not None:
            rims = tuple(signals.radius * signals.wheel_speed for signals in measured)
            pressures = tuple(signals.pressure for signals in measured)
            estimator = self.speed.update(estimator, accelerations[0], rims, period, pressures)
        measured, accelerations = self._with_speed(measured, accelerations, estimator)
        samples = tuple(map(Sample.of, self.loop.of_channels(measured, parts)))
        channels = self.loop.fitted_to_load(accelerations, parts)
        observed = tuple(
            own
            if channel.observer is None
            else own._replace(observer=advance(channel.observer, own.observer, before, now, period, self.substeps))
            for channel, own, before, now in zip(channels, loop.channels, unit.samples, samples)
        )
        loop = loop._replace(channels=observed)
        told = self.loop.told(measured, loop, parts)
        opened = [first_open(guards) for guards in self.loop.controller_guards(channels, told, loop, parts)]
        loop, parts = self.loop.switch(channels, told, loop, parts, *zip(*opened))
        rates = self.loop.commands(channels, told, loop, parts)
        unit = Unit(time, samples, tuple(sensors), estimator)
        return SampledVehicleState(loop, rates, unit), self.loop.mode(parts)
