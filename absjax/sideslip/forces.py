"""Lateral force and yaw moment of the four tyres at theta = 1, and their slopes over the lateral velocity.

Over each wheel, with V = sqrt(wx^2 + wy^2 + 1),

    lx = (w R - wx) / V,  ly = -wy / V,  s = sqrt(lx^2 + ly^2 + 1e-8),  F = Fz mu(s) / s (lx, ly)

f_y* = sum of the lateral components in the axes of the car, f_r* = sum of x_i Fy_i - y_i Fx_i. Source: Grip et al.
2008, 2 and 5; the slip is regularised at standstill and at zero.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from absjax.sideslip.car import Car
from absjax.sideslip.friction import MonotoneFriction

SMALLEST_SPEED_SQUARED = 1.0
"""m^2/s^2"""
SMALLEST_SLIP_SQUARED = 1e-8


class Forces(NamedTuple):
    """Of all tyres together, at theta = 1."""

    lateral: jax.Array
    """f_y* [N]"""
    yaw: jax.Array
    """f_r* [N m]"""
    lateral_slope: jax.Array
    """df_y*/dvy [N s/m], never positive for a monotone friction but for large longitudinal slips under steering"""
    yaw_slope: jax.Array
    """df_r*/dvy [N s], zeta of the source"""


def forces(friction: MonotoneFriction, car: Car, velocity, steering_angle, wheel_speed, loads) -> Forces:
    """Forces of the tyres.

    Args:
        velocity: (vx, vy, r) [m/s, m/s, rad/s].
        steering_angle: delta [rad].
        wheel_speed: (4,) [rad/s].
        loads: (4,) [N].
    """
    vx, vy, yaw_rate = velocity
    wheel = car.wheel_motion(vx, vy, yaw_rate, steering_angle)
    speed = jnp.sqrt(wheel.along**2 + wheel.across**2 + SMALLEST_SPEED_SQUARED)
    slip_x, slip_y = (wheel_speed * car.radius - wheel.along) / speed, -wheel.across / speed
    slip = jnp.sqrt(slip_x**2 + slip_y**2 + SMALLEST_SLIP_SQUARED)
    used = friction.friction(slip) / slip

    # d/dvy: (wx, wy) moves by (sin, cos) of the wheel's angle.
    speed_slope = (wheel.along * wheel.sine + wheel.across * wheel.cosine) / speed
    slip_x_slope = -(wheel.sine + slip_x * speed_slope) / speed
    slip_y_slope = -(wheel.cosine + slip_y * speed_slope) / speed
    slip_slope = (slip_x * slip_x_slope + slip_y * slip_y_slope) / slip
    used_slope = (friction.stiffness(slip) - used) / slip * slip_slope

    def resultant(x, y):
        """Lateral force and yaw moment of forces in the axes of the wheels."""
        forward, sideways = wheel.cosine * x - wheel.sine * y, wheel.sine * x + wheel.cosine * y
        return jnp.sum(sideways), jnp.sum(car.ahead * sideways - car.left * forward)

    lateral, yaw = resultant(loads * used * slip_x, loads * used * slip_y)
    lateral_slope, yaw_slope = resultant(
        loads * (used_slope * slip_x + used * slip_x_slope), loads * (used_slope * slip_y + used * slip_y_slope)
    )
    return Forces(lateral, yaw, lateral_slope, yaw_slope)
