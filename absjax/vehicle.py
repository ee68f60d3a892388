"""A braked wheel under a quarter of a car, or on a test rig.

    J w' = -R Fx - gamma_b Pb,    Fx = Fz mu(lambda),    lambda = (R w - v) / v

with v' = Fx / m in a car and v imposed on a rig. The wheel acceleration offset is x2 = R w' - v'.
Source: Aguado-Rojas 2019, section 2.1; Hoang et al. 2014, eq. 1-4.
"""

from typing import NamedTuple, Protocol

import jax

from absjax.parameters import model, parameter, part
from absjax.road import Road

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""


class Signals(NamedTuple):
    """What sensors see and controllers use; scalars per lane."""

    vehicle_speed: jax.Array
    """v [m/s]"""
    vehicle_acceleration: jax.Array
    """v' [m/s^2]"""
    wheel_speed: jax.Array
    """w [rad/s]"""
    acceleration_offset: jax.Array
    """x2 = R w' - v' [m/s^2]"""
    radius: jax.Array
    """R [m], which a controller knows"""
    pressure: jax.Array
    """Pb at the wheel [bar]"""
    stiffness: jax.Array
    """XBS = mu'(lambda): the true one of a plant, the estimate where a loop has an observer"""
    time: jax.Array
    """of a clock that starts with the manoeuvre [s]"""
    pedal: jax.Array | float = 1.0
    """1 while the driver presses the pedal, else 0: all that a controller knows of the foot"""


@model
class Wheel:
    """A braked wheel and the load it carries."""

    inertia: jax.Array | float = parameter("J, kg m^2", default=1.2, low=0.0, open_low=True)
    radius: jax.Array | float = parameter("R, m", default=0.3, low=0.0, open_low=True)
    load: jax.Array | float = parameter("Fz, vertical load, N", default=2500.0, low=0.0, open_low=True)
    brake_efficiency: jax.Array | float = parameter("gamma_b, N m/bar", default=17.5, low=0.0, open_low=True)

    @property
    def mass(self):
        """m = Fz / g [kg]."""
        return self.load / GRAVITY

    @property
    def slip_gain(self):
        """a = R^2 Fz / J [m/s^2], of x2' = -(a mu' / v) x2 - b Pb'."""
        return self.radius**2 * self.load / self.inertia

    @property
    def pressure_gain(self):
        """b = R gamma_b / J [m/(s^2 bar)], likewise."""
        return self.radius * self.brake_efficiency / self.inertia

    def acceleration(self, force, pressure):
        """w' = (-R Fx - gamma_b Pb) / J [rad/s^2] from tyre force [N] and brake pressure [bar]."""
        return -(self.radius * force + self.brake_efficiency * pressure) * (1 / self.inertia)

    def slip(self, wheel_speed, speed):
        """lambda = (R w - v) / v."""
        return self.radius * wheel_speed / speed - 1


class Plant(Protocol):
    """What a closed loop asks of the thing that is braked."""

    wheel: Wheel

    road: Road

    def flow(self, time, state, pressure):
        """d(state)/dt under brake pressure [bar]."""
        ...

    def speed_of(self, time, state) -> jax.Array:
        """v [m/s]."""
        ...

    def position(self, time, state) -> jax.Array:
        """Distance travelled since time 0 [m]."""
        ...

    def signals(self, time, state, pressure) -> Signals:
        """What the sensors of this plant see."""
        ...


def _signals(plant: Plant, time, state, pressure, wheel_acceleration, vehicle_acceleration) -> Signals:
    speed = plant.speed_of(time, state)
    slip = plant.wheel.slip(state.wheel_speed, speed)
    return Signals(
        vehicle_speed=speed,
        vehicle_acceleration=vehicle_acceleration,
        wheel_speed=state.wheel_speed,
        acceleration_offset=plant.wheel.radius * wheel_acceleration - vehicle_acceleration,
        radius=plant.wheel.radius,
        pressure=pressure,
        stiffness=plant.road.stiffness(slip, time, plant.position(time, state)),
        time=time,
    )


class CarState(NamedTuple):
    """State of a quarter car; scalars per lane."""

    speed: jax.Array
    """v [m/s]"""
    wheel_speed: jax.Array
    """w [rad/s]"""
    distance: jax.Array
    """travelled, m"""


@model
class QuarterCar:
    """One wheel and its share of the car; v' = Fx / m. Valid while v > 0."""

    wheel: Wheel = part("the wheel")
    road: Road = part("the road under it")

    def force(self, time, state: CarState):
        """Fx = Fz mu(lambda) [N]."""
        slip = self.wheel.slip(state.wheel_speed, state.speed)
        return self.wheel.load * self.road.friction(slip, time, state.distance)

    def flow(self, time, state: CarState, pressure) -> CarState:
        """(v', w', distance')."""
        force = self.force(time, state)
        return CarState(force * (1 / self.wheel.mass), self.wheel.acceleration(force, pressure), state.speed)

    def signals(self, time, state: CarState, pressure) -> Signals:
        """Signals of the true state."""
        slope = self.flow(time, state, pressure)
        return _signals(self, time, state, pressure, slope.wheel_speed, slope.speed)

    def speed_of(self, time, state: CarState):
        """v [m/s]."""
        return state.speed

    def position(self, time, state: CarState):
        """Distance travelled [m]."""
        return state.distance

    def at(self, speed) -> CarState:
        """State of free rolling at `speed` [m/s]."""
        return CarState(speed, speed / self.wheel.radius, 0.0 * speed)


class RigState(NamedTuple):
    """State of a test rig; scalars per lane."""

    wheel_speed: jax.Array
    """w [rad/s]"""


@model
class TestRig:
    """A braked wheel on a drum whose surface speed is imposed: v = speed + acceleration * time."""

    __test__ = False

    wheel: Wheel = part("the wheel")
    road: Road = part("the surface of the drum")
    speed: jax.Array | float = parameter("v at time 0, m/s", low=0.0, open_low=True)
    acceleration: jax.Array | float = parameter("v', m/s^2", default=0.0)

    def speed_of(self, time, state=None):
        """v(time) [m/s]."""
        return self.speed + self.acceleration * time

    def position(self, time, state=None):
        """Length of drum surface passed [m]."""
        return time * (self.speed + 0.5 * self.acceleration * time)

    def force(self, time, state: RigState):
        """Fx = Fz mu(lambda) [N]."""
        slip = self.wheel.slip(state.wheel_speed, self.speed_of(time))
        return self.wheel.load * self.road.friction(slip, time, self.position(time))

    def flow(self, time, state: RigState, pressure) -> RigState:
        """(w',)."""
        return RigState(self.wheel.acceleration(self.force(time, state), pressure))

    def signals(self, time, state: RigState, pressure) -> Signals:
        """Signals of the true state."""
        slope = self.flow(time, state, pressure)
        return _signals(self, time, state, pressure, slope.wheel_speed, self.acceleration + 0.0 * slope.wheel_speed)

    def at(self, speed) -> RigState:
        """State of free rolling at drum speed `speed` [m/s]."""
        return RigState(speed / self.wheel.radius)
