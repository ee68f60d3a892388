"""The position model: what the errors of an encoder add to the angle, learned by recursive least squares.

    th_m = th + phi' ϑ,    phi = (sin th_m, cos th_m, sin 2th_m, cos 2th_m, ...)

th is not known, but it hardly differs from a parabola over 1 / (2 pi fc): of that, three first-order high-pass filters
in a row leave nothing once they have settled. The regressor passes the same three, and ϑ follows by the least squares
of `absjax.encoder.harmonics`. Its coefficients are not those of speed and acceleration, which are no derivatives of
the angle but come from the same fit: what is learned here corrects the angle, and is to be compared with theirs.
Source: Aguado-Rojas 2019, eq. 6.2, remark 3 and eq. 6.7 and 6.8. The filters in a row are ours.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax._numerics import tree_where
from absjax.encoder.harmonics import TUNED, least_squares_step
from absjax.parameters import model, parameter

FILTERS = 3
"""High-pass filters in a row."""
SETTLED = 25.0
"""Time constants of a filter after which nothing is left of how the angle began, and samples begin to count."""


class Position(NamedTuple):
    """State of the least squares."""

    known: Any
    """ϑ = (a1, b1, a2, b2, ...), rad, (2 M,)"""
    covariance: Any
    """(2 M, 2 M)"""
    angle: Any
    """th_m of the last sample, rad"""
    regressor: Any
    """phi of the last sample, (2 M,)"""
    passed: Any
    """angle and regressor after each filter, (3, 1 + 2 M)"""
    begun: Any
    """valid samples in a row; after one that is not, the filters begin anew"""


@model
class PositionLeastSquares:
    """Least squares of M harmonics in the angle."""

    harmonics: int = 6
    """M"""
    forgetting: Any = parameter("beta, 1/s", default=0.1, span=(0.01, 10.0), **TUNED)
    cutoff: Any = parameter("of each high-pass filter, Hz", default=5.0, span=(0.2, 30.0), **TUNED)
    gain: Any = parameter(
        "g, initial G over its steady value 2 beta (1 + kappa M)", default=1e5, span=(1.0, 1e7), **TUNED
    )
    kappa: Any = parameter("of the normalisation; only G / kappa matters", default=1.0, low=0.0, open_low=True)

    def __post_init__(self):
        if self.harmonics != int(self.harmonics) or self.harmonics < 1:
            raise ValueError(f"PositionLeastSquares.harmonics = {self.harmonics} must be an integer >= 1")

    def initial_state(self, dtype) -> Position:
        """Nothing learned."""
        size, zero = 2 * self.harmonics, jnp.zeros((), dtype)
        initial = jnp.asarray(2 * self.gain * self.forgetting * (1 + self.kappa * self.harmonics), dtype)
        flat = jnp.zeros(size, dtype)
        return Position(
            flat, initial * jnp.eye(size, dtype=dtype), zero, flat, jnp.zeros((FILTERS, 1 + size), dtype), zero
        )

    def regressor(self, angle):
        """phi, (2 M,)."""
        k = jnp.arange(1, self.harmonics + 1) * angle
        return jnp.stack([jnp.sin(k), jnp.cos(k)], axis=-1).reshape(-1)

    def learn(self, state: Position, angle, valid, period) -> tuple[Position, jax.Array]:
        """The state after a sample, and the angle as corrected with it [rad].

        Args:
            angle: th_m in [0, 2 pi), rad.
            valid: whether it is known.
            period: between samples, s.
        """
        phi = self.regressor(angle)
        turned = jnp.mod(angle - state.angle + np.pi, 2 * np.pi) - np.pi
        moved = jnp.concatenate([turned[None], phi - state.regressor])
        warped = jnp.tan(np.pi * self.cutoff * period)
        passed = []
        for last in state.passed:
            after = (moved + (1 - warped) * last) / (1 + warped)
            moved = after - last
            passed.append(after)
        passed = jnp.where(state.begun > 0, jnp.stack(passed), 0.0)
        target, x = passed[-1, 0], passed[-1, 1:]
        held = period * (2 * np.pi * self.cutoff * period * state.begun > SETTLED)
        m2, most = 1 + self.kappa * jnp.sum(x * x), jnp.trace(self.initial_state(phi.dtype).covariance)
        known, covariance = least_squares_step(
            state.known, state.covariance, x, target, held, m2, self.forgetting, most
        )
        after = Position(known, covariance, angle, phi, passed, state.begun + 1)
        after = tree_where(valid, after, state._replace(begun=jnp.zeros_like(angle)))
        return after, angle - jnp.sum(phi * after.known)


@jax.jit
def learn_position(squares: PositionLeastSquares, angle, valid, period) -> tuple[jax.Array, jax.Array]:
    """Run the least squares over a log.

    Args:
        squares: the least squares.
        angle: th_m, (samples,), rad.
        valid: whether it is known, (samples,).
        period: between samples, s.

    Returns:
        ϑ after every sample, (samples, 2 M), and the corrected angle, (samples,).
    """

    def body(state, sample):
        now, seen = sample
        state, corrected = squares.learn(state, now, seen, period)
        return state, (state.known, corrected)

    _, found = lax.scan(body, squares.initial_state(angle.dtype), (angle, jnp.asarray(valid)))
    return found
