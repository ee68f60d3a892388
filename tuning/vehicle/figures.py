"""Figures of the published scenario on two axles, after Figs 3.15 to 3.19 of the source."""

import matplotlib.pyplot as plt
import numpy as np

from tuning.vehicle.scenario import CHANGES, Ride

AXLES = "front", "rear"


def speed_figure(rides: dict[str, Ride]):
    """True and estimated speed, and the rims (Fig. 3.15), one panel for each filter."""
    figure, all_axes = plt.subplots(len(rides), 1, figsize=(9, 3.2 * len(rides)), sharex=True, layout="constrained")
    for axes, (name, ride) in zip(np.atleast_1d(all_axes), rides.items()):
        for rim, axle, colour in zip(ride.rims, AXLES, ("C0", "C1")):
            axes.plot(ride.time, rim, colour, lw=0.8, label=f"rim, {axle}")
        axes.plot(ride.time, ride.speed, "k", label="vehicle")
        axes.plot(ride.time, ride.told_speed, "C3--", label="estimated")
        error = 100 * np.mean((np.abs(ride.told_speed - ride.speed) / ride.speed)[ride.active[0]])
        axes.set(ylabel="speed [m/s]", title=f"{name}: mean error {error:.1f} %")
        axes.legend(fontsize="small", ncols=2)
        _roads(axes)
    np.atleast_1d(all_axes)[-1].set(xlabel="time [s]")
    return figure


def pressure_figure(ride: Ride):
    """Pressure at both axles (Fig. 3.16)."""
    figure, axes = plt.subplots(figsize=(9, 3.5), layout="constrained")
    for pressure, axle in zip(ride.pressures, AXLES):
        axes.plot(ride.time, pressure, lw=0.9, label=axle)
    axes.set(xlabel="time [s]", ylabel="pressure [bar]")
    axes.legend()
    _roads(axes)
    return figure


def load_figure(ride: Ride):
    """Loads of both axles, true and as the observers know them (Fig. 3.17)."""
    figure, axes = plt.subplots(figsize=(9, 3.5), layout="constrained")
    for load, known, axle, colour in zip(ride.loads, ride.known_loads, AXLES, ("C0", "C1")):
        axes.plot(ride.time, load / 1e3, colour, label=axle)
        axes.plot(ride.time, known / 1e3, colour, ls=":", lw=1, label=f"{axle}, eq. 3.36")
    axes.set(xlabel="time [s]", ylabel="vertical load [kN]")
    axes.legend(ncols=2, fontsize="small")
    _roads(axes)
    return figure


def stiffness_figure(ride: Ride, from_truth: bool):
    """XBS of both axles and its estimate; beside that from the true signals (Fig. 3.18) or alone (Fig. 3.19)."""
    figure, all_axes = plt.subplots(2, 1, figsize=(9, 6.5), sharex=True, layout="constrained")
    for axes, true, told, known, active, axle in zip(
        all_axes, ride.stiffness, ride.estimated, ride.from_truth, ride.active, AXLES
    ):
        first = int(np.argmax(active))
        time = ride.time[first:]
        axes.plot(time, told[first:], "C3", lw=0.8, label="estimated, from what the unit is told")
        if from_truth:
            axes.plot(time, known[first:], "C0", lw=0.8, label="estimated, from the true speed and acceleration")
        axes.plot(time, true[first:], "k", lw=1.2, label="true")
        axes.set(ylabel=f"XBS, {axle}", ylim=(-2, 10))
        axes.axhline(0, color="k", lw=0.5)
        _roads(axes)
    all_axes[0].legend(fontsize="small")
    all_axes[1].set(xlabel="time [s]")
    return figure


def _roads(axes) -> None:
    for change in CHANGES:
        axes.axvline(change, color="0.5", ls="--", lw=0.8)
    axes.grid(alpha=0.3)
