"""Speeds and rims of some stops of a screening."""

import matplotlib.pyplot as plt
import numpy as np

from absjax.loop.sampled_loop import loop_state
from tuning.vehicle.regulation.screening import LOADS, Screened

SHOWN = (
    ("utilisation", "high"),
    ("utilisation", "low"),
    ("passage", "high to low"),
    ("rise", "low to high"),
    ("split", "split"),
)
STYLES = ("C0", "-"), ("C0", "--"), ("C1", "-"), ("C1", "--")


def stops_figure(found: Screened, title: str):
    """The vehicle and the rims of its four wheels; a row a kind of stop, a column a load."""
    path = found.stops.rollout.path
    state = loop_state(path.state).vehicle
    figure, grid = plt.subplots(len(SHOWN), len(LOADS), figsize=(11, 12), sharey=True, layout="constrained")
    for row, kind in zip(grid, SHOWN):
        for axes, laden in zip(row, LOADS):
            at = next(i for i, lane in enumerate(found.lanes) if lane.stop[:2] == kind and lane.laden == laden)
            ends = int(np.asarray(path.valid[at]).sum())
            time = np.asarray(path.time[at])[:ends]
            for wheel, (color, line) in enumerate(STYLES):
                rim = 3.6 * found.radii[wheel] * np.asarray(state.wheel_speeds[wheel][at])[:ends]
                axes.plot(time, rim, color=color, ls=line, lw=0.8, label=found.places[wheel])
            axes.plot(time, 3.6 * np.asarray(state.motion.longitudinal[at])[:ends], "k", lw=1.4, label="vehicle")
            stop = found.lanes[at].stop
            axes.set_title(f"{stop.surface}, {stop.at:g} km/h, {LOADS[laden]}", fontsize=10)
            axes.grid(alpha=0.3)
            axes.set(ylim=(0, None), xlim=(0, None))
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    for axes in grid[:, 0]:
        axes.set_ylabel("speed [km/h]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    figure.suptitle(title)
    return figure
