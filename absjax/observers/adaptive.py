"""The switched adaptive observer: XBS on a road of which nothing is known.

    w = (x2, XBS + (c/a) x2),  theta = (c, d),  c = c2,  d = c2 c3
    dw^/dt = A w^ + B u + Psi th^ + (K + Y G Y' C') (y - C w^)
    dth^/dt = G Y' C' (y - C w^)
    dY/dt = (A - K C) Y + Psi

    A = (y/v) [[0, -a], [0, 0]],  B = (-b, 0)',  C = (1, 0),  K = (y/v) K'(sign y)
    Psi = [[y^2/v, 0], [-(b/a) u, y/v]]

y/v is the rate of the slip. Of a tyre that takes a length sigma to build up its force it is that of the relaxed slip l,

    sigma d(l')/dt = y - v l'

the speed taken as constant over sigma, and l' stands for y/v above.
Source: Aguado-Rojas 2019, eq. 3.1-3.4 and 3.15; relaxation is ours.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.observers.certificate import Certificate, Condition, switched_certificate
from absjax.observers.gains import spectral_radius
from absjax.observers.switched import constant_stiffness
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel


class AdaptiveState(NamedTuple):
    """State of the adaptive observer; scalars per lane."""

    w1: jax.Array
    """estimate of x2, m/s^2"""
    w2: jax.Array
    """estimate of XBS + (c/a) x2"""
    c: jax.Array
    """estimate of c2"""
    d: jax.Array
    """estimate of c2 c3"""
    y11: jax.Array
    y12: jax.Array
    y21: jax.Array
    y22: jax.Array
    """the filtered regressor Y, row by row"""
    slip_rate: jax.Array | None = None
    """rate of the relaxed slip, l' [1/s]; None without relaxation"""


@model
class AdaptiveObserver:
    """Observer of XBS and of the road's c2 and c2 c3."""

    wheel: Wheel = part("wheel and brake as the observer knows them")
    plus: Any = parameter("K'+ = (k1+, k2+), gain while y > 0, shape (2,)", ndim=1)
    minus: Any = parameter("K'- = (k1-, k2-), gain while y < 0, shape (2,)", ndim=1)
    adaptation: Any = parameter("diagonal of G, shape (2,)", ndim=1, low=0.0)
    start_c: Any = parameter("c^ at the start", default=50.0, low=0.0)
    start_d: Any = parameter("d^ at the start", default=2.5, low=0.0)
    relaxation: Any = parameter(
        "sigma, relaxation length of the tyre, m; None: none, not 0", default=None, low=0.0, open_low=True
    )

    @classmethod
    def placed(cls, wheel: Wheel, factor, adaptation, ratio: Any = 1.0, **others: Any) -> "AdaptiveObserver":
        """The observer by pole placement.

        Args:
            wheel: wheel and brake as the observer knows them.
            factor: (p, q) > 0 of the characteristic polynomial s^2 + p s + q of A+: k1+ = p, k2+ = -q/a.
            adaptation: diagonal of G, (2,), positive.
            ratio: rho > 0; 1 gives k1- = -k1+, k2- = k2+ (Aguado-Rojas 2019, eq. 3.20).
            others: further fields.
        """
        gains = constant_stiffness(wheel).gains([factor], ratio)
        return cls(wheel, gains.plus, gains.minus, jnp.asarray(adaptation), **others)

    def certificate(self) -> Certificate:
        """What is known of its stability: that of the injection, and adaptation gains that are positive."""
        names = "G: adaptation of c", "G: adaptation of d"
        gains = [Condition(n, float(g), 0.0, np.inf) for n, g in zip(names, np.asarray(self.adaptation))]
        return switched_certificate(constant_stiffness(self.wheel).A, self.plus, self.minus, gains)

    def initial_state(self, y) -> AdaptiveState:
        """State before anything is known: the measured y [m/s^2], XBS 0, the road at the start values."""
        zero = 0.0 * y
        c = zero + self.start_c
        rate = None if self.relaxation is None else zero
        return AdaptiveState(y, c / self.wheel.slip_gain * y, c, zero + self.start_d, zero, zero, zero, zero, rate)

    def slip_rate(self, state: AdaptiveState, y, speed):
        """y/v, or that of the relaxed slip [1/s]."""
        return y / speed if state.slip_rate is None else state.slip_rate

    def flow(self, state: AdaptiveState, y, speed, rate) -> AdaptiveState:
        """d(state)/dt from y [m/s^2], v [m/s] and dPb/dt [bar/s]."""
        a, b = self.wheel.slip_gain, self.wheel.pressure_gain
        s, error, (g1, g2) = self.slip_rate(state, y, speed), y - state.w1, self.adaptation
        k1, k2 = jnp.where(s > 0, self.plus, self.minus)
        learn_c, learn_d = g1 * state.y11 * error, g2 * state.y12 * error
        return AdaptiveState(
            w1=s * (y * state.c - a * state.w2 + k1 * error) - b * rate + state.y11 * learn_c + state.y12 * learn_d,
            w2=s * (state.d + k2 * error) - b / a * rate * state.c + state.y21 * learn_c + state.y22 * learn_d,
            c=learn_c,
            d=learn_d,
            y11=s * (y - k1 * state.y11 - a * state.y21),
            y12=s * (-k1 * state.y12 - a * state.y22),
            y21=-s * k2 * state.y11 - b / a * rate,
            y22=s * (1 - k2 * state.y12),
            slip_rate=None if state.slip_rate is None else (y - speed * s) / self.relaxation,
        )

    def stiffness(self, state: AdaptiveState, y):
        """Estimated XBS: w2^ - (c^/a) y."""
        return state.w2 - state.c / self.wheel.slip_gain * y

    def fastest_rate(self, state: AdaptiveState, y, speed):
        """Fastest rate of the error dynamics [1/s], of injection and adaptation (Y G Y' C' C); arrays broadcast."""
        linear = constant_stiffness(self.wheel)
        plus, minus = (spectral_radius(linear.A - jnp.outer(K, linear.C)) for K in (self.plus, self.minus))
        s = self.slip_rate(state, y, speed)
        injection = jnp.abs(s) * jnp.where(s > 0, plus, minus)
        return injection + self.adaptation[0] * state.y11**2 + self.adaptation[1] * state.y12**2
