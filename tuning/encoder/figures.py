"""Figures of the encoder chain."""

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from tuning.encoder.analysis import LogStudy, order_spectrum
from tuning.encoder.chains import SIGNALS
from tuning.encoder.loop import Course
from tuning.logs.edge_speed import Turning
from tuning.logs.tooth_errors import ToothErrors

UNITS = {"speed": "wheel speed [rad/s]", "acceleration": "wheel acceleration [rad/s²]"}
BOTH_WAYS = {"color": "k", "lw": 0.8}
MOST_POINTS = 30_000
"""Edges shown."""
MEASURED, COMPENSATED = {"color": "0.6", "lw": 0.8}, {"color": "C3", "lw": 1.1}


def signals_figure(study: LogStudy, turning: Turning):
    """Both signals over time, as a control unit has them and looking both ways, and the end of the log, a quarter of a
    second at most; gaps where nothing is trusted."""
    figure, axes = plt.subplots(2, 2, figsize=(12, 6.5), width_ratios=(2, 1))
    time, valid = study.time, study.valid
    known = np.flatnonzero(valid)
    late = slice(max(known[0], known[-1] - int(min(250, 0.1 * known.size))), known[-1] + 1)
    for row, signal in zip(axes, SIGNALS):
        for panel, part in zip(row, (slice(known[0], known[-1] + 1), late)):
            lines = (
                (study.measured, "measured (time-stamping)", MEASURED),
                (study, "compensated", COMPENSATED),
                (turning, "looking both ways", BOTH_WAYS),
            )
            for source, label, style in lines:
                values = np.where(valid, getattr(source, signal)[: time.size], np.nan)[part]
                panel.plot(time[part], values, label=label, **style)
            panel.set(xlabel="time [s]", ylabel=UNITS[signal])
            panel.grid(alpha=0.3)
        row[1].locator_params(axis="x", nbins=4)
    axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize="small")
    axes[0, 1].set_title("the end of the log", fontsize="medium")
    figure.tight_layout()
    return figure


