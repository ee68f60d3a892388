"""Anti-lock thresholds and rates tuned by gradient descent over a batch of roads and speeds.

Every start is a row of lanes, one lane per road and speed; all starts descend together, their gradients
taken in one reverse pass through the located switchings. Parameters move on a logarithmic scale between
their limits, and stay on a limit they have reached.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from absjax.control.five_phase import FivePhase
from absjax.parameters import bounds_of
from tuning.batch import Problem, Row, build, judge, score
from tuning.config import CONTROLLERS, TuningConfig
from tuning.version import VERSION

CANDIDATES = 256
WIDEST_SEARCH, NARROWING = 0.06, 0.7
"""Standard deviation of the first refinement on the logarithms, and its factor from one to the next."""


@dataclasses.dataclass(frozen=True)
class TuningResult:
    """A tuned controller and what it is worth. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    rows: list[Row]
    cost: float
    """of the winner, at the worse of both semantics"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that ended on one of their limits"""
    config: TuningConfig
    version: str = VERSION

    @property
    def controller(self) -> FivePhase:
        """The tuned controller."""
        return CONTROLLERS[self.config.controller](**self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningResult":
        """Read back what `to_json` gave."""
        rows = [Row(**row) for row in data["rows"]]
        return cls(**{**data, "rows": rows, "config": TuningConfig.from_json(data["config"])})


def tune_abs(
    config: TuningConfig, *, progress: Callable[[int, int, float], None] = lambda i, n, cost: None
) -> TuningResult:
    """Tune a controller as the configuration says.

    Args:
        config: what to tune.
        progress: called with iteration, iterations and the best cost so far.
    """
    problem = build(config)
    names, low, high = config.box()
    box = np.log(low), np.log(high)
    ends, history = descend(config, problem, progress)
    chosen, cost = _refine(config, problem, names, ends, box)
    base = config.base_controller()
    tuned = {name: float(value) for name, value in zip(names, np.exp(chosen))}
    parameters = {name: float(getattr(base, name)) for name in bounds_of(base)} | tuned
    edge = (np.abs(chosen - box[0]) < 1e-6) | (np.abs(chosen - box[1]) < 1e-6)
    return TuningResult(
        parameters=parameters,
        rows=score(config, parameters),
        cost=cost,
        history=history,
        on_limit=[name for name, at in zip(names, edge) if at],
        config=config,
    )


def descend(config: TuningConfig, problem: Problem, progress: Callable[[int, int, float], None]):
    """Run the descents, located.

    Returns:
        Logarithms of the best point of every descent, then of every start (2 starts, parameters), and
        the costs of the starts by iteration.
    """
    names, low, high = config.box()
    box = np.log(low), np.log(high)
    logs = jnp.asarray(_starts(config, problem, names, box))
    moments, first_logs = _ADAM.init(logs), np.asarray(logs)
    history, best, best_logs = [], np.full(len(logs), np.inf), np.array(logs)
    for iteration in range(config.iterations):
        before = np.asarray(logs)
        rate = config.learning_rate * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * iteration / config.iterations)))
        logs, moments, costs = _descend(problem, logs, moments, rate, box, names)
        costs = np.asarray(costs)
        history.append([float(c) for c in costs])
        better = costs < best
        best, best_logs = np.where(better, costs, best), np.where(better[:, None], before, best_logs)
        progress(iteration + 1, config.iterations, float(best.min()))
    return np.concatenate([best_logs, first_logs]), history


_ADAM = optax.chain(optax.zero_nans(), optax.scale_by_adam())


@partial(jax.jit, static_argnames="names")
def _descend(problem: Problem, logs, moments, rate, box, names):
    """One step of all descents, which do not know of each other: each gradient is held to unit length."""

    def total(logs):
        costs = problem.smooth_costs(problem.stops(dict(zip(names, jnp.exp(logs.T)))))
        return costs.sum(), costs

    (_, costs), gradient = jax.value_and_grad(total, has_aux=True)(logs)
    gradient = gradient / jnp.maximum(jnp.linalg.norm(gradient, axis=1, keepdims=True), 1.0)
    updates, moments = _ADAM.update(gradient, moments)
    return jnp.clip(logs - rate * updates, *box), moments, costs


def _validate(config: TuningConfig, problem: Problem, names, logs) -> np.ndarray:
    """Cost of each parameter set at the worse of both semantics, located and sampled.

    A descent can end where a switching is missed, or a hold never left, as soon as guards are only
    tested now and then; such an end loses to one that is robust.
    """
    parameters = dict(zip(names, np.exp(logs.T)))
    return np.maximum(judge(problem, parameters).costs, judge(problem, parameters, *config.sampled_grid()).costs)


def _refine(config: TuningConfig, problem: Problem, names, logs, box) -> tuple[np.ndarray, float]:
    """The best of the descents' ends and starts under both semantics, and what random search around it finds."""
    rng = np.random.default_rng(config.seed + 1)
    costs = _validate(config, problem, names, logs)
    best, cost = logs[np.argmin(costs)], float(costs.min())
    for sweep in range(config.refinements):
        spread = WIDEST_SEARCH * NARROWING**sweep
        nearby = np.clip(best + rng.normal(size=(CANDIDATES, len(best))) * spread, *box)
        costs = _validate(config, problem, names, nearby)
        if costs.min() < cost:
            best, cost = nearby[np.argmin(costs)], float(costs.min())
    return best, cost


def _starts(config: TuningConfig, problem: Problem, names, box) -> np.ndarray:
    """The configured start, the known ones, and the best of the screened random ones."""
    base = config.base_controller()
    given = np.log([[p.get(name, float(getattr(base, name))) for name in names] for p in ({}, *config.known)])
    wanted = config.starts - len(given)
    scatter = np.random.default_rng(config.seed).normal(size=(config.screened, len(names))) * config.scatter
    scattered = np.clip(given[0] + scatter, *box)
    if wanted:
        costs = judge(problem, dict(zip(names, np.exp(scattered.T)))).costs
        given = np.concatenate([given, scattered[np.argsort(costs)[:wanted]]])
    return np.clip(given, *box)
