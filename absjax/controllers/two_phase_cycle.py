"""The limit cycle of the two-phase algorithm on a known XBS, in closed form.

In the time s of ds = dt / v, with z1* = -+zref, the acceleration offset and XBS follow

    z1' = -kp (z1 - z1*),  z2' = (c z2 + d) z1

With zeta = z1 / zref, alpha = kp and kappa = ln((d + c chi_a) / (d + c chi_b)) / (c zref) < 0 the Poincare map at
the beginning of the release is P = phi4 . phi3 . phi2 . phi1,

    phi1 = zeta + ln(1 - zeta) - 1 + alpha kappa,  phi2 = 1 + W0(-exp(phi1))
    phi3 = -phi2 + ln(1 + phi2) - 1 + alpha kappa,  phi4 = -1 - W0(-exp(phi3))

Its one fixed point is zeta = -r with 2 (atanh r - r) = alpha |kappa|. With r = tanh q it is contracted by
P' = ((1 - r) / (1 + r))^2 = exp(-4 q) < 1, whatever kp > 0, and the cycle takes s = 4 q / kp. The condition
kp > (1/2 - ln 2) / kappa of the source is sufficient, not necessary.
Source: Aguado-Rojas 2019, section 4.3, eq. 4.5 to 4.18; the fixed point is worked out here.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax.controllers._lambert import lambert_w0
from absjax.parameters import concrete

ITERATIONS = 12
SUFFICIENT = math.log(2) - 0.5
"""kp |kappa| above which the bounds of the source prove the contraction."""


class TwoPhaseCycle(NamedTuple):
    """A limit cycle; arrays of one shape.

    Attributes:
        kappa: of the thresholds and the road [s^2/m].
        offset: z1 at the beginning of the release [m/s^2]; at that of the apply it is the opposite.
        contraction: derivative of the Poincare map, in (0, 1).
        period: of the scaled time s [s^2/m]; times the vehicle speed in m/s it is in seconds.
        sufficient_gain: kp above which the condition of the source holds [m/s^2].
    """

    kappa: Any
    offset: Any
    contraction: Any
    period: Any
    sufficient_gain: Any


def kappa_of(c, d, zref, chi_a, chi_b):
    """kappa of eq. 4.14 [s^2/m].

    Args:
        c: c2 of the road.
        d: c2 c3 of the road.
        zref: acceleration offset followed, m/s^2.
        chi_a: lower threshold on XBS.
        chi_b: upper threshold on XBS.

    Raises:
        ValueError: unless c > 0, zref > 0, and -d/c < chi_a < chi_b: XBS of that road never falls to chi_a.
    """
    for name, value in (("c", c), ("zref", zref)):
        _require_positive(name, value)
    if all(map(concrete, (c, d, chi_a, chi_b))):
        least = -np.asarray(d) / np.asarray(c)
        if not np.all((np.asarray(chi_a) > least) & (np.asarray(chi_a) < np.asarray(chi_b))):
            raise ValueError(f"chi_a = {chi_a} must be above -d/c = {least} and below chi_b = {chi_b}")
    return _kappa(c, d, zref, chi_a, chi_b)


@jax.jit
def _kappa(c, d, zref, chi_a, chi_b):
    return jnp.log((d + c * chi_a) / (d + c * chi_b)) / (c * zref)


def _require_positive(name: str, value) -> None:
    if concrete(value) and not np.all(np.asarray(value) > 0):
        raise ValueError(f"{name} = {value} must be positive")


@jax.jit
def poincare_map(zeta, alpha, kappa):
    """One cycle from zeta = z1 / zref < 0 at the beginning of the release to the next, by Lambert's W [eq. 4.13]."""
    delta1 = zeta + jnp.log(1 - zeta) - 1 + alpha * kappa
    turned = 1 + lambert_w0(-jnp.exp(delta1))
    delta2 = -turned + jnp.log(1 + turned) - 1 + alpha * kappa
    return -1 - lambert_w0(-jnp.exp(delta2))


def two_phase_cycle(c, d, *, zref, gain, chi_a, chi_b) -> TwoPhaseCycle:
    """The limit cycle of a two-phase controller on a road; arguments broadcast, differentiable.

    Args:
        c: c2 of the road.
        d: c2 c3 of the road.
        zref: acceleration offset followed, m/s^2.
        gain: kp, with which it is followed, m/s^2.
        chi_a: lower threshold on XBS.
        chi_b: upper threshold on XBS.

    Raises:
        ValueError: unless c, zref and gain are positive and -d/c < chi_a < chi_b.
    """
    _require_positive("gain", gain)
    return _cycle(kappa_of(c, d, zref, chi_a, chi_b), zref, gain)


@jax.jit
def _cycle(kappa, zref, gain) -> TwoPhaseCycle:
    half = -0.5 * gain * kappa
    # q - tanh q = alpha |kappa| / 2: convex and rising, with q - tanh q near q^3 / 3 for small q.
    fixed = lax.stop_gradient(jnp.asarray(half))

    def newton(_, q):
        return q - (q - jnp.tanh(q) - fixed) / jnp.tanh(q) ** 2

    q = lax.stop_gradient(lax.fori_loop(0, ITERATIONS, newton, jnp.minimum(fixed + 1, (5 * fixed) ** (1 / 3))))
    q = q + (half - fixed) / jnp.tanh(q) ** 2
    fields = kappa, -zref * jnp.tanh(q), jnp.exp(-4 * q), 4 * q / gain, -SUFFICIENT / kappa
    return TwoPhaseCycle(*jnp.broadcast_arrays(*fields))
