"""A braked wheel on a drum."""

from typing import Any, ClassVar, NamedTuple

from absjax.parameters import model, parameter, part
from absjax.plant.base import Road, signals_of
from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class RigState(NamedTuple):
    """State of a test rig; scalars per lane."""

    wheel_speed: Any
    """w [rad/s]"""


@model
class TestRig:
    """A braked wheel on a drum whose surface speed is imposed: v = speed + acceleration * time."""

    __test__ = False
    title: ClassVar[str] = "test rig"

    wheel: Wheel = part("the wheel")
    road: Road = part("the surface of the drum")
    speed: Any = parameter("v at time 0, m/s", low=0.0, open_low=True)
    acceleration: Any = parameter("v', m/s^2", default=0.0)

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
        return signals_of(self, time, state, pressure, slope.wheel_speed, self.acceleration + 0.0 * slope.wheel_speed)

    def wheel_speed_of(self, state: RigState):
        """w [rad/s]."""
        return state.wheel_speed

    def with_wheel_speed(self, state: RigState, wheel_speed) -> RigState:
        """The state with another w [rad/s]."""
        return state._replace(wheel_speed=wheel_speed)

    def initial_state(self, speed) -> RigState:
        """State of free rolling at drum speed `speed` [m/s]."""
        return RigState(speed / self.wheel.radius)
