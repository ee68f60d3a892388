"""What the adaptive observer is compared with: integration, and Kalman filters on the same signals.

The Kalman filters take the longitudinal velocity from the wheels as the observer does, and the accelerometers as it
does. Between samples, by forward Euler, with the two-track model

    vy' = theta f_y* / m - r vx        r' = theta f_r* / J

measured are r and ay = theta f_y* / m. The linear one has theta = 1 and F = C Fz l; the extended one has theta as a
random walk besides, and the friction model of the observer. Theta fixed at 1 is
`SideSlipObserver(adapts=False)`.
"""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from absjax.parameters import model, parameter, part
from absjax.sideslip.accelerometer import BodyAccelerometer
from absjax.sideslip.base import Estimate
from absjax.sideslip.car import Car, CarSample
from absjax.sideslip.forces import forces
from absjax.sideslip.friction import MonotoneFriction, TanhFriction
from absjax.sideslip.longitudinal import LongitudinalSpeed, WheelSpeeds


@model
class KinematicIntegration:
    """vx' = ax + r vy, vy' = ay - r vx, from what the wheels say at the first sample."""

    title: ClassVar[str] = "kinematic integration"

    accelerometer: BodyAccelerometer = part("what the accelerometers tell", default=BodyAccelerometer())

    def initial_state(self, car: Car, sample: CarSample):
        """(vx, vy)."""
        vx = jnp.mean(sample.wheel_speed) * car.radius
        return vx, 0.0 * vx

    def step(self, car: Car, state, sample: CarSample, period):
        """State after a period [s], and the estimate."""
        vx, vy = state
        ax, ay, r = self.accelerometer.level(sample)[:3]
        after = vx + period * (ax + r * vy), vy + period * (ay - r * vx)
        return after, Estimate(vx, vy, r, 1.0 + 0.0 * vx), ()


@model
class LinearFriction:
    """mu = C s: a linear tyre, which never saturates."""

    title: ClassVar[str] = "linear"

    stiffness_at_rest: Any = parameter("C", default=26.0, low=1.0, trainable=True, span=(8.0, 80.0))

    def friction(self, slip):
        """mu(s)."""
        return self.stiffness_at_rest * slip

    def stiffness(self, slip):
        """mu'."""
        return self.stiffness_at_rest + 0.0 * slip


class FilterState(NamedTuple):
    """State of a Kalman filter."""

    longitudinal_speed: Any
    """vx [m/s]"""
    mean: Any
    """(vy, r) or (vy, r, theta)"""
    covariance: Any
    wheels: WheelSpeeds


