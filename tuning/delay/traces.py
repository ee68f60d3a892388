"""The course of stops in a control unit: what is followed, how well, and what the observer makes of it."""

from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.lanes import stacked
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import stop
from absjax.observers.designs import KnownRoad
from tuning.delay.brake import DELAY, HORIZON, MAX_EVENTS, TICK, Case, loop_of, undelayed_loop

LATER = 2.0
"""Delays after the entry of a phase from which its following is judged."""


class Trace(NamedTuple):
    """A stop at the ticks, arrays (ticks,)."""

    label: str
    time: np.ndarray
    offset: np.ndarray
    """z1, m/s^2"""
    target: np.ndarray
    """z1* one delay before, m/s^2"""
    tracked: np.ndarray
    """whether it is followed"""
    phase: np.ndarray
    slip: np.ndarray
    pressure: np.ndarray
    """at the wheel, bar"""
    observer_error: np.ndarray
    """of z1 and XBS, (2, ticks)"""
    rms: float
    """of z1 - z1*(t - h) where it is followed, m/s^2"""


def traces(cases: dict[str, Case], observed: bool = True) -> list[Trace]:
    """Stops told XBS by an observer of three states, sampled at 1 ms with a delay of 10 ms, as lanes of one program."""
    design = KnownRoad()
    observer = design.observer(loop_of(Case()).plant.wheel) if observed else None
    loop = stacked([loop_of(case, observer) for case in cases.values()])
    unit = loop.in_unit(round(DELAY / TICK), substeps=2 * design.substeps)
    return _traces(list(cases), unit, list(cases.values()), DELAY)


def undelayed_trace(label: str, case: Case) -> Trace:
    """The same without delay and told the true XBS."""
    loop = stacked([undelayed_loop(case)])
    return _traces([label], SampledLoop(loop), [case], 0.0)[0]


def _traces(labels: list[str], unit: SampledLoop, cases: list[Case], delay: float) -> list[Trace]:
    speed = np.array([case.speed_kmh / 3.6 for case in cases])
    result = stop(unit, speed, horizon=HORIZON / 3, step=TICK, max_events=MAX_EVENTS, save_every=1)
    path = result.rollout.path
    found = []
    for i, label in enumerate(labels):
        valid = np.asarray(path.valid[i])
        own = jax.tree.map(lambda leaf, i=i, valid=valid: np.asarray(leaf)[i][valid], path)
        loop: Any = jax.tree.map(lambda leaf, i=i: leaf[i], unit.loop)
        found.append(_trace(label, loop, own, delay))
    return found


def _trace(label: str, loop: Any, path: Any, delay: float) -> Trace:
    state, controller = path.state.loop, loop.controller
    signals = jax.vmap(loop.measured)(path.time, state, path.mode)
    phase = np.asarray(jax.vmap(loop.phase)(path.mode))
    target = jax.vmap(lambda t, kept, phase: controller.target(t - delay, kept, phase)[0])
    followed = np.asarray(target(path.time, state.controller, phase))
    offset, tracked = np.asarray(signals.acceleration_offset), np.isin(phase, (1, 3, 4))
    late = tracked & (path.time - np.asarray(state.controller.time) > LATER * delay)
    errors = np.zeros((2, len(path.time)))
    if state.observer is not None:
        errors = np.stack([offset - state.observer[0], signals.stiffness - state.observer[1]])
    return Trace(
        label=label,
        time=path.time,
        offset=offset,
        target=followed,
        tracked=tracked,
        phase=phase,
        slip=np.asarray(loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed)),
        pressure=np.asarray(signals.pressure),
        observer_error=errors,
        rms=float(np.sqrt(np.mean((offset - followed)[late] ** 2))) if late.any() else 0.0,
    )
