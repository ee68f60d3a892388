"""Longitudinal velocity from four wheel speeds and the accelerometer, first line of (14).

    vx' = ax + r vy + sum K_i (v_x,i - vx)
    v_x,i = ((w R - sin d (vy + r x_i)) / cos d + r y_i) / (1 + clip(l, +-0.15)),  l = ax_f / (g C max(theta, 0.2))

Each wheel counts by how near it is to what is known already: its speed, its acceleration, and how hard the car
brakes or drives; a driven wheel less while the car speeds up. ax_f is ax through 1 / (0.1 s + 1). The source refers
to a paper of its own for K_i; these are ours.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.plant.wheel import GRAVITY
from absjax.sideslip.car import Car, CarSample

LARGEST_SLIP, LEAST_FRICTION = 0.15, 0.2


class WheelSpeeds(NamedTuple):
    """State of the longitudinal velocity's part beside vx."""

    acceleration: Any
    """ax_f [m/s^2]"""
    velocity: Any
    """v_x,i at the sample before, (4,) [m/s]"""
    began: Any
    """1 from the second sample on"""


@model
class LongitudinalSpeed:
    """Gains of the wheels."""

    gain: Any = parameter("largest gain of a wheel, 1/s", default=3.0, low=0.0, trainable=True, span=(0.3, 10.0))
    least: Any = parameter("smallest share of it", default=0.01, low=0.0, high=1.0)
    speed_scale: Any = parameter("deviation of a wheel's speed that halves it, m/s", default=0.25, low=1e-3)
    acceleration_scale: Any = parameter("deviation of its acceleration that does, m/s^2", default=2.0, low=1e-2)
    braking_scale: Any = parameter("acceleration of the car that does, m/s^2", default=3.0, low=1e-2)
    lag: Any = parameter("time constant of ax_f, s", default=0.1, low=0.02)
    driving: Any = parameter("ax_f beyond which driven wheels count less, m/s^2", default=0.2, low=0.0)
    driven_share: Any = parameter("share of the gain they keep", default=0.2, low=0.0, high=1.0)

    def initial_state(self, car: Car, sample: CarSample) -> WheelSpeeds:
        """State at the first sample."""
        acceleration = sample.longitudinal_acceleration
        return WheelSpeeds(acceleration, sample.wheel_speed * car.radius, 0.0 * acceleration)

    def step(self, car: Car, state: WheelSpeeds, sample: CarSample, vx, vy, theta, stiffness, period):
        """d(vx)/dt [m/s^2], and the state after a period [s].

        Args:
            sample: with accelerations as they are to be taken.
            vx: estimate of the longitudinal velocity.
            vy: of the lateral velocity.
            theta: of the friction parameter.
            stiffness: C = mu'(0).
        """
        ax, r = sample.longitudinal_acceleration, sample.yaw_rate
        angles = car.steered(sample.steering_angle)
        over = (sample.wheel_speed * car.radius - jnp.sin(angles) * (vy + r * car.ahead)) / jnp.cos(angles)
        slip = state.acceleration / (GRAVITY * stiffness * jnp.maximum(theta, LEAST_FRICTION))
        velocity = (over + r * car.left) / (1 + jnp.clip(slip, -LARGEST_SLIP, LARGEST_SLIP))
        known = ax + r * vy
        change = jnp.where(state.began > 0, (velocity - state.velocity) / period, known)
        trusted = 1 / (1 + ((velocity - vx) / self.speed_scale) ** 2)
        trusted = trusted / (1 + ((change - state.acceleration - r * vy) / self.acceleration_scale) ** 2)
        trusted = trusted / (1 + (state.acceleration / self.braking_scale) ** 2)
        gains = self.gain * jnp.maximum(trusted, self.least)
        drives = jnp.where(state.acceleration > self.driving, car.driven, 0.0)
        gains = gains * (1 - (1 - self.driven_share) * drives)
        lagged = state.acceleration + period / self.lag * (ax - state.acceleration)
        return known + jnp.sum(gains * (velocity - vx)), WheelSpeeds(lagged, velocity, 1.0 + 0.0 * state.began)
