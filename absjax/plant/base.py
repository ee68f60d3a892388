"""What a loop asks of the thing that is braked, and what that asks of a road."""

from typing import Protocol

import jax

from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class Road(Protocol):
    """What a vehicle asks of a road."""

    def friction(self, slip: jax.Array, time: jax.Array, distance: jax.Array) -> jax.Array:
        """mu(lambda) at `time` [s] and `distance` [m]."""
        ...

    def stiffness(self, slip: jax.Array, time: jax.Array, distance: jax.Array) -> jax.Array:
        """XBS = mu'(lambda) at `time` [s] and `distance` [m]."""
        ...

    def peak_friction(self, time: jax.Array, distance: jax.Array) -> jax.Array:
        """Largest friction to be had at `time` [s] and `distance` [m]."""
        ...


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


def signals_of(plant: Plant, time, state, pressure, wheel_acceleration, vehicle_acceleration) -> Signals:
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
