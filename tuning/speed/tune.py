"""An estimator of the vehicle's speed tuned on simulated stops by gradient descent."""

import dataclasses
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from absjax.speed.base import SpeedEstimator
from tuning.core.box import Box
from tuning.core.descent import Progress
from tuning.core.fit import Fitted, fit
from tuning.core.journal import Journal
from tuning.core.objective import Objective
from tuning.core.problem import Problem, in_chunks
from tuning.speed.bench import Bench
from tuning.speed.config import SpeedConfig
from tuning.speed.estimators import with_values


@partial(jax.jit, static_argnames=("box", "objective", "gradients"))
def _costs(bench: Bench, estimator: SpeedEstimator, points, members, box: Box, objective: Objective, gradients: bool):
    if members is not None:
        bench = bench.of_members(members)

    def cost(point):
        losses = bench.errors(with_values(estimator, box.values(point))).rms
        return objective.costs(losses, smooth=gradients)

    return jax.vmap(jax.value_and_grad(cost) if gradients else cost)(points)


@dataclasses.dataclass(frozen=True)
class SpeedProblem(Problem):
    """Parameters of an estimator on stops."""

    population: ClassVar[int] = 16

    bench: Bench
    start: SpeedEstimator
    box: Box
    given: np.ndarray
    members: int
    objective: Objective

    @classmethod
    def of(cls, config: SpeedConfig, name: str, bench: Bench) -> "SpeedProblem":
        """The problem of an estimator that has something to tune."""
        start, box = config.initial(name), config.box(name)
        assert box is not None
        given = box.point({parameter: getattr(start, parameter) for parameter in box.names})[None]
        objective = Objective(config.objective, config.tail)
        return cls(bench, jax.tree.map(jnp.asarray, start), box, given, bench.speed.shape[0], objective)

    def costs_and_gradients(self, points, members):
        """Costs and gradients."""
        return _costs(self.bench, self.start, points, members, self.box, self.objective, gradients=True)

    def judge(self, points):
        """Costs."""
        return in_chunks(
            lambda chunk: _costs(self.bench, self.start, chunk, None, self.box, self.objective, gradients=False),
            points,
            self.population,
        )


def tune_speed(config: SpeedConfig, name: str, bench: Bench, progress: Progress, journal: Journal) -> Fitted | None:
    """Tune an estimator as the configuration says; None where it has nothing to tune."""
    if config.box(name) is None:
        return None
    return fit(SpeedProblem.of(config, name, bench), config, progress=progress, journal=journal)
