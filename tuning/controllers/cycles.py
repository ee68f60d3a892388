"""Limit cycles of tuned controllers: a certificate by road and speed, and a charge on contraction in tuning."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import lane_count
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.limit_cycle import CycleStatus, limit_cycle
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
    cycle = _cycles(loops, parameters, step)
    return _charged(cycle.status == CycleStatus.FOUND, cycle.contraction, largest).sum(axis=0)


def _charged(found, contraction, largest: float):
    excess = jnp.maximum(jnp.where(found, contraction, 0.0) - largest, 0.0)
    return CONTRACTION_CHARGE * excess + NO_CYCLE_CHARGE * ~found


class _Cycles(NamedTuple):
    """Limit cycles of sets on rigs, (rigs, sets)."""

    status: Any
    period: Any
    contraction: Any


@partial(jax.jit, static_argnames="step")
def _cycles(loops: ClosedLoop, parameters: Mapping[str, Any], step: float) -> _Cycles:
    rigs = lane_count(loops.plant, "rigs") or 1
    cycle = limit_cycle(every_set_on_every_row(loops, parameters, rigs), step=step)
    return _Cycles(*(x.reshape(rigs, -1) for x in (cycle.status, cycle.period, cycle.contraction)))


def _exact_cycles(setup: Setup, names: tuple[str, ...], sets: np.ndarray) -> _Cycles:
    """Of sets (sets, parameters), in chunks of one program for tuning and certificate; what is not named is as at
    the start."""
    given = np.tile([setup.initial[name] for name in setup.initial], (len(sets), 1))
    given[:, [list(setup.initial).index(name) for name in names]] = sets
    loops = rig_loops(setup)
    return in_chunks(
        lambda chunk: _cycles(loops, dict(zip(setup.initial, chunk.T)), setup.kind.grid_step), given, CHUNK, axis=-1
    )


def exact_charges(setup: Setup, names: tuple[str, ...], sets: np.ndarray, largest: float) -> np.ndarray:
    """`charges` of sets (sets, parameters)."""
    cycle = _exact_cycles(setup, names, sets)
    charged = _charged(cycle.status == CycleStatus.FOUND, cycle.contraction, largest)
    return np.asarray(charged).sum(axis=0)


def certify_cycles(setup: Setup, parameters: Mapping[str, float]) -> list[CycleRow]:
    """The limit cycles of a parameter set on the roads of a setup.

    None of a controller without cycles, of a vehicle, or of one that predicts over a delay: its state is a past.
    """
    config = setup.config
    alone = not config.predicts and config.vehicle is None
    if setup.kind.cycle_phase is None or not alone or not config.uniform_roads:
        return []
    names = tuple(parameters)
    cycle = _exact_cycles(setup, names, np.array([[parameters[name] for name in names]]))
    cycle, whole = jax.tree.map(lambda x: x[:, 0], cycle), None
    if setup.observer is not None:
        loops = dataclasses.replace(rig_loops(setup), controller=setup.controller(parameters), observer=setup.observer)
        whole = jax.tree.map(np.asarray, limit_cycle(loops, step=setup.step))

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
