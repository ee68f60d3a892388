"""The predictor of Theorem 6.1, and the control law on what it predicts.

With e_i(t) = x_i(t) - x_i*(t - h), from i = n down to 1,

    e_i^P = e_i - alpha_i int_{t-h}^t e_i - beta_i int_0^t p_i + int_{t-h}^t e_{i+1}^P,   p_i(t) = e_i^P(t - h) - e_i(t)
    x_i^P = x_i* + e_i^P,   x_{i+1}* = -f_i(x_1^P, ..., x_i^P) - alpha_i e_i + x_i*',   u = x_{n+1}*

where e_i^P(t) and x_i^P(t) are for the instant t + h. Not the system but the error it is meant to have is integrated,
so an unstable system is predicted as well as a stable one; p_i, by which the prediction made h ago is off, damps what
the two differ by, and counts as zero until there is a prediction.

The rates x_i*' are exact: of every reference, error and prediction as many derivatives are carried along as the law
asks for, n - i + 1 of x_i*, and no signal is differentiated numerically. The integrals are states,

    S_i' = e_i(t) - e_i(t - h),   I_i' = p_i(t),   T_i' = e_{i+1}^P(t) - e_{i+1}^P(t - h)

so what has to be kept are signals of h ago, whoever keeps them (`absjax.delay.tracking`).
Source: Hoang 2014 (thesis), eq. 6.11-6.16 (n = 1) and 6.23-6.29.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.delay._series import along, along_flow
from absjax.delay.chain import Chain, field
from absjax.parameters import concrete, model, parameter


class Signals(NamedTuple):
    """What is read again h later; lists by i of lists by order of the derivative."""

    reference: list[list[Any]]
    """x_i*, to the order n - i"""
    error: list[list[Any]]
    """e_i, likewise"""
    prediction: list[list[Any]]
    """e_i^P, likewise"""


class Law(NamedTuple):
    """What the predictor makes of an instant."""

    u: Any
    now: Signals
    rates: Any
    """of the integrals (3, n): S', I', T'"""


def row_of(signals: Signals) -> Any:
    """Signals as an array (3 n (n + 1) / 2,)."""
    flat = [d for kind in signals for derivatives in kind for d in derivatives]
    return jnp.stack(jnp.broadcast_arrays(*flat), axis=-1)


def signals_of(row: Any, order: int) -> Signals:
    """Signals of such an array."""
    entries = iter(row[..., k] for k in range(row.shape[-1]))
    return Signals(*([[next(entries) for _ in range(order - i)] for i in range(order)] for _ in range(3)))


@model
class Predictor:
    """Gains alpha and beta of the predictor and its law, arrays (n,), or one number for all i.

    Raises:
        ValueError: at construction, if a gain is not positive.
    """

    alpha: Any = parameter("alpha, shape (n,), 1/s", ndim=1)
    beta: Any = parameter("beta, shape (n,), 1/s", ndim=1)
    predicts: bool = True
    """False: the law on x and e as they are, as if there were no delay"""

    def __post_init__(self):
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if concrete(value) and not np.all(np.asarray(value) > 0):
                raise ValueError(f"Predictor.{name} = {value} must be positive")

    def law(self, chain: Chain, x, references: list[Any], past: Signals, integrals, defined) -> Law:
        """Input and rates at an instant.

        Args:
            chain: the system as it is known.
            x: its state (n,).
            references: x_1* and its derivatives up to the n-th.
            past: signals of h ago.
            integrals: S, I, T, arrays (3, n).
            defined: 1 where there is a prediction of h ago, else 0.
        """
        n = chain.order
        states = along_flow(lambda x: field(chain, x), x, n)
        errors = [[states[k][i] - past.reference[i][k] for k in range(n - i)] for i in range(n)]
        bias = [[defined * (p - e) for p, e in zip(past.prediction[i], errors[i])] for i in range(n)]
        predictions: list[list[Any]] = [[] for _ in range(n)]
        rates = [[jnp.zeros_like(x[0])] * n for _ in range(3)]
        for i in reversed(range(n)):
            change = [now - then for now, then in zip(errors[i], past.error[i])]
            sums = integrals[0, i], integrals[1, i]
            predictions[i] = [errors[i][0] - self.alpha[i] * sums[0] - self.beta[i] * sums[1]]
            predictions[i] += [
                errors[i][k] - self.alpha[i] * change[k - 1] - self.beta[i] * bias[i][k - 1] for k in range(1, n - i)
            ]
            if i < n - 1:
                ahead = [now - then for now, then in zip(predictions[i + 1], past.prediction[i + 1])]
                for k, add in enumerate([integrals[2, i], *ahead][: n - i]):
                    predictions[i][k] = predictions[i][k] + add
                rates[2][i] = ahead[0]
            rates[0][i], rates[1][i] = change[0], bias[i][0]
        targets = [list(references)]
        for i in range(n):
            order = n - i
            ahead = [self._ahead(targets, predictions, states, i, k) for k in range(order)]
            drift = along(lambda z, i=i: chain.drift(z)[i], ahead, order - 1)
            targets.append([-drift[k] - self.alpha[i] * errors[i][k] + targets[i][k + 1] for k in range(order)])
        reference = [targets[i][: n - i] for i in range(n)]
        return Law(targets[n][0], Signals(reference, errors, predictions), jnp.stack([jnp.stack(r) for r in rates]))

    def _ahead(self, targets, predictions, states, i: int, k: int):
        """k-th derivative of the state (n,) the drift is taken at; entries beyond i do not matter."""
        if not self.predicts:
            return states[k]
        known = [targets[j][k] + predictions[j][k] for j in range(i + 1)]
        return jnp.stack([*known, *[states[k][j] for j in range(i + 1, len(targets[0]) - 1)]])
