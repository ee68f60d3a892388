"""The cycles of the logics that cars have: eight phases with a threshold on slip, and four thresholds on acceleration.

From the pedal on a road of high adherence: speeds with the reference speed and its threshold lambda1, acceleration of
the rim with the thresholds, pressure, and the phases.
Source: Aguado-Rojas 2019, Fig. 2.2; Hoang 2014 (thesis), section 1.3 and Fig. 1.2. Both print shapes, no numbers.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import matplotlib.pyplot as plt
import numpy as np

from absjax.controllers import CONTROLLERS
from absjax.hybrid.rollout import Trajectory
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.stop import stop
from absjax.signals import Signals
from absjax.tyres.surfaces import SURFACES
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.setup import Setup

ROAD, SPEED_KMH = "dry_asphalt", 100.0
SHOWN = 1.5
"""From the pedal, s."""
SETTINGS: dict[str, dict[str, float]] = {
    "bosch": {
        "minus_a": 40.0,
        "plus_a": 8.0,
        "plus_A": 11.0,
        "lambda1": 0.3,
        "gradient": 7.0,
        "release": 50000.0,
        "apply": 5400.0,
        "step": 3500.0,
        "pulse": 0.008,
        "pause": 0.033,
        "longest_hold": 0.12,
        "share": 0.09,
    },
    "production": {
        "a1": 35.0,
        "a2": 53.0,
        "a3": 5.0,
        "a4": 18.0,
        "release": 28000.0,
        "apply": 5700.0,
        "through": 1030.0,
        "longest_hold": 0.137,
        "share": 0.38,
    },
}
"""By logic, set by hand for that road, so that the phases follow each other as the sources tell it."""


class Cycles(NamedTuple):
    """A stop under a logic; arrays (samples,)."""

    title: str
    loop: ClosedLoop
    time: np.ndarray
    signals: Signals
    reference: np.ndarray | None
    """reference speed [m/s]; None of a logic without one"""
    phase: np.ndarray

    @property
    def acceleration(self) -> np.ndarray:
        """Of the rim, R w' [m/s^2]."""
        return self.signals.acceleration_offset + self.signals.vehicle_acceleration

    def sequence(self) -> list[int]:
        """The phases in the order in which they follow each other."""
        return [int(p) for i, p in enumerate(self.phase) if i == 0 or p != self.phase[i - 1]]


def run(name: str) -> Cycles:
    """A stop under a logic, as set by hand."""
    config = dataclasses.replace(tuned_sets()[name], roads=(ROAD,), speeds_kmh=(SPEED_KMH,))
    setup = Setup.of(config)
    controller = setup.controller(SETTINGS[name])
    loop = setup.loop(controller, SURFACES[ROAD])
    step = setup.step
    stopped = stop(loop, SPEED_KMH / 3.6, horizon=8.0, step=step, max_events=config.max_events, save_every=1)
    path: Trajectory = jax.tree.map(
        lambda x: np.asarray(x)[np.asarray(stopped.rollout.path.valid)], stopped.rollout.path
    )
    signals = jax.tree.map(np.asarray, jax.vmap(loop.measured)(path.time, path.state, path.mode))
    reference_of = getattr(controller, "reference_speed", None)
    reference = None if reference_of is None else np.asarray(jax.vmap(reference_of)(signals, path.state.controller))
    return Cycles(
        CONTROLLERS[name].title, loop, np.asarray(path.time), signals, reference, np.asarray(loop.phase(path.mode))
    )


def rows(found: list[Cycles]) -> list[dict[str, Any]]:
    """Of each logic the share of its time in each kind of action, the friction it uses, and its first phases."""
    table = []
    peak = float(SURFACES[ROAD].peak().friction)
    for each in found:
        on = each.phase > 0
        used = -each.signals.vehicle_acceleration[on].mean() / 9.81 / peak
        rate = np.gradient(each.signals.pressure, each.time)[on]
        table.append(
            {
                "logic": each.title,
                "friction used [%]": round(100 * float(used), 1),
                "apply [%]": round(100 * float((rate > 1.0).mean()), 1),
                "hold [%]": round(100 * float((np.abs(rate) <= 1.0).mean()), 1),
                "release [%]": round(100 * float((rate < -1.0).mean()), 1),
                "phases, in their order": " ".join(map(str, each.sequence()[:24])),
            }
        )
    return table


def figure(found: list[Cycles]):
    """Speeds, acceleration of the rim with its thresholds, pressure and phases, a column each."""
    drawn, grid = plt.subplots(4, len(found), figsize=(7 * len(found), 10), sharex=True, layout="constrained")
    for column, each in zip(grid.T, found):
        controller, time = each.loop.controller, each.time
        speed, acceleration, pressure, phase = column
        speed.plot(time, each.signals.vehicle_speed, "k", label="vF, vehicle")
        speed.plot(time, each.signals.radius * each.signals.wheel_speed, "C0", lw=1.0, label="vR, rim")
        if each.reference is not None:
            speed.plot(time, each.reference, "C1--", lw=0.9, label="vRef")
            speed.plot(time, (1 - SETTINGS["bosch"]["lambda1"]) * each.reference, "C1:", lw=0.9, label="λ1")
        acceleration.plot(time, each.acceleration, "C0", lw=0.9)
        for label, value in _thresholds(controller).items():
            acceleration.axhline(value, color="C3", ls=":", lw=0.9)
            acceleration.annotate(label, (SHOWN, value), fontsize=8, color="C3", va="bottom", ha="right")
        pressure.plot(time, each.signals.pressure, "C3", lw=0.9)
        phase.step(time, each.phase, "C2", lw=0.9, where="post")
        phase.set_yticks(
            range(len(controller.phases)), [f"{i} {name}" for i, name in enumerate(controller.phases)], fontsize=7
        )
        speed.set(title=each.title, xlim=(0, SHOWN), ylim=(8, 29))
        acceleration.set(ylim=(-65, 45))
        pressure.set(ylim=(0, 65))
        phase.set(xlabel="time from the pedal [s]")
        for axes in column:
            axes.grid(alpha=0.3)
        speed.legend(fontsize="small")
    for axes, label in zip(grid[:, 0], ("speed [m/s]", "R ω' [m/s²]", "pressure [bar]")):
        axes.set_ylabel(label)
    return drawn


def _thresholds(controller: Any) -> dict[str, float]:
    if hasattr(controller, "a1"):
        return {
            "-a1": -float(controller.a1),
            "-a2": -float(controller.a2),
            "a3": float(controller.a3),
            "a4": float(controller.a4),
        }
    return {"-a": -float(controller.minus_a), "+a": float(controller.plus_a), "+A": float(controller.plus_A)}
