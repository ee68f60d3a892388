"""The slope that descends for a chain, of what is smooth in its place, against differences through the chain itself.

Five phases on the five roads from 60 and 120 km/h to 15 km/h, conditions scattered, told by encoders with errors
through a chain that has learned them; at sets tuned on the truth, for 5 ms and for the chain. Beside it the located
slope, of the same stops told the truth.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tuning.controllers.batch import Batch, scored
from tuning.controllers.chain import PREFIX
from tuning.controllers.problem import bounded
from tuning.controllers.recipes import recipes
from tuning.controllers.running import RunningProblem, running_problem
from tuning.controllers.study.by_setting import contestants
from tuning.controllers.study.slopes import CHANGE, cosine, wrong_signs
from tuning.core.box import Box

SPEEDS_KMH, DRAWS = (60.0, 120.0), 20
AT = ("truth", "5 ms", "chain")


def problem_through(draws: int = DRAWS) -> RunningProblem:
    """The recipe for the chain on more draws; its points are the untuned set and those of `AT`."""
    recipe, sets = recipes()["five_phase_through_chain"], contestants("five_phase")
    given = {"known": tuple({**recipe.start, **sets[name]} for name in AT), "starts": 1 + len(AT)}
    return running_problem(dataclasses.replace(recipe, speeds_kmh=SPEEDS_KMH, draws=draws, checked=draws, **given))


@partial(jax.jit, static_argnames="box")
def _located(batch: Batch, points, box: Box):
    """Gradients (stops, parameters) of the ratios at a point for each stop, switchings located."""
    ratios, pull = jax.vjp(lambda x: batch.ratios(batch.stops_of_lanes(box.values(x))), points)
    return bounded(pull(jnp.ones_like(ratios))[0])


def differences(problem: RunningProblem, point: np.ndarray) -> tuple[Any, Any, np.ndarray]:
    """Stops at a point through the chain and behind the stand-in, and central differences through the chain of the
    ratios, (stops, parameters)."""
    steps = CHANGE * np.eye(len(point))
    points = np.concatenate([[point], point + steps, point - steps])
    through = scored(problem.judged, problem.box.arrays(points), *problem.grid, problem.population)
    smooth = scored(problem.descended, problem.box.arrays(point[None]), *problem.grid, problem.population)
    up, down = np.split(through.ratios[:, 1:], 2, axis=1)
    return through.ratios[:, 0], smooth.ratios[:, 0], (up - down) / (2 * CHANGE)


def table(draws: int = DRAWS) -> list[dict[str, Any]]:
    """A row for each set: stops behind the stand-in and through the chain, and cosines to the differences."""
    problem, rows = problem_through(draws), []
    controller = np.array([not name.startswith(PREFIX) for name in problem.box.names])
    for name, point in zip(AT, problem.given[1:]):
        through, smooth, by_stop = differences(problem, point)
        wanted, apart = by_stop.mean(axis=0), np.abs(smooth / through - 1)
        found = np.asarray(problem.costs_and_gradients(point[None], None)[1])[0]
        truth = dataclasses.replace(problem.judged, sensor=None)
        located = np.asarray(_located(truth, np.tile(point, (problem.members, 1)), problem.box)).mean(axis=0)
        halves = by_stop[::2].mean(axis=0), by_stop[1::2].mean(axis=0)
        rows.append(
            {
                "set, tuned for": name,
                "stops": problem.members,
                "above ideal: chain [%]": round(100 * (through.mean() - 1), 2),
                "stand-in [%]": round(100 * (smooth.mean() - 1), 2),
                "a stop apart: mean, most [%]": f"{100 * apart.mean():.2f}, {100 * apart.max():.2f}",
                "cosine, located": round(cosine(located[controller], wanted[controller]), 3),
                "cosine, descended by": round(cosine(found[controller], wanted[controller]), 3),
                "with the chain's": round(cosine(found, wanted), 3),
                "cosine of halves": round(cosine(*(half[controller] for half in halves)), 3),
                "wrong signs, descended by": wrong_signs(found, wanted),
            }
        )
    return rows
