"""The figure of a log: every signal, which of its samples were measured, and which are not to be trusted."""

import matplotlib.pyplot as plt
import numpy as np

from tuning.logs.brake_log import Reading
from tuning.logs.units import OWN

MOST_POINTS = 20000
"""Samples of a signal that are drawn as points."""


def description_figure(found: Reading):
    """Every signal against time, its measurements as points; those clipped or stuck in red."""
    log, count = found.log, len(found.signals)
    figure, axes = plt.subplots(count, 1, figsize=(9, 1.9 * count + 0.6), sharex=True, layout="constrained")
    for axis, signal, quality in zip(np.atleast_1d(axes), found.signals, found.qualities):
        name, unit = signal.name, found.sources[signal.name].unit
        inside = (signal.time >= log.time[0]) & (signal.time <= log.time[-1])
        axis.plot(log.time, getattr(log, name), color="0.6", lw=0.8)
        for kind, colour, label in (
            (quality.taken & quality.trusted, "C0", "measured"),
            (quality.taken & ~quality.trusted, "C3", "clipped or stuck"),
        ):
            shown = np.flatnonzero(kind & inside)
            shown = shown[:: max(1, shown.size // MOST_POINTS)]
            if shown.size:
                axis.plot(signal.time[shown], signal.values[shown], ".", ms=2, color=colour, label=label)
        share = f"{log.measured[name].mean():.0%} measured"
        title = f"{name.replace('_', ' ')}: {signal.channel.name} in {unit.text}, {share}"
        axis.set_title(title, fontsize="small", loc="left", parse_math=False)
        axis.set_ylabel(f"[{OWN[name]}]")
        axis.grid(alpha=0.3)
        if not quality.trusted[quality.taken].all():
            axis.legend(fontsize="x-small", loc="upper right", markerscale=3)
    np.atleast_1d(axes)[-1].set_xlabel("time [s]")
    figure.suptitle(log.name, parse_math=False)
    return figure
