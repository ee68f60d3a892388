"""The tunings of the demonstration: under a given pedal, and what each limit costs."""

import dataclasses
from typing import Any

import numpy as np

from tuning.controllers.batch import scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.problem import problem_of
from tuning.controllers.result import TuningResult
from tuning.core.descent import Progress
from tuning.core.evolution import refine

TUNED = ("eps0", "eps0_growth", "eps1", "eps2", "eps3", "eps4", "eps5", "u1", "u3", "u4", "fallback")


def limited() -> TuningConfig:
    """Five phases under 400 bar/s, 750 bar/s, a lag of 5 ms and thresholds of 10 m/s^2, from the default set
    but for a first threshold that grows with speed."""
    return TuningConfig(
        start={"eps0_growth": 2.0},
        tune=TUNED,
        limits={"fallback": (0.3, 0.99), "u1": (1000.0, 40000.0)},
        screened=128,
        iterations=40,
        refinements=40,
    )


WITHOUT_LIMITS: dict[str, Any] = {"rate_limit": None, "lag": None, "threshold_floor": 1.0}
ONE_LIMIT: dict[str, dict[str, Any]] = {
    "none": {},
    "rate limit 750 bar/s": {"rate_limit": 750.0},
    "lag 5 ms": {"lag": 0.005},
    "thresholds >= 10 m/s²": {"threshold_floor": 10.0},
}
GENERATIONS = 30


def limit_costs(result: TuningResult, progress: Progress) -> list[dict[str, Any]]:
    """Tune under one limit at a time: what each costs by itself, and all together.

    The searches, by evolution from the set found under all limits, are short, so that a cost is an upper bound.
    """
    rows, least = [], None
    for i, (limit, change) in enumerate(ONE_LIMIT.items()):
        config = dataclasses.replace(result.config, **{**WITHOUT_LIMITS, **change})
        problem = problem_of(config)
        box, batch = problem.box, problem.batch
        best, _ = refine(
            problem.screen,
            box,
            box.valid(box.point(result.parameters)[None]),
            rounds=GENERATIONS,
            count=problem.population,
            widest=problem.widest,
            seed=config.seed,
        )
        distance = np.asarray(scored(batch, box.arrays(best[None])).stops.distance)[:, 0]
        excess = 100 * (distance / batch.ideal - 1)
        least = float(excess.mean()) if least is None else least
        rows.append(_row(limit, excess, least))
        progress(i + 1, len(ONE_LIMIT), float(excess.mean()))
    excess = np.array(
        [100 * (row.tuned.distance / row.ideal - 1) for row in result.rows if row.tuned.distance and row.ideal]
    )
    return [*rows, _row("all three", excess, least or 0.0)]


def _row(limit: str, excess: np.ndarray, least: float) -> dict[str, Any]:
    return {
        "limits": limit,
        "mean of the rows [%]": f"{excess.mean():.2f}",
        "worst row [%]": f"{excess.max():.2f}",
        "costs at most, in the mean [%]": f"{excess.mean() - least:.2f}",
    }
