"""Who turns the steering wheel: nobody, a signal, or a driver who keeps the car from turning.

The angle is that of the road wheels in front, positive to the left.
"""

from itertools import pairwise
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np

from absjax.parameters import concrete, model, parameter


class Steering(Protocol):
    """What a steered vehicle asks: a class made by `absjax.parameters.model`; its state is a pytree of scalars."""

    def initial_state(self, speed: Any) -> Any:
        """State of driving straight ahead at `speed` [m/s]."""
        ...

    def angle(self, time: Any, state: Any) -> Any:
        """delta [rad]."""
        ...

    def flow(self, time: Any, state: Any, yaw_rate: Any, yaw: Any) -> Any:
        """d(state)/dt, of r [rad/s] and the yaw angle [rad]."""
        ...

    def scales(self, state: Any) -> Any:
        """As of `absjax.plant.vehicle.Vehicle`."""
        ...


class _Given:
    """An angle that depends on nothing but time."""

    def initial_state(self, speed):
        """None."""
        return ()

    def flow(self, time, state, yaw_rate, yaw):
        """None."""
        return ()

    def scales(self, state):
        """None."""
        return ()


@model
class FixedSteering(_Given):
    """A steering wheel that is held."""

    at: Any = parameter("delta, rad", default=0.0, low=-1.2, high=1.2)

    def angle(self, time, state):
        """delta [rad]."""
        return self.at + 0.0 * time


@model
class SteeringTable(_Given):
    """Angles at instants, straight between them, the first before and the last behind.

    A rollout keeps its order if the instants lie on its grid.

    Raises:
        ValueError: at construction, unless there are as many angles as instants, two at least, and the instants rise.
    """

    times: tuple[Any, ...] = parameter("instants, s")
    angles: tuple[Any, ...] = parameter("delta at them, rad", low=-1.2, high=1.2)

    def __post_init__(self):
        if len(self.times) != len(self.angles) or len(self.times) < 2:
            raise ValueError(f"SteeringTable has {len(self.times)} times for {len(self.angles)} angles; two at least")
        if all(map(concrete, self.times)) and not all(np.all(np.less(a, b)) for a, b in pairwise(self.times)):
            raise ValueError(f"SteeringTable.times = {self.times} must rise")

    def angle(self, time, state):
        """delta [rad]."""
        angle = self.angles[0] + 0.0 * time
        for (begin, end), (before, after) in zip(pairwise(self.times), pairwise(self.angles)):
            angle = angle + jnp.clip((time - begin) / (end - begin), 0.0, 1.0) * (after - before)
        return angle


@model
class YawDriver:
    """A driver who steers against the yaw rate and the yaw angle, late and within what the arms can do.

    lag delta' = A tanh(-(K r + Kp psi) / A) - delta
    """

    yaw_gain: Any = parameter("K, rad per rad/s of yaw rate", default=0.4, low=0.0)
    heading_gain: Any = parameter("Kp, rad per rad of yaw angle", default=0.8, low=0.0)
    lag: Any = parameter("s", default=0.15, low=0.0, open_low=True)
    largest: Any = parameter("A, largest angle, rad", default=0.25, low=0.0, high=1.2, open_low=True)

    def initial_state(self, speed):
        """delta: straight ahead."""
        return 0.0 * speed

    def angle(self, time, state):
        """delta [rad]."""
        return state

    def flow(self, time, state, yaw_rate, yaw):
        """delta' [rad/s]."""
        wanted = -(self.yaw_gain * yaw_rate + self.heading_gain * yaw)
        return (self.largest * jnp.tanh(wanted / self.largest) - state) / self.lag

    def scales(self, state):
        """An angle rests at zero."""
        return 0.01 + 0.0 * state
