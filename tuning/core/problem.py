"""A tuning problem as a value: what is tuned, from where, and what points cost."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import jax
import numpy as np

from tuning.core.box import Box


class Problem(ABC):
    """Built from a configuration once; `tuning.core.fit.fit` works on nothing else."""

    population: ClassVar[int] = 64
    """points of a generation of evolution: one shape, compiled once"""
    widest: ClassVar[float] = 0.25
    """standard deviation of the first generation, on the scales of the box"""

    box: Box
    given: np.ndarray
    """points to start from, (given, parameters); the first is the configured start"""
    members: int
    """size of the ensemble that mini-batches are drawn from"""

    @abstractmethod
    def costs_and_gradients(self, points: np.ndarray, members: np.ndarray | None) -> tuple[Any, Any]:
        """What is descended on: costs (sets,) of points (sets, parameters), and the gradient of each with respect to
        its own point. `members`: those of the ensemble that count, (batch,); None: all."""

    @abstractmethod
    def judge(self, points: np.ndarray) -> np.ndarray:
        """What counts in the end: costs (sets,) of points (sets, parameters)."""

    def screen(self, points: np.ndarray) -> np.ndarray:
        """What random starts are chosen by: costs (sets,); as they are judged, unless that can be done for less."""
        return self.judge(points)

    def on(self, members: np.ndarray) -> "Problem | None":
        """The problem on some of the ensemble, (batch,), where points can be judged and screened on those alone; else
        None: they are judged on all."""
        return None


def in_chunks(function: Callable[[np.ndarray], Any], points: np.ndarray, size: int, axis: int = 0) -> Any:
    """`function` over points (sets, parameters) in chunks of one shape, compiled once; leaves joined along `axis`."""
    pieces = []
    for first in range(0, len(points), size):
        chunk = np.resize(points[first : first + size], (size, *points.shape[1:]))
        pieces.append(jax.tree.map(np.asarray, function(chunk)))
    return jax.tree.map(lambda *x: np.concatenate(x, axis=axis).take(np.arange(len(points)), axis=axis), *pieces)
