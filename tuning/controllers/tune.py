"""An anti-lock controller tuned by gradient descent over a batch of roads and speeds.

Every start is a row of lanes, one lane per road, speed and pedal; all starts descend together, their gradients
taken in one reverse pass through the located switchings (`tuning.core.search`). Where the contraction of limit cycles
is limited, they are looked for at every point of the descent, and what exceeds the limit is charged.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import numpy as np

from absjax.controllers.base import Controller
from tuning.controllers.batch import Figures, Problem, build, judge, rows_of
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import CycleRow, certify_cycles, charges, exact_charges, rig_loops
from tuning.controllers.legacy import updated_result
from tuning.controllers.phase_times import short_phases
from tuning.core import search
from tuning.core.search import Box, Progress
from tuning.core.version import VERSION

CANDIDATES = 64
WIDEST_SEARCH = 0.25
"""Standard deviation of the first refinement on the scales of the box."""
BREACH_CHARGE = 10.0
"""Added to the cost of a set that exceeds the limit on contraction: any set that keeps it is better."""
FINALISTS = 8
"""Sets whose limit cycles are looked for in a round of refinement, where contraction is limited."""


@dataclasses.dataclass(frozen=True)
class ResultRow:
    """One road, speed and pedal: ideal and published distances [m], and the stops of the start and of the tuned set.

    `ideal` is from the pedal, None in results of earlier versions; `published_ideal` is v0^2 / (2 g mu_max), None on a
    road that changes; `published` is None where nothing is.
    """

    road: str
    speed_kmh: float
    pedal_bar_s: float | None
    ideal: float | None
    published_ideal: float | None
    published: float | None
    untuned: Figures
    tuned: Figures
    sampled: Figures

    @property
    def reached(self) -> bool | None:
        """Whether the published quantity of the tuned set, located and sampled, is at or below the published one."""
        if self.published is None:
            return None
        found = (self.tuned.published_quantity, self.sampled.published_quantity)
        return all(d is not None and d <= self.published for d in found)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ResultRow":
        """Read back what `dataclasses.asdict` gave."""
        stops = {name: Figures(**data[name]) for name in ("untuned", "tuned", "sampled")}
        return cls(**{**data, **stops})


@dataclasses.dataclass(frozen=True)
class TuningResult:
    """A tuned controller and what it is worth. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    rows: list[ResultRow]
    cycles: list[CycleRow]
    """limit cycles on every uniform road; empty for a controller without"""
    cost: float
    """of the winner, at the worse of both semantics"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that ended on one of their limits"""
    config: TuningConfig
    version: str = VERSION
    warnings: list[str] = dataclasses.field(default_factory=list)
    """what a user of the set should know: phases that last less than a tick, and the like"""

    @property
    def controller(self) -> Controller:
        """The tuned controller."""
        return self.config.kind.build(self.config.car(), self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningResult":
        """Read back what `to_json` gave, or a result of an earlier version."""
        known = updated_result(data)
        rows = [ResultRow.from_json(row) for row in known["rows"]]
        cycles = [CycleRow(**row) for row in known["cycles"]]
        return cls(**{**known, "rows": rows, "cycles": cycles, "config": TuningConfig.from_json(known["config"])})


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
        seed=config.seed + 1,
        evolutions=config.evolutions,
    )
    tuned = {name: float(value) for name, value in box.values(chosen).items()}
    parameters = config.initial() | tuned
    return TuningResult(
        parameters=parameters,
        rows=score(config, problem, parameters),
        warnings=short_phases(config, problem, parameters),
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
        charged = costs + 2 * BREACH_CHARGE
        charged[best] = costs[best] + excess + BREACH_CHARGE * (excess > 0)
        return charged
    return costs


def _starts(config: TuningConfig, problem: Problem, box: Box) -> np.ndarray:
    """The configured start, the known ones, and the best of the screened random ones."""
    initial = config.initial()
    given = box.valid(np.stack([box.point({**initial, **known}) for known in ({}, *config.known)]))

    def costs(points):
        return judge(problem, {name: np.asarray(values) for name, values in box.values(points).items()}).costs

    keep = config.starts - len(given)
    others = search.screen(
        costs, box, given[0], scatter=config.scatter, count=config.screened, keep=keep, seed=config.seed
    )
    return np.concatenate([given, others])


def score(config: TuningConfig, problem: Problem, parameters: Mapping[str, float]) -> list[ResultRow]:
    """The stops of the configured start and of tuned parameters, located, and those sampled."""
    initial = config.initial()
    both = {name: np.array([initial[name], value]) for name, value in parameters.items()}
    located, sampled = judge(problem, both), judge(problem, both, *config.sampled_grid())
    rows = [
        ResultRow(
            road=row.name,
            speed_kmh=row.speed_kmh,
            pedal_bar_s=row.pedal_rate,
            ideal=float(problem.ideal[i]),
            published_ideal=row.published_ideal,
            published=row.published(config.controller),
            untuned=located.figures(i, 0),
            tuned=located.figures(i, 1),
            sampled=sampled.figures(i, 1),
        )
        for i, row in enumerate(rows_of(config))
    ]
    return sorted(rows, key=lambda row: (row.speed_kmh, row.ideal))
