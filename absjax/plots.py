"""Figures of models and rollouts. Each function draws into the axes it is given."""

from typing import Any

import jax
import matplotlib.axes
import numpy as np

from absjax.closed_loop import ClosedLoop, LoopState
from absjax.engine import Trajectory


def speeds(axes: matplotlib.axes.Axes, trajectory: Trajectory, radius: float, label: str = "") -> None:
    """Vehicle speed and wheel rim speed of one lane against time."""
    valid = np.asarray(trajectory.valid)
    time, plant = np.asarray(trajectory.time)[valid], trajectory.state.plant
    axes.plot(time, np.asarray(plant.speed)[valid], label=f"{label} vehicle".strip())
    axes.plot(time, radius * np.asarray(plant.wheel_speed)[valid], lw=0.8, label=f"{label} wheel rim".strip())
    axes.set(xlabel="time [s]", ylabel="speed [m/s]")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3)


def phase_plane(axes: matplotlib.axes.Axes, loop: ClosedLoop, trajectory: Trajectory, **line: Any) -> None:
    """Wheel acceleration offset x2 against slip of one lane."""
    valid = np.asarray(trajectory.valid)
    time, state = np.asarray(trajectory.time)[valid], _valid(trajectory.state, valid)
    signals = loop.signals(time, state, np.asarray(trajectory.mode)[valid])
    slip = np.asarray(loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed))
    axes.plot(slip, np.asarray(signals.acceleration_offset), **{"lw": 0.8, **line})
    axes.set(xlabel="slip λ", ylabel="x2 = R ω' - v'  [m/s²]")
    axes.grid(alpha=0.3)


def _valid(state: LoopState, valid: np.ndarray) -> LoopState:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[valid], state)
