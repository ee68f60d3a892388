"""An estimator of side-slip tuned on logs by gradient descent, and judged on others.

The losses are those of `tuning.sideslip.bench.LogSet.losses`, less what they are at the start, so that each says by how
much a log has become better or worse. Gradients go forward through the
scan: few parameters, and no states to be kept for thousands of samples.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from absjax.sideslip.base import Estimator
from absjax.sideslip.car import Car
from tuning.core.box import Box
from tuning.core.descent import Progress
from tuning.core.fit import fit
from tuning.core.journal import Journal
from tuning.core.objective import Objective
from tuning.core.problem import Problem
from tuning.core.version import VERSION
from tuning.logs.vehicle_log import VehicleLog
from tuning.sideslip.bench import LogSet, errors_of
from tuning.sideslip.config import SideSlipConfig
from tuning.sideslip.estimators import parameters_of, with_values

BEFORE, AFTER = "side-slip before [deg]", "side-slip after [deg]"
"""Columns of the rms errors."""


@dataclasses.dataclass(frozen=True)
class SideSlipResult:
    """A tuned estimator. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    logs: list[dict[str, Any]]
    """a row a log: rms errors before and after, and whether it was tuned on"""
    each: list[dict[str, Any]]
    """a row a log that was held out in turn: rms errors before and after, and the parameters tuned on the others"""
    on_limit: list[str]
    history: list[list[float]]
    """cost of each start, by iteration"""
    config: SideSlipConfig
    version: str = VERSION
    interrupted: bool = False
    """whether the search was ended from the keyboard"""

    def estimator(self) -> Estimator:
        """The tuned estimator."""
        return with_values(self.config.initial(), self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "SideSlipResult":
        """Read back what `to_json` gave."""
        return cls(**{**data, "config": SideSlipConfig.from_json(data["config"])})


@partial(jax.jit, static_argnames=("box", "objective", "gradients"))
def _costs(logs: LogSet, estimator: Estimator, points, members, prior, box: Box, objective: Objective, gradients: bool):
    weight, given, base = prior
    if members is not None:
        logs, base = logs.of_members(members), base[members]

    def cost(point):
        losses = logs.losses(with_values(estimator, box.values(point))) - base
        return objective.costs(losses, smooth=gradients) + weight * jnp.mean((point - given) ** 2)

    def one(point):
        if not gradients:
            return cost(point)

        def along(direction):
            return jax.jvp(cost, (point,), (direction,))

        return jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(box.names)))

    return jax.lax.map(one, points)


@dataclasses.dataclass(frozen=True)
class SideSlipProblem(Problem):
    """Parameters of an estimator on logs."""

    population: ClassVar[int] = 8

    logs: LogSet
    start: Estimator
    box: Box
    given: np.ndarray
    members: int
    objective: Objective
    prior: tuple[Any, Any, Any]
    """weight, point it is at, and losses of the logs there"""

    @classmethod
    def of(cls, config: SideSlipConfig, logs: LogSet) -> "SideSlipProblem":
        """The problem a configuration describes, on logs."""
        start, box = config.initial(), config.box()
        values = {name: value for name, (value, _, _) in parameters_of(start).items()}
        objective = Objective(config.objective, config.tail)
        plain = jax.tree.map(jnp.asarray, logs.nameless())
        start, given = jax.tree.map(jnp.asarray, start), box.point(values)
        prior = config.prior, given, jax.jit(LogSet.losses)(plain, start)
        return cls(plain, start, box, given[None], len(logs.names), objective, prior)

    def costs_and_gradients(self, points, members):
        """Costs and gradients."""
        return _costs(self.logs, self.start, points, members, self.prior, self.box, self.objective, gradients=True)

    def judge(self, points):
        """Costs."""
        return np.asarray(
            _costs(self.logs, self.start, points, None, self.prior, self.box, self.objective, gradients=False)
        )


def tune_side_slip(
    config: SideSlipConfig,
    tuned: Sequence[tuple[VehicleLog, Car]],
    held_out: Sequence[tuple[VehicleLog, Car]] = (),
    *,
    progress: Progress = lambda i, n, cost: None,
    journal: Journal | None = None,
) -> SideSlipResult:
    """Tune an estimator as the configuration says.

    Args:
        tuned: logs that are tuned on, with their cars.
        held_out: logs that are judged on only.
        progress: called with iteration, iterations and the best cost so far.
        journal: where evaluations are kept, to go on from.
    """
    found = fit(SideSlipProblem.of(config, _set(tuned, config.biases)), config, progress=progress, journal=journal)
    start = config.initial()
    best = with_values(start, found.values)
    rows = [{**row, "tuned on": "yes"} for row in _rows(tuned, start, best)]
    rows += [{**row, "tuned on": "no"} for row in _rows(held_out, start, best)]
    each, interrupted = [], found.interrupted
    for i in range(len(tuned) if config.each else 0):
        if interrupted:
            break
        rest = [log for k, log in enumerate(tuned) if k != i]
        other = fit(SideSlipProblem.of(config, _set(rest, config.biases)), config, progress=progress, journal=journal)
        interrupted = other.interrupted
        told = with_values(start, other.values)
        row = _rows([tuned[i]], start, told)[0]
        on = [(r[BEFORE], r[AFTER]) for r in _rows(rest, start, told)]
        ratio = float(np.exp(np.mean([np.log(after / before) for before, after in on])))
        each.append(
            {**row, "ratio": row[AFTER] / row[BEFORE]} | {"ratio on the others, tuned on": ratio, **other.values}
        )
    return SideSlipResult(found.values, rows, each, found.on_limit, found.history, config, interrupted=interrupted)


def _set(logs: Sequence[tuple[VehicleLog, Car]], biases: Sequence[float] = (0.0,)) -> LogSet:
    """Logs side by side, each with every bias of the lateral accelerometer."""
    return LogSet.of([log.biased(bias) for log, _ in logs for bias in biases], [car for _, car in logs for _ in biases])


def _rows(logs: Sequence[tuple[VehicleLog, Car]], before: Estimator, after: Estimator) -> list[dict[str, Any]]:
    """Errors of two estimators, a row a log."""
    if not logs:
        return []
    beside = _set(logs)
    old, new = errors_of(beside, before), errors_of(beside, after)
    return [
        {
            "log": name,
            BEFORE: float(np.degrees(old.side_slip[i])),
            AFTER: float(np.degrees(new.side_slip[i])),
            "vy before [m/s]": float(old.lateral_speed[i]),
            "vy after [m/s]": float(new.lateral_speed[i]),
        }
        for i, name in enumerate(beside.names)
    ]
