"""Figures of whole vehicles."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.sideslip.accelerometer import BodyAccelerometer
from tuning.logs.vehicle_log import VehicleLog
from tuning.vehicle.drive_log import Drive
from tuning.vehicle.split_mu import Case
from tuning.vehicle.trade_off import WHERES, Traded

YAW_RATES = 2, 5, 10, 20, 50, 100
"""Ticks, deg/s."""
TRADE = ("largest yaw rate", "deg/s"), ("distance", "m")
REAL, DRIVEN = {"color": "k", "ls": "--", "lw": 1.0}, {"color": "C0", "lw": 1.0}


def drive_figure(log: VehicleLog, found: Drive):
    """Yaw rate, side-slip and lateral acceleration of a driven car against the truth, or what was measured."""
    motion, truth = found.motion, log.truth
    known = {"longitudinal_speed", "lateral_speed"} <= set(truth)
    panels: list[tuple[str, Any, Any, str]] = [
        (
            "yaw rate [rad/s]",
            motion.yaw_rate,
            truth.get("yaw_rate", log.samples.yaw_rate),
            "real" if "yaw_rate" in truth else "measured",
        ),
        (
            "side-slip β [deg]",
            np.degrees(motion.side_slip),
            np.degrees(log.true_side_slip) if known else None,
            "real",
        ),
        (
            "lateral acceleration [m/s²]",
            motion.lateral_acceleration,
            BodyAccelerometer().level(log.samples).lateral_acceleration,
            "measured, roll taken off",
        ),
        ("speed [m/s]", motion.longitudinal, truth.get("longitudinal_speed"), "real"),
    ]
    figure, axes = plt.subplots(len(panels), 1, figsize=(9, 2.2 * len(panels)), sharex=True)
    for panel, (label, driven, real, what) in zip(axes, panels):
        panel.plot(log.time, driven, **DRIVEN, label="driven by the log")
        if real is not None:
            panel.plot(log.time, real, **REAL, label=what)
        panel.set_ylabel(label, fontsize="small")
        panel.grid(alpha=0.3)
        panel.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize="x-small")
    axes[0].set_title(f"{log.name}\n{found.variant.title}, friction {found.friction:.2f}", fontsize="small")
    axes[-1].set_xlabel("time [s]")
    return figure


def split_mu_figure(cases: Sequence[Case], title: str):
    """Yaw rate and side-slip over time, a column for who steers; and what distance is paid for less of them."""
    steering = list(dict.fromkeys(case.row["steering"] for case in cases))
    controls = list(dict.fromkeys(case.row["control"] for case in cases))
    colours = {control: f"C{i}" for i, control in enumerate(controls)}
    figure, axes = plt.subplots(2, 3, figsize=(13, 6.5))
    for case in cases:
        column, colour = steering.index(case.row["steering"]), colours[case.row["control"]]
        axes[0, column].plot(case.time, np.degrees(case.yaw_rate), color=colour, lw=1, label=case.row["control"])
        axes[1, column].plot(case.time, np.degrees(case.side_slip), color=colour, lw=1)
        for panel, name in zip(axes[:, 2], ("largest yaw rate [deg/s]", "largest side-slip [deg]")):
            if case.row["end"] != "spun":
                filled = colour if column == 0 else "none"
                panel.plot(case.row["distance [m]"], case.row[name], "os"[column], color=colour, mfc=filled, ms=8)
            panel.set(ylabel=name)
    for column, name in enumerate(steering):
        axes[0, column].set(title=f"steering: {name}", ylabel="yaw rate [deg/s]")
        axes[1, column].set(xlabel="time [s]", ylabel="side-slip [deg]")
    axes[0, 2].set_title(f"circles: {steering[0]}, squares: {steering[-1]}\ncars that spun left out", fontsize="medium")
    axes[1, 2].set_xlabel("distance [m]")
    for panel in axes.flat:
        panel.grid(alpha=0.3, which="both")
    axes[0, 0].legend(fontsize="small")
    figure.suptitle(title)
    figure.tight_layout()
    return figure


def trade_off_figure(traded: Sequence[Traded], cases: Sequence[Case], title: str):
    """Distance over the largest yaw rate: tuned sets, sampled, from another speed; and the set they start from."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 5))
    for i, wiring in enumerate(dict.fromkeys(one.wiring for one in traded)):
        rows = [one.row for one in traded if one.wiring == wiring]
        for panel, wheres in zip(axes, (WHERES[:2], WHERES[2:])):
            for where, style in zip(wheres, ("o-", "s:")):
                found = [[row[f"{what}{where} [{unit}]"] for row in rows] for what, unit in TRADE]
                panel.plot(*found, style, color=f"C{i}", lw=0.6, ms=6, mfc="none", label=f"{wiring}, tuned{where}")
                sound = [row["limit"] == "kept" and row["end"] != "spun" for row in rows]
                panel.plot(*(np.array(values)[sound] for values in found), style[0], color=f"C{i}", ms=6)
        for case in cases:
            if case.row["control"] == wiring and case.row["steering"] != "held" and case.row["end"] != "spun":
                at = case.row["largest yaw rate [deg/s]"], case.row["distance [m]"]
                axes[0].plot(*at, "*", color=f"C{i}", ms=14, mec="k", label=f"{wiring}, shipped set")
    for panel in axes:
        panel.set(xlabel="largest yaw rate [deg/s]", ylabel="distance [m]", xscale="log", xticks=YAW_RATES)
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter("")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small", loc="lower left")
    figure.suptitle(f"{title}: what distance is paid for less yaw\nhollow: the limit is not reached, or the car spins")
    figure.tight_layout()
    return figure
