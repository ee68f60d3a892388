"""Levenberg-Marquardt for shared parameters and one small state per lane, with covariance.

The Jacobian of such a problem is an arrow: every lane's residuals depend on the shared parameters and
on the lane's own state only. Own states are eliminated lane by lane (Schur complement), so that a
hundred shooting intervals cost what one costs, times a hundred.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

MOST_ITERATIONS = 60


class Fit(NamedTuple):
    """Result of `arrow_fit`."""

    shared: np.ndarray
    """(parameters,)"""
    own: np.ndarray
    """(lanes, states)"""
    residual: np.ndarray
    """(lanes, residuals), whitened"""
    covariance: np.ndarray
    """(parameters, parameters), robust against residuals that are correlated within a lane"""
    iterations: int
    converged: bool


def arrow_fit(
    evaluate: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]],
    shared: np.ndarray,
    own: np.ndarray,
    *,
    lower: np.ndarray,
) -> Fit:
    """Minimise the sum of squares.

    Args:
        evaluate: `(shared, own) -> residual (lanes, n), d/d shared (lanes, n, p), d/d own (lanes, n, q)`.
        shared: start (p,).
        own: start (lanes, q); q may be 0.
        lower: lower bounds (p,); a step that would pass one ends on it.
    """
    damping, converged, iterations = 1e-4, False, 0
    residual, by_shared, by_own = evaluate(shared, own)
    cost = float(np.sum(residual**2))
    while iterations < MOST_ITERATIONS and not converged:
        iterations += 1
        matrix, vector, own_inverse, cross, own_vector = _reduced(residual, by_shared, by_own, damping)
        scale = np.diag(np.diag(matrix)) * damping
        step = -np.linalg.solve(matrix + scale, vector)
        trial_shared = np.maximum(shared + step, lower)
        step = trial_shared - shared
        own_step = -np.einsum("lij,lj->li", own_inverse, own_vector + np.einsum("lpj,p->lj", cross, step))
        trial = evaluate(trial_shared, own + own_step)
        trial_cost = float(np.sum(trial[0] ** 2))
        if np.isfinite(trial_cost) and trial_cost <= cost:
            gain = (cost - trial_cost) / max(cost, 1e-300)
            shared, own, cost = trial_shared, own + own_step, trial_cost
            residual, by_shared, by_own = trial
            damping = max(damping / 10, 1e-12)
            converged = gain < 1e-10 or bool(np.all(np.abs(step) <= 1e-9 * (np.abs(shared) + 1e-9)))
        else:
            damping *= 10
            converged = damping > 1e12
    return Fit(shared, own, residual, _covariance(residual, by_shared, by_own), iterations, converged)


def _reduced(residual, by_shared, by_own, damping):
    own_matrix = np.einsum("lni,lnj->lij", by_own, by_own)
    diagonal = np.einsum("lii->li", own_matrix)
    own_inverse = np.linalg.inv(own_matrix + damping * np.einsum("li,ij->lij", diagonal, np.eye(by_own.shape[2])))
    cross = np.einsum("lnp,lnj->lpj", by_shared, by_own)
    own_vector = np.einsum("lnj,ln->lj", by_own, residual)
    matrix = np.einsum("lnp,lnq->pq", by_shared, by_shared) - np.einsum("lpi,lij,lqj->pq", cross, own_inverse, cross)
    vector = np.einsum("lnp,ln->p", by_shared, residual) - np.einsum("lpi,lij,lj->p", cross, own_inverse, own_vector)
    return matrix, vector, own_inverse, cross, own_vector


def _covariance(residual, by_shared, by_own):
    """Sandwich covariance with lanes as clusters, and not less than the one of independent residuals."""
    matrix, _, own_inverse, cross, _ = _reduced(residual, by_shared, by_own, 0.0)
    bread = np.linalg.pinv(matrix)
    projected = by_shared - np.einsum("lni,lij,lpj->lnp", by_own, own_inverse, cross)
    scores = np.einsum("lnp,ln->lp", projected, residual)
    lanes, n = residual.shape
    spare = max(residual.size - matrix.shape[0] - by_own.shape[0] * by_own.shape[2], 1)
    plain = bread * np.sum(residual**2) / spare
    if lanes < 2 * matrix.shape[0] + 2:
        return plain
    robust = bread @ (scores.T @ scores) @ bread * lanes / (lanes - 1) * (lanes * n) / spare
    larger = np.sqrt(np.maximum(np.diag(robust) / np.diag(plain), 1.0))
    return plain * np.outer(larger, larger)
