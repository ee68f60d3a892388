"""The car an observer of side-slip knows: geometry, mass, wheels, and the loads on them.

ISO axes: x forward, y left, yaw rate positive to the left. Wheels in the order front left, front right, rear left,
rear right; arrays of them have the axis (4,).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.plant.wheel import GRAVITY

LEAST_LOAD = 0.02
"""Smallest load of a wheel, as a share of the weight of the car."""


class CarSample(NamedTuple):
    """What the sensors of a car tell at an instant; scalars, or arrays (samples,) of a log."""

    longitudinal_acceleration: Any
    """on the body, m/s^2"""
    lateral_acceleration: Any
    """on the body, m/s^2"""
    yaw_rate: Any
    """r [rad/s]"""
    steering_angle: Any
    """delta at the road wheels in front [rad]"""
    wheel_speed: Any
    """w [rad/s], (4,) or (samples, 4)"""


class WheelMotion(NamedTuple):
    """Velocity over the wheel centres in the axes of the wheels [m/s], (4,), and the directions of those axes."""

    along: jax.Array
    across: jax.Array
    sine: jax.Array
    """sin(delta_i)"""
    cosine: jax.Array
    """cos(delta_i)"""


@model
class Car:
    """A car on four wheels, steered in front."""

    mass: Any = parameter("m, kg", low=0.0, open_low=True)
    yaw_inertia: Any = parameter("J about the vertical axis, kg m^2", low=0.0, open_low=True)
    to_front: Any = parameter("from the centre of gravity to the front axle, m", low=0.0, open_low=True)
    to_rear: Any = parameter("from the centre of gravity to the rear axle, m", low=0.0, open_low=True)
    track_front: Any = parameter("T in front, m", low=0.0, open_low=True)
    track_rear: Any = parameter("T behind, m", low=0.0, open_low=True)
    height: Any = parameter("h of the centre of gravity, m", low=0.0)
    radius: Any = parameter("R of the wheels, m", low=0.0, open_low=True)
    driven_front: Any = parameter("1 if the front wheels are driven, else 0", default=1.0, low=0.0, high=1.0)
    driven_rear: Any = parameter("1 if the rear wheels are driven, else 0", default=0.0, low=0.0, high=1.0)

    @property
    def ahead(self):
        """x_i of the wheels, (4,) [m]."""
        return jnp.stack([self.to_front, self.to_front, -self.to_rear, -self.to_rear])

    @property
    def left(self):
        """y_i of the wheels, (4,) [m]."""
        return jnp.stack([self.track_front, -self.track_front, self.track_rear, -self.track_rear]) / 2

    @property
    def driven(self):
        """1 for each driven wheel, (4,)."""
        return jnp.stack([self.driven_front, self.driven_front, self.driven_rear, self.driven_rear])

    def steered(self, angle):
        """Angles of the wheels, (4,)."""
        return jnp.stack([angle, angle, 0.0 * angle, 0.0 * angle])

    def loads(self, longitudinal, lateral):
        """Vertical loads (4,) [N] from the accelerations of the body: m (b g -+ h ax) / L (1/2 -+ h ay / (g T)).

        At least `LEAST_LOAD` of the weight.
        """
        base = self.to_front + self.to_rear
        front = self.mass * (self.to_rear * GRAVITY - self.height * longitudinal) / base
        rear = self.mass * (self.to_front * GRAVITY + self.height * longitudinal) / base
        roll = self.height * lateral / (2 * GRAVITY * self.left)
        loads = jnp.stack([front, front, rear, rear]) * (0.5 - roll)
        return jnp.maximum(loads, LEAST_LOAD * self.mass * GRAVITY)

    def wheel_motion(self, longitudinal, lateral, yaw_rate, angle) -> WheelMotion:
        """Motion over the wheels of a car with the velocities (vx, vy), the yaw rate and the steering angle."""
        angles = self.steered(angle)
        sine, cosine = jnp.sin(angles), jnp.cos(angles)
        forward, sideways = longitudinal - yaw_rate * self.left, lateral + yaw_rate * self.ahead
        return WheelMotion(cosine * forward + sine * sideways, cosine * sideways - sine * forward, sine, cosine)
