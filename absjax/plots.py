"""Figures of models and rollouts. Each function draws into the axes it is given."""

from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from absjax.hybrid.rollout import Trajectory
from absjax.loop.closed_loop import ClosedLoop, LoopState
from absjax.loop.sampled_loop import loop_state

if TYPE_CHECKING:
    import matplotlib.axes


def speeds(axes: "matplotlib.axes.Axes", trajectory: Trajectory, radius: float, label: str = "") -> None:
    """Vehicle speed and wheel rim speed of one lane against time."""
    valid = np.asarray(trajectory.valid)
    time, plant = np.asarray(trajectory.time)[valid], trajectory.state.plant
    axes.plot(time, np.asarray(plant.speed)[valid], label=f"{label} vehicle".strip())
    axes.plot(time, radius * np.asarray(plant.wheel_speed)[valid], lw=0.8, label=f"{label} wheel rim".strip())
    axes.set(xlabel="time [s]", ylabel="speed [m/s]")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3)


def phase_plane(axes: "matplotlib.axes.Axes", loop: ClosedLoop, trajectory: Trajectory, **line: Any) -> None:
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


def stop_panels(axes, loop: ClosedLoop, trajectory: Trajectory, label: str = "") -> None:
    """Speeds, slip, pressure and phases of one lane against time, into four axes."""
    valid = np.asarray(trajectory.valid)
    path = jax.tree.map(lambda leaf: np.asarray(leaf)[valid], trajectory)
    state = loop_state(path.state)
    signals = jax.vmap(loop.measured)(path.time, state, path.mode)
    speeds, slip, pressure, phase = axes
    speeds.plot(path.time, signals.vehicle_speed, "k", label="vehicle")
    speeds.plot(path.time, signals.radius * signals.wheel_speed, "C0", lw=0.8, label="wheel rim")
    speeds.set(ylabel="speed [m/s]", title=label)
    slip.plot(path.time, loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed), "C0", lw=0.8)
    slip.set(ylabel="slip λ", ylim=(-1.02, 0.05))
    if state.pedal is not None:
        pressure.plot(path.time, state.pedal.level, "k:", lw=1, label="pedal")
    pressure.plot(path.time, signals.pressure, "C3", lw=0.9, label="at the wheel")
    pressure.set(ylabel="pressure [bar]")
    phase.step(path.time, loop.phase(path.mode), "C2", lw=0.8, where="post")
    names = [f"{i} {name}" for i, name in enumerate(loop.controller.phases)]
    phase.set_yticks(range(len(names)), names, fontsize=7)
    phase.set(xlabel="time [s]")
    locked = np.asarray(loop.locked(path.mode))
    for panel in axes:
        panel.grid(alpha=0.3)
        panel.fill_between(path.time, 0, 1, where=locked, transform=panel.get_xaxis_transform(), color="C1", alpha=0.3)
    for panel in (speeds, pressure):
        panel.legend(fontsize="small", loc="upper right")