def spectrum_figure(study: LogStudy):
    """Amplitudes at multiples of the wheel's frequency, before and after (Aguado-Rojas 2019, Fig. 6.5)."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 4))
    for panel, signal in zip(axes, SIGNALS):
        for compensated, label, shift, colour in ((False, "measured", -0.2, "0.6"), (True, "compensated", 0.2, "C3")):
            amplitude = order_spectrum(study, signal, compensated)
            order = np.arange(1, amplitude.size + 1)
            panel.bar(order + shift, amplitude, 0.4, label=label, color=colour)
        panel.set(xlabel="multiple of the wheel's frequency", ylabel=f"amplitude, {UNITS[signal]}", yscale="log")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small")
    figure.tight_layout()
    return figure


def tooth_figure(errors: ToothErrors):
    """Errors of the edges by tooth (Aguado-Rojas 2019, Fig. 5.3)."""
    figure, axes = plt.subplots(figsize=(9, 4))
    some = slice(None, None, max(1, errors.tooth.size // MOST_POINTS))
    axes.plot(errors.tooth[some], errors.error[some], ".", ms=2, alpha=0.3, color="C0", label="edges")
    axes.plot(np.arange(errors.mean.size), errors.mean, "kx", ms=5, label="mean of a tooth")
    axes.set(xlabel="tooth, from the first edge of the log", ylabel="error of the edge [encoder cycles]")
    axes.legend(loc="upper right", fontsize="small")
    axes.grid(alpha=0.3)
    return figure


def coefficients_figure(study: LogStudy):
    """Coefficients learned from either signal (Aguado-Rojas 2019, Fig. 6.1)."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.8), sharey=True)
    for panel, first, name in zip(axes, (0, 1), "ab"):
        for i, (signal, values) in enumerate(study.coefficients.items()):
            order = np.arange(1, values.size // 2 + 1)
            panel.bar(order + 0.4 * i - 0.2, 1e3 * values[first::2], 0.4, label=f"from the {signal}", color=f"C{i}")
        panel.set(xlabel="harmonic k", ylabel=f"${name}_k$ [mrad]")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small")
    figure.tight_layout()
    return figure


def convergence_figure(time: np.ndarray, errors: Mapping[str, tuple[np.ndarray, np.ndarray]]):
    """Error of both signals against time by chain, mean over encoders; both are arrays (samples,)."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 4))
    for label, values in errors.items():
        for panel, signal, value in zip(axes, SIGNALS, values):
            panel.plot(time, value, lw=1.0, label=label)
            panel.set(xlabel="time [s]", ylabel=f"rms error, {UNITS[signal]}", yscale="log")
            panel.grid(alpha=0.3, which="both")
    axes[0].legend(fontsize="small")
    figure.tight_layout()
    return figure


def grid_figure(rows: list[dict[str, Any]], measured: Mapping[int, float]):
    """How many times smaller errors become with n events and M harmonics."""
    figure, axes = plt.subplots(figsize=(7, 4.5))
    for events in sorted({row["events"] for row in rows}):
        mine = [row for row in rows if row["events"] == events]
        ratio = [np.exp(measured[events] - row["cost"]) for row in mine]
        axes.plot([row["harmonics"] for row in mine], ratio, "o-", ms=4, label=f"n = {events}")
    axes.set(xlabel="harmonics M", ylabel="error measured / compensated, geometric mean")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return figure


def descent_figure(history: list[list[float]]):
    """Cost of every start by iteration."""
    figure, axes = plt.subplots(figsize=(7, 4))
    axes.plot(np.asarray(history), lw=1.0)
    axes.set(xlabel="iteration", ylabel="mean log of the rms errors")
    axes.grid(alpha=0.3)
    return figure


def cycles_figure(courses: Mapping[str, Course], lane: int = 0):
    """Phase planes of the stops by what the controller is told (Aguado-Rojas 2019, Fig. 6.7 to 6.9)."""
    truth = courses["the truth"]
    others = {label: found for label, found in courses.items() if found is not truth}
    figure, axes = plt.subplots(2, 3, figsize=(15, 8), sharex=True, sharey=True)
    for panel, (label, found) in zip(axes.flat, others.items()):
        mine = min(lane, len(found.time) - 1)
        for one, i, style in ((found, mine, {"color": "C3", "lw": 0.8}), (truth, 0, {"color": "C2", "lw": 1.2})):
            inside = one.valid[i]
            name = "told the truth" if one is truth else f"told by: {label}"
            panel.plot(one.slip[i, inside], one.signals.acceleration_offset[i, inside], label=name, **style)
        for threshold in (-50, 30, 40, 20, -20, -30):
            panel.axhline(threshold, color="0.7", lw=0.6, zorder=0)
        panel.set(xlim=(-0.6, 0.1), ylim=(-70, 150), title=label)
        panel.grid(alpha=0.2)
        panel.legend(fontsize="small", loc="upper left")
    for panel in axes.flat[len(others) :]:
        panel.set_axis_off()
    for panel in axes.flat[max(0, len(others) - axes.shape[1]) : len(others)]:
        panel.tick_params(labelbottom=True)
        panel.set_xlabel("slip λ")
    for panel in axes[:, 0]:
        panel.set_ylabel("x2 = R ω' - v'  [m/s²]")
    figure.tight_layout()
    return figure


def loop_figure(courses: Mapping[str, Course], lane: int = 0):
    """Speeds of vehicle and rim over time by what the controller is told."""
    figure, axes = plt.subplots(len(courses), 1, figsize=(10, 2 * len(courses)), sharex=True)
    for panel, (label, found) in zip(axes, courses.items()):
        mine = min(lane, len(found.time) - 1)
        inside = found.valid[mine]
        time, signals = found.time[mine, inside], found.signals
        panel.plot(time, signals.vehicle_speed[mine, inside], color="k", lw=1.2, label="vehicle")
        rim = (signals.radius * signals.wheel_speed)[mine, inside]
        panel.plot(time, rim, color="C3", lw=0.9, label="rim")
        panel.set(ylabel="speed [m/s]", title=f"told by: {label}")
        panel.grid(alpha=0.3)
    axes[0].legend(fontsize="small")
    axes[-1].set_xlabel("time [s]")
    figure.tight_layout()
    return figure
