"""Simulated braking for observers: a wheel under an anti-lock controller, over roads that change.

The speed is imposed (a constant deceleration), the wheel is the full model, and the controller acts on the
true state, so that what excites an observer does not depend on it.
"""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.hybrid.rollout import Status, rollout
from absjax.lanes import over_lanes, stacked
from absjax.loop.closed_loop import ClosedLoop
from absjax.observers.base import Sample
from absjax.plant.brake import Brake
from absjax.plant.road import ChangingRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.results import raise_if_failed
from absjax.tyres.base import Tyre

BLEND = 0.025
"""Length of the blend from one road to the next [s]."""
FAR = 10.0
"""Slip at which XBS has come to its limit."""
FIVE: dict[str, Any] = {"eps1": 25.0, "eps2": 32.0, "eps3": 15.0, "eps5": 22.0}
"""Thresholds of the five-phase cycle: within reach on snow, where x2 cannot exceed a mu = 34 m/s^2."""
Excitation = Literal["five_phase", "two_phase"]


@dataclasses.dataclass(frozen=True)
class Scenarios:
    """Runs of equal length; arrays (runs, samples) unless said otherwise."""

    wheel: Wheel
    period: float
    """of the samples, s"""
    samples: Sample
    stiffness: np.ndarray
    """true XBS"""
    slip: np.ndarray
    begins: np.ndarray
    """where each road begins to count, s, (runs, roads): 0, then the ends of the blends"""
    ends: np.ndarray
    """where the next blend begins, or the run ends, s, (runs, roads)"""
    surfaces: Any
    """tyre curves, coefficients (runs, roads)"""

    @property
    def time(self) -> np.ndarray:
        """(samples,), s."""
        return self.period * np.arange(self.stiffness.shape[1])

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.stiffness.shape[0]

    @property
    def cycling(self) -> np.ndarray:
        """Whether y changes its sign three times at least on every road of a run, bool (runs,): without, no
        observer can settle."""
        y, time = np.asarray(self.samples.y), self.time[1:]
        changes = y[:, 1:] * y[:, :-1] < 0
        on_road = (time >= self.begins[..., None]) & (time < self.ends[..., None])
        return ((changes[:, None, :] & on_road).sum(axis=-1) >= 3).all(axis=1)

    def select(self, index) -> "Scenarios":
        """Some of the runs."""
        parts = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return Scenarios(
            **{k: v if k in ("wheel", "period") else jax.tree.map(lambda x: x[index], v) for k, v in parts.items()}
        )


PER_RUN = ("samples", "stiffness", "slip", "begins", "ends", "surfaces")


def concatenate(parts: Sequence[Scenarios]) -> Scenarios:
    """Several sets of runs of equal length as one."""
    return dataclasses.replace(
        parts[0],
        **{name: jax.tree.map(lambda *x: np.concatenate(x), *(getattr(p, name) for p in parts)) for name in PER_RUN},
    )


def simulate(
    surfaces: Sequence[Sequence[Tyre]],
    changes: Any,
    *,
    speed: Any = 25.0,
    deceleration: Any = 1.96,
    excitation: Excitation = "five_phase",
    duration: float = 9.0,
    period: float = 1e-3,
    wheel: Wheel | None = None,
) -> Scenarios:
    """Simulate runs.

    Args:
        surfaces: of each run the surfaces in order; all runs have equally many.
        changes: where the blends begin, s, (runs, surfaces - 1).
        speed: at the start, m/s, scalar or (runs,).
        deceleration: imposed, m/s^2, scalar or (runs,).
        excitation: the controller that cycles.
        duration: of a run, s.
        period: of the samples and the grid, s.
        wheel: the default wheel when None.

    Raises:
        ValueError: if the speed would fall below 1 m/s, or shapes do not fit.
        RolloutError: if a run diverges.
    """
    wheel = wheel or Wheel()
    runs, changes = len(surfaces), np.asarray(changes, float).reshape(len(surfaces), -1)
    if any(len(row) != changes.shape[1] + 1 for row in surfaces):
        raise ValueError(f"{changes.shape[1]} changes need {changes.shape[1] + 1} surfaces in every run")
    speed, deceleration = (np.broadcast_to(np.asarray(x, float), runs) for x in (speed, deceleration))
    if (slowest := float((speed - duration * deceleration).min())) < 1.0:
        raise ValueError(f"the speed falls to {slowest:g} m/s in {duration:g} s; 1 m/s is the least")
    curves = stacked([stacked(row) for row in surfaces])
    columns = tuple(jax.tree.map(lambda x, k=k: x[:, k], curves) for k in range(changes.shape[1] + 1))
    road = ChangingRoad(columns, tuple(changes.T), BLEND)
    plant = TestRig(wheel, road, speed, -deceleration)
    controller = _two_phase(curves, wheel) if excitation == "two_phase" else _five_phase(wheel)
    loop = ClosedLoop(plant, Brake(), controller)
    steps = round(duration / period)
    start = controller.phases.index("apply") if excitation == "two_phase" else 0
    state = loop.initial_state(jnp.asarray(speed))
    told, status, onset = jax.tree.map(np.asarray, _simulated(loop, state, start, period, steps))
    raise_if_failed(status, Status)
    samples, stiffness, slip = told
    if not (onset > 0).all():
        raise ValueError(
            f"in run {int(np.argmin(onset > 0))} the controller never switches; there is nothing to excite"
        )
    begins = np.concatenate([np.zeros((runs, 1)), changes + BLEND], axis=1)
    ends = np.concatenate([changes, np.full((runs, 1), (steps + 1) * period)], axis=1)
    return Scenarios(wheel, period, samples, stiffness, slip, begins, ends, curves)


def _five_phase(wheel: Wheel) -> AccelerationTracking:
    return AccelerationTracking(**FIVE, wheel=wheel)


def _two_phase(surfaces: Tyre, wheel: Wheel) -> TwoPhase:
    """Thresholds every surface of a run reaches: XBS goes from that of free rolling to its limit for large slips."""
    lowest, highest = (np.asarray(surfaces.stiffness(jnp.asarray(slip))) for slip in (-FAR, 0.0))
    low, high = np.maximum(-0.1, 0.6 * lowest.max(axis=1)), np.minimum(5.0, 0.5 * highest.min(axis=1))
    return TwoPhase(wheel=wheel, zref=40.0, chi_a=low, chi_b=high)


@partial(jax.jit, static_argnums=4)
def _simulated(loop: ClosedLoop, state, start, period, steps: int):
    """Samples, stiffness and slip of every run, how it ended, and when its controller first switched."""
    result = rollout(loop, state, start, step=period, steps=steps, save_every=1, max_events=3000)

    def of_run(loop, time, state, mode):
        signals = jax.vmap(loop.signals)(time, state, mode)
        return Sample.of(signals), signals.stiffness, loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed)

    path = result.path
    told = over_lanes(of_run, loop, path.time, path.state, path.mode)
    return told, result.status, result.state.memory.control.onset_time
