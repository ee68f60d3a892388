"""The sufficient conditions of Theorem 6.1 on the gains, and the largest gains that meet them.

    (6.30)  alpha_m >= 4 b + alpha_M (alpha_M + 2 b) h,  b = 1 for a chain, 0 for a scalar system
    (6.31)  beta_m >= 4 gamma + beta_M (beta_M + 2 gamma) h

with gamma = gamma_1 + b of the proof, gamma_1 the largest Lipschitz constant of the f_i, and m, M the least and the
largest of a gain. For equal gains each is a quadratic inequality: met between two roots, if there are any.
Source: Hoang 2014 (thesis), eq. 6.30, 6.31 and the end of the proof of Theorem 6.1.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np


class GainCondition(NamedTuple):
    """A condition on a gain.

    Attributes:
        name: of the condition.
        least: the least of the gains, 1/s.
        required: what it has to reach, 1/s.
        low, high: between which equal gains meet the condition, 1/s; NaN-free, both 0 where none do.
    """

    name: str
    least: Any
    required: Any
    low: Any
    high: Any

    @property
    def holds(self):
        """Whether the gains meet it."""
        return self.least >= self.required


def conditions(alpha: Any, beta: Any, delay: Any, lipschitz: Any) -> tuple[GainCondition, GainCondition]:
    """Both conditions.

    Args:
        alpha: gains of the law (n,).
        beta: gains of the biases (n,).
        delay: h*, s.
        lipschitz: gamma_1, 1/s.
    """
    b = 0.0 if np.shape(alpha)[-1] == 1 else 1.0
    return _condition("(6.30)", alpha, b, delay), _condition("(6.31)", beta, lipschitz + b, delay)


def _condition(name: str, gains: Any, bound: Any, delay: Any) -> GainCondition:
    gains = jnp.asarray(gains)
    largest = jnp.max(gains)
    required = 4 * bound + largest * (largest + 2 * bound) * delay
    # h g^2 - (1 - 2 b h) g + 4 b <= 0
    middle = 1 - 2 * bound * delay
    room = middle**2 - 16 * bound * delay
    met = (room >= 0) & (middle > 0)
    spread = jnp.sqrt(jnp.where(met, room, 0.0))
    low, high = (jnp.where(met, (middle + sign * spread) / (2 * delay), 0.0) for sign in (-1.0, 1.0))
    return GainCondition(name, jnp.min(gains), required, low, high)
