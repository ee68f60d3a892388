"""Control of XBS in the phase plane (x2, XBS): continuous and two-phase, on the true XBS and on an estimated one.

Continuous control with the adaptive observer fails, for two reasons: as x2 vanishes the observer is not excited
and the estimate does not converge; and the estimate may fall to -d/c, where the law is not defined.
Source: Aguado-Rojas 2019, chapter 4, Figs 4.1, 4.2, 4.5 and 4.6. Initial conditions and gains are not printed
there; those below show the same.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.two_phase import TwoPhase
from absjax.hybrid.rollout import rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.observers.base import Sample
from absjax.observers.designs import Adaptive
from absjax.observers.run import observe
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.results import UNDEFINED
from absjax.tyres.surfaces import SURFACES

SPEED, DURATION, STEP = 25.0, 2.0, 1.25e-4
"""m/s, s, s"""
TYRE = SURFACES["dry_asphalt"]
C, D = float(TYRE.c2), float(TYRE.c2 * TYRE.c3)
STARTS = {"a": (-20.0, 0.5), "b": (-100.0, 8.0)}
"""x2 [m/s^2] and XBS at the start"""
CONTINUOUS = StiffnessControl(rate_gain=200.0, gain=400.0, c=C, d=D)
TWO_PHASE = TwoPhase(zref=20.0, gain=300.0, chi_a=-0.2, chi_b=2.0)


class PhaseRun(NamedTuple):
    """One run; arrays (samples,)."""

    label: str
    time: np.ndarray
    offset: np.ndarray
    """x2 [m/s^2]"""
    stiffness: np.ndarray
    """true XBS"""
    estimate: np.ndarray
    """XBS as the observer has it, in the loop or in parallel"""
    undefined: bool
    """whether the run ended because the law is not defined any more"""

    @property
    def end(self) -> slice:
        """The last fifth of the run."""
        return slice(-max(1, len(self.time) // 5), None)

    @property
    def distance(self) -> float:
        """Largest |XBS| in the last fifth of the run: how near the peak it stays."""
        return float(np.abs(self.stiffness[self.end]).max())

    @property
    def error(self) -> float:
        """Largest error of the estimate in the last fifth."""
        return float(np.abs(self.estimate - self.stiffness)[self.end].max())


def observer():
    """The adaptive observer with default gains; it takes the road for another one at the start."""
    return Adaptive().observer(Wheel())


def run(controller: Any, start: tuple[float, float], in_the_loop: bool) -> PhaseRun:
    """Run a controller from a point of the phase plane, its first phase after driver braking active.

    Args:
        start: x2 [m/s^2] and XBS.
        in_the_loop: whether the controller is told the estimated XBS; else the observer runs in parallel.
    """
    loop = ClosedLoop(TestRig(Wheel(), UniformRoad(TYRE), SPEED), Brake(), controller, driver=FreeRamp())
    if in_the_loop:
        loop = dataclasses.replace(loop, observer=observer())
    state = loop.braking(jnp.asarray(SPEED), TYRE.slip_at(start[1]), start[0])
    result = rollout(loop, state, 1, step=STEP, steps=round(DURATION / STEP), save_every=1)
    result.raise_if_failed()
    path, valid = result.path, np.asarray(result.path.valid)
    signals = jax.vmap(loop.measured)(path.time, path.state, path.mode)
    told = jax.vmap(loop.signals)(path.time, path.state, path.mode).stiffness
    if not in_the_loop:
        told = observe(observer(), Sample.of(signals), STEP).stiffness
    columns = path.time, signals.acceleration_offset, signals.stiffness, told
    time, offset, stiffness, estimate = (np.asarray(x)[valid] for x in columns)
    label = "estimated XBS" if in_the_loop else "true XBS"
    return PhaseRun(label, time, offset, stiffness, estimate, bool(result.mode == UNDEFINED))


def runs(controller: Any) -> dict[str, dict[bool, PhaseRun]]:
    """By start, then by whether the observer is in the loop."""
    return {
        name: {inside: run(controller, start, inside) for inside in (False, True)} for name, start in STARTS.items()
    }


def rows(name: str, studied: dict[str, dict[bool, PhaseRun]]) -> list[dict[str, Any]]:
    """How each run ended."""
    return [
        {
            "control": name,
            "start": start,
            "told": run.label,
            "ends": f"control undefined at {run.time[-1]:.3f} s" if run.undefined else "still running",
            "last |XBS|": round(run.distance, 4),
            "last |x2| [m/s²]": round(float(np.abs(run.offset[run.end]).max()), 3),
            "last error of XBS": round(run.error, 3),
            "lowest estimate": round(float(run.estimate.min()), 3),
        }
        for start, pair in studied.items()
        for run in pair.values()
    ]


def figure(studied: dict[str, dict[bool, PhaseRun]], in_the_loop: bool, title: str):
    """Phase plane from each start, the observer's estimate beside the true course."""
    drawn, grid = plt.subplots(1, len(studied), figsize=(6 * len(studied), 4.5), layout="constrained", squeeze=False)
    for axes, (start, pair) in zip(grid[0], studied.items()):
        one = pair[in_the_loop]
        axes.plot(one.offset, one.stiffness, label="system")
        axes.plot(one.offset, one.estimate, "-.", color="C2", lw=0.9, label="observer")
        axes.plot(one.offset[0], one.stiffness[0], "ko", ms=4, label="start")
        axes.axhline(-D / C, color="C3", ls="--", lw=0.9, label="XBS = -d/c")
        axes.axhline(0, color="k", lw=0.5)
        axes.axvline(0, color="k", lw=0.5)
        low, high = -1.5, 1.15 * max(float(one.stiffness.max()), 1.0)
        axes.set(xlabel="x2 [m/s²]", ylabel="XBS", ylim=(low, high))
        ending = f", undefined at {one.time[-1]:.3f} s" if one.undefined else ""
        axes.set_title(f"({start}) {title}{ending}", fontsize=10)
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    return drawn
