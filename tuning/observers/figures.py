"""Figures of observers: excitation, states, XBS estimated against true, on simulated runs and on a rig log."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.observers.base import Sample
from absjax.observers.excitation import dwell_times, excitation
from absjax.observers.run import Observation
from tuning.observers.scenarios import Scenarios
from tuning.observers.signals import LogSignals
from tuning.observers.study import RigStudy

NOISIEST = 1.0
"""Noise of XBS beyond which a point of the trade-off is drawn at the edge."""


def _axes(rows: int = 1, height: float = 2.6, **options: Any) -> tuple[Any, Any]:
    figure, axes = plt.subplots(rows, 1, figsize=(10, height * rows), layout="constrained", **options)
    for each in np.atleast_1d(axes):
        each.grid(alpha=0.3)
    return figure, axes


def _run(runs: Scenarios, i: int) -> Sample:
    return Sample(*(np.asarray(x)[i] for x in runs.samples))


def _mark_changes(axes, runs: Scenarios, i: int) -> None:
    for end in runs.ends[i, :-1]:
        axes.axvline(end, color="k", ls=":", lw=0.7)


def excitation_figure(runs: Scenarios, i: int = 0, window: float = 1.0):
    """Eigenvalues of the windowed integral of Psi' Psi, and the dwell times of the sign of y."""
    figure, (upper, middle, lower) = _axes(3)
    samples = _run(runs, i)
    values = excitation(samples, runs.period, runs.wheel, window)
    for column, label in ((0, "smaller"), (1, "larger")):
        upper.semilogy(runs.time[: len(values)], values[:, column], label=label)
    upper.set(ylabel="eigenvalues of ∫ Ψ'Ψ", title=f"persistency of excitation, window {window:g} s")
    upper.legend(fontsize="small")
    middle.plot(runs.time, samples.y, lw=0.7)
    middle.set(ylabel="x2 [m/s²]")
    dwell = dwell_times(samples, runs.period)
    lower.plot(dwell.begin, 1e3 * dwell.length, ".", label="in time [ms]")
    lower.plot(dwell.begin, 1e3 * dwell.scaled, "x", ms=4, label="in scaled time [1e-3]")
    lower.set(xlabel="time [s]", ylabel="dwell times", title=f"shortest {1e3 * dwell.length.min():.1f} ms")
    lower.set_yscale("log")
    lower.legend(fontsize="small")
    for axes in (upper, middle, lower):
        _mark_changes(axes, runs, i)
    return figure


def states_figure(runs: Scenarios, observed: Observation, i: int = 0, title: str = ""):
    """Errors of the adaptive observer: states w and parameters theta."""
    figure, (upper, lower) = _axes(2, sharex=True)
    samples, state = _run(runs, i), observed.state
    road = np.clip(np.searchsorted(runs.begins[i], runs.time, side="right") - 1, 0, None)
    c = np.asarray(runs.surfaces.c2)[i][road]
    d = c * np.asarray(runs.surfaces.c3)[i][road]
    w2 = runs.stiffness[i] + c / float(runs.wheel.slip_gain) * samples.y
    upper.plot(runs.time, state.w1[i] - samples.y, lw=0.7, label="w1: x2 [m/s²]")
    upper.plot(runs.time, state.w2[i] - w2, lw=0.7, label="w2: XBS + (c/a) x2")
    lower.plot(runs.time, state.c[i] - c, lw=0.7, label="c")
    lower.plot(runs.time, state.d[i] - d, lw=0.7, label="d")
    upper.set(ylabel="error of the states", ylim=(-5, 5), title=title)
    lower.set(ylabel="error of the parameters", xlabel="time [s]", ylim=(-60, 60))
    for axes in (upper, lower):
        axes.legend(fontsize="small")
        _mark_changes(axes, runs, i)
    return figure


