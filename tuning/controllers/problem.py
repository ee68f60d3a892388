"""The tuning of a controller over a batch of roads, speeds and pedals as a problem.

Every start is a row of lanes, one lane per road, speed and pedal; all starts descend together, their gradients
taken in one reverse pass through the located switchings. Where the contraction of limit cycles is limited, they are
looked for at every point of the descent, and what exceeds the limit is charged.
"""

import dataclasses
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from absjax.loop.closed_loop import ClosedLoop
from tuning.controllers.batch import Batch, Scored, batch_of, scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import charges, exact_charges, rig_loops
from tuning.controllers.regulation import Regulation, regulation_of
from tuning.controllers.setup import Setup
from tuning.core.box import Box
from tuning.core.objective import Objective
from tuning.core.problem import Problem

BREACH_CHARGE = 10.0
"""Added to the cost of a set that exceeds the limit on contraction, or breaches a row of the regulation: any set that
keeps them is better."""
LARGEST_GRADIENT = 10.0
"""Of the loss of one stop, on the scales of the box. Where a stop is unstable, as `absjax.loop.growth` has it, its
derivative may be 10^5 and holds nowhere: it counts with its direction, and no more than this."""
FINALISTS = 8
"""Sets whose limit cycles are looked for in a generation, where contraction is limited."""


@dataclasses.dataclass(frozen=True)
class ControllerProblem(Problem):
    """A controller's parameters on a batch of rows."""

    charge: ClassVar[float] = BREACH_CHARGE

    setup: Setup
    batch: Batch
    objective: Objective
    box: Box
    given: np.ndarray
    members: int
    rigs: ClosedLoop | None
    """loops on a rig, where contraction is limited"""
    regulation: Regulation | None = None
    """where a vehicle has to pass it"""

    def costs_and_gradients(self, points, members):
        """Costs and gradients, located, with a smooth maximum of the losses for the worst."""
        limits = (self.setup.config.largest_contraction, self.setup.kind.grid_step)
        return _costs_and_gradients(self.batch, self.rigs, points, members, self.box, self.objective, limits)

    def on(self, members):
        """The same of some of the rows."""
        return dataclasses.replace(self, batch=self.batch.of(members), members=len(members))

    def screen(self, points):
        """Costs, located."""
        return np.asarray(self.objective.costs(self._scored(points).losses))

    def judge(self, points):
        """Costs at the worse of both semantics, located and sampled.

        A descent can end where a switching is missed, or a hold never left, as soon as guards are only
        tested now and then; such an end loses to one that is robust. Where contraction is limited, or the
        regulation is to be passed, the best few are charged for it, and the others are out.
        """
        parameters, setup = self.box.arrays(points), self.setup
        sampled = self._scored(points, *setup.sampled_grid()).losses
        costs = np.maximum(self.screen(points), np.asarray(self.objective.costs(sampled)))
        largest = setup.config.largest_contraction
        if self.regulation is not None:
            return self.regulation.judged(costs, parameters, BREACH_CHARGE)
        if largest is None:
            return costs
        best = np.argsort(costs)[:FINALISTS]
        sets = np.stack([parameters[name][best] for name in self.box.names], axis=1)
        excess = exact_charges(setup, self.box.names, sets, largest)
        charged = costs + 2 * BREACH_CHARGE
        charged[best] = costs[best] + excess + BREACH_CHARGE * (excess > 0)
        return charged

    def _scored(self, points, *grid) -> Scored:
        """A generation at a time."""
        together = self.setup.config.population or self.population
        return scored(self.batch, self.box.arrays(points), *grid, chunk=together)


@partial(jax.jit, static_argnames=("box", "objective", "limits"))
def _costs_and_gradients(batch: Batch, rigs, points, members, box: Box, objective: Objective, limits):
    if members is not None:
        batch = batch.of(members)

    points = jnp.asarray(points)
    lanes = jnp.tile(points, (batch.rows, 1))
    losses, pull = jax.vjp(lambda x: batch.losses(batch.stops_of_lanes(box.values(x))), lanes)
    own = bounded(pull(jnp.ones_like(losses))[0]).reshape(batch.rows, *points.shape)
    costs, weigh = jax.vjp(lambda losses: objective.costs(losses, smooth=True), losses)
    gradients = jnp.einsum("rs,rsp->sp", weigh(jnp.ones_like(costs))[0], own)
    if rigs is not None:
        largest, step = limits

        # Forward mode: the contraction is a second derivative, and its transpose takes twice as long to compile.
        # Sets do not know of each other, so one direction serves them all.
        def along(direction):
            directions = jnp.broadcast_to(direction, points.shape)
            return jax.jvp(lambda x: charges(rigs, box.values(x), step, largest), (points,), (directions,))

        charged, columns = jax.vmap(along, out_axes=(None, 0))(jnp.eye(points.shape[1]))
        costs, gradients = costs + charged, gradients + columns.T
    return costs, gradients


def bounded(gradients):
    """Gradients (lanes, parameters), none longer than `LARGEST_GRADIENT`; one that has overflowed counts as none."""
    finite = jnp.all(jnp.isfinite(gradients), axis=1, keepdims=True)
    gradients = jnp.where(finite, gradients, 0.0)
    length = jnp.linalg.norm(gradients, axis=1, keepdims=True)
    return gradients * jnp.minimum(1.0, LARGEST_GRADIENT / jnp.maximum(length, LARGEST_GRADIENT))


def problem_of(config: TuningConfig) -> ControllerProblem:
    """The problem a configuration describes.

    Raises:
        ConfigError: naming the entry that cannot be used.
    """
    setup = Setup.of(config)
    box, batch = setup.box(), batch_of(setup)
    given = np.stack([box.point({**setup.initial, **known}) for known in ({}, *config.known)])
    rigs = None if config.largest_contraction is None else rig_loops(setup)
    objective, passes = Objective(config.objective, config.tail), regulation_of(config)
    return ControllerProblem(setup, batch, objective, box, given, batch.rows, rigs, passes)
