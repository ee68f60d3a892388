"""Harmonic compensation: what the errors of an encoder add to speed and acceleration, learned and taken off.

Errors that repeat with each revolution make the measured signals those of the wheel plus a term linear in 2 M unknown
Fourier coefficients ϑ of the error,

    w_m = w + Phi' ϑ,    Phi = D phi(th_m) w_m                              for the speed
    a_m = a + Phi' ϑ,    Phi = D phi(th_m) a_m - D^2 psi(th_m) w_m^2        for the acceleration

    D = diag(1, 1, 2, 2, ...),   phi = (cos th, -sin th, cos 2th, ...),   psi = (sin th, cos th, sin 2th, ...)

each signal with coefficients of its own, since neither is the derivative of the other. Both are sums over the edges of
the fit, though: w_m = sum of L_i th_i, so that with

    Phi = sum over the edges of L_i (sin th_i, cos th_i, sin 2th_i, ...)

in their place (`through_edges`) the relation is exact, for any number of edges, at any speed, and the largest M below
N / 2 holds every error that repeats, but the one that alternates from tooth to tooth where N is even.

Signal and regressor pass the same high-pass filter, which leaves zeta = x' ϑ; ϑ follows by normalised recursive least
squares with forgetting, exactly for samples held over Ts,

    d = 1 + kappa x'x + Ts x'G x
    ϑ+ = ϑ + (Ts / d) G x (zeta - x'ϑ)
    G+ = e^(beta Ts) (G - (Ts / d) G x x' G)

and the estimate is the measured signal less Phi' ϑ, Phi not filtered. Computed on the scale of k^p ϑ, p = 1 for the
speed, 2 for the acceleration, on which every harmonic is alike.
Source: Aguado-Rojas 2019, section 6.2, eq. 6.5-6.8.
"""

import dataclasses
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from absjax._numerics import safe_divide, tree_where
from absjax.encoder.time_stamping import Measured
from absjax.parameters import model, parameter

TUNED: dict[str, Any] = {"low": 0.0, "open_low": True, "trainable": True}
POWER = {"speed": 1, "acceleration": 2}
GATE_ORDER = 4
"""Samples weigh 1 / (1 + (|a| / gate)^4)."""


@model
class Learned:
    """State of the compensation; on the scale of k^p ϑ, ordered as phi."""

    scaled: Any = parameter("k^p ϑ, shape (2 M,)", ndim=1)
    covariance: Any = parameter("k^p G k^p, shape (2 M, 2 M)", ndim=2)
    signal: Any = parameter("last signal, before and after the high-pass filter, shape (2,)", ndim=1)
    regressor: Any = parameter("last regressor, before and after it, shape (2, 2 M)", ndim=2)
    transient: Any = parameter("last acceleration, before and after it, shape (2,)", ndim=1)
    begun: Any = parameter("1 if the last sample was regular; if not, the filters begin anew")


