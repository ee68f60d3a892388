"""An anti-lock controller tuned by gradient descent over a batch of roads and speeds.

Every start is a row of lanes, one lane per road and speed; all starts descend together, their gradients
taken in one reverse pass through the located switchings (`tuning.search`). Where the contraction of limit cycles
is limited, they are looked for at every point of the descent, and what exceeds the limit is charged.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import numpy as np

from absjax.closed_loop import Controller
from tuning import search
from tuning.batch import Problem, Row, build, judge, score
from tuning.config import TuningConfig
from tuning.cycles import CycleRow, certify_cycles, charges, exact_charges, rig_loops
from tuning.search import Box, Progress
from tuning.version import VERSION

CANDIDATES = 256
WIDEST_SEARCH, NARROWING = 0.06, 0.7
"""Standard deviation of the first refinement on the scales of the box, and its factor from one to the next."""
BREACH_CHARGE = 10.0
"""Added to the cost of a set that exceeds the limit on contraction: any set that keeps it is better."""
FINALISTS = 8
"""Sets whose limit cycles are looked for in a round of refinement, where contraction is limited."""


@dataclasses.dataclass(frozen=True)
class TuningResult:
    """A tuned controller and what it is worth. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    rows: list[Row]
    cycles: list[CycleRow]
    """limit cycles on every road; empty for a controller without"""
    cost: float
    """of the winner, at the worse of both semantics"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that ended on one of their limits"""
    config: TuningConfig
    version: str = VERSION

    @property
    def controller(self) -> Controller:
        """The tuned controller."""
        return self.config.kind.build(self.config.car(), self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningResult":
        """Read back what `to_json` gave."""
        rows, cycles = [Row(**row) for row in data["rows"]], [CycleRow(**row) for row in data["cycles"]]
        return cls(**{**data, "rows": rows, "cycles": cycles, "config": TuningConfig.from_json(data["config"])})


def tune_abs(config: TuningConfig, *, progress: Progress = lambda i, n, cost: None) -> TuningResult:
    """Tune a controller as the configuration says.

    Args:
        config: what to tune.
        progress: called with iteration, iterations and the best cost so far.
    """
    problem, box = build(config), config.box()
    ends, history = descend(config, problem, box, progress)
    chosen, cost = search.refine(
        lambda points: _validate(config, problem, box, points),
        box,
        ends,
        rounds=config.refinements,
        count=CANDIDATES,
        widest=WIDEST_SEARCH,
        narrowing=NARROWING,
        seed=config.seed + 1,
    )
    tuned = {name: float(value) for name, value in box.values(chosen).items()}
    parameters = config.initial() | tuned
    return TuningResult(
        parameters=parameters,
        rows=score(config, parameters),
        cycles=certify_cycles(config, parameters),
        cost=cost,
        history=history,
        on_limit=box.on_limit(chosen),
        config=config,
    )


def descend(config: TuningConfig, problem: Problem, box: Box, progress: Progress = lambda i, n, cost: None):
    """Run the descents, located.

    Returns:
        The best point of every descent, then every start, (2 starts, parameters), and the costs of the starts
        by iteration.
    """
    starts = _starts(config, problem, box)
    loops = None if config.largest_contraction is None else rig_loops(config)
    limits = (config.largest_contraction, config.kind.step)
    ends, history = search.descend(
        lambda points: _costs_and_gradients(problem, loops, points, box, limits),
        box,
        starts,
        iterations=config.iterations,
        learning_rate=config.learning_rate,
        progress=progress,
    )
    return np.concatenate([ends, starts]), history


@partial(jax.jit, static_argnames=("box", "limits"))
def _costs_and_gradients(problem: Problem, loops, points, box: Box, limits):
    def total(points):
        parameters = box.values(points)
        costs = problem.smooth_costs(parameters)
        if loops is not None:
            largest, step = limits
            costs = costs + charges(loops, parameters, step, largest)
        return costs.sum(), costs

    (_, costs), gradients = jax.value_and_grad(total, has_aux=True)(points)
    return costs, gradients


def _validate(config: TuningConfig, problem: Problem, box: Box, points) -> np.ndarray:
    """Cost of each point at the worse of both semantics, located and sampled.

    A descent can end where a switching is missed, or a hold never left, as soon as guards are only
    tested now and then; such an end loses to one that is robust. Where contraction is limited the best few
    are charged for it, and the others are out.
    """
    parameters = {name: np.asarray(values) for name, values in box.values(points).items()}
    costs = np.maximum(judge(problem, parameters).costs, judge(problem, parameters, *config.sampled_grid()).costs)
    if config.largest_contraction is not None:
        best = np.argsort(costs)[:FINALISTS]
        sets = np.stack([parameters[name][best] for name in box.names], axis=1)
        excess = exact_charges(config, box.names, sets)
        charged = np.full(len(costs), np.inf)
        charged[best] = costs[best] + excess + BREACH_CHARGE * (excess > 0)
        return charged
    return costs


def _starts(config: TuningConfig, problem: Problem, box: Box) -> np.ndarray:
    """The configured start, the known ones, and the best of the screened random ones."""
    initial = config.initial()
    given = np.clip(np.stack([box.point({**initial, **known}) for known in ({}, *config.known)]), *box.limits)

    def costs(points):
        return judge(problem, {name: np.asarray(values) for name, values in box.values(points).items()}).costs

    keep = config.starts - len(given)
    others = search.screen(
        costs, box, given[0], scatter=config.scatter, count=config.screened, keep=keep, seed=config.seed
    )
    return np.concatenate([given, others])
