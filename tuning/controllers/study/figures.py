"""Figures of the controllers' study."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from absjax.loop.stop import stop
from absjax.plots import phase_plane
from absjax.tyres.surfaces import SURFACES
from tuning.controllers.cycles import CycleRow
from tuning.controllers.figures import HIGHEST
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.settings import Setting
from tuning.controllers.setup import Setup
from tuning.controllers.study.distances import NAMES, Entry, untuned_and_tuned
from tuning.core.figures import bars_up_to


def slip_planes_figure(road: str = "wet_asphalt", speed_kmh: float = 120.0):
    """Two-phase and five-phase in the plane of slip and x2, untuned and tuned, from the pedal to the stop."""
    figure, grid = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained", sharey=True)
    for name, color in (("five_phase", "C0"), ("two_phase", "C1")):
        config = tuned_sets()[name]
        for axes, (which, values) in zip(grid, untuned_and_tuned(config).items()):
            setup = Setup.of(config)
            loop = setup.loop(setup.controller(values), SURFACES[road])
            every = max(1, round(1e-3 / setup.step))
            stopped = stop(loop, speed_kmh / 3.6, horizon=12.0, step=setup.step, save_every=every, max_events=1500)
            phase_plane(axes, loop, stopped.rollout.path, color=color, label=NAMES[name])
            axes.set_title(f"{road.replace('_', ' ')}, {speed_kmh:g} km/h, {which}")
    for axes in grid:
        axes.axvline(-float(SURFACES[road].peak().slip), color="k", ls=":", lw=0.8)
        axes.axhline(0, color="k", ls=":", lw=0.8)
        axes.set(xlim=(-1.0, 0.0), ylim=(-120, 120))
        axes.legend(fontsize="small")
    return figure


def distances_figure(entries: Sequence[Entry], settings: Sequence[Setting]):
    """Distance from the pedal above ideal of every tuned controller by row, a panel for each setting."""
    figure, grid = plt.subplots(len(settings), 1, figsize=(12, 3.1 * len(settings)), layout="constrained", sharex=True)
    names = list(dict.fromkeys(e.controller for e in entries))
    for axes, setting in zip(np.atleast_1d(grid), settings):
        mine = [e for e in entries if e.setting == setting and e.set == "tuned"]
        places = sorted({(e.row.speed_kmh, e.ideal, e.row.name) for e in mine})
        for k, name in enumerate(names):
            excess = {(e.row.speed_kmh, e.ideal, e.row.name): e.excess for e in mine if e.controller == name}
            values = [excess[place] for place in places]
            percent = [HIGHEST if value is None else 100 * value for value in values]
            at, width = np.arange(len(places)) + 0.85 * (k / len(names) - 0.5), 0.85 / len(names)
            bars = bars_up_to(HIGHEST, axes, at, percent, width, align="edge", label=NAMES[name])
            for bar, value in zip(bars, values):
                if value is None:
                    bar.set(hatch="////", alpha=0.4)
        labels = [f"{name.replace('_', ' ')}\n{speed:g} km/h" for speed, _, name in places]
        axes.set_xticks(np.arange(len(places)), labels, rotation=60, fontsize=7)
        axes.set(ylabel="above ideal [%]", ylim=(0, HIGHEST), title=f"{setting.label} (hatched: does not end)")
        axes.grid(axis="y", alpha=0.3)
    figure.legend(
        *np.atleast_1d(grid)[0].get_legend_handles_labels(), fontsize="small", ncols=7, loc="outside upper center"
    )
    return figure


def robustness_figure(excess: dict[str, np.ndarray]):
    """Distribution of distance over ideal on scattered stops, by set; sets of a controller share a colour."""
    figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
    families = list(dict.fromkeys(label.rsplit(",", 1)[0] for label in excess))
    for label, values in excess.items():
        ordered = np.sort(100 * (values - 1))
        share = np.linspace(0, 100, len(ordered))
        style = {"tuned": "-", "untuned": "--"}.get(label.rsplit(", ", 1)[1], ":")
        axes.plot(ordered, share, style, color=f"C{families.index(label.rsplit(',', 1)[0])}", label=label)
    axes.set(
        xlabel="distance from the pedal above ideal [%]", ylabel="share of the stops [%]", xlim=(0, 40), ylim=(0, 100)
    )
    count = len(next(iter(excess.values())))
    axes.set_title(f"{count} scattered stops, sampled; curves that end below 100 % have stops without end")
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
        axes.set(xlabel="speed, held constant [km/h]", ylabel="contraction of the limit cycle", title=NAMES[name])
        axes.legend(fontsize="small")
        axes.grid(alpha=0.3)
    return figure
