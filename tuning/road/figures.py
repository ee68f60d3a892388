"""Figures of an identified road."""

from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.plant.wheel import Wheel
from tuning.core.figures import save
from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.road.curve import Curve
from tuning.road.identify import Z95, Identification, Segment


def identification_figures(
    result: Identification, log: BrakeLog, car: Car | Wheel, folder: Path, shown: str | None = None
) -> list[Path]:
    """Friction curves with data and confidence bands; the log with its surfaces.

    Args:
        result: the road.
        log: it was identified from.
        car: what was known of it.
        folder: for the figures.
        shown: what they show, for their titles; the log's name where not given.
    """
    return [
        save(friction_figure(result, log, car, shown), folder / "friction_curve.png"),
        save(log_figure(result, log, car, shown), folder / "log.png"),
    ]


def friction_figure(result: Identification, log: BrakeLog, car: Car | Wheel, shown: str | None = None):
    """The friction curve of every surface with its data, 95 % band and peak."""
    samples = result.samples(log, car)[1]
    figure, axes = plt.subplots(figsize=(8, 5))
    for i, segment in enumerate(result.segments):
        colour = f"C{i}"
        inside = (log.time >= segment.start + 0.06 * (i > 0)) & (log.time <= segment.end)
        sign = 1 if segment.side == "driving" else -1
        inside &= sign * samples.slip > -0.01
        axes.plot(sign * samples.slip[inside], sign * samples.friction[inside], ".", ms=1.5, alpha=0.25, color=colour)
        slip = np.linspace(0, max(0.3, 1.3 * segment.largest_slip, 1.5 * min(segment.peak_slip, 0.5)), 300)
        middle, half = _band(segment, slip)
        found = ", ".join(f"{name} {value:.4g}" for name, value in segment.parameters.items())
        label = f"{segment.start:.2f} to {segment.end:.2f} s, {segment.side}: {found}"
        axes.plot(slip, middle, color="k", lw=2.2)
        axes.plot(slip, middle, color=colour, lw=1.4, label=label)
        axes.fill_between(slip, middle - half, middle + half, color=colour, alpha=0.35)
        axes.errorbar(
            segment.peak_slip,
            segment.peak_friction,
            xerr=segment.peak_slip - segment.ci95["peak_slip"][0],
            yerr=segment.peak_friction - segment.ci95["peak_friction"][0],
            fmt="o",
            ms=5,
            color="k",
            capsize=3,
        )
    axes.set(xlabel="slip magnitude |λ|", ylabel="friction |μ|", xlim=(0, None), ylim=(0, None))
    axes.set_title(
        f"{shown or result.log}: friction from {samples.source},\ncurve, 95 % band and peak. Verdict: {result.verdict}"
    )
    axes.legend(loc="lower right", fontsize="small")
    axes.grid(alpha=0.3)
    return figure


def _band(segment: Segment, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Friction magnitude of the fitted curve and its 95 % half-width."""

    curve = Curve(type(segment.tyre))

    def friction(c):
        return -curve.tyre(c).friction(-jnp.asarray(slip))

    c = jnp.asarray(list(segment.parameters.values()))
    slope = np.asarray(jax.jacfwd(friction)(c))
    variance = np.einsum("np,pq,nq->n", slope, np.asarray(segment.covariance), slope)
    return np.asarray(friction(c)), Z95 * np.sqrt(np.maximum(variance, 0))


def log_figure(result: Identification, log: BrakeLog, car: Car | Wheel, shown: str | None = None):
    """Speeds, pressure and friction against time, surfaces shaded."""
    log, samples = result.samples(log, car)
    figure, axes = plt.subplots(3, 1, figsize=(9, 7), sharex=True, layout="constrained")
    axes[0].plot(log.time, log.vehicle_speed, label="vehicle")
    axes[0].plot(log.time, result.wheel["radius"] * log.wheel_speed, lw=0.8, label="wheel rim")
    axes[0].set_ylabel("speed [m/s]")
    axes[0].legend(fontsize="small")
    if log.brake_pressure is not None:
        axes[1].plot(log.time, log.brake_pressure, lw=0.8)
    axes[1].set_ylabel("brake pressure [bar]")
    axes[2].plot(log.time, -samples.friction, lw=0.6, label="measured")
    for i, segment in enumerate(result.segments):
        inside = (log.time >= segment.start) & (log.time <= segment.end)
        axes[2].plot(
            log.time[inside],
            -np.asarray(segment.tyre.friction(samples.slip[inside])),
            lw=1.2,
            color="k",
            label="fitted" if i == 0 else None,
        )
        for axis in axes:
            axis.axvspan(segment.start, segment.end, color=f"C{i}", alpha=0.08, lw=0)
    axes[2].set(xlabel="time [s]", ylabel="friction |μ|")
    axes[2].legend(fontsize="small", loc="lower right")
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.suptitle(f"{shown or result.log}: {len(result.segments)} surface(s). Verdict: {result.verdict}")
    return figure
