"""Components as a user writes them: to the contracts alone, knowing nothing else of the project."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from absjax.controllers.base import Controller
from absjax.parameters import model, parameter, part
from absjax.plant.base import Road
from absjax.plant.wheel import Wheel
from absjax.signals import Signals
from absjax.tyres.base import Peak


@model
class Rational:
    """mu = 2 mu_p s_p s / (s_p^2 + s^2), s = |lambda|, odd: a peak mu_p at s_p."""

    title: ClassVar[str] = "rational"
    beyond_peak: ClassVar[tuple[str, ...]] = ()

    top: Any = parameter("mu_p", default=1.0, low=0.0, open_low=True, trainable=True, span=(0.1, 1.5))
    where: Any = parameter("s_p", default=0.15, low=0.0, open_low=True, trainable=True, span=(0.02, 0.5))

    def friction(self, slip):
        return 2 * self.top * self.where * slip / (self.where**2 + slip**2)

    def stiffness(self, slip):
        room = self.where**2 + slip**2
        return 2 * self.top * self.where * (self.where**2 - slip**2) / room**2

    def peak(self):
        return Peak(self.where, self.top)


class SledState(NamedTuple):
    v: Any
    spin: Any
    way: Any


@model
class Sled:
    """A quarter car that the air brakes too: m v' = Fx - k v^2."""

    title: ClassVar[str] = "sled"

    wheel: Wheel = part("the wheel")
    road: Road = part("the road")
    drag: Any = parameter("k, N s^2/m^2", default=0.05, low=0.0)

    def initial_state(self, speed):
        return SledState(speed, speed / self.wheel.radius, 0.0 * speed)

    def _force(self, time, state):
        slip = self.wheel.slip(state.spin, state.v)
        return self.wheel.load * self.road.friction(slip, time, state.way)

    def flow(self, time, state, pressure):
        force = self._force(time, state)
        slowing = (force - self.drag * state.v**2) / self.wheel.mass
        return SledState(slowing, self.wheel.acceleration(force, pressure), state.v)

    def speed_of(self, time, state):
        return state.v

    def position(self, time, state):
        return state.way

    def wheel_speed_of(self, state):
        return state.spin

    def with_wheel_speed(self, state, wheel_speed):
        return state._replace(spin=wheel_speed)

    def signals(self, time, state, pressure):
        slope = self.flow(time, state, pressure)
        slip = self.wheel.slip(state.spin, state.v)
        return Signals(
            vehicle_speed=state.v,
            vehicle_acceleration=slope.v,
            wheel_speed=state.spin,
            acceleration_offset=self.wheel.radius * slope.spin - slope.v,
            radius=self.wheel.radius,
            pressure=pressure,
            stiffness=self.road.stiffness(slip, time, state.way),
            time=time,
        )


@model
class SlipThresholds(Controller):
    """Released below one slip, applied above another."""

    title: ClassVar[str] = "slip thresholds"
    grid_step: ClassVar[float] = 2e-3
    phases: ClassVar[tuple[str, ...]] = ("the driver's", "release", "apply")
    slots: ClassVar[int] = 1
    cycle_phase: ClassVar[int | None] = 1

    deep: Any = parameter("slip that begins a release, magnitude", default=0.25, low=0.0, open_low=True, trainable=True)
    flat: Any = parameter("slip that begins an apply, magnitude", default=0.08, low=0.0, open_low=True, trainable=True)
    pace: Any = parameter("pressure rate, bar/s", default=500.0, low=0.0, open_low=True, trainable=True)

    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("flat", "deep", 0.01),)

    def initial_state(self, signals):
        return ()

    def rate(self, signals, state, phase):
        return jnp.where(phase == 0, 1e4, jnp.where(phase == 1, -self.pace, self.pace))

    def guards(self, signals, state, phase):
        slip = 1 - signals.radius * signals.wheel_speed / signals.vehicle_speed
        begins = jnp.where(signals.pedal > 0.5, slip - self.deep, -1.0)
        return (jnp.where(phase == 1, self.flat - slip, jnp.where(phase == 0, begins, slip - self.deep)),)

    def switch(self, signals, state, phase, slot):
        return state, jnp.where(phase == 1, 2, 1)


@model
class Filtered:
    """An observer that takes x2' = -(a/v) XBS x2 - b Pb' for a first-order lag of XBS: crude, and never unstable."""

    wheel: Wheel = part("the wheel as it knows it", default=Wheel())
    pull: Any = parameter("gain", default=40.0, low=0.0, open_low=True)

    def initial_state(self, y):
        return (y, 0.0 * y)

    def flow(self, state, y, speed, rate):
        error = y - state[0]
        slope = -self.wheel.slip_gain / speed * state[1] * y - self.wheel.pressure_gain * rate + self.pull * error
        return slope, -jnp.sign(y) * 0.05 * self.pull * error

    def stiffness(self, state, y):
        return state[1]

    def fastest_rate(self, state, y, speed):
        return self.pull + 0.0 * jnp.abs(y)


@model
class FilteredDesign:
    """It as a tuner sees it."""

    title: ClassVar[str] = "filtered"
    substeps: ClassVar[int] = 2

    pull: Any = parameter("gain", default=40.0, low=0.0, open_low=True, trainable=True, span=(5.0, 200.0))

    def observer(self, wheel):
        return Filtered(wheel, self.pull)


@model
class Rounding:
    """A sensor that tells x2 in steps."""

    step: Any = parameter("m/s^2", default=1.0, low=0.0, open_low=True)

    @property
    def period(self):
        return None

    def begin(self, signals):
        return self.measure(signals, ())

    def flow(self, state, signals):
        return ()

    def measure(self, signals, state):
        told = jnp.round(signals.acceleration_offset / self.step) * self.step
        return signals._replace(acceleration_offset=told), state
