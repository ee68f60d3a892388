"""The commands on whole vehicles."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from absjax.sideslip.car import Car
from tuning.core.figures import save
from tuning.core.files import write_json
from tuning.core.report import Report
from tuning.core.terminal import say_step
from tuning.logs.vehicle_log import VehicleLog
from tuning.vehicle import lateral_figures as figures
from tuning.vehicle.drive_log import drive
from tuning.vehicle.split_mu import study
from tuning.vehicle.trade_off import TRADED, Traded, trade_off


def drive_log(log: VehicleLog, car: Car, out: Path) -> Report:
    """Report of a car driven by a log: table of the variants, motion of the one that fits the measurements best."""
    found = drive(log, car)
    best = min(found, key=lambda one: one.cost)
    rows: list[dict[str, Any]] = [
        {
            "car": one.variant.title,
            "friction": round(one.friction, 3),
            "misfit": float(f"{one.cost:.4g}"),
            **{name: float(f"{value:.3g}") for name, value in one.errors(log).items()},
        }
        for one in found
    ]
    out.mkdir(parents=True, exist_ok=True)
    motion = best.motion
    columns = {
        "time_s": log.time,
        "vx_m_s": motion.longitudinal,
        "vy_m_s": motion.lateral,
        "yaw_rate_rad_s": motion.yaw_rate,
        "side_slip_rad": motion.side_slip,
        "lateral_acceleration_m_s2": motion.lateral_acceleration,
    }
    table = out / "driven.csv"
    pd.DataFrame({k: np.asarray(v) for k, v in columns.items()}).to_csv(table, index=False, float_format="%.9g")
    result = {"log": log.name, "best": best.variant.title, "friction": best.friction, "errors": best.errors(log)}
    files = [table, save(figures.drive_figure(log, best), out / "driven.png")]
    lines = [*log.notes, f"best by what was measured: {best.variant.title}"]
    results = {out / "result.json": {**result, "notes": list(log.notes)}}
    return Report({"cars driven by the log": rows}, lines, files, results=results)


def split_mu(right: str, speed_kmh: float, out: Path, *, tune: bool = False) -> Report:
    """Report of braking on split mu: a row for each control and who steers, and a figure.

    Args:
        tune: whether thresholds are tuned under limits of the yaw rate: another table and figure.
    """
    cases = study(right, speed_kmh)
    title = f"split mu: dry asphalt left, {right.replace('_', ' ')} right, {speed_kmh:g} km/h"
    tables = {title: [case.row for case in cases]}
    files = [save(figures.split_mu_figure(cases, title), out / "split_mu.png")]
    if tune:
        traded: list[Traded] = []
        for wiring in TRADED:
            say_step(f"thresholds, {wiring} ...")
            traded += trade_off(right, speed_kmh, wiring)
        tables["thresholds tuned under limits of the yaw rate"] = [one.row for one in traded]
        files.append(save(figures.trade_off_figure(traded, cases, title), out / "trade_off.png"))
        files.append(write_json(out / "trade_off.json", {"sets": [one._asdict() for one in traded]}))
    return Report(tables, [], files)
