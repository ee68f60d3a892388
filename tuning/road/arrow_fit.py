"""Levenberg-Marquardt for shared parameters and one small state per lane, with covariance.

The Jacobian of such a problem is an arrow: every lane's residuals depend on the shared parameters and
on the lane's own state only. Own states are eliminated lane by lane (Schur complement), so that a
hundred shooting intervals cost what one costs, times a hundred. What is known of a shared parameter before
counts as one more residual, (p - mean) / spread.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

MOST_ITERATIONS = 60
LARGEST_LEVERAGE = 0.8
NOTHING, UNKNOWN = 1e-200, 1e12
"""Information that is none, and the variance of a parameter that has none."""
LARGEST_DAMPING = 1e-3
"""With which a small step is one at the minimum."""
ROUNDING = 1e-11
"""Share of a cost that is no change of it."""
LARGEST_SLOPE = 1e50
"""A step after which derivatives are larger, or no numbers, is not made."""
RIDGE = 1e-10
"""Of its diagonal, added to what is known of a lane's own state: two states that look alike have an inverse still."""
Evaluate = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


class Prior(NamedTuple):
    """What is known of the shared parameters; arrays (parameters,)."""

    mean: np.ndarray
    spread: np.ndarray
    """standard deviations; inf: nothing is known"""

    @classmethod
    def none(cls, size: int) -> "Prior":
        """Nothing is known."""
        return cls(np.zeros(size), np.full(size, np.inf))

    def residual(self, shared: np.ndarray) -> np.ndarray:
        """(p - mean) / spread"""
        return (shared - self.mean) / self.spread

    @property
    def information(self) -> np.ndarray:
        """1 / spread^2"""
        return 1 / self.spread**2


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
    plain: np.ndarray
    """the same as if residuals were independent"""
    cost: float
    """sum of squares, prior included"""
    iterations: int
    converged: bool

    def of_all(self, shared: np.ndarray, free: np.ndarray) -> "Fit":
        """The fit of all parameters, of which only those that are `free` were fitted; `shared` has the others."""
        whole = shared.copy()
        whole[free] = self.shared
        covariance, plain = np.zeros((2, len(free), len(free)))
        covariance[np.ix_(free, free)], plain[np.ix_(free, free)] = self.covariance, self.plain
        return self._replace(shared=whole, covariance=covariance, plain=plain)

    @property
    def inflation(self) -> float:
        """How many times larger variances are since residuals are correlated, in the mean; at least 1."""
        told = (np.diag(self.plain) < UNKNOWN) & (np.diag(self.plain) > 0)
        ratio = np.diag(self.covariance)[told] / np.diag(self.plain)[told]
        return float(np.mean(np.maximum(ratio, 1.0))) if told.any() else 1.0


class Part(NamedTuple):
    """Lanes whose residuals depend on the same of the shared parameters, as those of one of several logs."""

    evaluate: Evaluate
    """by its own parameters, and its lanes' states"""
    own: np.ndarray
    """start (lanes, states)"""
    at: np.ndarray
    """where each of its parameters stands among all shared ones, (its parameters,)"""


def arrow_fit(
    evaluate: Evaluate, shared: np.ndarray, own: np.ndarray, *, lower: np.ndarray, prior: Prior | None = None
) -> Fit:
    """Minimise the sum of squares.

    Args:
        evaluate: `(shared, own) -> residual (lanes, n), d/d shared (lanes, n, p), d/d own (lanes, n, q)`.
        shared: start (p,).
        own: start (lanes, q); q may be 0.
        lower: lower bounds (p,); a step that would pass one ends on it, and the other parameters' with it.
        prior: what is known of the shared parameters.

    Returns:
        A `Fit`; its cost is inf where the start has none.
    """
    return joint_fit([Part(evaluate, own, np.arange(len(shared)))], shared, lower=lower, prior=prior)[0]