def stiffness_figure(runs: Scenarios, estimates: Mapping[str, np.ndarray], i: int = 0, title: str = "", zoom=None):
    """XBS true and estimated, and the errors, of one run."""
    figure, (upper, lower) = _axes(2, sharex=True)
    upper.plot(runs.time, runs.stiffness[i], "k", lw=1.0, label="true")
    for label, estimate in estimates.items():
        upper.plot(runs.time, estimate[i], lw=0.7, label=label)
        lower.plot(runs.time, estimate[i] - runs.stiffness[i], lw=0.7, label=label)
    upper.set(ylabel="XBS", ylim=(-3, 12), title=title)
    lower.set(ylabel="error of XBS", ylim=(-3, 3), xlabel="time [s]")
    for axes in (upper, lower):
        axes.legend(fontsize="small", loc="upper right")
        _mark_changes(axes, runs, i)
    if zoom is not None:
        upper.set_xlim(*zoom)
    return figure


def offset_figure(runs: Scenarios, noise: np.ndarray, i: int = 0, zoom=(1.0, 2.0)):
    """The wheel acceleration offset, and as it is measured."""
    figure, axes = _axes(1, 3.2)
    axes.plot(runs.time, runs.samples.y[i] + noise[i], lw=0.7, label="measured")
    axes.plot(runs.time, runs.samples.y[i], "k", lw=0.9, label="true")
    axes.set(
        xlabel="time [s]", ylabel="x2 [m/s²]", xlim=zoom, title="perturbed by an oscillation with the wheel's angle"
    )
    axes.legend(fontsize="small")
    return figure


def rig_figure(study: RigStudy, labels: Sequence[str] | None = None, zoom=(2.0, 2.6)):
    """XBS on a rig log: what force gives, and the estimates; the whole log, and a stretch of it."""
    labels = list(labels or study.estimates)
    figure, grid = plt.subplots(
        len(labels), 2, figsize=(12, 1.9 * len(labels)), sharey=True, squeeze=False, layout="constrained"
    )
    for (whole, part), label in zip(grid, labels):
        for axes in (whole, part):
            axes.plot(study.signals.time, study.truth, "k", lw=0.9, label="from force")
            axes.plot(study.signals.time, study.estimates[label], lw=0.7, color="C3", label="estimated")
            axes.grid(alpha=0.3)
        error = next(row["XBS rms"] for row in study.rows if row["observer"] == label)
        whole.set_title(f"{label}: rms {error:.3f}", fontsize=9)
        whole.set(ylim=(-3, 5), xlim=(study.signals.time[study.braking][0], None))
        part.set_xlim(*zoom)
    grid[0, 0].legend(fontsize="small", ncols=2)
    figure.supxlabel("time [s]")
    figure.supylabel("XBS")
    return figure


def rig_states_figure(study: RigStudy, label: str, estimate_y: np.ndarray):
    """Wheel acceleration offset and XBS on a rig log, measured against estimated."""
    figure, (upper, lower) = _axes(2, sharex=True)
    upper.plot(study.signals.time, study.signals.samples.y, "k", lw=0.8, label="from the wheel speed")
    upper.plot(study.signals.time, estimate_y, lw=0.7, color="C3", label="estimated")
    lower.plot(study.signals.time, study.truth, "k", lw=0.8, label="from force and slip")
    lower.plot(study.signals.time, study.estimates[label], lw=0.7, color="C3", label="estimated")
    upper.set(ylabel="x2 [m/s²]", title=label, ylim=(-60, 90))
    lower.set(ylabel="XBS", xlabel="time [s]", ylim=(-3, 8), xlim=(0.5, None))
    for axes in (upper, lower):
        axes.legend(fontsize="small", loc="upper right")
    return figure


def rig_slip_figure(study: RigStudy, peak: float):
    """Wheel slip on a rig log, and the peak of the curve fitted to force (Aguado-Rojas 2019, Fig. 3.11)."""
    figure, axes = _axes(1, 3.0)
    axes.plot(study.signals.time, study.signals.slip, lw=0.8)
    axes.axhline(-peak, color="k", ls=":", lw=0.9, label="peak of the fitted curve")
    axes.set(xlabel="time [s]", ylabel="slip λ", title=f"at {3.6 * study.signals.samples.speed.mean():.0f} km/h")
    axes.legend(fontsize="small")
    return figure


