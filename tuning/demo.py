"""The tunings of the demonstration: the published setting, a realistic actuator, and what each limit costs."""

import dataclasses
from collections.abc import Callable
from importlib import resources

import numpy as np
from rich.table import Table

from tuning.batch import build, judge
from tuning.config import TuningConfig
from tuning.files import read_json
from tuning.tune_abs import TuningResult, descend

PUBLISHED_SETTING = TuningConfig(
    reference="published",
    rate_limit=None,
    lag=None,
    threshold_floor=1.0,
    starts=4,
    screened=128,
    iterations=30,
    refinements=2,
)
"""No actuator limits and no floor worth the name, as in the published table."""

ALL_PARAMETERS = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5", "u1", "u3", "u4", "ramp", "fallback")


def limited() -> TuningConfig:
    """Rate limit 750 bar/s, brake lag 5 ms, thresholds >= 10 m/s^2.

    Every one of the eleven parameters is tuned. The set of an earlier and longer search, shipped with the
    package, is among the starts: the basin it lies in is narrow, and a short search does not find it.
    """
    with resources.as_file(resources.files("tuning") / "data" / "five_phase_limited.json") as path:
        known = read_json(path)
    return TuningConfig(
        reference="published",
        tune=ALL_PARAMETERS,
        known=(known,),
        starts=4,
        screened=128,
        learning_rate=0.02,
        iterations=30,
        refinements=3,
    )


RELAXED = {
    "all three": {},
    "without rate limit 750 bar/s": {"rate_limit": 1e9},
    "without thresholds >= 10 m/s²": {"threshold_floor": 1.0},
    "without lag 5 ms": {"lag": None},
}


def limit_costs(result: TuningResult, free: TuningResult, progress: Callable[[int, int, float], None]) -> Table:
    """Tune for the mean distance with all limits and without one at a time: what each limit costs.

    Args:
        result, free: tuned with all limits, and without any; both are among the starts.
    """
    table = Table(title="distance above ideal after tuning for the mean of the rows, switchings located")
    for heading in ("limits", "mean [%]", "the limit costs [%]"):
        table.add_column(heading, justify="left" if heading == "limits" else "right")
    reached, known = {}, result.parameters
    for i, (limits, change) in enumerate(RELAXED.items()):
        config = dataclasses.replace(
            result.config,
            known=(known, free.parameters),
            starts=3,
            reference="ideal",
            objective="mean",
            learning_rate=0.04,
            iterations=24,
            **change,
        )
        problem = build(config)
        ends, _ = descend(config, problem, lambda *_: None)
        names = config.box()[0]
        costs = judge(problem, dict(zip(names, np.exp(ends.T)))).costs
        reached[limits] = 100 * (float(costs.min()) - 1)
        if not change:
            known = dict(zip(names, map(float, np.exp(ends[np.argmin(costs)]))))
        cost = "" if not change else f"{reached['all three'] - reached[limits]:.2f}"
        table.add_row(limits, f"{reached[limits]:.2f}", cost)
        progress(i + 1, len(RELAXED), 1 + reached[limits] / 100)
    return table
