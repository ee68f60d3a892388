"""Figures of a tuning result, written as PNG."""

from collections.abc import Sequence
from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.loop.stop import stop
from absjax.plots import phase_plane
from tuning.controllers.load import plot_stop
from tuning.controllers.result import ResultRow, TuningResult
from tuning.controllers.setup import Setup
from tuning.core.figures import bars_up_to, save
from tuning.core.roads import name_of, surfaces_of

JUDGED = {
    "located": "at the worse of both semantics",
    "sampled": "in the control unit",
    "chain": "in the control unit, behind the chain",
}
"""What the cost in the end is of, by setting."""
HIGHEST = 20.0
"""Where bars end that would be higher, %."""
ROOM = 1.25
"""Times the highest bar: the legend is above it."""


def tuning_figures(result: TuningResult, folder: Path) -> list[Path]:
    """Distances over ideal, descent of the starts, a stop, limit cycles before and after where roads are uniform."""
    road, speed = result.config.roads[0], max(result.config.speeds_kmh)
    files = [
        save(distances(result), folder / "distances.png"),
        save(_history(result), folder / "history.png"),
        save(plot_stop(result, road, speed), folder / "stop.png"),
    ]
    if result.config.uniform_roads and result.config.vehicle is None:
        files.append(save(_cycles(result), folder / "cycles.png"))
    return files


def distances(result: TuningResult):
    """From the pedal, a panel for each of several cars; of one wheel the published quantity as well."""
    cars, alone = list(dict.fromkeys(row.car for row in result.rows)), result.config.vehicle is None
    panels, began = len(cars) + alone, result.config.began
    figure, grid = plt.subplots(
        panels, 1, figsize=(11, 2.5 + 2.5 * panels), layout="constrained", sharex=True, squeeze=False
    )
    labels = [f"{row.road.replace('_', ' ')}\n{row.speed_kmh:g} km/h" for row in result.rows if row.car == cars[0]]
    place = np.arange(len(labels))
    for axes, car in zip(grid[:, 0], cars):
        order = {label: i for i, label in enumerate(labels)}
        rows = sorted(
            (row for row in result.rows if row.car == car),
            key=lambda row: order[f"{row.road.replace('_', ' ')}\n{row.speed_kmh:g} km/h"],
        )
        _bars(axes, place, _excess(rows, began, "distance", "ideal"))
        axes.set(ylabel="from the pedal,\nabove ideal [%]", title=car.replace("_", " "))
    if alone:
        quantity = {"published": [_percent(row.published, row.published_ideal) for row in result.rows]}
        _bars(grid[-1, 0], place, quantity | _excess(result.rows, began, "published_quantity", "published_ideal"))
        grid[-1, 0].set(ylabel="published quantity,\nabove its ideal [%]")
    for axes in grid[:, 0]:
        highest = max((bar.get_height() for bar in axes.patches), default=0.0)
        axes.set(ylim=(0, ROOM * highest or HIGHEST))
        axes.legend(fontsize="small", ncols=4)
        axes.grid(axis="y", alpha=0.3)
    grid[-1, 0].set_xticks(place, labels, rotation=60, fontsize=7)
    return figure


def _excess(rows: Sequence[ResultRow], began: str, figure: str, ideal: str) -> dict[str, list[float]]:
    def of(stop_name: str) -> list[float]:
        return [_percent(getattr(getattr(row, stop_name), figure), getattr(row, ideal)) for row in rows]

    return {began: of("untuned"), "tuned": of("tuned"), "tuned, sampled": of("sampled")}


def _percent(value: float | None, ideal: float | None) -> float:
    return np.nan if value is None or ideal is None else 100 * (value / ideal - 1)


def _bars(axes, place: np.ndarray, series: dict[str, list[float]]) -> None:
    """A bar a row and series."""
    width = 0.8 / len(series)
    for i, (label, values) in enumerate(series.items()):
        bars_up_to(HIGHEST, axes, place + width * (i - 0.5 * (len(series) - 1)), values, width, label=label)


def _history(result: TuningResult):
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(np.asarray(result.history), lw=0.9, marker=".")
    lowest = float(np.nanmin(result.history))
    axes.set(xlabel="iteration", ylabel=f"{result.config.objective} distance / {result.config.reference}")
    highest = min(lowest + 0.12, float(np.nanmax(result.history)) + 0.003)
    axes.set_ylim(min(lowest, result.cost) - 0.003, highest)
    axes.axhline(result.cost, color="k", ls=":", lw=0.9, label=f"after evolution, {JUDGED[result.config.setting]}")
    axes.legend(fontsize="small")
    starts = "1 start" if result.config.starts == 1 else f"{result.config.starts} starts"
    axes.set_title(f"descent of {starts}, best {lowest:.4f}, chosen {result.cost:.4f}")
    axes.grid(alpha=0.3)
    return figure


def _cycles(result: TuningResult):
    roads = result.config.uniform_roads
    figure, all_axes = plt.subplots(2, len(roads), figsize=(3.2 * len(roads), 6), squeeze=False, layout="constrained")
    speed = max(result.config.speeds_kmh) / 3.6
    for column, road in zip(all_axes.T, roads):
        _cycle_pair(column, result.setup, result, road, speed)
    return figure


def _cycle_pair(column, setup: Setup, result: TuningResult, road, speed: float) -> None:
    (tyre,), _ = surfaces_of(road)
    every = max(1, round(2e-3 / setup.step))
    controllers = (setup.controller(), setup.controller(result.parameters))
    for axes, controller, when in zip(column, controllers, (result.config.began, "tuned")):
        loop = setup.loop(controller, tyre)
        stopped = stop(
            loop,
            jnp.asarray(speed),
            horizon=3.0,
            step=setup.step,
            max_events=setup.config.max_events,
            save_every=every,
        )
        phase_plane(axes, loop, stopped.rollout.path, color="C1" if when == "tuned" else "C0")
        axes.axvline(-float(tyre.peak().slip), color="k", ls=":", lw=0.8)
        axes.axhline(0, color="k", ls=":", lw=0.8)
        axes.set_title(f"{name_of(road)}, {when}, first 3 s".replace("_", " "), fontsize=9)
        axes.set(xlim=(-0.5, 0.01), ylim=(-120, 120))
