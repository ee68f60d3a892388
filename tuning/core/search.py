"""What every tuner shares: a box of parameters on a scale of their own, gradient descent of many starts, and
evolution from the best.

Positive parameters move on a logarithmic scale; those that may be negative on a linear one on which their
limits are `LINEAR_SPAN` apart, about as far as the limits of a positive one. They stay on a limit they reach.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from cmaes import CMA

Progress = Callable[[int, int, float], None]
"""Called with iteration, iterations and the best cost so far."""
Costs = Callable[[np.ndarray], np.ndarray]
"""Costs (sets,) of points (sets, parameters)."""

LINEAR_SPAN = 4.0
SLACK = 1e-9
"""By which evolution may leave the limits before it is brought back: it needs an interior."""
WORST = 1e9
"""Cost in evolution of what has none."""
_ADAM = optax.chain(optax.zero_nans(), optax.scale_by_adam())


class Box(NamedTuple):
    """Tuned parameters and their limits; a point is where they are on their scales, (..., parameters). Hashable.

    Pairs of parameters that have to keep an order keep it at every point: where a point has them nearer, the higher one
    is raised.
    """

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    ordered: tuple[tuple[str, str, float], ...] = ()
    """(lower, higher, by how much at least); the limits leave room for it"""

    @property
    def _logarithmic(self) -> np.ndarray:
        return np.asarray(self.low) > 0

    @property
    def _unit(self) -> np.ndarray:
        span = np.subtract(self.high, self.low)
        return np.where(span > 0, span, 1.0) / LINEAR_SPAN

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest point."""
        return self.point(dict(zip(self.names, self.low))), self.point(dict(zip(self.names, self.high)))

    def point(self, values: Mapping[str, Any]) -> np.ndarray:
        """The point of given values; others are left out. Arrays (sets,) give (sets, parameters)."""
        stacked = np.stack(np.broadcast_arrays(*(np.asarray(values[name], float) for name in self.names)), axis=-1)
        log = self._logarithmic
        return np.where(log, np.log(np.where(log, stacked, 1.0)), stacked / self._unit)

    def values(self, point) -> dict[str, Any]:
        """Values by name, arrays (...), in order; traceable."""
        log, unit = self._logarithmic, self._unit
        scaled = (jnp.exp(point[..., i]) if log[i] else point[..., i] * unit[i] for i in range(len(self.names)))
        values = dict(zip(self.names, scaled))
        for low, high, margin in self.ordered:
            values[high] = jnp.maximum(values[high], values[low] + margin)
        return values

    def valid(self, points) -> np.ndarray:
        """The nearest points within the limits, in order."""
        points = np.clip(points, *self.limits)
        return np.asarray(self.point(self.values(points))) if self.ordered else points

    def on_limit(self, point) -> list[str]:
        """Names of the parameters that lie on a limit."""
        low, high = self.limits
        return [n for n, at in zip(self.names, (abs(point - low) < 1e-6) | (abs(point - high) < 1e-6)) if at]


def descend(
    costs_and_gradients: Callable[[Any], tuple[Any, Any]],
    box: Box,
    starts: np.ndarray,
    *,
    iterations: int,
    learning_rate: float,
    progress: Progress = lambda i, n, cost: None,
) -> tuple[np.ndarray, list[list[float]]]:
    """Descend from every start (Adam, cosine decay), each gradient held to unit length.

    Args:
        costs_and_gradients: of points (sets, parameters): costs (sets,), and the gradient of each with respect
            to its own point.
        starts: points (sets, parameters).

    Returns:
        The best point of every descent, (sets, parameters), and the costs by iteration.
    """
    # Points go to the costs from the host: where they come from would otherwise count as another type.
    points = np.array(starts)
    moments = _ADAM.init(jnp.asarray(points))
    best, best_points, history = np.full(len(starts), np.inf), np.array(starts), []
    for iteration in range(iterations):
        before = points
        rate = learning_rate * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * iteration / iterations)))
        costs, gradients = costs_and_gradients(points)
        moved, moments = _step(points, moments, np.asarray(gradients), rate)
        points, costs = box.valid(np.asarray(moved)), np.asarray(costs)
        history.append([float(c) for c in costs])
        better = costs < best
        best, best_points = np.where(better, costs, best), np.where(better[:, None], before, best_points)
        progress(iteration + 1, iterations, float(best.min()))
    return best_points, history


@jax.jit
def _step(points, moments, gradients, rate):
    gradients = gradients / jnp.maximum(jnp.linalg.norm(gradients, axis=1, keepdims=True), 1.0)
    updates, moments = _ADAM.update(gradients, moments)
    return points - rate * updates, moments


def screen(costs: Costs, box: Box, first: np.ndarray, *, scatter: float, count: int, keep: int, seed: int):
    """The best `keep` of `count` random points around `first`, (keep, parameters)."""
    if keep < 1:
        return np.empty((0, len(first)))
    spread = np.random.default_rng(seed).normal(size=(count, len(first))) * scatter
    points = box.valid(first + spread)
    return points[np.argsort(costs(points))[:keep]]


def refine(
    costs: Costs,
    box: Box,
    candidates: np.ndarray,
    *,
    rounds: int,
    count: int,
    widest: float,
    seed: int,
    evolutions: int = 1,
) -> tuple[np.ndarray, float]:
    """The best of the candidates, and what evolution (CMA-ES) from it finds.

    Args:
        candidates: points (sets, parameters).
        rounds, count: generations, and points in each.
        widest: standard deviation of the first generation.
        evolutions: how often it is tried, from the same point with other draws; the best counts.

    Returns:
        The best point and its cost.
    """
    judged = costs(candidates)
    best, cost = candidates[np.argmin(judged)], float(judged.min())
    first, bounds = best, np.stack([box.limits[0] - SLACK, box.limits[1] + SLACK], axis=1)
    for evolution in range(evolutions):
        strategy = CMA(first, widest, bounds, seed=seed + evolution, population_size=count)
        for _ in range(rounds):
            asked = [strategy.ask() for _ in range(count)]
            points = box.valid(np.stack(asked))
            judged = costs(points)
            strategy.tell([(point, min(float(value), WORST)) for point, value in zip(asked, judged)])
            if judged.min() < cost:
                best, cost = points[np.argmin(judged)], float(judged.min())
    return best, cost


def in_chunks(function: Callable[[np.ndarray], Any], points: np.ndarray, size: int, axis: int = 0) -> Any:
    """`function` over points (sets, parameters) in chunks of one shape, compiled once; leaves joined along `axis`."""
    pieces = []
    for first in range(0, len(points), size):
        chunk = np.resize(points[first : first + size], (size, *points.shape[1:]))
        pieces.append(jax.tree.map(np.asarray, function(chunk)))
    return jax.tree.map(lambda *x: np.concatenate(x, axis=axis).take(np.arange(len(points)), axis=axis), *pieces)
