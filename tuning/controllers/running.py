"""The tuning of a controller for where it runs: in a control unit, told by its sensors, in scattered conditions.

Descended on is the loop of one wheel whose switchings move with their crossings (`absjax.loop.ticking_loop`), behind a
stand-in of an encoder's chain, over pairs of points (`tuning.core.slope`); of a vehicle the slope is all fitted over
them. Judged is the sampled loop itself, behind the chain. What must not be, long locks and slides above 15 km/h, long
cycles, stops without end, is no price: a set that breaks a limit in any condition it is judged in is worse than every
set that keeps them all.
"""

import dataclasses
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from absjax.loop.ticking_loop import TickingLoop
from absjax.loop.vehicle_loop import VehicleLoop
from tuning.controllers.batch import Batch, batch_of, scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import exact_charges
from tuning.controllers.problem import bounded
from tuning.controllers.regulation import Regulation, regulation_of
from tuning.controllers.scatter import scattered
from tuning.controllers.setup import Setup
from tuning.core.box import Box
from tuning.core.objective import Objective
from tuning.core.problem import Problem
from tuning.core.slope import offsets, pairs_within, pooled_slope

STRICTNESS = 10.0
"""Times the charges of `tuning.controllers.batch` for a broken limit, while descending."""
INFEASIBLE = 100.0
"""Cost from which on sets are that break a limit; more than any ratio."""


@dataclasses.dataclass(frozen=True)
class RunningProblem(Problem):
    """A controller's parameters in scattered conditions under the clock of a control unit."""

    population: ClassVar[int] = 24
    charge: ClassVar[float] = INFEASIBLE

    setup: Setup
    batch: Batch
    """the rows as they are, told the truth"""
    descended: Batch
    """the training draws, behind what is smooth"""
    judged: Batch
    """the same behind what the controller is told by"""
    objective: Objective
    box: Box
    given: np.ndarray
    members: int
    grid: tuple[float, int]
    """grid step, s, and steps to a tick"""
    regulation: Regulation | None = None
    """where a vehicle has to pass it"""

    def costs_and_gradients(self, points, members):
        """Costs at pairs of points beside each, and what their slope is."""
        config = self.setup.config
        which = np.arange(self.members) if members is None else members
        apart = offsets((config.seed, *which[:2]), len(which), points.shape[1], config.smoothing)
        rows = None if members is None else members
        return _costs_and_slopes(self.descended, points, rows, apart, self.box, self.objective, self.grid)

    def on(self, members):
        """The same of some of the training draws."""
        some = {name: getattr(self, name).of(members) for name in ("descended", "judged")}
        return dataclasses.replace(self, members=len(members), **some)

    def screen(self, points):
        """Costs behind the stand-in."""
        return self._costs(self.descended, points)

    def judge(self, points):
        """Costs on the sampled loop, behind the chain; feasible sets before all others."""
        costs = self._costs(self.judged, points)
        if self.regulation is not None:
            return self.regulation.judged(costs, self.box.arrays(points), INFEASIBLE)
        largest = self.setup.config.largest_contraction
        if largest is None:
            return costs
        excess = exact_charges(self.setup, self.box.names, self._sets(points), largest)
        return np.where(excess > 0, INFEASIBLE + costs + excess, costs)

    def _costs(self, batch: Batch, points) -> np.ndarray:
        together = self.setup.config.population or self.population
        found = scored(batch, self.box.arrays(points), *self.grid, together)
        costs = np.asarray(self.objective.costs(found.ratios))
        broken = np.sum(found.losses - found.ratios, axis=0)
        return np.where(broken > 0, INFEASIBLE + broken, costs)

    def _sets(self, points) -> np.ndarray:
        parameters = self.box.arrays(points)
        return np.stack([parameters[name] for name in self.box.names], axis=1)


@partial(jax.jit, static_argnames=("box", "objective", "grid"))
def _costs_and_slopes(batch: Batch, points, members, apart, box: Box, objective: Objective, grid):
    if members is not None:
        batch = batch.of(members)
    sets, size = points.shape
    centre, apart = pairs_within(jnp.asarray(points), jnp.asarray(apart), *box.limits)
    pair = jnp.stack([apart, -apart], axis=1)
    lanes = (centre[:, :, None] + pair[:, None]).reshape(-1, size)

    def losses_of(x) -> Any:
        stops = batch.stops_of_lanes(box.values(x), *grid, kind=TickingLoop)
        return batch.ratios(stops) + STRICTNESS * batch.charges(stops)

    if isinstance(batch.loop, VehicleLoop):
        losses, own = losses_of(lanes), jnp.zeros((batch.rows, sets, 2, size), points.dtype)
    else:
        losses, pull = jax.vjp(losses_of, lanes)
        own = bounded(pull(jnp.ones_like(losses))[0]).reshape(batch.rows, sets, 2, size)
    losses = losses.reshape(batch.rows, sets, 2)
    costs, weigh = jax.vjp(lambda x: objective.costs(x, smooth=True), losses.mean(axis=2))
    weights = weigh(jnp.ones_like(costs))[0]
    pooled = jax.vmap(lambda loss, slope: pooled_slope(loss, slope, apart))(
        losses.transpose(1, 2, 0), own.transpose(1, 2, 0, 3)
    )
    # What the gradients miss is fitted over all of the ensemble alike, whatever weight a member has.
    missing = pooled.slope - own.mean(axis=(0, 2))
    return costs, jnp.einsum("rs,rsp->sp", weights, own.mean(axis=2)) + missing


def running_problem(config: TuningConfig) -> RunningProblem:
    """The problem of a configuration whose setting is not 'located'.

    Raises:
        ConfigError: naming the entry that cannot be used.
    """
    setup = Setup.of(config)
    box = setup.box()
    given = np.stack([box.point({**setup.initial, **known}) for known in ({}, *config.known)])
    judged = scattered(setup, "training")
    descended = scattered(setup, "training", stand_in=True)
    return RunningProblem(
        setup=setup,
        batch=batch_of(setup),
        descended=descended,
        judged=judged,
        objective=Objective(config.objective, config.tail),
        box=box,
        given=given,
        members=judged.rows,
        grid=setup.sampled_grid(),
        regulation=regulation_of(config),
    )
