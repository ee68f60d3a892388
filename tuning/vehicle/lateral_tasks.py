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
from tuning.vehicle.trade_off import TRADED, Front, trade_off


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
        tune: whether the front of distance and yaw rate is searched for: another table and figure, and all sets judged.
    """
    cases = study(right, speed_kmh)
    title = f"split mu: dry asphalt left, {right.replace('_', ' ')} right, {speed_kmh:g} km/h"
    tables = {title: [case.row for case in cases]}
    files = [save(figures.split_mu_figure(cases, title), out / "split_mu.png")]
    fronts = [_front(right, speed_kmh, wiring) for wiring in TRADED] if tune else []
    if any(front.traded for front in fronts):
        tables["shortest stops under limits of the yaw rate"] = [one.row for front in fronts for one in front.traded]
    if fronts:
        files.append(save(figures.trade_off_figure(fronts, cases, title), out / "trade_off.png"))
        sets = [one._asdict() for front in fronts for one in front.traded]
        files.append(write_json(out / "trade_off.json", {"sets": sets}))
        files.append(out / "judged.csv")
        pd.concat(map(_judged, fronts)).to_csv(files[-1], index=False, float_format="%.6g")
    return Report(tables, [_counted(front) for front in fronts], files)


def _front(right: str, speed_kmh: float, wiring: str) -> Front:
    say_step(f"thresholds, {wiring} ...")
    return trade_off(right, speed_kmh, wiring)


def _counted(front: Front) -> str:
    worse = front.archive.worse
    count, spun, sound = len(front.archive.points), worse.spun.sum(), worse.sound.sum()
    return f"{front.wiring}: of {count} sets that were judged {spun} spin; {sound} stop without long locks and slides"


def _judged(front: Front) -> pd.DataFrame:
    """All sets, at the worse of located and sampled, SI units, and their parameters."""
    columns = {"control": front.wiring, **front.archive.worse._asdict(), **front.box.arrays(front.archive.points)}
    return pd.DataFrame(columns)