def rig_adaptive_figure(study: RigStudy, states: Mapping[str, np.ndarray], found: Mapping[str, Observation]):
    """States and parameters of the adaptive observer on a rig log (Aguado-Rojas 2019, Fig. 3.13).

    Args:
        states: w1, w2, c and d as force and slip give them, arrays (samples,).
        found: observations by the name of the gains.
    """
    figure, grid = _axes(4, 2.2, sharex=True)
    labels = {"w1": "w1 = x2 [m/s²]", "w2": "w2 = XBS + (c/a) x2", "c": "θ1 = c", "d": "θ2 = d"}
    for axes, (name, truth) in zip(grid, states.items()):
        axes.plot(study.signals.time, truth, "k", lw=0.9, label="from force and slip")
        for label, observed in found.items():
            axes.plot(study.signals.time, getattr(observed.state, name), lw=0.7, label=label)
        late = truth[study.braking]
        room = 0.6 * np.ptp(late) or 1.3 * np.abs(late).max()
        axes.set(ylabel=labels[name], ylim=(late.min() - room, late.max() + room))
    grid[0].legend(fontsize="small", loc="upper right", ncols=3)
    grid[-1].set(xlabel="time [s]")
    return figure


def log_figure(signals: LogSignals, truth: np.ndarray, estimates: Mapping[str, np.ndarray], cut: float):
    """XBS of a log before and after tuning; the part tuned on lies left of `cut`."""
    figure, axes = _axes()
    axes.plot(signals.time, truth, "k", lw=0.9, label="from force")
    for label, estimate in estimates.items():
        axes.plot(signals.time, estimate, lw=0.7, label=label)
    axes.axvline(cut, color="k", ls=":", lw=0.8)
    axes.set(xlabel="time [s]", ylabel="XBS", ylim=(-3, 5), title="tuned on the left of the line")
    axes.legend(fontsize="small")
    return figure


def held_out_figure(rows: Sequence[Mapping[str, Any]], roads: Sequence[str]):
    """Worst settling by the road changed to, default against tuned."""
    cycles = list(dict.fromkeys(row["cycle"] for row in rows))
    figure, all_axes = plt.subplots(1, len(cycles), figsize=(6.5 * len(cycles), 4), sharey=True, layout="constrained")
    for axes, cycle in zip(np.atleast_1d(all_axes), cycles):
        chosen = [row for row in rows if row["cycle"] == cycle]
        width = 0.8 / len(chosen)
        for k, row in enumerate(chosen):
            place = np.arange(len(roads)) + width * (k - (len(chosen) - 1) / 2)
            axes.bar(place, [row[road] for road in roads], width, label=row["observer"])
        axes.set_xticks(np.arange(len(roads)), [road.replace("_", "\n") for road in roads], fontsize=8)
        axes.set(title=f"{cycle.replace('_', '-')} cycle", yscale="log", ylim=(1e-2, 3))
        axes.grid(axis="y", alpha=0.3, which="both")
    np.atleast_1d(all_axes)[0].set_ylabel("worst settling after the change [s]")
    figure.legend(
        *np.atleast_1d(all_axes)[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8
    )
    return figure


def trade_off_figure(curves: Mapping[str, Sequence[Mapping[str, float]]], points: Mapping[str, Mapping[str, float]]):
    """Settling against noise: tuned with several weights of the noise, and gain sets as points."""
    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    for label, curve in curves.items():
        ordered = sorted(curve, key=lambda point: point["noise"])
        axes.plot([p["noise"] for p in ordered], [p["mean"] for p in ordered], "o-", ms=4, label=f"{label}, tuned")
    for label, point in points.items():
        noise = min(point["noise"], NOISIEST)
        label += "" if noise == point["noise"] else " (diverges)"
        axes.plot(noise, point["mean"], "k^", ms=6)
        side, shift = ("right", -5) if noise == NOISIEST else ("left", 5)
        axes.annotate(label, (noise, point["mean"]), fontsize=8, ha=side, xytext=(shift, 4), textcoords="offset points")
    axes.set(xscale="log", yscale="log", xlabel="XBS rms caused by 0.5 m/s² of noise on x2", xlim=(0.08, 2 * NOISIEST))
    axes.set_ylabel("mean settling time after a road change [s]")
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize="small")
    return figure


def tuning_figure(history: Sequence[Sequence[float]], title: str):
    """Cost of the descents by iteration."""
    figure, axes = _axes(1, 4)
    axes.semilogy(np.asarray(history), lw=0.9)
    axes.set(xlabel="iteration", ylabel="cost [s]", title=f"{title}: best {np.nanmin(history):.4f}")
    return figure
