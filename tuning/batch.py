"""Roads and speeds of a configuration as lanes: stops, their cost, and the table of distances."""

import dataclasses
import math
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.closed_loop import ClosedLoop, SampledLoop
from absjax.manoeuvre import Outcome, Stop, stop
from absjax.parameters import model, parameter, part
from absjax.tyre import Burckhardt
from absjax.vehicle import GRAVITY
from tuning import published
from tuning.config import TuningConfig
from tuning.entries import ConfigError, tyre_of
from tuning.search import in_chunks

CHUNK = 64
"""Parameter sets that are rolled out together when only distances are wanted: one shape, compiled once."""
FEW = 4
"""As many are not worth filling up a chunk."""
SHARPNESS = 600.0
"""Of the smooth maximum over the rows: larger is nearer to the maximum."""
LONG_CYCLE_CHARGE = 0.05
"""Added to a row's ratio for every second by which its longest cycle exceeds the longest allowed."""
LOCK_CHARGE = 0.005
"""Added to the ratio of a row whose wheel locks, were it at the very end; it guides the choice, not the descent."""
FAILURE_CHARGE = 1.0
"""Added to the ratio of a row that neither stops nor locks; likewise."""
DISORDER_CHARGE = 10.0
"""Added for every unit by which parameters that have to be in order are not."""
WORST_EFFICIENCY = 0.02
"""Efficiency below which a row counts no worse, so that a stop that fails outright has a finite cost."""
SAFETY_HORIZON = 1.35
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""


@dataclasses.dataclass(frozen=True)
class Row:
    """One road and speed: distances v0^2 / (2 g mean friction) [m] and how the stops ended.

    A distance is None where the vehicle was not slowed down at all.
    """

    road: str
    speed_kmh: float
    ideal: float
    published: float | None
    untuned: float | None
    tuned: float | None
    sampled: float | None
    cycles: int
    longest_cycle: float
    """s"""
    outcome: str
    sampled_outcome: str

    @property
    def reached(self) -> bool | None:
        """Whether tuned distances, located and sampled, are at or below the published one."""
        if self.published is None:
            return None
        return all(d is not None and d <= self.published for d in (self.tuned, self.sampled))


def every_set_on_every_row(loop: ClosedLoop, parameters: Mapping[str, Any], rows: int) -> ClosedLoop:
    """Lanes (rows * sets,) of a loop whose plant carries the rows; parameters of the controller are (sets,)."""
    sets = len(next(iter(parameters.values())))
    plant = jax.tree.map(lambda leaf: jnp.repeat(leaf, sets) if jnp.ndim(leaf) else leaf, loop.plant)
    own = {name: jnp.tile(values, rows) for name, values in parameters.items()}
    return dataclasses.replace(loop, plant=plant, controller=dataclasses.replace(loop.controller, **own))


