"""A four-wheel car whose wheels turn and are steered as a log has them: what its body does then."""

import dataclasses
from typing import Any

import jax.numpy as jnp

from absjax.hybrid.system import Smooth
from absjax.parameters import model, parameter, part
from absjax.plant.base import Road
from absjax.plant.four_wheel import FourWheel, FourWheelState, PlanarMotion
from absjax.plant.steering import FixedSteering


@model
class ScaledRoad:
    """A road with a share of the friction of another, its slope along with it."""

    road: Road = part("the other one")
    scale: Any = parameter("friction over that of the other", default=1.0, low=0.0, open_low=True)

    def friction(self, slip, time, distance):
        """mu(lambda)."""
        return self.scale * self.road.friction(slip, time, distance)

    def stiffness(self, slip, time, distance):
        """XBS."""
        return self.scale * self.road.stiffness(slip, time, distance)

    def peak_friction(self, time, distance):
        """Largest friction to be had."""
        return self.scale * self.road.peak_friction(time, distance)


@model
class DrivenCar(Smooth):
    """The body of a car on imposed wheel speeds and an imposed steering angle, straight between samples.

    The dynamics of the wheels, brakes and engine are left out: what they do is in the wheel speeds. A rollout keeps its
    order if the period is a multiple of its step.
    """

    car: FourWheel = part("the car; its own steering is not used")
    period: Any = parameter("of the samples, the first at time 0, s", low=0.0, open_low=True)
    wheel_speeds: Any = parameter("w, (samples, 4) [rad/s]", ndim=2)
    angles: Any = parameter("delta, (samples,) [rad]", ndim=1)

    def _between(self, time, samples):
        count = samples.shape[0]
        place = jnp.clip(time / self.period, 0.0, count - 1.0)
        # Rounding leaves a grid point on either side: both sides agree there.
        before = jnp.clip(jnp.floor(place).astype(jnp.int32), 0, count - 2)
        share = place - before
        return (1 - share) * samples[before] + share * samples[before + 1]

    def initial_state(self, speed, lateral=0.0, yaw_rate=0.0) -> FourWheelState:
        """State of a car that moves so, its tyres without slip; the wheels are the log's."""
        state = self.car.initial_state(speed)
        zero = 0.0 * speed
        motion = PlanarMotion(speed, zero + lateral, zero + yaw_rate, zero, zero)
        return state._replace(motion=motion, wheel_speeds=(), steering=())

    def flow(self, time, state: FourWheelState, mode) -> FourWheelState:
        """d(state)/dt."""
        speeds = self._between(time, self.wheel_speeds)
        steered = dataclasses.replace(self.car, steering=FixedSteering(self._between(time, self.angles)))
        full = state._replace(wheel_speeds=tuple(speeds[i] for i in range(4)))
        slope = steered.flow(time, full, (0.0,) * 4)
        return slope._replace(wheel_speeds=())
