"""The command on vehicle speed: estimators tuned on simulated stops and judged on others."""

import dataclasses
import itertools
from pathlib import Path
from typing import Any

from absjax.speed.kalman import KalmanSpeed
from tuning.core.descent import Progress
from tuning.core.figures import save
from tuning.core.fit import unmoved
from tuning.core.journal import Journal
from tuning.core.report import Report
from tuning.core.roads import name_of, stacked
from tuning.core.version import VERSION
from tuning.speed import study
from tuning.speed.bench import Bench
from tuning.speed.config import SpeedConfig
from tuning.speed.estimators import title_of, with_values
from tuning.speed.figures import speeds_figure
from tuning.speed.stops import Stops, Told, published_scenario, simulate
from tuning.speed.tune import tune_speed

SCENARIO_BIAS = 0.5
"""Turn-on bias of the accelerometer in the published scenario, m/s^2."""
ROLLING = (0.0, 0.25, 0.75, 1.75)
"""Added to the time the wheels roll before it, s."""


def stops_of(config: SpeedConfig, entry: str) -> Told:
    """The stops that are tuned on (`roads`) or judged on (`held_out`), as they are told."""
    stops = config.stops(entry)
    road, speeds = stacked([road for road, _ in stops]), [speed / 3.6 for _, speed in stops]
    how = {name: getattr(config, name) for name in ("delay", "stop_speed", "period", "horizon")}
    made = [simulate(road, speeds, controller, **how) for controller in config.controllers]
    names = [f"{name_of(road)}, {speed:g} km/h, {c}" for c in config.controllers for road, speed in stops]
    seed = config.seed + 10_000 * (entry == "held_out")
    errors = list(itertools.product(config.biases, config.gains))
    return Told.of(names, Stops.joined(made), errors, config.noise, config.rim_noise, seed)


def speed_study(config: SpeedConfig, out: Path, progress: Progress, journal: Journal) -> Report:
    """Tune every estimator, judge it on stops held out, and on the published scenario."""
    training, held_out = Bench.of(stops_of(config, "roads")), stops_of(config, "held_out")
    judged, scenario = Bench.of(held_out), published_scenario(config.period, config.controllers[0])
    told = Told.of(["Fig. 3.15"], scenario, [(SCENARIO_BIAS, 0.0)], config.noise, config.rim_noise, config.seed)
    published = Bench.of(told)
    sets: dict[str, tuple[Any, Any]] = {}
    parameters, tuned, interrupted, warnings = {}, {}, False, []
    for name in config.estimators:
        start = config.initial(name)
        found = None if interrupted else tune_speed(config, name, training, progress, journal)
        sets[name] = start, start if found is None else with_values(start, found.values)
        if found is not None:
            interrupted = found.interrupted
            parameters |= {f"{name}.{parameter}": value for parameter, value in found.values.items()}
            start_values = {parameter: getattr(start, parameter) for parameter in found.values}
            warnings += [f"warning: {title_of(name)}: {said}" for said in unmoved(start_values, found.values)]
            tuned[name] = [p + "*" * (p in found.on_limit) for p in found.values]
    very = {}
    if not interrupted:
        very, interrupted = _of_this_stop(config, sets, published, progress, journal)
    tables: dict[str, Any] = {
        "held-out stops: errors while a controller acts": study.error_rows(judged, sets),
        "tuned stops: errors on those tuned on": study.error_rows(training, sets),
        "published scenario: Fig. 3.15": study.error_rows(published, sets | very),
        "each road: mean error [%] of the tuned on held-out stops": study.road_rows(judged, held_out.roads, sets),
        "rolling before braking: mean error [%] of the tuned, Fig. 3.15": study.rolling_rows(told, sets, ROLLING),
    }
    if tuned:
        tables["parameters"] = study.parameter_rows(sets, tuned)
    shown = {f"{title_of(name)}, tuned": after for name, (_, after) in sets.items() if name in tuned}
    lines = []
    for name, (_, filter_) in sets.items():
        if isinstance(filter_, KalmanSpeed):
            rows = study.gate_rows(published, filter_)
            tables[f"gates of {name}: wheels trusted while they slip, Fig. 3.15"] = rows
            lines.append(_said(name, rows))
            wide = next((row["gates wider by"] for row in rows if row["setting"] == "the published error"), None)
            if wide is not None and name == "kalman_front":
                shown[f"{title_of(name)}, gates wider by {wide:g}"] = study.opened(filter_, wide)
    chosen = {title: one for title, one in shown.items() if not title.startswith(title_of("fixed_gradient"))}
    figure = speeds_figure(study.traces(published, scenario.time, chosen), "dry, snow from 2.5 s, wet from 5 s")
    result = {"parameters": parameters, "config": config.to_json(), "version": VERSION, "tables": tables}
    files = [save(figure, out / "speed.png")]
    return Report(tables, lines, files, interrupted, warnings=warnings, results={out / "result.json": result})


def _of_this_stop(config: SpeedConfig, sets: dict[str, Any], bench: Bench, progress: Progress, journal: Journal):
    """The filters tuned on a single stop, by title: the best that can be said of it, and of no other; and whether that
    was interrupted."""
    alone, found = dataclasses.replace(config, batch=None), {}
    for name, (start, tuned) in sets.items():
        if isinstance(tuned, KalmanSpeed):
            fitted = tune_speed(alone, name, bench, progress, journal)
            if fitted is not None:
                found[f"{title_of(name)}, tuned on this stop"] = start, with_values(start, fitted.values)
                if fitted.interrupted:
                    return found, True
    return found, False


def _said(name: str, rows: list[dict[str, Any]]) -> str:
    """What makes the published error, in a line."""
    percent = 100 * study.PUBLISHED_ERROR
    best = min(row["mean error [%]"] for row in rows)
    for row in rows:
        if row["setting"] == "the published error":
            wide = row["gates wider by"]
            return f"{title_of(name)}: {percent:g} % with gates wider by {wide:g}, {best:g} % at best"
    return f"{title_of(name)}: no width of the gates gives {percent:g} %; {best:g} % at best"