def joint_fit(parts: Sequence[Part], shared: np.ndarray, *, lower: np.ndarray, prior: Prior | None = None) -> list[Fit]:
    """Minimise the sum of squares of several parts, which have some of the shared parameters in common.

    An arrow of arrows: each part's lanes are eliminated first, and what is left of it goes into the rows of the
    parameters that it has.

    Args:
        parts: the parts.
        shared: start, of all parameters (p,).
        lower: lower bounds (p,), as for `arrow_fit`.
        prior: what is known of them.

    Returns:
        A `Fit` of each part: its parameters and its block of the covariance of all; cost and iterations are those of
        the whole.
    """
    prior = Prior.none(len(shared)) if prior is None else prior
    damping, converged, iterations = 1e-4, False, 0
    owns = [part.own for part in parts]
    there = [part.evaluate(shared[part.at], own) for part, own in zip(parts, owns)]
    cost = _cost(there, shared, prior)
    if not (np.isfinite(cost) and _moderate(there)):
        nothing = np.full((len(shared), len(shared)), np.inf)
        return _split(parts, shared, owns, there, nothing, nothing, np.inf, 0, False)
    while iterations < MOST_ITERATIONS and not converged:
        iterations += 1
        reduced = [_reduced(*some, damping) for some in there]
        matrix, vector = np.diag(prior.information), prior.residual(shared) / prior.spread
        for part, some in zip(parts, reduced):
            matrix[np.ix_(part.at, part.at)] += some.matrix
            vector[part.at] += some.vector
        step = _bounded(matrix, vector, damping, lower - shared)
        trial_shared = np.maximum(shared + step, lower)
        trial_owns = [own + some.own_step(step[part.at]) for part, own, some in zip(parts, owns, reduced)]
        trial = [part.evaluate(trial_shared[part.at], own) for part, own in zip(parts, trial_owns)]
        trial_cost = _cost(trial, trial_shared, prior)
        if trial_cost <= cost and _moderate(trial):
            gain = (cost - trial_cost) / max(cost, 1e-300)
            shared, owns, cost, there = trial_shared, trial_owns, trial_cost, trial
            # A step that damping keeps small says nothing of how far the minimum is.
            small = gain < 1e-8 or bool(np.all(np.abs(step) <= 1e-9 * (np.abs(shared) + 1e-9)))
            converged = small and damping <= LARGEST_DAMPING
            damping = max(damping / 10, 1e-12)
        else:
            # A whole step that makes a difference of rounding only: nothing is left to gain.
            still = trial_cost - cost <= ROUNDING * cost and damping <= LARGEST_DAMPING
            damping *= 10
            converged = still or damping > 1e12
    covariance, plain = _covariance(parts, there, prior)
    return _split(parts, shared, owns, there, covariance, plain, cost, iterations, converged)


def _split(parts, shared, owns, there, covariance, plain, cost, iterations, converged) -> list[Fit]:
    return [
        Fit(
            shared[part.at],
            own,
            np.nan_to_num(residual),
            covariance[np.ix_(part.at, part.at)],
            plain[np.ix_(part.at, part.at)],
            cost,
            iterations,
            converged,
        )
        for part, own, (residual, *_) in zip(parts, owns, there)
    ]


def _moderate(there) -> bool:
    """Whether derivatives are numbers that can be squared."""
    return all(np.abs(some).max(initial=0.0) < LARGEST_SLOPE for _, *slopes in there for some in slopes)


def _cost(there, shared, prior: Prior) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(sum(np.sum(residual**2) for residual, *_ in there) + np.sum(prior.residual(shared) ** 2))


def _bounded(matrix, vector, damping, least):
    """The step of the damped system. What it would take below `least` ends there, and the others step knowing that."""
    step, held = -_solved(matrix, vector, damping), np.zeros(len(vector), bool)
    while np.any(beyond := ~held & (step < least)):
        held |= beyond
        free = ~held
        step[held] = least[held]
        known = vector[free] + matrix[np.ix_(free, held)] @ step[held]
        step[free] = -_solved(matrix[np.ix_(free, free)], known, damping)
    return step


def _solved(matrix, vector, damping):
    """Solution of the damped system on the scales of its diagonal; in a direction that is not determined, none."""
    told = np.diag(matrix) > NOTHING
    scale = np.sqrt(np.diag(matrix)[told])
    scaled = matrix[np.ix_(told, told)] / np.outer(scale, scale) + damping * np.eye(len(scale))
    solution = np.zeros(len(vector))
    solution[told] = np.linalg.lstsq(scaled, vector[told] / scale, rcond=1e-13)[0] / scale
    return solution


