"""Figures of the controllers' study."""

import matplotlib.pyplot as plt
import numpy as np

from absjax.manoeuvre import stop
from absjax.plots import phase_plane
from absjax.road import SURFACES
from tuning import distance_study
from tuning.cycles import CycleRow
from tuning.distance_study import NAMES, Study


def slip_planes_figure(road: str = "wet_asphalt", speed_kmh: float = 120.0):
    """Two-phase and five-phase in the plane of slip and x2, default and tuned sets."""
    figure, grid = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained", sharey=True)
    for axes, sets, title in zip(
        grid, (distance_study.default_sets(), distance_study.tuned_sets()), ("default, no limits", "tuned, with limits")
    ):
        for name, color in (("five_phase", "C0"), ("two_phase", "C1")):
            config = sets[name]
            loop = config.loop(config.base_controller(), SURFACES[road])
            every = max(1, round(1e-3 / config.grid_step))
            stopped = stop(loop, speed_kmh / 3.6, horizon=3.0, step=config.grid_step, save_every=every)
            phase_plane(axes, loop, stopped.rollout.trajectory, color=color, label=NAMES[name])
        axes.axvline(-float(SURFACES[road].peak().slip), color="k", ls=":", lw=0.8)
        axes.axhline(0, color="k", ls=":", lw=0.8)
        axes.set(title=f"{road.replace('_', ' ')}, {speed_kmh:g} km/h, {title}", xlim=(-0.4, 0.0), ylim=(-80, 80))
        axes.legend(fontsize="small")
    return figure


def distances_figure(done: Study):
    """Distance over ideal of every tuned controller, sampled, by row."""
    figure, axes = plt.subplots(figsize=(12, 4.8), layout="constrained")
    order, count = done.order, len(done.sampled)
    place = np.arange(len(order))
    ideal = np.array([done.rows[i][2] for i in order])
    for k, (name, d) in enumerate(done.sampled.items()):
        excess = 100 * (d.distance[order] / ideal - 1)
        axes.bar(
            place + 0.85 * (k / count - 0.5), np.clip(excess, 0, 15), 0.85 / count, align="edge", label=NAMES[name]
        )
    axes.set_xticks(
        place,
        [f"{done.rows[i][0].replace('_', ' ')}\n{done.rows[i][1]:g} km/h" for i in order],
        rotation=60,
        fontsize=7,
    )
    axes.set(ylabel="distance above ideal [%], at most 15", ylim=(0, 15))
    axes.legend(fontsize="small", ncols=6, loc="lower left", bbox_to_anchor=(0, 1))
    axes.grid(axis="y", alpha=0.3)
    return figure


def robustness_figure(excess: dict[str, np.ndarray]):
    """Distribution of distance over ideal on scattered stops, by set; sets of a controller share a colour."""
    figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
    families = list(dict.fromkeys(label.rsplit(",", 1)[0] for label in excess))
    for label, values in excess.items():
        ordered = np.sort(100 * (values - 1))
        share = np.linspace(0, 100, len(ordered))
        style = {"tuned": "-", "default": "--"}.get(label.rsplit(", ", 1)[1], ":")
        axes.plot(ordered, share, style, color=f"C{families.index(label.rsplit(',', 1)[0])}", label=label)
    axes.set(xlabel="distance above ideal [%]", ylabel="share of the stops [%]", xlim=(0, 30), ylim=(0, 100))
    axes.set_title(f"{len(next(iter(excess.values())))} scattered stops, sampled")
    axes.legend(fontsize="small", loc="lower right")
    axes.grid(alpha=0.3)
    return figure


def contraction_figure(cycles: dict[str, list[CycleRow]]):
    """Contraction of the limit cycles by road and speed."""
    figure, grid = plt.subplots(1, len(cycles), figsize=(5.5 * len(cycles), 4), layout="constrained", squeeze=False)
    for axes, (name, rows) in zip(grid[0], cycles.items()):
        for road in dict.fromkeys(row.road for row in rows):
            mine = [row for row in rows if row.road == road]
            contraction = [np.nan if row.contraction is None else row.contraction for row in mine]
            axes.semilogy([row.speed_kmh for row in mine], contraction, "o-", label=road.replace("_", " "))
        axes.axhline(1, color="k", ls=":")
        axes.set(xlabel="speed [km/h]", ylabel="contraction of the limit cycle", title=NAMES[name])
        axes.legend(fontsize="small", loc="lower left" if name == "five_phase" else "center left")
        axes.grid(alpha=0.3)
    return figure
