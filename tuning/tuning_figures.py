"""Figures of a tuning result, written as PNG."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from absjax.manoeuvre import stop
from absjax.plots import phase_plane
from tuning.config import TuningConfig
from tuning.entries import tyre_of
from tuning.figures import save
from tuning.tune_abs import TuningResult


def tuning_figures(result: TuningResult, folder: Path) -> list[Path]:
    """Distances over ideal, descent of the starts, limit cycles before and after."""
    return [
        save(_distances(result), folder / "distances.png"),
        save(_history(result), folder / "history.png"),
        save(_cycles(result), folder / "cycles.png"),
    ]


def _distances(result: TuningResult):
    figure, axes = plt.subplots(figsize=(10, 4.5), layout="constrained")
    place = np.arange(len(result.rows))
    series = {
        "published": [row.published or np.nan for row in result.rows],
        "untuned": [row.untuned for row in result.rows],
        "tuned": [row.tuned for row in result.rows],
        "tuned, sampled": [row.sampled for row in result.rows],
    }
    ideal = np.array([row.ideal for row in result.rows])
    for i, (label, values) in enumerate(series.items()):
        excess = 100 * (np.asarray(values, dtype=float) / ideal - 1)
        axes.bar(place + 0.2 * (i - 1.5), np.where(np.isfinite(excess), excess, 0), 0.2, label=label)
    axes.set_xticks(
        place, [f"{row.road.replace('_', ' ')}\n{row.speed_kmh:g} km/h" for row in result.rows], rotation=60, fontsize=7
    )
    axes.set(ylabel="distance above ideal [%]", ylim=(0, 15))
    axes.legend(fontsize="small", ncols=4)
    axes.grid(axis="y", alpha=0.3)
    return figure


def _history(result: TuningResult):
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(np.asarray(result.history), lw=0.9)
    lowest = float(np.nanmin(result.history))
    axes.set(xlabel="iteration", ylabel=f"{result.config.objective} distance / {result.config.reference}")
    axes.set_ylim(lowest - 0.003, lowest + 0.12)
    axes.set_title(f"descent of {result.config.starts} starts, best {lowest:.4f}")
    axes.grid(alpha=0.3)
    return figure


def _cycles(result: TuningResult):
    roads = result.config.roads
    figure, all_axes = plt.subplots(2, len(roads), figsize=(3.2 * len(roads), 6), squeeze=False, layout="constrained")
    speed = max(result.config.speeds_kmh) / 3.6
    for column, road in zip(all_axes.T, roads):
        _cycle_pair(column, result.config, result, road, speed)
    return figure


def _cycle_pair(column, config: TuningConfig, result: TuningResult, road, speed: float) -> None:
    tyre = tyre_of(road)
    for axes, controller, when in zip(column, (config.base_controller(), result.controller), ("untuned", "tuned")):
        loop = config.loop(controller, tyre)
        stopped = stop(loop, speed, horizon=3.0, save_every=1)
        phase_plane(axes, loop, stopped.rollout.trajectory, color="C0" if when == "untuned" else "C1")
        axes.axvline(-float(tyre.peak().slip), color="k", ls=":", lw=0.8)
        axes.axhline(0, color="k", ls=":", lw=0.8)
        axes.set_title(f"{road if isinstance(road, str) else tuple(road)}, {when}".replace("_", " "), fontsize=9)
        axes.set(xlim=(-0.5, 0.01), ylim=(-120, 120))