@model
class HarmonicCompensation:
    """Compensation of M harmonics in one of the signals of the time-stamping algorithm."""

    signal: Literal["speed", "acceleration"]
    """what is compensated"""
    harmonics: int = 6
    """M; ceil(1.5 N / n) is where the residual flattens"""
    filter_regressor: bool = True
    """whether the regressor is filtered as the signal is; False is the published law"""
    through_edges: bool = False
    """whether the regressor is made as the signal is, of the edges; False is the published one, of the signals"""
    forgetting: Any = parameter("beta, 1/s", default=0.1, span=(0.01, 10.0), **TUNED)
    cutoff: Any = parameter("of the high-pass filter, Hz", default=5.0, span=(0.2, 30.0), **TUNED)
    gain: Any = parameter(
        "g, initial G over its steady value 2 beta sum k^(2 p) / k^(2 p)", default=1000.0, span=(1.0, 1e6), **TUNED
    )
    kappa: Any = parameter("of the normalisation; only G / kappa matters", default=1.0, low=0.0, open_low=True)
    slowest: Any = parameter("wheel speed below which nothing is learned, rad/s", default=10.0, low=0.0)
    gate: Any = parameter(
        "acceleration, low-passed with the same cut-off, at which samples weigh half, rad/s^2; None: they all weigh 1",
        default=None,
        span=(5.0, 1e4),
        **TUNED,
    )
    active: Any = parameter("M, of which only the lowest so many are used; None: all", default=None, low=1.0)

    def __post_init__(self):
        if self.signal not in POWER:
            raise ValueError(f"HarmonicCompensation.signal = {self.signal!r} must be one of {', '.join(POWER)}")
        if self.harmonics != int(self.harmonics) or self.harmonics < 1:
            raise ValueError(f"HarmonicCompensation.harmonics = {self.harmonics} must be an integer >= 1")

    def _orders(self, dtype):
        return jnp.repeat(jnp.arange(1, self.harmonics + 1), 2).astype(dtype)

    def _used(self, dtype):
        orders = self._orders(dtype)
        return jnp.ones_like(orders) if self.active is None else (orders <= self.active).astype(dtype)

    def _weights(self, dtype):
        """k^(2 p), for both coefficients of a harmonic; 0 for the harmonics that are not used."""
        return self._orders(dtype) ** (2 * POWER[self.signal]) * self._used(dtype)

    def _initial(self, dtype):
        """k^p G0 k^p, its diagonal: g times the steady value 2 beta sum k^(2 p)."""
        return self.gain * self.forgetting * jnp.sum(self._weights(dtype)) * self._used(dtype)

    def initial_state(self, dtype) -> Learned:
        """Nothing learned: ϑ = 0, G = G0."""
        zero, size = jnp.zeros((), dtype), 2 * self.harmonics
        covariance = jnp.diag(jnp.asarray(self._initial(dtype), dtype))
        pair = jnp.zeros(2, dtype)
        return Learned(jnp.zeros(size, dtype), covariance, pair, jnp.zeros((2, size), dtype), pair, zero)

    def coefficients(self, learned: Learned) -> jax.Array:
        """ϑ, ordered a1, b1, a2, b2, ... [rad]."""
        return learned.scaled / self._orders(learned.scaled.dtype) ** POWER[self.signal]

    def regressor(self, measured: Measured) -> jax.Array:
        """k^-p Phi, shape (2 M,)."""
        angle, speed, acceleration = measured.rotation
        k = jnp.arange(1, self.harmonics + 1).astype(angle.dtype)
        if self.through_edges:
            weights = getattr(measured.weights, self.signal)
            angles = k[:, None] * measured.weights.angle
            sums = jnp.stack([jnp.sum(f(angles) * weights, axis=-1) for f in (jnp.sin, jnp.cos)], axis=-1)
            return (sums / k[:, None] ** POWER[self.signal]).reshape(-1) * self._used(angle.dtype)
        cosine, sine = jnp.cos(k * angle), jnp.sin(k * angle)
        if self.signal == "speed":
            pairs = jnp.stack([cosine * speed, -sine * speed], axis=-1)
        else:
            a, b = acceleration / k, speed**2
            pairs = jnp.stack([cosine * a - sine * b, -sine * a - cosine * b], axis=-1)
        return pairs.reshape(-1) * self._used(angle.dtype)

    def clean(self, state: Learned, measured: Measured, period) -> tuple[Learned, jax.Array]:
        """The state after a sample, and the signal as compensated with it; `period` Ts [s]."""
        value = getattr(measured.rotation, self.signal)
        phi = self.regressor(measured)
        begun = state.begun > 0
        signal = _high_pass(self.cutoff, state.signal, value, begun, period)
        filtered = _high_pass(self.cutoff, state.regressor, phi, begun, period)
        transient = _high_pass(self.cutoff, state.transient, measured.rotation.acceleration, begun, period)
        x = filtered[1] if self.filter_regressor else phi

        weight = ((measured.rotation.speed > self.slowest) & begun).astype(value.dtype)
        if self.gate is not None:
            weight = weight / (1 + ((transient[0] - transient[1]) / self.gate) ** GATE_ORDER)
        held = period * weight
        m2 = 1 + self.kappa * jnp.sum(self._weights(value.dtype) * x * x)
        most = jnp.sum(self._initial(value.dtype))
        scaled, covariance = least_squares_step(
            state.scaled, state.covariance, x, signal[1], held, m2, self.forgetting, most
        )
        known = Learned(scaled, covariance, signal, filtered, transient, jnp.ones_like(value))
        known = tree_where(measured.regular, known, dataclasses.replace(state, begun=jnp.zeros_like(value)))
        return known, value - jnp.sum(phi * known.scaled)


def least_squares_step(known, covariance, x, target, held, m2, forgetting, most):
    """One step of the recursive least squares: what is known after target = x' known, and its covariance.

    Args:
        known: (n,).
        covariance: (n, n).
        x: (n,).
        held: time for which the sample is held, s; 0 for one that tells nothing.
        m2: 1 + kappa x'x.
        most: trace of the covariance that is never exceeded.
    """
    gx = jnp.sum(covariance * x, axis=-1)
    step = held / (m2 + held * jnp.sum(x * gx))
    known = known + step * gx * (target - jnp.sum(x * known))
    # The outer product first: it is symmetric to the last bit, and what is not would grow with the forgetting.
    taken = step * (gx[:, None] * gx[None, :])
    covariance = jnp.exp(forgetting * held) * (covariance - taken)
    # What is known never falls below what was at the start.
    trace = jnp.trace(covariance)
    return known, covariance * jnp.minimum(1.0, safe_divide(most, trace, trace > most, 1.0))


def _high_pass(cutoff, last, now, begun, period):
    """First-order high-pass filter s / (s + wc) by Tustin's rule, prewarped; at rest before the first sample."""
    warped = jnp.tan(np.pi * cutoff * period)
    passed = (now - last[0] + (1 - warped) * last[1]) / (1 + warped)
    return jnp.stack([now, jnp.where(begun, passed, 0.0)])
