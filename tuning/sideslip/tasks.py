"""The commands on side-slip: a log studied, estimators compared over logs, one tuned."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from absjax.sideslip.base import Estimator
from absjax.sideslip.car import Car
from absjax.sideslip.observer import SideSlipObserver
from tuning.core.descent import Progress
from tuning.core.figures import save
from tuning.core.files import read_json
from tuning.core.fit import unmoved
from tuning.core.journal import Journal
from tuning.core.report import Report
from tuning.logs.car import car_of
from tuning.logs.recording import LogError
from tuning.logs.vehicle_log import VehicleLog, read_vehicle_log
from tuning.logs.whole_car import read_whole_car
from tuning.sideslip import figures
from tuning.sideslip.bench import LogSet, errors_of
from tuning.sideslip.config import SideSlipConfig
from tuning.sideslip.estimators import ESTIMATORS, TITLES, estimator_of, parameters_of
from tuning.sideslip.study import study_log
from tuning.sideslip.tune import AFTER, BEFORE, SideSlipResult, tune_side_slip

NARROW = 0.5
"""Share of the standard deviation of the side-slip over all logs below which one manoeuvre makes up the set."""


def read_with_car(log: Path, car: Path | None = None, columns: dict[str, str] | None = None) -> tuple[VehicleLog, Car]:
    """A log and its car, that of the JSON file beside it unless one is given.

    Raises:
        LogError: if there is no car, or the log cannot be used.
    """
    found = car_of(log, car)
    if found is None:
        raise LogError(f"{log}: no car; give one with --car, or beside it as {log.with_suffix('.json').name}")
    known = read_whole_car(found)
    return read_vehicle_log(log, known, columns), known


def chosen(name: str) -> Estimator:
    """An estimator by name, or as `tune-side-slip` has left it.

    Raises:
        ValueError: if there is no such name, or the file is not a result of `tune-side-slip`.
    """
    if not name.endswith(".json"):
        return estimator_of("--estimator", name)
    try:
        return SideSlipResult.from_json(read_json(Path(name))).estimator()
    except (KeyError, TypeError):
        raise LogError(f"{name}: not a result of tune-side-slip") from None


def study(log: VehicleLog, car: Car, estimator: Estimator, out: Path) -> Report:
    """Report of an estimator on a log: table of estimates, result, figures."""
    found = study_log(log, car, estimator)
    out.mkdir(parents=True, exist_ok=True)
    table = out / "estimates.csv"
    pd.DataFrame(found.columns()).to_csv(table, index=False, float_format="%.9g")
    errors, verdicts, signs = found.errors(), found.verdicts(), found.signs()
    result = {
        "log": log.name,
        "estimator": type(estimator).__name__,
        "parameters": {name: value for name, (value, _, _) in parameters_of(estimator).items()},
        "errors": errors,
        "intervals": verdicts,
        "assumptions": signs,
        "notes": list(log.notes),
    }
    files = [table, save(figures.estimates_figure(found), out / "estimates.png")]
    if found.excitation is not None:
        files.append(save(figures.excitation_figure(found), out / "excitation.png"))
    if isinstance(estimator, SideSlipObserver):
        files.append(save(figures.friction_curves_figure(), out / "friction_curves.png"))
        if found.implied is not None:
            figure = figures.friction_parameter_figure(log, found.implied, found.estimate.friction)
            files.append(save(figure, out / "friction_parameter.png"))
    tables: dict[str, Any] = {}
    if errors:
        tables[f"errors: {log.name}"] = [{"log": log.name, **{k: float(f"{v:.4g}") for k, v in errors.items()}}]
    if signs:
        tables["choice functions along the run"] = [{k: float(f"{v:.4g}") for k, v in signs.items()}]
    if not tables:
        span = np.degrees(np.asarray(found.estimate.side_slip))
        row = {"log": log.name, "side-slip from [deg]": round(span.min(), 3), "to [deg]": round(span.max(), 3)}
        tables["estimates, no truth to compare with"] = [row]
    lines = [*log.notes, *_said(verdicts)]
    return Report(tables, lines, files, results={out / "result.json": result})


def _said(verdicts: dict[str, list[dict[str, Any]]]) -> list[str]:
    """The verdict on theta as sentences."""
    lines = []
    for interval in verdicts.get("friction", []):
        told = "theta can be told" if interval["identifiable"] else "theta cannot be told"
        lines.append(f"{interval['from']:.2f} to {interval['to']:.2f} s: {told}")
    return lines


def compare(logs: Sequence[tuple[VehicleLog, Car]], given: Sequence[str], out: Path) -> Report:
    """Report of all estimators, and of `given` results of `tune-side-slip`, over logs."""
    beside = LogSet.of([log for log, _ in logs], [car for _, car in logs])
    estimators = {TITLES[name]: ESTIMATORS[name].make() for name in ESTIMATORS}
    estimators |= {name: chosen(name) for name in given}
    found = {title: errors_of(beside, estimator) for title, estimator in estimators.items()}
    names = [Path(name).stem for name in beside.names]

    def rows(pick, digits):
        return [
            {"estimator": title, **{name: round(float(pick(e)[i]), digits) for i, name in enumerate(names)}}
            for title, e in found.items()
        ]

    tables = {
        "side-slip rms [deg]": rows(lambda e: np.degrees(e.side_slip), 4),
        "side-slip largest [deg]": rows(lambda e: np.degrees(e.largest_side_slip), 3),
        "lateral velocity rms [m/s]": rows(lambda e: e.lateral_speed, 4),
        "longitudinal velocity rms [m/s]": rows(lambda e: e.longitudinal_speed, 4),
    }
    result = {"logs": list(beside.names), "tables": tables}
    slips = {title: np.degrees(e.side_slip) for title, e in found.items()}
    files = [save(figures.comparison_figure(names, slips), out / "side_slip_errors.png")]
    notes = [note for log, _ in logs for note in log.notes]
    return Report(tables, notes, files, results={out / "result.json": result})


def doubts(logs: Sequence[tuple[VehicleLog, Car]]) -> list[str]:
    """What speaks against tuning on these logs alone."""
    if len(logs) < 2:
        return ["warning: one manoeuvre only: gains that fit it are often two or three times worse on others"]
    lateral = [log.samples.yaw_rate * float(car.radius) * log.samples.wheel_speed.mean(axis=1) for log, car in logs]
    largest = np.array([np.quantile(np.abs(x), 0.99) for x in lateral])
    friction = [np.unique(np.round(log.truth["friction"], 1)) for log, _ in logs if "friction" in log.truth]
    roads = np.unique(np.concatenate(friction)) if friction else np.zeros(2)
    said = []
    if np.ptp(largest) < 0.2 * largest.max():
        said.append("warning: all logs reach about the same lateral acceleration: one manoeuvre, driven several times")
    if roads.size < 2:
        said.append("warning: all logs are of one friction: gains that fit it may not fit other roads")
    return said


def worsened(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The logs held out on which the tuned gains are worse than those before."""
    return [
        f"warning: {row['log']}, held out: the side-slip error grew from {row[BEFORE]:.3g} to {row[AFTER]:.3g} deg"
        for row in rows
        if row["tuned on"] == "no" and row[AFTER] > row[BEFORE]
    ]


