"""The switched observer for systems linear up to a time scale that changes sign, and its XBS instances.

    dz/dt = s (A z) + B u,  y = C z,  s = y / v
    dz^/dt = s (A z^ + K (y - C z^)) + B u,  K = K+ for y > 0, K- for y < 0

with y = x2 the wheel acceleration offset, v the vehicle speed, u = dPb/dt. The injected term is
continuous in y, so that no switching has to be located.
Source: Hoang 2014 (thesis), eq. 4.2-4.6; Hoang et al. 2014, eq. 8 and 20.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.observers.certificate import Certificate, switched_certificate
from absjax.observers.gains import GainPair, characteristic, partner, place, spectral_radius
from absjax.parameters import model, parameter
from absjax.plant.wheel import Wheel


class LinearModel(NamedTuple):
    """A system dz/dt = s A z + B u with y = z_1 and XBS = z_2."""

    A: Any
    """(n, n)"""
    B: Any
    """(n,)"""

    @property
    def C(self):
        """Row of the output, (n,): y = z_1."""
        return jnp.eye(self.A.shape[0])[0]

    def gains(self, factors: Sequence[Sequence[Any]], ratio: Any = 1.0) -> GainPair:
        """Gains by pole placement.

        Args:
            factors: monic factors of the characteristic polynomial of A+, see
                `absjax.observers.gains.characteristic`; positive coefficients make every one stable.
            ratio: rho > 0; 1 gives A- the same spectrum.
        """
        return partner(self.A, self.C, place(self.A, self.C, characteristic(*factors)), ratio)


def constant_stiffness(wheel: Wheel) -> LinearModel:
    """z = (x2, XBS) with XBS constant. Source: Hoang 2014, eq. 2.1 (after Ono et al. 2003)."""
    return LinearModel(_matrix([[0.0, -wheel.slip_gain], [0.0, 0.0]]), _input(wheel, 2))


def known_road(wheel: Wheel, c2: Any) -> LinearModel:
    """z = (x2, XBS, c2 c3) on a Burckhardt road whose c2 is known. Source: Hoang et al. 2014, eq. 7."""
    return LinearModel(_matrix([[0.0, -wheel.slip_gain, 0.0], [0.0, c2, 1.0], [0.0, 0.0, 0.0]]), _input(wheel, 3))


def unknown_road(wheel: Wheel, rate1: Any = 22.0, rate2: Any = 52.0) -> LinearModel:
    """z = (x2, mu', mu'', d1 d2 th0) on a road of the exponential basis with rates d1, d2.

    Between d1 and d2 lies the c2 of the roads it is meant for: 24 to 50 with the published rates.
    Source: Hoang et al. 2014, eq. 20.
    """
    rows = [[0.0, -wheel.slip_gain, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -rate1 * rate2, rate1 + rate2, 1.0]]
    return LinearModel(_matrix([*rows, [0.0] * 4]), _input(wheel, 4))


def _matrix(rows):
    return jnp.stack([jnp.stack([jnp.asarray(entry, jnp.result_type(float)) for entry in row]) for row in rows])


def _input(wheel: Wheel, n: int):
    return jnp.zeros(n).at[0].set(-wheel.pressure_gain)


@model
class SwitchedObserver:
    """Observer of XBS with a gain for either sign of y; its state is a tuple of n scalars."""

    A: Any = parameter("A, in the scaled time, shape (n, n)", ndim=2)
    B: Any = parameter("B, input of the pressure rate, shape (n,)", ndim=1)
    plus: Any = parameter("K+, gain while y > 0, shape (n,)", ndim=1)
    minus: Any = parameter("K-, gain while y < 0, shape (n,)", ndim=1)

    @classmethod
    def placed(cls, linear: LinearModel, factors: Sequence[Sequence[Any]], ratio: Any = 1.0) -> "SwitchedObserver":
        """The observer of a model, by pole placement (`LinearModel.gains`)."""
        gains = linear.gains(factors, ratio)
        return cls(linear.A, linear.B, gains.plus, gains.minus)

    def certificate(self) -> Certificate:
        """What is known of its stability."""
        return switched_certificate(self.A, self.plus, self.minus)

    def initial_state(self, y) -> tuple[jax.Array, ...]:
        """State before anything is known: the measured y [m/s^2], all else zero."""
        zero = 0.0 * y
        return (y,) + (zero,) * (self.B.shape[-1] - 1)

    def flow(self, state, y, speed, rate) -> tuple[jax.Array, ...]:
        """d(state)/dt from y [m/s^2], v [m/s] and dPb/dt [bar/s]."""
        n, error = len(state), y - state[0]
        K = jnp.where(y > 0, self.plus, self.minus)
        return tuple(
            y / speed * (sum(self.A[i, j] * state[j] for j in range(n)) + K[i] * error) + self.B[i] * rate
            for i in range(n)
        )

    def stiffness(self, state, y):
        """Estimated XBS."""
        return state[1]

    def fastest_rate(self, state, y, speed):
        """Fastest rate of the error dynamics, 1/s; arrays broadcast."""
        C = jnp.eye(self.B.shape[-1])[0]
        plus, minus = (spectral_radius(self.A - jnp.outer(K, C)) for K in (self.plus, self.minus))
        return jnp.abs(y) / speed * jnp.where(y > 0, plus, minus)
