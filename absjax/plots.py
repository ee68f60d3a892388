"""Figures of models and rollouts. Each function draws into the axes it is given."""

from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from absjax.hybrid.rollout import Trajectory
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.sampled_loop import loop_state
from absjax.loop.vehicle_loop import VehicleLoop

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
    path = jax.tree.map(lambda leaf: np.asarray(leaf)[valid], trajectory)
    signals = jax.vmap(loop.measured)(path.time, loop_state(path.state), path.mode)
    slip = np.asarray(loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed))
    axes.plot(slip, np.asarray(signals.acceleration_offset), **{"lw": 0.8, **line})
    axes.set(xlabel="slip λ", ylabel="x2 = R ω' - v'  [m/s²]")
    axes.grid(alpha=0.3)


def stop_panels(axes, loop: ClosedLoop | VehicleLoop, trajectory: Trajectory, label: str = "") -> None:
    """Speeds, slip, pressure and phases of one lane against time, into four axes; of a vehicle those of every wheel."""
    valid = np.asarray(trajectory.valid)
    path = jax.tree.map(lambda leaf: np.asarray(leaf)[valid], trajectory)
    state = loop_state(path.state)
    measured: Any = jax.vmap(loop.measured)(path.time, state, path.mode)
    speeds, slip, pressure, phase = axes
    if isinstance(loop, VehicleLoop):
        wheels, names, phases = measured, loop.vehicle.places, loop.phases(path.mode)
        locked, controller, channels = np.any(loop.locked(path.mode), axis=0), loop.channels[0].controller, loop.names
    else:
        wheels, names, phases = (measured,), ("wheel rim",), (loop.phase(path.mode),)
        locked, controller, channels = np.asarray(loop.locked(path.mode)), loop.controller, ("",)
    speeds.plot(path.time, wheels[0].vehicle_speed, "k", label="vehicle")
    speeds.set(ylabel="speed [m/s]", title=label)
    if state.pedal is not None:
        pressure.plot(path.time, state.pedal.level, "k:", lw=1, label="pedal")
    for i, (signals, name) in enumerate(zip(wheels, names)):
        rim, colour = signals.radius * signals.wheel_speed, f"C{i}"
        speeds.plot(path.time, rim, colour, lw=0.8, label=name)
        slip.plot(path.time, rim / signals.vehicle_speed - 1, colour, lw=0.8)
        at_wheel = "at the wheel" if len(wheels) == 1 else name
        pressure.plot(path.time, signals.pressure, "C3" if len(wheels) == 1 else colour, lw=0.9, label=at_wheel)
    slip.set(ylabel="slip λ", ylim=(-1.02, 0.05))
    pressure.set(ylabel="pressure [bar]")
    for i, (of_channel, name) in enumerate(zip(phases, channels)):
        phase.step(path.time, of_channel, f"C{i if len(channels) > 1 else 2}", lw=0.8, where="post", label=name)
    numbered = [f"{i} {name}" for i, name in enumerate(controller.phases)]
    phase.set_yticks(range(len(numbered)), numbered, fontsize=7)
    phase.set(xlabel="time [s]")
    for panel in axes:
        panel.grid(alpha=0.3)
        panel.fill_between(path.time, 0, 1, where=locked, transform=panel.get_xaxis_transform(), color="C1", alpha=0.3)
    for panel in (speeds, pressure):
        panel.legend(fontsize="small", loc="upper right")
