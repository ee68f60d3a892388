"""Limit cycles of tuned controllers: a certificate by road and speed, and a charge on contraction in tuning."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.limit_cycle import CycleStatus, limit_cycle
from tuning.controllers.batch import every_set_on_every_row
from tuning.controllers.config import TuningConfig
from tuning.controllers.roads import name_of, stacked
from tuning.core.search import in_chunks

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


def rig_loops(config: TuningConfig) -> ClosedLoop:
    """Loops on a rig, a lane for each uniform road and speed, all speeds of the first road first; with the true XBS."""
    roads, speeds = config.uniform_roads, config.cycle_speeds_kmh
    speed = np.tile(np.asarray(speeds) / 3.6, len(roads))
    config = dataclasses.replace(config, observer=None, observer_parameters={})
    return config.rig_loop(config.base_controller(), stacked([road for road in roads for _ in speeds]), speed)


def charges(loops: ClosedLoop, parameters: Mapping[str, Any], step: float, largest: float):
    """What sets are charged for contractions above the largest allowed, (sets,); parameters are (sets,).
    Differentiable."""
    rows = loops.plant.speed.shape[0]
    cycle = limit_cycle(every_set_on_every_row(loops, parameters, rows), step=step)
    found = cycle.status == CycleStatus.FOUND
    excess = jnp.maximum(jnp.where(found, cycle.contraction, 0.0) - largest, 0.0)
    return (CONTRACTION_CHARGE * excess + NO_CYCLE_CHARGE * ~found).reshape(rows, -1).sum(axis=0)


_charges = jax.jit(charges, static_argnames="step")


def exact_charges(config: TuningConfig, names: tuple[str, ...], sets: np.ndarray) -> np.ndarray:
    """`charges` of sets (sets, parameters), in chunks."""
    loops, step = rig_loops(config), config.kind.step
    return in_chunks(
        lambda chunk: _charges(loops, dict(zip(names, chunk.T)), step, config.largest_contraction), sets, CHUNK
    )


def certify_cycles(config: TuningConfig, parameters: Mapping[str, float]) -> list[CycleRow]:
    """The limit cycles of a parameter set on the roads of a configuration; none of a controller without cycles."""
    if config.kind.model.cycle_phase is None or not config.uniform_roads:
        return []
    true = rig_loops(config)
    controller = dataclasses.replace(true.controller, **parameters)
    cycle = jax.tree.map(
        np.asarray, limit_cycle(dataclasses.replace(true, controller=controller), step=config.kind.step)
    )
    whole = None
    if config.observer is not None:
        observed = dataclasses.replace(true, controller=controller, observer=config.observer_model())
        whole = jax.tree.map(np.asarray, limit_cycle(observed, step=config.grid_step))

    def finite(value):
        return float(value) if np.isfinite(value) else None

    rows = []
    for i, (road, speed) in enumerate(
        (road, speed) for road in config.uniform_roads for speed in config.cycle_speeds_kmh
    ):
        observed = {}
        if whole is not None:
            code = CycleStatus(int(whole.status[i]))
            observed = {"observer_status": code.name, "with_observer": finite(whole.contraction[i])}
        found = CycleStatus(int(cycle.status[i])).name
        rows.append(
            CycleRow(name_of(road), speed, found, finite(cycle.period[i]), finite(cycle.contraction[i]), **observed)
        )
    return rows
