"""Gradient descent of many starts together, each on its own: Adam, or L-BFGS."""

import math
from collections.abc import Callable
from typing import Any, Literal, Protocol

import jax
import jax.numpy as jnp
import numpy as np
import optax

from tuning.core.box import Box

Progress = Callable[[int, int, float], None]
"""Called with iteration, iterations and the best cost so far."""
Method = Literal["adam", "lbfgs"]
_ADAM = optax.chain(optax.zero_nans(), optax.scale_by_adam())
_LBFGS = optax.chain(optax.zero_nans(), optax.scale_by_lbfgs(memory_size=10))
LONGEST_STEP = 0.3
"""Of L-BFGS, on the scales of the box."""
ARMIJO = 1e-4
"""Share of the decrease a straight line promises that a step of L-BFGS has to bring."""
SHORTEST = 1e-4
"""Share of a step of L-BFGS below which it is not halved any more."""


class Stepper(Protocol):
    """Where the starts go next."""

    def step(self, iteration: int, points: np.ndarray, costs: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """The next points (sets, parameters), from costs (sets,) and gradients at these."""
        ...


class Adam:
    """Adam with cosine decay, each gradient held to unit length."""

    def __init__(self, box: Box, starts: np.ndarray, iterations: int, learning_rate: float):
        """A descent from `starts`."""
        self.box, self.iterations, self.learning_rate = box, iterations, learning_rate
        self.moments = _ADAM.init(jnp.asarray(starts))

    def step(self, iteration: int, points: np.ndarray, costs: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """The next points."""
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / self.iterations))
        rate = self.learning_rate * (0.02 + 0.98 * cosine)
        moved, self.moments = _adam_step(points, self.moments, gradients, rate)
        return self.box.valid(np.asarray(moved))


@jax.jit
def _adam_step(points, moments, gradients, rate):
    gradients = gradients / jnp.maximum(jnp.linalg.norm(gradients, axis=1, keepdims=True), 1.0)
    updates, moments = _ADAM.update(gradients, moments)
    return optax.apply_updates(points, jax.tree.map(lambda u: -rate * u, updates)), moments


class LBFGS:
    """L-BFGS with backtracking: a step that does not lower the cost enough is halved and tried again."""

    def __init__(self, box: Box, starts: np.ndarray, iterations: int, learning_rate: float):
        """A descent from `starts`; the first step is of the length `learning_rate`."""
        self.box, self.rate = box, learning_rate
        self.state = jax.vmap(_LBFGS.init)(jnp.asarray(starts))
        self.points, self.costs = np.array(starts), np.full(len(starts), np.inf)
        self.direction, self.slope = np.zeros_like(starts), np.zeros(len(starts))
        self.share = np.ones(len(starts))

    def step(self, iteration: int, points: np.ndarray, costs: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """The next points: on from those that are accepted, half as far for the others."""
        enough = costs <= self.costs + ARMIJO * self.share * self.slope
        accepted = np.isfinite(costs) & (enough | (self.share < SHORTEST) | ~np.isfinite(self.costs))
        new_direction, new_state = _lbfgs_step(points, self.state, np.nan_to_num(gradients))
        self.state = jax.tree.map(lambda new, old: _where(accepted, new, old), new_state, self.state)
        direction = np.asarray(new_direction)
        slope = np.sum(direction * np.nan_to_num(gradients), axis=1)
        length = np.linalg.norm(direction, axis=1)
        limit = self.rate if iteration == 0 else LONGEST_STEP
        shrink = np.minimum(1.0, limit / np.maximum(length, 1e-300))
        self.points = np.where(accepted[:, None], points, self.points)
        self.costs = np.where(accepted, costs, self.costs)
        self.direction = np.where(accepted[:, None], direction * shrink[:, None], self.direction)
        self.slope = np.where(accepted, np.minimum(slope, 0.0) * shrink, self.slope)
        self.share = np.where(accepted, 1.0, 0.5 * self.share)
        return self.box.valid(self.points + self.share[:, None] * self.direction)


def _where(condition, new, old):
    return jnp.where(jnp.reshape(condition, condition.shape + (1,) * (jnp.ndim(new) - 1)), new, old)


@jax.jit
def _lbfgs_step(points, state, gradients):
    def one(point, state, gradient):
        update, state = _LBFGS.update(gradient, state, point)
        return jax.tree.map(jnp.negative, update), state

    return jax.vmap(one)(points, state, gradients)


STEPPERS: dict[str, Callable[[Box, np.ndarray, int, float], Stepper]] = {"adam": Adam, "lbfgs": LBFGS}


class Descent:
    """The descents and what is best of each so far."""

    def __init__(self, starts: np.ndarray):
        """Nothing is known of the starts yet."""
        self.points = np.array(starts)
        self.best, self.best_points = np.full(len(starts), np.inf), np.array(starts)
        self.history: list[list[float]] = []

    def run(
        self,
        costs_and_gradients: Callable[[int, np.ndarray], tuple[Any, Any]],
        box: Box,
        *,
        iterations: int,
        learning_rate: float,
        method: Method = "adam",
        patience: int | None = None,
        progress: Progress = lambda i, n, cost: None,
    ) -> "Descent":
        """Descend from every start.

        Args:
            costs_and_gradients: of an iteration and points (sets, parameters): costs (sets,), and the gradient of
                each with respect to its own point.
            patience: iterations without a better cost anywhere after which it ends; None: never before the last.
        """
        # Points go to the costs from the host: where they come from would otherwise count as another type.
        stepper, waited = STEPPERS[method](box, self.points, iterations, learning_rate), 0
        for iteration in range(iterations):
            before = self.points
            costs, gradients = map(np.asarray, costs_and_gradients(iteration, before))
            self.history.append([float(c) for c in costs])
            better = costs < self.best
            waited = 0 if (costs.min() < self.best.min()) else waited + 1
            self.best = np.where(better, costs, self.best)
            self.best_points = np.where(better[:, None], before, self.best_points)
            self.points = stepper.step(iteration, before, costs, gradients)
            progress(iteration + 1, iterations, float(self.best.min()))
            if patience is not None and waited >= patience:
                break
        return self
