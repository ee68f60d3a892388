"""Observer gains tuned by gradient descent over simulated road changes.

Every start is a parameter set; all sets run over all runs at once and descend together, on the cost of
`tuning.observers.bench`: an objective of smooth settling times over runs and roads, plus noise_weight times
the mean noise of the estimate. The winner is chosen, and refined, by the settling times themselves. Every iterate is
stable by construction (`absjax.observers.designs`), and steps too large for the gains are charged.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from absjax.observers.certificate import certify
from tuning.core.box import Box
from tuning.core.descent import Descent, Progress
from tuning.core.fit import fit
from tuning.core.journal import Journal
from tuning.core.objective import Objective
from tuning.core.problem import Problem, in_chunks
from tuning.core.version import VERSION
from tuning.observers.bench import Bench, Judgement, bench_of, training_runs
from tuning.observers.config import ObserverConfig


@dataclasses.dataclass(frozen=True)
class ObserverResult:
    """A tuned observer. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    gains: dict[str, list[float]]
    """K+ and K-, and G of the adaptive observer"""
    certificate: dict[str, Any] | None
    """None of an observer that offers none"""
    before: dict[str, float]
    """worst and mean settling [s], mean noise and mean rms of the error on the runs tuned on, at the start"""
    after: dict[str, float]
    history: list[list[float]]
    """cost of each start, by iteration"""
    config: ObserverConfig
    version: str = VERSION
    interrupted: bool = False
    """whether the search was ended from the keyboard"""

    def observer(self):
        """The tuned observer."""
        return self.config.design(**self.parameters).observer(self.config.car())

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ObserverResult":
        """Read back what `to_json` gave."""
        return cls(**{**data, "config": ObserverConfig.from_json(data["config"])})


@dataclasses.dataclass(frozen=True)
class ObserverProblem(Problem):
    """An observer's parameters on a bench."""

    population: ClassVar[int] = 32
    widest: ClassVar[float] = 0.15

    config: ObserverConfig
    bench: Bench
    box: Box
    given: np.ndarray
    members: int
    objective: Objective

    @classmethod
    def of(cls, config: ObserverConfig, bench: Bench | None = None) -> "ObserverProblem":
        """The problem a configuration describes; on simulated runs unless a bench is given."""
        bench, box = bench or bench_of(config, training_runs(config)), config.box()
        given, runs = box.point(config.initial())[None], bench.stiffness.shape[0]
        return cls(config, bench, box, given, runs, Objective(config.objective, config.tail))

    def costs_and_gradients(self, points, members):
        """Costs and gradients with smooth settling times."""
        return self.weighted(points, self.config.noise_weight, members)

    def weighted(self, points, noise_weights, members=None):
        """The same with noise weights of their own, one or (sets,)."""
        weights = None if noise_weights is None else jnp.broadcast_to(jnp.asarray(noise_weights, float), len(points))
        bench = self.bench if members is None else self.bench.of(members)
        return _costs_and_gradients(bench, points, weights, self.box, self.config.initial(), self.objective)

    def judged(self, points: np.ndarray) -> list[Judgement]:
        """What parameter sets are worth, points (sets, parameters)."""
        initial = self.config.initial()
        judged = in_chunks(lambda chunk: _judged(self.bench, chunk, self.box, initial), points, self.population)
        return [jax.tree.map(lambda x, i=i: x[i], judged) for i in range(len(points))]

    def judge(self, points):
        """Costs by the settling times themselves."""
        weight = self.config.noise_weight
        return np.array([float(one.cost(self.objective, weight, exact=True)) for one in self.judged(points)])


@partial(jax.jit, static_argnames=("box", "objective"))
def _costs_and_gradients(bench: Bench, points, noise_weights, box: Box, fixed, objective: Objective):
    def one(point, weight):
        return jax.value_and_grad(lambda x: bench.judge({**fixed, **box.values(x)}).cost(objective, weight))(point)

    return jax.vmap(one, in_axes=(0, None if noise_weights is None else 0))(points, noise_weights)


@partial(jax.jit, static_argnames="box")
def _judged(bench: Bench, points, box: Box, fixed):
    return jax.vmap(lambda point: bench.judge({**fixed, **box.values(point)}))(points)


def tune_observer(
    config: ObserverConfig,
    bench: Bench | None = None,
    *,
    progress: Progress = lambda i, n, cost: None,
    journal: Journal | None = None,
) -> ObserverResult:
    """Tune an observer as the configuration says.

    Args:
        config: what to tune.
        bench: runs to tune on; simulated as the configuration says when None.
        progress: called with iteration, iterations and the best cost so far.
        journal: where evaluations are kept, to go on from.
    """
    problem = ObserverProblem.of(config, bench)
    fitted = fit(problem, config, progress=progress, journal=journal)
    parameters = config.initial() | fitted.values
    before, after = map(_summary, problem.judged(np.stack([problem.given[0], fitted.point])))
    observer = config.design(**parameters).observer(config.car())
    fields = ("plus", "minus", "adaptation")
    gains = {f: np.asarray(getattr(observer, f)).tolist() for f in fields if hasattr(observer, f)}
    certificate = certify(observer).to_json() if hasattr(observer, "certificate") else None
    return ObserverResult(
        parameters, gains, certificate, before, after, fitted.history, config, interrupted=fitted.interrupted
    )


def _summary(judgement: Judgement) -> dict[str, float]:
    return {
        "worst_settling": float(judgement.settling.max()),
        "mean_settling": float(judgement.settling.mean()),
        "mean_noise": float(judgement.noise.mean()),
        "mean_rms": float(judgement.error.mean()),
    }


def trade_off(config: ObserverConfig, starts: Sequence[Mapping[str, float]], weights: Sequence[float]):
    """Tuned sets from one end of the trade-off to the other, settling against noise.

    Args:
        starts: parameter sets every descent begins from.
        weights: of the noise, one point of the curve each.

    Returns:
        A dictionary for each weight and one for each start: the weight (None for a start), the parameters,
        and mean settling and noise.
    """
    problem = ObserverProblem.of(config)
    box = problem.box
    first = np.stack([box.point(start) for start in starts])
    grid = np.repeat(np.asarray(weights, float), len(first))
    descent = Descent(np.tile(first, (len(weights), 1)))
    descent.run(
        lambda _, points: problem.weighted(points, grid),
        box,
        iterations=config.iterations,
        learning_rate=config.learning_rate,
    )
    ends = descent.best_points

    def point(place, one, weight):
        parameters = {**config.initial(), **{name: float(value) for name, value in box.values(place).items()}}
        settled, noise = float(one.settling.mean()), float(one.noise.mean())
        return {"noise_weight": weight, "mean": settled, "noise": noise, "parameters": parameters}

    judged = problem.judged(ends)
    curve = []
    for weight in weights:
        mine = np.flatnonzero(grid == weight)
        costs = [judged[i].settling.mean() + weight * judged[i].noise.mean() + judged[i].stepping for i in mine]
        best = mine[int(np.argmin(costs))]
        curve.append(point(ends[best], judged[best], float(weight)))
    return curve, [point(x, one, None) for x, one in zip(first, problem.judged(first))]
