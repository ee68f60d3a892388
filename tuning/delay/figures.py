"""Figures of delays: chains, rightmost roots, delay margins, tracking through a delay of the brake."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from tuning.delay.chains import Course
from tuning.delay.traces import Trace


def _axes(rows: int = 1, height: float = 2.8, **options: Any) -> tuple[Any, Any]:
    figure, axes = plt.subplots(rows, 1, figsize=(10, height * rows), layout="constrained", **options)
    for each in np.atleast_1d(axes):
        each.grid(alpha=0.3)
    return figure, axes


def wave_figure(courses: Mapping[str, Course]):
    """The pendulum between its equilibria, and its error (Hoang 2014, Fig. 6.1)."""
    figure, (upper, lower) = _axes(2, sharex=True)
    first = next(iter(courses.values()))
    upper.plot(first.time, first.target, "k--", lw=1.2, label="x1*(t - h)")
    for name, run in courses.items():
        upper.plot(run.time, run.x, lw=0.9, label=f"x1, {name}")
        lower.semilogy(run.time, np.maximum(np.abs(run.errors[0]), 1e-9), lw=0.9, label=name)
    upper.set(ylabel="angle [rad]", title="pendulum through a delay of 20 ms, control unit at 1 ms")
    lower.set(ylabel="|e1| [rad]", xlabel="time [s]", ylim=(1e-8, 1))
    for axes in (upper, lower):
        axes.legend(fontsize="small", loc="lower right")
    return figure


def root_figure(delays: np.ndarray, curves: Mapping[str, np.ndarray]):
    """Rightmost roots over the delay; stable below zero."""
    figure, axes = _axes(1, 3.6)
    for i, (name, root) in enumerate(curves.items()):
        axes.plot(1e3 * delays, root, "-" if i % 2 == 0 else "--", color=f"C{i // 2}", label=name)
    axes.axhline(0, color="k", lw=0.8)
    axes.set(xlabel="delay [ms]", ylabel="rightmost root [1/s]", title="pendulum, published gains")
    axes.legend(fontsize="small")
    return figure


def margin_figure(speeds: np.ndarray, curves: Mapping[str, Mapping[str, np.ndarray]]):
    """Delay margins over speed by friction slope (Hoang 2014, Fig. 8.7 to 8.12); infinite ones are not drawn."""
    figure, grid = _axes(len(curves), 2.6, sharex=True)
    for axes, (slope, by_filter) in zip(grid, curves.items()):
        for name, margin in by_filter.items():
            axes.plot(3.6 * speeds, np.where(np.isfinite(margin), 1e3 * margin, np.nan), lw=1.1, label=name)
        axes.set(ylabel="delay margin [ms]", title=slope, ylim=(0, 60))
        axes.legend(fontsize="small", loc="lower right")
    grid[-1].set(xlabel="speed [km/h]")
    return figure


def nyquist_figure(plots: Mapping[str, Any]):
    """G(j w) with the unit circle (Hoang 2014, Fig. 8.5 and 8.6)."""
    figure, axes = plt.subplots(1, len(plots), figsize=(10, 4.6), layout="constrained")
    circle: Any = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    for panel, (name, G) in zip(np.atleast_1d(axes), plots.items()):
        panel.plot(circle.real, circle.imag, "k:", lw=0.9, label="unit circle")
        panel.plot(G.real, G.imag, "C0", label="G(jω), ω > 0")
        panel.plot(G.real, -G.imag, "C0", lw=0.6, alpha=0.6)
        panel.plot(-1, 0, "rx", label="-1")
        panel.set(title=name, xlabel="Re", ylabel="Im", aspect="equal", xlim=(-3, 1.5), ylim=(-2, 2))
        panel.grid(alpha=0.3)
    np.atleast_1d(axes)[0].legend(fontsize="small", loc="upper left")
    return figure


def tracking_figure(traces: Sequence[Trace], window: tuple[float, float]):
    """Wheel acceleration and what it follows (Hoang 2014, Fig. 7.3), one panel a version."""
    figure, grid = _axes(len(traces), 2.4, sharex=True, sharey=True)
    for axes, trace in zip(grid, traces):
        axes.plot(trace.time, trace.offset, "k", lw=1.0, label="z1")
        axes.plot(trace.time, np.where(trace.tracked, trace.target, np.nan), "r", lw=1.2, label="z1*(t - h)")
        axes.set(
            ylabel="z1 [m/s²]",
            title=f"{trace.label}: off by {trace.rms:.1f} m/s² (rms) where it follows",
            ylim=(-90, 90),
        )
        axes.legend(fontsize="small", loc="upper right")
    grid[-1].set(xlabel="time [s]", xlim=window)
    return figure


def cycle_figure(traces: Sequence[Trace], window: tuple[float, float]):
    """Cycles in the plane of slip and acceleration (Hoang 2014, Fig. 7.2)."""
    figure, grid = plt.subplots(1, len(traces), figsize=(12, 4.2), sharey=True, sharex=True, layout="constrained")
    for axes, trace in zip(np.atleast_1d(grid), traces):
        part = (trace.time >= window[0]) & (trace.time <= window[1])
        axes.plot(trace.slip[part], trace.offset[part], "k", lw=0.8, label="z1")
        target = np.where(trace.tracked, trace.target, np.nan)
        axes.plot(trace.slip[part], target[part], "r", lw=1.0, label="z1*(t - h)")
        axes.set(xlabel="slip λ", title=trace.label)
        axes.locator_params(axis="x", nbins=6)
        axes.grid(alpha=0.3)
    first = np.atleast_1d(grid)[0]
    first.set(ylabel="z1 [m/s²]", ylim=(-90, 90))
    first.legend(fontsize="small")
    return figure


def pressure_figure(traces: Sequence[Trace], window: tuple[float, float]):
    """Brake pressure (Hoang 2014, Fig. 7.4)."""
    figure, axes = _axes(1, 3.4)
    for trace in traces:
        axes.plot(trace.time, trace.pressure, lw=1.0, label=trace.label)
    axes.set(xlabel="time [s]", ylabel="pressure at the wheel [bar]", xlim=window)
    axes.legend(fontsize="small")
    return figure


def observer_figure(trace: Trace):
    """Errors of the observer in the plane (Hoang 2014, Fig. 7.1), and over time."""
    figure, (plane, time) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    plane.plot(trace.observer_error[0], trace.observer_error[1], lw=0.7)
    plane.set(xlabel="error of z1 [m/s²]", ylabel="error of XBS")
    time.plot(trace.time, trace.observer_error[1], lw=0.8)
    time.set(xlabel="time [s]", ylabel="error of XBS", ylim=(-3, 3))
    for axes in (plane, time):
        axes.grid(alpha=0.3)
    figure.suptitle(f"observer of three states in the loop, {trace.label}")
    return figure


def sweep_figure(rows: Sequence[Mapping[str, Any]], undelayed: float):
    """Distance over the delay; crosses where it does not cycle."""
    figure, axes = _axes(1, 3.6)
    for i, law in enumerate(dict.fromkeys(row["law"] for row in rows)):
        own = [row for row in rows if row["law"] == law]
        h, d = (np.array([row[key] for row in own]) for key in ("delay [ms]", "distance [m]"))
        cycling = np.array([row["cycling"] == "yes" for row in own])
        axes.plot(h, np.where(cycling, d, np.nan), "o-", color=f"C{i}", ms=4, label=law)
        axes.plot(
            h[~cycling],
            d[~cycling],
            "x",
            color=f"C{i}",
            label=f"{law}, no cycle, or step too large" if not cycling.all() else None,
        )
    axes.axhline(undelayed, color="k", ls=":", label="without delay")
    axes.set(
        xlabel="delay [ms]", ylabel="distance to 10 km/h [m]", title="dry asphalt from 120 km/h, gains by the delay"
    )
    axes.legend(fontsize="small")
    return figure