@model
class TwoTrackFilter:
    """The Kalman filter, linear or extended: `random_walk` says whether theta is a state."""

    title: ClassVar[str] = "Kalman filter"

    friction_model: MonotoneFriction = part("the tyres at theta = 1", default=LinearFriction())
    accelerometer: BodyAccelerometer = part("what the accelerometers tell", default=BodyAccelerometer())
    longitudinal: LongitudinalSpeed = part("the longitudinal velocity", default=LongitudinalSpeed())
    random_walk: bool = False
    """whether theta is estimated"""

    lateral_drift: Any = parameter(
        "density of what drives vy, m/s^1.5", default=0.3, low=0.0, open_low=True, trainable=True, span=(0.01, 5.0)
    )
    yaw_drift: Any = parameter(
        "of what drives r, rad/s^1.5", default=0.1, low=0.0, open_low=True, trainable=True, span=(0.003, 3.0)
    )
    friction_drift: Any = parameter(
        "of the random walk of theta, 1/s^0.5", default=0.2, low=0.0, open_low=True, trainable=True, span=(0.005, 2.0)
    )
    acceleration_noise: Any = parameter(
        "of ay, m/s^2", default=0.3, low=0.0, open_low=True, trainable=True, span=(0.02, 5.0)
    )
    yaw_noise: Any = parameter("of r, rad/s", default=0.01, low=0.0, open_low=True, trainable=True, span=(0.001, 0.3))
    start: Any = parameter("theta at the first sample", default=1.0, low=0.05, high=1.5)
    lowest: Any = parameter("theta_min", default=0.1, low=0.05, high=1.0)
    highest: Any = parameter("theta_max", default=1.0, low=0.5, high=1.5)

    def initial_state(self, car: Car, sample: CarSample) -> FilterState:
        """As the wheels roll, and no lateral velocity."""
        vx = jnp.mean(sample.wheel_speed) * car.radius
        mean, variance = [0.0 * vx, sample.yaw_rate], [0.01, 0.001]
        if self.random_walk:
            mean, variance = [*mean, self.start + 0.0 * vx], [*variance, 0.1]
        wheels = self.longitudinal.initial_state(car, self.accelerometer.level(sample))
        return FilterState(vx, jnp.stack(mean), jnp.diag(jnp.asarray(variance, vx.dtype)), wheels)

    def step(self, car: Car, state: FilterState, sample: CarSample, period):
        """State after a period [s], and the estimate before the sample."""
        level, vx = self.accelerometer.level(sample), state.longitudinal_speed
        loads = car.loads(level.longitudinal_acceleration, level.lateral_acceleration)

        def accelerations(mean):
            velocity = vx, mean[0], mean[1]
            found = forces(self.friction_model, car, velocity, level.steering_angle, level.wheel_speed, loads)
            theta = mean[2] if self.random_walk else 1.0
            return theta * found.lateral / car.mass, theta * found.yaw / car.yaw_inertia

        def measured(mean):
            return jnp.stack([accelerations(mean)[0], mean[1]])

        def ahead(mean):
            lateral, yaw = accelerations(mean)
            return mean + period * jnp.stack([lateral - mean[1] * vx, yaw, *(0.0 * mean[2:])])

        mean, covariance = state.mean, state.covariance
        slope = jax.jacfwd(measured)(mean)
        noise = jnp.diag(jnp.stack([self.acceleration_noise**2, self.yaw_noise**2]))
        gain = jnp.linalg.solve(slope @ covariance @ slope.T + noise, slope @ covariance).T
        told = jnp.stack([level.lateral_acceleration, level.yaw_rate])
        mean = self._kept(mean + gain @ (told - measured(mean)))
        left = jnp.eye(len(mean), dtype=mean.dtype) - gain @ slope
        covariance = left @ covariance @ left.T + gain @ noise @ gain.T
        drifts = [self.lateral_drift, self.yaw_drift, *([self.friction_drift] if self.random_walk else [])]
        step = jax.jacfwd(ahead)(mean)
        covariance = step @ covariance @ step.T + period * jnp.diag(jnp.stack(drifts) ** 2)
        theta = mean[2] if self.random_walk else 1.0 + 0.0 * vx
        stiffness = self.friction_model.stiffness(0.0 * vx)
        slope_x, wheels = self.longitudinal.step(car, state.wheels, level, vx, mean[0], theta, stiffness, period)
        after = FilterState(vx + period * slope_x, self._kept(ahead(mean)), covariance, wheels)
        before = state.mean[2] if self.random_walk else theta
        return after, Estimate(vx, state.mean[0], state.mean[1], before), ()

    def _kept(self, mean):
        return mean.at[2].set(jnp.clip(mean[2], self.lowest, self.highest)) if self.random_walk else mean


def linear_filter(**parts: Any) -> TwoTrackFilter:
    """The linear two-track Kalman filter, as tuned on five logs of a multi-body car."""
    values = {"lateral_drift": 0.04, "yaw_drift": 0.39, "acceleration_noise": 2.2, "yaw_noise": 0.0026}
    return TwoTrackFilter(**{"friction_model": LinearFriction(22.0), **values, **parts})


def extended_filter(**parts: Any) -> TwoTrackFilter:
    """The extended Kalman filter with theta as a random walk, as tuned on five logs of a multi-body car."""
    values = {"lateral_drift": 0.22, "yaw_drift": 0.46, "friction_drift": 0.21}
    noises = {"acceleration_noise": 2.0, "yaw_noise": 0.0016}
    return TwoTrackFilter(**{"friction_model": TanhFriction(51.0), "random_walk": True, **values, **noises, **parts})
