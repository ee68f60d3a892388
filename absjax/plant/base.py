"""What a loop asks of the thing that is braked and of its actuator, and what that asks of a road."""

from typing import Any, ClassVar, Protocol

from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class Road(Protocol):
    """What a plant asks of a road: a class made by `absjax.parameters.model`."""

    def friction(self, slip: Any, time: Any, distance: Any) -> Any:
        """mu(lambda) at `time` [s] and `distance` [m]."""
        ...

    def stiffness(self, slip: Any, time: Any, distance: Any) -> Any:
        """XBS = mu'(lambda) at `time` [s] and `distance` [m]."""
        ...

    def peak_friction(self, time: Any, distance: Any) -> Any:
        """Largest friction to be had at `time` [s] and `distance` [m]."""
        ...


class Plant(Protocol):
    """What a closed loop asks of the thing that is braked: a class made by `absjax.parameters.model`.

    Its state is a pytree of float scalars. It has a field `wheel` and a field `road`.
    """

    title: ClassVar[str]
    """for tables and figures"""

    @property
    def wheel(self) -> Wheel:
        """The wheel that is braked."""
        ...

    @property
    def road(self) -> Road:
        """The road under it."""
        ...

    def initial_state(self, speed: Any) -> Any:
        """State of free rolling at `speed` [m/s]."""
        ...

    def flow(self, time: Any, state: Any, pressure: Any) -> Any:
        """d(state)/dt under brake pressure [bar]."""
        ...

    def speed_of(self, time: Any, state: Any) -> Any:
        """v [m/s]."""
        ...

    def position(self, time: Any, state: Any) -> Any:
        """Distance travelled since time 0 [m]."""
        ...

    def wheel_speed_of(self, state: Any) -> Any:
        """w [rad/s]; of a d(state)/dt it is w'."""
        ...

    def with_wheel_speed(self, state: Any, wheel_speed: Any) -> Any:
        """The state with another w [rad/s]; a d(state)/dt with another w'."""
        ...

    def signals(self, time: Any, state: Any, pressure: Any) -> Signals:
        """What the sensors of this plant see."""
        ...


class Actuator(Protocol):
    """What a closed loop asks of a brake actuator: a class made by `absjax.parameters.model`.

    Its state is a NamedTuple of float scalars with a field `commanded`, the integral of the commanded rate [bar].
    It may have `scales(state)`, of that structure: magnitudes below which errors are shares of these.
    """

    @property
    def lags(self) -> bool:
        """Whether the pressure at the wheel comes after the commanded one."""
        ...

    @property
    def overshoots(self) -> bool:
        """Whether the pressure at the wheel may leave the range of what was commanded."""
        ...

    def initial_state(self, pressure: Any = 0.0) -> Any:
        """State of rest at `pressure` [bar]."""
        ...

    def limit(self, rate: Any, state: Any) -> Any:
        """The commanded rate [bar/s] it can follow: what a valve can do may depend on the pressure."""
        ...

    def flow(self, state: Any, rate: Any) -> Any:
        """d(state)/dt under the commanded rate [bar/s], already limited."""
        ...

    def pressure(self, state: Any) -> Any:
        """Pressure at the wheel [bar]."""
        ...


def signals_of(plant: Plant, time, state, pressure, wheel_acceleration, vehicle_acceleration) -> Signals:
    """The signals of a true state, from w' [rad/s^2] and v' [m/s^2]."""
    speed = plant.speed_of(time, state)
    wheel_speed = plant.wheel_speed_of(state)
    slip = plant.wheel.slip(wheel_speed, speed)
    return Signals(
        vehicle_speed=speed,
        vehicle_acceleration=vehicle_acceleration,
        wheel_speed=wheel_speed,
        acceleration_offset=plant.wheel.radius * wheel_acceleration - vehicle_acceleration,
        radius=plant.wheel.radius,
        pressure=pressure,
        stiffness=plant.road.stiffness(slip, time, plant.position(time, state)),
        time=time,
    )
