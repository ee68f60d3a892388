"""Descents by the located gradient and by that of the ticking loop, both judged on the sampled loop.

Five phases on the five roads from 60 and 120 km/h to 15 km/h, conditions scattered; from the untuned set and from the
one tuned on the truth. Every point a descent passes is judged under the clock on the training draws, the best of them
on test draws: what a gradient is worth is where it leads.
"""

import dataclasses
from typing import Any

import numpy as np

from tuning.controllers.batch import scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.problem import ControllerProblem
from tuning.controllers.recipes import recipes, tuned_sets
from tuning.controllers.running import RunningProblem, running_problem
from tuning.controllers.scatter import scattered
from tuning.core.descent import Descent
from tuning.core.problem import Problem

ITERATIONS, RATE = 16, 0.02
SPEEDS_KMH, DRAWS = (60.0, 120.0), 8
FROM = ("untuned", "truth")


def problem_at(period: float, draws: int = DRAWS, **other: Any) -> RunningProblem:
    """Five phases under a clock of a period [s], from the untuned set and from the shipped one."""
    recipe = recipes()["five_phase"]
    config = TuningConfig(
        setting="sampled",
        sampled_period=period,
        speeds_kmh=SPEEDS_KMH,
        stop_speed_kmh=15.0,
        objective="mean",
        draws=draws,
        checked=draws,
        start=recipe.start,
        known=(tuned_sets()["five_phase"].start,),
        tune=recipe.tune,
        limits=recipe.limits,
    )
    return running_problem(dataclasses.replace(config, **other))


def passed(problem: Problem, starts: np.ndarray, iterations: int) -> np.ndarray:
    """Points of the descents (iterations, sets, parameters) by the gradient of a problem, from starts."""
    points: list[np.ndarray] = []

    def costs_and_gradients(iteration: int, here: np.ndarray):
        points.append(here)
        return problem.costs_and_gradients(here, None)

    Descent(starts).run(costs_and_gradients, problem.box, iterations=iterations, learning_rate=RATE)
    return np.stack(points)


def table(period: float, iterations: int = ITERATIONS) -> list[dict[str, Any]]:
    """A row for each start and gradient: cost where it begins and at the best point passed, above ideal."""
    ticking = problem_at(period)
    located = ControllerProblem(
        ticking.setup, ticking.descended, ticking.objective, ticking.box, ticking.given, ticking.members, rigs=None
    )
    test = scattered(ticking.setup, "test")
    rows = []
    for label, problem in (("located", located), ("ticking, fitted too", ticking)):
        points = passed(problem, ticking.given, iterations)
        for k, start in enumerate(FROM):
            judged = ticking.judge(points[:, k])
            best = points[int(np.argmin(judged)), k]
            at_test = scored(test, ticking.box.arrays(best[None]), *ticking.grid)
            rows.append(
                {
                    "tick [ms]": f"{1e3 * period:g}",
                    "from": start,
                    "gradient": label,
                    "begins at [%]": percent(judged[0]),
                    "best passed [%]": percent(judged.min()),
                    "last [%]": percent(judged[-1]),
                    "best, test draws [%]": percent(at_test.ratios.mean()),
                    "do not end": int((np.asarray(at_test.stops.outcome) != 0).sum()),
                }
            )
    return rows


def percent(cost: float) -> str:
    """A mean ratio above ideal; what breaks a limit has none."""
    return f"{100 * (cost - 1):.2f}" if cost < 10 else "breaks a limit"
