"""Observer of longitudinal and lateral velocity and yaw rate that adapts to the friction of the road.

With f_y*, f_r* the lateral force and yaw moment of the tyres at theta = 1, and ay~ = ay - theta f_y* / m,

    vx'    = ax + r vy + sum K_i (v_x,i - vx)
    vy'    = ay - r vx + Kvy Lambda xi m ay~ + G2/G1 zeta (r - r^)
    r^'    = theta f_r* / J + Kr (r - r^)
    theta' = G1 Kvy Lambda f_y* m (HP ay~) + G2 f_r* (r - r^),  HP = s / (s + 0.25)

by forward Euler, theta kept to [0.1, 1]. While the monitor says that excitation is low, theta' = (1 - theta) / 0.1
instead. Source: Grip et al. 2008, (4), (14) and section 8.1; where it leaves things open, the parts say what is ours.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter, part
from absjax.plant.wheel import GRAVITY
from absjax.sideslip.accelerometer import BodyAccelerometer
from absjax.sideslip.base import Estimate, Insight
from absjax.sideslip.car import Car, CarSample
from absjax.sideslip.choice import PublishedXi, XiRule, scaling
from absjax.sideslip.forces import Forces, forces
from absjax.sideslip.friction import MonotoneFriction, TanhFriction
from absjax.sideslip.longitudinal import LongitudinalSpeed, WheelSpeeds
from absjax.sideslip.monitor import Monitor, ScaledMonitor
from absjax.sideslip.offsets import OffsetAdaptation, Offsets


class SideSlipState(NamedTuple):
    """State of the observer."""

    longitudinal_speed: Any
    """vx [m/s]"""
    lateral_speed: Any
    """vy [m/s]"""
    yaw_rate: Any
    """r^ [rad/s]"""
    friction: Any
    """theta"""
    slow_residual: Any
    """what the high-pass takes off m ay~ [N]"""
    wheels: WheelSpeeds
    monitor: Any
    offsets: Offsets | None


@model
class SideSlipObserver:
    """The observer, composed of parts; gains as published, on the scale of the car."""

    title: ClassVar[str] = "adaptive observer"

    friction_model: MonotoneFriction = part("the tyres at theta = 1", default=TanhFriction())
    rule: XiRule = part("how xi is approximated", default=PublishedXi())
    monitor: Monitor = part("of the excitation", default=ScaledMonitor())
    accelerometer: BodyAccelerometer = part("what the accelerometers tell", default=BodyAccelerometer())
    longitudinal: LongitudinalSpeed = part("the longitudinal velocity", default=LongitudinalSpeed())
    offsets: OffsetAdaptation | None = part("bank and biases; None: not adapted", default=None)
    adapts: bool = True
    """whether theta is adapted; it stays at its start otherwise"""

    lateral_gain: Any = parameter("m Kvy", default=1.0, low=0.0, trainable=True, span=(0.1, 5.0))
    yaw_gain: Any = parameter("Kr, 1/s", default=40.0, low=0.0, trainable=True, span=(5.0, 60.0))
    friction_gain: Any = parameter(
        "G1, gain of theta", default=4.0, low=0.0, open_low=True, trainable=True, span=(0.5, 40.0)
    )
    yaw_friction_gain: Any = parameter(
        "J G2, gain of theta from the yaw rate", default=0.1, low=0.0, trainable=True, span=(0.01, 1.0)
    )
    start: Any = parameter("theta at the first sample", default=1.0, low=0.05, high=1.5)
    lowest: Any = parameter("theta_min", default=0.1, low=0.05, high=1.0)
    highest: Any = parameter("theta_max", default=1.0, low=0.5, high=1.5)
    washout: Any = parameter("corner of the high-pass, 1/s", default=0.25, low=0.0, trainable=True, span=(0.05, 2.0))
    target: Any = parameter("theta it is drawn to while excitation is low", default=1.0, low=0.1, high=1.5)
    pull: Any = parameter("time constant of that, s", default=0.1, low=0.02)

    def initial_state(self, car: Car, sample: CarSample) -> SideSlipState:
        """As the wheels roll, no lateral velocity, the measured yaw rate."""
        level = self.accelerometer.level(sample)
        vx = jnp.mean(sample.wheel_speed) * car.radius
        zero = 0.0 * vx
        theta = self.start + zero
        found = self.forces(car, (vx, zero, sample.yaw_rate), level)
        share = self.monitor.share(found, vx, self._stiffness(zero))
        return SideSlipState(
            vx,
            zero,
            sample.yaw_rate,
            theta,
            car.mass * level.lateral_acceleration - theta * found.lateral,
            self.longitudinal.initial_state(car, level),
            self.monitor.initial_state(share, level.lateral_acceleration),
            None if self.offsets is None else self.offsets.initial_state(vx),
        )

    def step(self, car: Car, state: SideSlipState, sample: CarSample, period):
        """State after a period [s], the estimate at the sample, and the `Insight` into it."""
        level, gravity = self._corrected(state.offsets, self.accelerometer.level(sample))
        vx, vy, r, theta = state[:4]
        ay, yaw_error = level.lateral_acceleration, level.yaw_rate - r
        found = self.forces(car, (vx, vy, r), level)
        expected, measured = theta * found.lateral, car.mass * ay
        xi = self.rule.xi(found.lateral_slope, found.lateral, expected, measured)
        scale, residual = scaling(xi, found.lateral), measured - expected
        injection = self.lateral_gain / car.mass * scale * xi * residual

        stiffness = self._stiffness(vx)
        share, low = self.monitor.share(found, vx, stiffness), self.monitor.low(state.monitor)
        wheels = self.longitudinal.step(car, state.wheels, level, vx, vy, theta, stiffness, period)
        coupling = self.yaw_friction_gain / car.yaw_inertia
        adapted = self.friction_gain * self.lateral_gain / car.mass * scale * found.lateral
        adapted = adapted * (residual - state.slow_residual) + coupling * found.yaw * yaw_error
        theta_slope = jnp.where(low, (self.target - theta) / self.pull, adapted)
        vy_slope = ay - level.yaw_rate * vx + gravity + injection
        vy_slope = vy_slope + coupling / self.friction_gain * found.yaw_slope * yaw_error
        offsets = state.offsets
        if self.offsets is not None and offsets is not None:
            rolling = wheels[0] - level.longitudinal_acceleration - level.yaw_rate * vy
            excess = ay - level.yaw_rate * vx
            offsets = self.offsets.step(offsets, injection, excess, residual / car.mass, rolling, share, period)
        after = SideSlipState(
            vx + period * wheels[0],
            vy + period * vy_slope,
            r + period * (theta * found.yaw / car.yaw_inertia + self.yaw_gain * yaw_error),
            jnp.clip(theta + period * theta_slope, self.lowest, self.highest) if self.adapts else theta,
            state.slow_residual + period * self.washout * (residual - state.slow_residual),
            wheels[1],
            self.monitor.step(state.monitor, share, ay, period),
            offsets,
        )
        insight = Insight(
            found.lateral, found.lateral_slope, xi, scale, residual / car.mass, low + 0.0 * vx, state.offsets
        )
        return after, Estimate(vx, vy, r, theta), insight

    def forces(self, car: Car, velocity, level: CarSample) -> Forces:
        """Forces at theta = 1 of velocities (vx, vy, r) and a sample with accelerations along the road."""
        loads = car.loads(level.longitudinal_acceleration, level.lateral_acceleration)
        return forces(self.friction_model, car, velocity, level.steering_angle, level.wheel_speed, loads)

    def _stiffness(self, like):
        return self.friction_model.stiffness(0.0 * like)

    def _corrected(self, offsets: Offsets | None, level: CarSample):
        """The sample without its biases, and the part of the weight along y [m/s^2]."""
        if offsets is None or self.offsets is None:
            return level, 0.0
        corrected = level._replace(
            longitudinal_acceleration=level.longitudinal_acceleration - offsets.longitudinal_bias,
            lateral_acceleration=level.lateral_acceleration - offsets.lateral_bias,
        )
        return corrected, -GRAVITY * jnp.sin(self.offsets.applied(offsets))


def published_gains(**parts: Any) -> SideSlipObserver:
    """Gains of the source for its vehicle A: m Kvy = 1, Kr = 40, G1 = 4, J G2 = 0.1 [8.2]."""
    return SideSlipObserver(**parts)


def better_gains(**parts: Any) -> SideSlipObserver:
    """Gains with less injection and a faster theta: m Kvy = 0.6, Kr = 40, G1 = 10, J G2 = 0.1."""
    return SideSlipObserver(**{"lateral_gain": 0.6, "friction_gain": 10.0, **parts})
