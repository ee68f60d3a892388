"""The tunings of the demonstration: the published setting, a realistic actuator, and what each limit costs."""

import dataclasses

import numpy as np
from rich.table import Table

from tuning.batch import build, judge
from tuning.config import TuningConfig
from tuning.distance_study import tuned_sets
from tuning.search import Progress
from tuning.tune_abs import TuningResult, descend

PUBLISHED_SETTING = TuningConfig(
    reference="published",
    rate_limit=None,
    lag=None,
    threshold_floor=1.0,
    starts=4,
    screened=64,
    iterations=24,
    refinements=1,
)
"""No actuator limits and no floor worth the name, as in the published table."""

ALL_PARAMETERS = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5", "u1", "u3", "u4", "ramp", "fallback")


def limited() -> TuningConfig:
    """Rate limit 750 bar/s, brake lag 5 ms, thresholds >= 10 m/s^2, limit cycles that contract on every road.

    Every one of the eleven parameters is tuned. The set of an earlier and longer search, shipped with the
    package, is among the starts: the basin it lies in is narrow, and a short search does not find it.
    """
    return TuningConfig(
        reference="published",
        tune=ALL_PARAMETERS,
        known=(tuned_sets()["five_phase"].start,),
        largest_contraction=0.9,
        starts=3,
        screened=64,
        learning_rate=0.004,
        iterations=12,
        refinements=2,
    )


WITHOUT_LIMITS = {"rate_limit": 1e9, "lag": None, "threshold_floor": 1.0}
ONE_LIMIT = {
    "none": {},
    "rate limit 750 bar/s": {"rate_limit": 750.0},
    "thresholds >= 10 m/s²": {"threshold_floor": 10.0},
    "lag 5 ms": {"lag": 0.005},
}


def limit_costs(result: TuningResult, free: TuningResult, progress: Progress) -> Table:
    """Tune under one limit at a time: what each costs by itself, and all together.

    The descents are short, so that a cost is an upper bound.

    Args:
        result, free: tuned with all limits, and without any. Both are among the starts, and the first also
            with the release of the untuned set: where nothing limits the rate, its own is too fast.
    """
    table = Table(title="distance above ideal by the limits in force, tuned, switchings located")
    for heading in ("limits", "mean of the rows [%]", "worst row [%]", "costs at most, in the mean [%]"):
        table.add_column(heading, justify="left" if heading == "limits" else "right")
    least = None
    for i, (limit, change) in enumerate(ONE_LIMIT.items()):
        slower = {**result.parameters, "u1": float(result.config.base_controller().u1)}
        known = (free.parameters, result.parameters, slower)
        free_cycles = {"largest_contraction": None, "starts": len(known) + 1}
        config = dataclasses.replace(
            result.config, known=known, learning_rate=0.04, iterations=16, **{**WITHOUT_LIMITS, **free_cycles, **change}
        )
        problem, box = build(config), config.box()
        ends, _ = descend(config, problem, box)
        judged = judge(problem, {name: np.asarray(values) for name, values in box.values(ends).items()})
        ratios = judged.distances / problem.ideal[:, None]
        best = int(np.argmin(np.where(np.isfinite(ratios), ratios, np.inf).mean(axis=0)))
        mean = _add(table, limit, ratios[:, best], least)
        least = mean if least is None else least
        progress(i + 1, len(ONE_LIMIT), float(ratios[:, best].max()))
    _add(table, "all three", np.array([row.tuned / row.ideal for row in result.rows]), least)
    return table


def _add(table: Table, limits: str, ratios: np.ndarray, least: float | None) -> float:
    mean, worst = 100 * (ratios.mean() - 1), 100 * (ratios.max() - 1)
    table.add_row(limits, f"{mean:.2f}", f"{worst:.2f}", "" if least is None else f"{mean - least:.2f}")
    return float(mean)
