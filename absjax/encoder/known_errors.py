"""Errors of an encoder that have been learned, taken off without learning on.

What `absjax.encoder.harmonics` has learned of errors that repeat with each revolution is an angle for every tooth,

    e_j = sum over k of  a_k sin(k 2 pi j / N) + b_k cos(k 2 pi j / N)

and since speed and acceleration are sums over the edges of the fit, s_m = sum of L_i th_i, they are compensated by
sum of L_i e_(tooth of i). A control unit that learns while the wheel rolls freely, and no more from the pedal on, does
that at a thousandth of the cost.
Source: Aguado-Rojas 2019, section 6.2, for the relation; the table is ours.
"""

from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from absjax.encoder.harmonics import HarmonicCompensation, Learned
from absjax.encoder.time_stamping import Measured
from absjax.encoder.wheel_speed import ChainState, WheelSpeedChain
from absjax.parameters import model, parameter


@model
class KnownErrors:
    """Compensation of one of the signals of the time-stamping algorithm by a table of the teeth; it has no state."""

    signal: Literal["speed", "acceleration"]
    """what is compensated"""
    errors: Any = parameter("e_j, of every tooth, rad, shape (N,)", ndim=1)

    @property
    def harmonics(self) -> int:
        """All that the teeth tell apart."""
        return (self.errors.shape[-1] - 1) // 2

    def initial_state(self, dtype) -> tuple[()]:
        """Nothing."""
        return ()

    def clean(self, state, measured: Measured, period) -> tuple[tuple[()], jax.Array]:
        """The signal without the errors."""
        weights, teeth = measured.weights, self.errors.shape[-1]
        tooth = jnp.round(weights.angle * teeth / (2 * np.pi)).astype(jnp.int32) % teeth
        off = jnp.sum(getattr(weights, self.signal) * self.errors[tooth])
        return (), getattr(measured.rotation, self.signal) - off


def errors_of(coefficients, teeth: int):
    """e_j of every tooth (..., N) [rad] of coefficients a1, b1, a2, b2, ... (..., 2 M) [rad]."""
    orders = np.arange(1, coefficients.shape[-1] // 2 + 1)
    turned = orders[:, None] * 2 * np.pi * np.arange(teeth) / teeth
    return coefficients @ np.stack([np.sin(turned), np.cos(turned)], axis=1).reshape(-1, teeth)


def lowest(errors, harmonics):
    """Errors of every tooth (..., N) with no more than the lowest harmonics of them, a number or (...)."""
    spectrum = jnp.fft.rfft(errors, axis=-1)
    kept = jnp.arange(spectrum.shape[-1]) <= jnp.asarray(harmonics)[..., None]
    return jnp.fft.irfft(spectrum * kept, n=errors.shape[-1], axis=-1)


def settled(chain: WheelSpeedChain, state: ChainState) -> tuple[WheelSpeedChain, ChainState]:
    """A chain that knows what it has learned through the edges, and learns no more; and its state. Lanes in front.

    Raises:
        ValueError: if a signal is not compensated through the edges.
    """
    parts: dict[str, KnownErrors] = {}
    for name in ("speed", "acceleration"):
        learns, learned = getattr(chain, name), getattr(state, name)
        if not isinstance(learns, HarmonicCompensation) or not learns.through_edges:
            raise ValueError(f"WheelSpeedChain.{name} does not learn through the edges; only then are errors of teeth")
        assert isinstance(learned, Learned)
        parts[name] = KnownErrors(name, errors_of(learns.coefficients(learned), chain.stamping.teeth))
    return WheelSpeedChain(chain.stamping, **parts), state._replace(speed=(), acceleration=())
