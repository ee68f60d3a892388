"""One wheel and its share of the car."""

from typing import Any, ClassVar, NamedTuple

from absjax.parameters import model, part
from absjax.plant.base import Road, signals_of
from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class CarState(NamedTuple):
    """State of a quarter car; scalars per lane."""

    speed: Any
    """v [m/s]"""
    wheel_speed: Any
    """w [rad/s]"""
    distance: Any
    """travelled, m"""


@model
class QuarterCar:
    """One wheel and its share of the car; v' = Fx / m. Valid while v > 0."""

    title: ClassVar[str] = "quarter car"

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
        return signals_of(self, time, state, pressure, slope.wheel_speed, slope.speed)

    def speed_of(self, time, state: CarState):
        """v [m/s]."""
        return state.speed

    def position(self, time, state: CarState):
        """Distance travelled [m]."""
        return state.distance

    def wheel_speed_of(self, state: CarState):
        """w [rad/s]."""
        return state.wheel_speed

    def with_wheel_speed(self, state: CarState, wheel_speed) -> CarState:
        """The state with another w [rad/s]."""
        return state._replace(wheel_speed=wheel_speed)

    def initial_state(self, speed) -> CarState:
        """State of free rolling at `speed` [m/s]."""
        return CarState(speed, speed / self.wheel.radius, 0.0 * speed)
