"""The last round of a search: evolution (CMA-ES) from the best, on what counts."""

from collections.abc import Callable

import numpy as np
from cmaes import CMA

from tuning.core.box import Box

Costs = Callable[[np.ndarray], np.ndarray]
"""Costs (sets,) of points (sets, parameters)."""
SLACK = 1e-9
"""By which evolution may leave the limits before it is brought back: it needs an interior."""
WORST = 1e9
"""Cost in evolution of what has none."""


class Evolution:
    """The best point so far, and what evolution from it finds."""

    def __init__(self, box: Box, points: np.ndarray, costs: np.ndarray):
        """The best of points (sets, parameters) of known costs (sets,)."""
        self.box = box
        self.point, self.cost = points[np.argmin(costs)], float(np.min(costs))

    def run(
        self,
        costs: Costs,
        *,
        rounds: int,
        count: int,
        widest: float,
        seed: int,
        evolutions: int = 1,
        judge: Costs | None = None,
        told: Callable[[float], None] = lambda cost: None,
    ) -> "Evolution":
        """Evolve.

        Args:
            costs: of points.
            judge: what counts, where `costs` are others in each generation, as on members of an ensemble that are drawn
                anew: the best of the last generations are judged by it. None: `costs` are what counts.
            told: called after each generation with the best cost so far; with the best of the generation where there is
                a `judge`.
            rounds: generations.
            count: points in each.
            widest: standard deviation of the first generation.
            seed: of the draws.
            evolutions: how often it is tried, from the same point with other draws; the best counts.
        """
        low, high = self.box.limits
        first, bounds = self.point, np.stack([low - SLACK, high + SLACK], axis=1)
        for evolution in range(evolutions):
            strategy = CMA(first, widest, bounds, seed=seed + evolution, population_size=count)
            leaders = []
            for _ in range(rounds):
                asked = [strategy.ask() for _ in range(count)]
                points = self.box.valid(np.stack(asked))
                judged = costs(points)
                strategy.tell([(point, min(float(value), WORST)) for point, value in zip(asked, judged)])
                if judge is None:
                    self._take(points, judged)
                leaders.append(points[np.argmin(judged)])
                told(self.cost if judge is None else float(judged.min()))
            if judge is not None and leaders:
                points = np.stack([*leaders[-count + 1 :], self.box.valid(strategy.mean[None])[0]])
                self._take(points, judge(points))
        return self

    def _take(self, points: np.ndarray, costs: np.ndarray) -> None:
        """Take the best of points if it is better than the best so far."""
        if costs.min() < self.cost:
            self.point, self.cost = points[np.argmin(costs)], float(costs.min())


def refine(costs: Costs, box: Box, candidates: np.ndarray, **evolution) -> tuple[np.ndarray, float]:
    """The best of candidates (sets, parameters), and what evolution from it finds (see `Evolution.run`).

    Returns:
        The best point and its cost.
    """
    found = Evolution(box, candidates, costs(candidates)).run(costs, **evolution)
    return found.point, found.cost
