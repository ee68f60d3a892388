"""Figures of the vehicle's speed, true and estimated."""

import matplotlib.pyplot as plt

from tuning.speed.study import Traces


def speeds_figure(traces: Traces, title: str):
    """Fig. 3.15 of the source: speed, true and estimated, and the rims; below, the errors."""
    figure, (speeds, errors) = plt.subplots(
        2, 1, figsize=(9, 6), sharex=True, height_ratios=(2, 1), layout="constrained"
    )
    for i, (axle, shade) in enumerate(zip(("front", "rear"), ("0.55", "0.8"))):
        speeds.plot(traces.time, traces.rims[:, i], color=shade, lw=0.7, label=f"{axle} rim")
    speeds.plot(traces.time, traces.speed, "k", lw=1.6, label="true")
    for i, (name, estimate) in enumerate(traces.estimates.items()):
        style = {"color": f"C{i}", "lw": 1.1, "ls": ("-", "--", "-.", ":")[i % 4]}
        speeds.plot(traces.time, estimate, label=name, **style)
        errors.plot(traces.time, estimate - traces.speed, **style)
    speeds.set(ylabel="speed [m/s]", ylim=(0, None), title=title)
    speeds.legend(fontsize="small", loc="upper right")
    errors.set(xlabel="time [s]", ylabel="error [m/s]")
    for axes in (speeds, errors):
        axes.grid(alpha=0.3)
    return figure
