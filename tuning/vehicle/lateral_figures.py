"""Figures of whole vehicles."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.sideslip.accelerometer import BodyAccelerometer
from tuning.logs.vehicle_log import VehicleLog
from tuning.vehicle.archive import Turned
from tuning.vehicle.drive_log import Drive
from tuning.vehicle.split_mu import Case
from tuning.vehicle.trade_off import Front

YAW_RATES = 2, 5, 10, 20, 50, 100
"""Ticks, deg/s."""
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


def trade_off_figure(fronts: Sequence[Front], cases: Sequence[Case], title: str):
    """Distance over the largest yaw rate: all sets that were judged with the front among them, and the sets of the
    limits wherever they were judged."""
    figure, (whole, elsewhere) = plt.subplots(1, 2, figsize=(13, 5.5))
    every = [found.archive.worse for found in fronts]
    unsound = [_traded(worse.taken(~worse.sound & ~worse.spun)) for worse in every]
    grey = {"color": "grey", "mew": 0.5, "ms": 3, "alpha": 0.5, "zorder": 0}
    whole.plot(*np.concatenate(unsound, axis=1), "x", **grey, label="a wheel locks or slides for long, or no stop")
    for i, found in enumerate(fronts):
        colour, worse, front = f"C{i}", found.archive.worse, found.archive.front()
        for those, filled in ((worse.sound, colour), (worse.spun, "none")):
            whole.plot(*_traded(worse.taken(those)), "o", color=colour, mfc=filled, mew=0.5, ms=3, alpha=0.25, zorder=1)
        along = {"drawstyle": "steps-pre", "color": colour, "lw": 1.8, "label": f"{found.wiring}, front"}
        whole.plot(*_traded(worse.taken(front)), **along)
        whole.plot(*_traded(worse.taken(found.chosen)), "o", color=colour, mec="k", ms=7)
        for (where, judged), marker in zip(found.judged.items(), "os^D"):
            label, stops = f"{found.wiring}, {where}", judged.ended & ~judged.spun
            elsewhere.plot(*_traded(judged.taken(stops)), marker + ":", color=colour, lw=0.6, ms=6, label=label)
            elsewhere.plot(*_traded(judged.taken(~stops)), marker, color=colour, mfc="none", ms=6)
        for case in cases:
            if case.row["control"] == found.wiring and case.row["steering"] != "held" and case.row["end"] != "spun":
                at = case.row["largest yaw rate [deg/s]"], case.row["distance [m]"]
                whole.plot(*at, "*", color=colour, ms=14, mec="k", label=f"{found.wiring}, shipped set")
    whole.set_title("all sets that were judged; large: the shortest stop under each limit", fontsize="medium")
    elsewhere.set_title("the sets of the limits, and where they were not tuned", fontsize="medium")
    for panel in (whole, elsewhere):
        panel.set(xlabel="largest yaw rate [deg/s]", ylabel="distance [m]", xscale="log", xticks=YAW_RATES)
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter("")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="x-small")
    figure.suptitle(f"{title}: what distance is paid for less yaw\nhollow: the car spins; right: or does not stop")
    figure.tight_layout()
    return figure


def _traded(turned: Turned) -> tuple[np.ndarray, np.ndarray]:
    """Yaw rates [deg/s] and distances [m]."""
    return np.degrees(turned.yaw_rate), turned.distance