class _Reduced(NamedTuple):
    """Normal equations of a part, its lanes' states eliminated."""

    matrix: np.ndarray
    vector: np.ndarray
    own_inverse: np.ndarray
    cross: np.ndarray
    own_vector: np.ndarray

    def own_step(self, step: np.ndarray) -> np.ndarray:
        """Of the lanes' states, for a step of the part's parameters."""
        return -np.einsum("lij,lj->li", self.own_inverse, self.own_vector + np.einsum("lpj,p->lj", self.cross, step))


def _reduced(residual, by_shared, by_own, damping) -> _Reduced:
    by_own_turned = by_own.swapaxes(1, 2)
    own_matrix = by_own_turned @ by_own
    diagonal = np.einsum("lii->li", own_matrix)
    # A lane that carries no weight has no state to find.
    raised = (damping + RIDGE) * diagonal + (diagonal == 0)
    own_inverse = np.linalg.inv(own_matrix + raised[:, None] * np.eye(by_own.shape[2]))
    cross = by_shared.swapaxes(1, 2) @ by_own
    own_vector = (by_own_turned @ residual[..., None])[..., 0]
    flat = by_shared.reshape(-1, by_shared.shape[2])
    lanes, eliminated = (x.swapaxes(0, 1).reshape(flat.shape[1], -1) for x in (cross, cross @ own_inverse))
    matrix = flat.T @ flat - eliminated @ lanes.T
    vector = flat.T @ residual.ravel() - eliminated @ own_vector.ravel()
    return _Reduced(matrix, vector, own_inverse, cross, own_vector)


def _covariance(parts: Sequence[Part], there, prior: Prior):
    """Sandwich covariance with lanes as clusters, and not less than the one of independent residuals."""
    known = np.diag(prior.information)
    information, pulls, lanes = known.copy(), [], 0
    for part, (residual, by_shared, by_own) in zip(parts, there):
        reduced = _reduced(residual, by_shared, by_own, 0.0)
        by_state = np.einsum("lij,lpj->lip", reduced.own_inverse, reduced.cross)
        projected = by_shared - np.einsum("lni,lip->lnp", by_own, by_state)
        used, size = int(np.any(residual != 0, axis=1).sum()), int(np.count_nonzero(residual))
        spare = max(size - len(part.at) - used * by_own.shape[2], 1)
        level = np.sum(residual**2) / spare
        information[np.ix_(part.at, part.at)] += reduced.matrix / level
        pulls.append((part.at, projected, np.einsum("lnp,ln->lp", projected, residual) / level, level))
        lanes += used
    bread = _inverse(information)
    # Parameters, but for what was known of them before.
    learnt = float(np.sum(1 - np.diag(bread) * prior.information))
    if lanes < 2 * learnt + 2:
        return bread, bread
    meat = known
    for at, projected, scores, level in pulls:
        # A lane that pulls hard leaves less of its own error in the residual (Bell and McCaffrey 2002).
        block = bread[np.ix_(at, at)]
        leverage = np.einsum("lnp,pq,lnq->l", projected, block, projected, optimize=True) / level
        scores = scores / np.sqrt(1 - np.minimum(leverage, LARGEST_LEVERAGE))[:, None]
        meat[np.ix_(at, at)] += scores.T @ scores
    robust = bread @ meat @ bread
    told = np.diag(robust) > NOTHING
    ratio = np.diag(robust)[told] / np.diag(bread)[told]
    raised = np.ones(len(told))
    raised[told] = np.sqrt(np.maximum(1 / ratio, 1.0))
    return robust * np.outer(raised, raised), bread


def _inverse(matrix):
    """Of a symmetric matrix, on the scales of its diagonal; what nothing is known of has the variance `UNKNOWN`."""
    told = np.diag(matrix) > NOTHING
    scale = np.where(told, np.sqrt(np.where(told, np.diag(matrix), 1.0)), 1.0)
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-14, hermitian=True) / np.outer(scale, scale)
    inverse[~told, ~told] = UNKNOWN
    return inverse