def prepare(config: SideSlipConfig):
    """The logs of a configuration: tuned on, and held out."""
    return [read_with_car(Path(log)) for log in config.logs], [read_with_car(Path(log)) for log in config.held_out]


def tune(
    config: SideSlipConfig,
    logs: tuple[list[tuple[VehicleLog, Car]], list[tuple[VehicleLog, Car]]],
    out: Path,
    progress: Progress,
    journal: Journal,
) -> Report:
    """Tune as the configuration says: result.json, tables and figures."""
    tuned, held_out = logs
    result = tune_side_slip(config, tuned, held_out, progress=progress, journal=journal)
    start = {name: value for name, (value, _, _) in parameters_of(config.initial()).items()}
    stars = {name: "*" if name in result.on_limit else "" for name in result.parameters}
    tables: dict[str, Any] = {
        "parameters": [
            {"parameter": name + stars[name], "before": round(start[name], 4), "after": round(value, 4)}
            for name, value in result.parameters.items()
        ],
        "errors": [_rounded(row) for row in result.logs],
    }
    lines = []
    if result.each:
        tables["each log held out in turn"] = [_rounded(row) for row in result.each]
        for key, what in (("ratio", "held out"), ("ratio on the others, tuned on", "tuned on")):
            mean = _geometric_mean([row[key] for row in result.each])
            lines.append(f"side-slip error after over before, {what}: geometric mean {mean:.3f}")
        beside = LogSet.of([log for log, _ in tuned], [car for _, car in tuned])
        better = np.degrees(errors_of(beside, ESTIMATORS["better"].make()).side_slip)
        for rows, what in ((result.each, "held out"), (result.logs[: len(tuned)], "tuned on all")):
            ratios = np.array([row[AFTER] for row in rows]) / better
            shown = ", ".join(f"{ratio:.3f}" for ratio in ratios)
            lines.append(
                f"over that of the better gains, {what}: {shown}; geometric mean {_geometric_mean(ratios):.3f}"
            )
    lines += [
        _friction_line(log, car, result.estimator()) for log, car in (*tuned, *held_out) if "friction" in log.truth
    ]
    files = [save(figures.history_figure(result.history), out / "history.png")]
    warnings = [*doubts(tuned), *worsened(result.logs)]
    warnings += [f"warning: {said}" for said in unmoved(start, result.parameters)]
    results = {out / "result.json": result.to_json()}
    return Report(tables, lines, files, result.interrupted, warnings=warnings, results=results)


def _geometric_mean(values) -> float:
    return float(np.exp(np.mean(np.log(values))))


def _rounded(row: dict[str, Any]) -> dict[str, Any]:
    return {key: value if isinstance(value, str) else float(f"{value:.4g}") for key, value in row.items()}


def _friction_line(log: VehicleLog, car: Car, estimator: Estimator) -> str:
    errors = study_log(log, car, estimator).errors()
    told = {name: value for name, value in errors.items() if name.startswith(("theta", "share"))}
    if not told:
        return f"{log.name}: the run does not tell theta"
    return f"{log.name}, where the run tells theta: " + ", ".join(f"{name} {value:.3f}" for name, value in told.items())