@model
class Problem:
    """Rows of a tuning problem: arrays (rows,), the longest stops last, and what is the same for all."""

    loop: ClosedLoop = part("the loop with the start's controller; its road carries the rows")
    speed: Any = parameter("initial speeds, m/s, shape (rows,)", ndim=1)
    ideal: Any = parameter("ideal distances, m, shape (rows,)", ndim=1)
    reference: Any = parameter("distances the cost is relative to, m, shape (rows,)", ndim=1)
    longest_cycle: Any = parameter("longest cycle allowed, s", default=1.0)
    horizon: float = 10.0
    step: float = 2e-3
    substeps: int = 1
    max_events: int = 800
    ordered: tuple[tuple[str, str], ...] = ()
    objective: str = "worst"

    def stops(self, parameters: Mapping[str, Any], step: float | None = None, ticks: int = 0) -> Stop:
        """Stops of every set on every row, lanes (rows * sets,); parameters are arrays (sets,).

        `ticks`: steps between two tests of the guards, or 0 to locate switchings.
        """
        rows, sets = self.speed.shape[0], len(next(iter(parameters.values())))
        loop = every_set_on_every_row(self.loop, parameters, rows)
        loop = SampledLoop(loop, tick_every=ticks, substeps=self.substeps) if ticks else loop
        tile = min(64, max(8, rows * sets // 4))
        speed = jnp.repeat(self.speed, sets)
        step = step or self.step
        return stop(loop, speed, horizon=self.horizon, step=step, max_events=self.max_events, tile=tile)

    def disorder(self, parameters: Mapping[str, Any]):
        """By how much parameters that have to be in order are not, summed, (sets,)."""
        known = {name: getattr(self.loop.controller, name) for pair in self.ordered for name in pair}
        values = {**known, **parameters}
        sets = jnp.shape(next(iter(parameters.values())))
        return sum((jnp.maximum(values[a] - values[b] + 1e-3, 0.0) for a, b in self.ordered), jnp.zeros(sets))

    def ratios(self, stops: Stop, parameters: Mapping[str, Any]):
        """Distance over reference, (rows, sets), and what long cycles, wheels that lock, failures and parameters
        out of order are charged."""
        rows = self.speed.shape[0]
        efficiency = jnp.maximum(stops.efficiency, WORST_EFFICIENCY).reshape(rows, -1)
        excess = jnp.maximum(stops.longest_cycle.reshape(rows, -1) - self.longest_cycle, 0.0)
        outcome = stops.outcome.reshape(rows, -1)
        locked, failed = outcome == Outcome.LOCKED, (outcome != Outcome.LOCKED) & (outcome != Outcome.STOPPED)
        charges = LONG_CYCLE_CHARGE * excess + LOCK_CHARGE * locked + FAILURE_CHARGE * failed
        charges = charges + DISORDER_CHARGE * self.disorder(parameters)
        return (self.ideal / self.reference)[:, None] / efficiency + charges

    def smooth_costs(self, parameters: Mapping[str, Any]):
        """Cost of each set, (sets,): mean ratio, or a smooth maximum of the ratios."""
        ratios = self.ratios(self.stops(parameters), parameters)
        if self.objective == "mean":
            return ratios.mean(axis=0)
        exponential = jax.nn.logsumexp(SHARPNESS * ratios, axis=0) - math.log(ratios.shape[0])
        return exponential / SHARPNESS


class Judgement(NamedTuple):
    """What parameter sets are worth: cost (sets,), the rest (rows, sets)."""

    costs: np.ndarray
    distances: np.ndarray
    outcomes: np.ndarray
    cycles: np.ndarray
    longest_cycles: np.ndarray


@partial(jax.jit, static_argnames=("step", "ticks"))
def _judged(problem: Problem, parameters, step, ticks):
    stops, rows = problem.stops(parameters, step, ticks), problem.speed.shape[0]
    values = stops.equivalent_distance, stops.outcome, stops.cycles, stops.longest_cycle
    return problem.ratios(stops, parameters), *(value.reshape(rows, -1) for value in values)


def judge(problem: Problem, parameters: Mapping[str, Any], step: float | None = None, ticks: int = 0) -> Judgement:
    """Judge parameter sets, in chunks: located, or with guards tested every `ticks` steps."""
    same, names = dataclasses.replace(problem, objective="worst"), tuple(parameters)
    sets = np.stack([np.asarray(parameters[name], float) for name in names], axis=1)
    size = CHUNK if len(sets) > FEW else len(sets)
    ratios, *rest = in_chunks(
        lambda chunk: _judged(same, dict(zip(names, chunk.T)), step or problem.step, ticks), sets, size, axis=-1
    )
    return Judgement(ratios.mean(axis=0) if problem.objective == "mean" else ratios.max(axis=0), *rest)


def labels(config: TuningConfig) -> list[tuple[str, float, Any]]:
    """Name, speed [km/h] and tyre curve of every row, the longest stops last."""
    rows = [
        (road if isinstance(road, str) else f"c = {tuple(road)}", speed, tyre_of(road))
        for speed in config.speeds_kmh
        for road in config.roads
    ]
    return sorted(rows, key=lambda row: row[1] / float(row[2].peak().friction))


def build(config: TuningConfig) -> Problem:
    """The problem a configuration describes.

    Raises:
        ConfigError: if distances are to be relative to published ones that do not exist.
    """
    rows = labels(config)
    speed = np.array([speed for _, speed, _ in rows]) / 3.6
    peak = np.array([float(tyre.peak().friction) for _, _, tyre in rows])
    ideal = speed**2 / (2 * GRAVITY * peak)
    reference = ideal
    if config.reference == "published":
        reference = np.array([_published(config, name, kmh) or np.nan for name, kmh, _ in rows])
        for missing in np.flatnonzero(np.isnan(reference)):
            name, kmh, _ = rows[missing]
            raise ConfigError(f"reference = 'published', but no distance is published for {name} from {kmh:g} km/h")
    tyre = Burckhardt(*(np.array([float(getattr(t, c)) for _, _, t in rows]) for c in ("c1", "c2", "c3")))
    return Problem(
        loop=config.loop(config.base_controller(), tyre),
        speed=speed,
        ideal=ideal,
        reference=reference,
        longest_cycle=config.longest_cycle,
        horizon=SAFETY_HORIZON * float(np.max(speed / (GRAVITY * peak))) + 1.0,
        step=config.grid_step,
        substeps=config.steps_per_sample,
        max_events=config.max_events,
        ordered=config.kind.ordered,
        objective=config.objective,
    )


def _published(config: TuningConfig, road: str, speed_kmh: float) -> float | None:
    row = published.DISTANCES.get(road, {}).get(speed_kmh)
    return None if row is None else getattr(row, "two_phase" if config.controller == "two_phase" else "five_phase")


def _finite(distance) -> float | None:
    return float(distance) if np.isfinite(distance) else None


def score(config: TuningConfig, parameters: Mapping[str, float]) -> list[Row]:
    """Distances of the configured start and of tuned parameters: located, and sampled."""
    problem, initial = build(config), config.initial()
    both = {name: np.array([initial[name], value]) for name, value in parameters.items()}
    located, sampled = judge(problem, both), judge(problem, both, *config.sampled_grid())
    rows = [
        Row(
            road=road,
            speed_kmh=speed,
            ideal=float(problem.ideal[i]),
            published=_published(config, road, speed),
            untuned=_finite(located.distances[i, 0]),
            tuned=_finite(located.distances[i, 1]),
            sampled=_finite(sampled.distances[i, 1]),
            cycles=int(located.cycles[i, 1]),
            longest_cycle=float(located.longest_cycles[i, 1]),
            outcome=Outcome(int(located.outcomes[i, 1])).name,
            sampled_outcome=Outcome(int(sampled.outcomes[i, 1])).name,
        )
        for i, (road, speed, _) in enumerate(labels(config))
    ]
    return sorted(rows, key=lambda row: (row.speed_kmh, row.ideal))
