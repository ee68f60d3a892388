"""Limit cycles of tuned controllers: a certificate by road and speed, and a charge on contraction in tuning."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import lane_count
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.limit_cycle import CycleStatus, LimitCycle, limit_cycle
from tuning.controllers.batch import every_set_on_every_row
from tuning.controllers.setup import Setup
from tuning.core.problem import in_chunks
from tuning.core.roads import name_of, stacked

CONTRACTION_CHARGE = 1.0
"""Added to a cost for every unit by which a contraction exceeds the largest allowed."""
NO_CYCLE_CHARGE = 0.05
"""Added for every road and speed without a limit cycle, when contraction is limited."""
CHUNK = 8


@dataclasses.dataclass(frozen=True)
class CycleRow:
    """The limit cycle on one road at one speed; None where there is none.

    `contraction` is that of wheel, brake and controller on the true XBS, `with_observer` that of the whole loop;
    `observer_status` is None without an observer.
    """

    road: str
    speed_kmh: float
    status: str
    period: float | None
    contraction: float | None
    observer_status: str | None = None
    with_observer: float | None = None

    @property
    def certified(self) -> bool:
        """Whether the cycle is attractive, with the observer too where there is one."""
        wanted = [self.contraction] if self.observer_status is None else [self.contraction, self.with_observer]
        return all(value is not None and value < 1 for value in wanted)


def rig_loops(setup: Setup) -> ClosedLoop:
    """Loops on a rig, a lane for each uniform road and speed, all speeds of the first road first; with the true XBS."""
    roads, speeds = setup.config.uniform_roads, setup.config.cycle_speeds_kmh
    speed = np.tile(np.asarray(speeds) / 3.6, len(roads))
    true = dataclasses.replace(setup, observer=None)
    return true.rig_loop(setup.controller(), stacked([road for road in roads for _ in speeds]), speed)


def charges(loops: ClosedLoop, parameters: Mapping[str, Any], step: float, largest: float):
    """What sets are charged for contractions above the largest allowed, (sets,); parameters are (sets,).
    Differentiable."""
    rows = lane_count(loops.plant, "rigs") or 1
    cycle = limit_cycle(every_set_on_every_row(loops, parameters, rows), step=step)
    found = cycle.status == CycleStatus.FOUND
    excess = jnp.maximum(jnp.where(found, cycle.contraction, 0.0) - largest, 0.0)
    return (CONTRACTION_CHARGE * excess + NO_CYCLE_CHARGE * ~found).reshape(rows, -1).sum(axis=0)


_charges = jax.jit(charges, static_argnames="step")


def exact_charges(setup: Setup, names: tuple[str, ...], sets: np.ndarray) -> np.ndarray:
    """`charges` of sets (sets, parameters), in chunks."""
    loops, limit = rig_loops(setup), (setup.kind.grid_step, setup.config.largest_contraction)
    return in_chunks(lambda chunk: _charges(loops, dict(zip(names, chunk.T)), *limit), sets, CHUNK)


def certify_cycles(setup: Setup, parameters: Mapping[str, float]) -> list[CycleRow]:
    """The limit cycles of a parameter set on the roads of a setup; none of a controller without cycles."""
    config = setup.config
    if setup.kind.cycle_phase is None or not config.uniform_roads:
        return []
    true = dataclasses.replace(rig_loops(setup), controller=setup.controller(parameters))
    cycle, whole = _found(true, setup.kind.grid_step), None
    if setup.observer is not None:
        whole = _found(dataclasses.replace(true, observer=setup.observer), setup.step)

    def finite(value):
        return float(value) if np.isfinite(value) else None

    rows = []
    for i, (road, speed) in enumerate((r, s) for r in config.uniform_roads for s in config.cycle_speeds_kmh):
        observed = {}
        if whole is not None:
            code = CycleStatus(int(whole.status[i]))
            observed = {"observer_status": code.name, "with_observer": finite(whole.contraction[i])}
        found = CycleStatus(int(cycle.status[i])).name
        rows.append(
            CycleRow(name_of(road), speed, found, finite(cycle.period[i]), finite(cycle.contraction[i]), **observed)
        )
    return rows


def _found(loop: ClosedLoop, step: float) -> LimitCycle:
    return jax.tree.map(np.asarray, limit_cycle(loop, step=step))
