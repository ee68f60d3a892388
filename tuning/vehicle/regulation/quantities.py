"""What the regulation reckons with: braking rates of times, adhesion of braking rates, and what is demanded of them.

    z = (v1 - v2) / (g t)                                    0.566 / t from 40 to 20 km/h, 0.849 / t from 45 to 15
    F_fdyn = F_1 + (h/E) z P,    F_rdyn = F_2 - (h/E) z P
    k_f = (z_m P - D_r) / (F_1 + (h/E) z_m P),    k_r = (z_m P - D_f) / (F_2 - (h/E) z_m P)
    k_M = (k_f F_fdyn + k_r F_rdyn) / P,    epsilon = z_AL / k_M

P is the weight, F_1 and F_2 the static loads of the axles, E the wheelbase, h the height of the centre of gravity; D is
what the axle that is not braked holds back. The regulation has its rolling resistance there, 0.010 F of a driven and
0.015 F of a free axle. The model's wheels have none: what they have is inertia, and push, D = -(J / R^2) z g of each.
So k is that of the road, and no less is demanded.
Source: UN Regulation No. 13-H, Annex 6, paragraphs 5.2 and 5.3, Appendix 2.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.plant.two_axle import TwoAxle
from absjax.plant.wheel import GRAVITY

KMH = 1 / 3.6
"""m/s"""
UTILISATION = 0.75
"""Least epsilon (5.2), and least share of the adhesion of a split road (5.3.5)."""
LARGEST_UTILISATION = 1.10
"""Epsilon above which k has to be measured anew (5.2.1)."""
MARGIN = 0.05
"""Share by which a screening asks for more than the regulation does, as a second verdict."""


def time_at(time, speed, level):
    """When the speed first falls below a level [s]; infinite where it never does.

    Straight between the points; differentiable by them.

    Args:
        time: (points,), s.
        speed: (points,), m/s.
        level: m/s.
    """
    below = speed < level
    after = jnp.maximum(jnp.argmax(below), 1)
    before = after - 1
    lost = speed[before] - speed[after]
    share = safe_divide(speed[before] - level, lost, lost > 0)
    return jnp.where(below.any(), time[before] + share * (time[after] - time[before]), jnp.inf)


def braking_rate(time, speed, high, low):
    """Mean deceleration over g between two speeds [m/s]; 0 where the lower is not reached."""
    first, last = time_at(time, speed, high), time_at(time, speed, low)
    reached = jnp.isfinite(last) & (last > first)
    return safe_divide((high - low) / GRAVITY, jnp.where(reached, last - first, 1.0), reached)


def mean_rate(rates):
    """Of the mean time of several tests, (..., tests): of z = c / t the harmonic mean; 0 if one of them is."""
    sound = (rates > 0).all(axis=-1)
    return jnp.where(sound, 1 / jnp.mean(1 / jnp.where(rates > 0, rates, 1.0), axis=-1), 0.0)


class Weights(NamedTuple):
    """Of a car."""

    weight: Any
    """P [N]"""
    front: Any
    """F_1 [N]"""
    rear: Any
    """F_2 [N]"""
    transfer: Any
    """h / E"""
    pushes: tuple[Any, ...]
    """(J / R^2) of the wheels of each axle over the mass"""

    @classmethod
    def of(cls, car: TwoAxle) -> "Weights":
        """Of a model."""
        front, rear = car.wheels
        pushes = tuple(axle.inertia / axle.radius**2 / car.mass for axle in car.axles)
        return cls(car.mass * GRAVITY, front.load, rear.load, car.height / car.wheelbase, pushes)

    def dynamic(self, rate):
        """F_fdyn, F_rdyn [N] at a braking rate."""
        moved = self.transfer * rate * self.weight
        return self.front + moved, self.rear - moved

    def adhesion(self, axle: int, rate):
        """k of an axle, 0 in front or 1 behind, that alone brakes at a rate."""
        held_back = -self.pushes[1 - axle] * rate * self.weight
        return (rate * self.weight - held_back) / self.dynamic(rate)[axle]

    def mean_adhesion(self, adhesions, rate):
        """k_M of (k_f, k_r) at the rate under anti-lock."""
        front, rear = self.dynamic(rate)
        return (adhesions[0] * front + adhesions[1] * rear) / self.weight

    def utilisation(self, adhesions, rate):
        """epsilon of the rate z_AL."""
        return rate / self.mean_adhesion(adhesions, rate)


def split_demands(high, low):
    """What z_MALS has to be at least on a road of adhesions k_H and k_L: 0.75 (4 k_L + k_H) / 5, and k_L (5.3.5)."""
    return UTILISATION * (4 * low + high) / 5, low
