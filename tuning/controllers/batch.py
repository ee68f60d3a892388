"""Roads, speeds and pedals of a configuration as lanes: stops, their cost, and the figures of every stop."""

import dataclasses
import math
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.ideal import ideal_distance
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, Stop, stop
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import GRAVITY
from tuning.controllers import published
from tuning.controllers.config import TuningConfig
from tuning.controllers.roads import least_peak, name_of, speeds_of, stacked
from tuning.core.config import ConfigError
from tuning.core.search import in_chunks

CHUNK = 64
"""Parameter sets that are rolled out together when only figures are wanted: one shape, compiled once."""
FEW = 4
"""As many are not worth filling up a chunk."""
SHARPNESS = 600.0
"""Of the smooth maximum over the rows: larger is nearer to the maximum."""
WORST_SHARE = 0.1
"""Weight of the worst row in the balanced objective."""
LONG_CYCLE_CHARGE = 0.05
"""Added to a row's ratio for every second by which its longest cycle exceeds the longest allowed."""
LOCK_CHARGE = 2.0
"""Added for every second by which its longest lock above 15 km/h exceeds the longest allowed."""
FAILURE_CHARGE = 1.0
"""Added to the ratio of a row that does not stop; it guides the choice, not the descent."""
LEAST_SLOWED = 0.02
"""Share of the kinetic energy below which a row counts no worse: a stop that fails outright has a finite cost."""
SAFETY_HORIZON = 1.5
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""


class Row(NamedTuple):
    """A road, a speed and a pedal."""

    road: Any
    speed_kmh: float
    pedal_rate: float
    """bar/s"""

    @property
    def name(self) -> str:
        """Of the road."""
        return name_of(self.road)

    @property
    def speed(self) -> float:
        """m/s"""
        return self.speed_kmh / 3.6

    @property
    def longest_ideal(self) -> float:
        """Time the ideal stop would take on the worst surface of the road [s]."""
        return self.speed / (GRAVITY * least_peak(self.road))

    @property
    def published_ideal(self) -> float | None:
        """v0^2 / (2 g mu_max) [m]; None on a road that changes."""
        if isinstance(self.road, dict):
            return None
        return self.speed**2 / (2 * GRAVITY * least_peak(self.road))

    def published(self, controller: str) -> float | None:
        """The published distance [m]: of the two-phase algorithm if that is the controller, else the five-phase one."""
        found = published.DISTANCES.get(self.name, {}).get(self.speed_kmh)
        return None if found is None else getattr(found, "two_phase" if controller == "two_phase" else "five_phase")


def rows_of(config: TuningConfig) -> list[Row]:
    """The rows of a configuration, the longest stops last."""
    rows = [
        Row(road, speed, pedal)
        for road in config.roads
        for speed in speeds_of(road, config.speeds_kmh)
        for pedal in config.pedals(speed)
    ]
    return sorted(rows, key=lambda row: row.longest_ideal)


def every_set_on_every_row(loop: ClosedLoop, parameters: Mapping[str, Any], rows: int) -> ClosedLoop:
    """Lanes (rows * sets,) of a loop whose plant and driver carry the rows; the controller's parameters are (sets,)."""
    sets = len(next(iter(parameters.values())))
    plant, driver = jax.tree.map(
        lambda leaf: jnp.repeat(leaf, sets) if jnp.ndim(leaf) else leaf, (loop.plant, loop.driver)
    )
    own = {name: jnp.tile(values, rows) for name, values in parameters.items()}
    return dataclasses.replace(loop, plant=plant, driver=driver, controller=dataclasses.replace(loop.controller, **own))


@model
class Problem:
    """Rows of a tuning problem: arrays (rows,), the longest stops last, and what is the same for all."""

    loop: ClosedLoop = part("the loop with the start's controller; its road and driver carry the rows")
    speed: Any = parameter("initial speeds, m/s, shape (rows,)", ndim=1)
    ideal: Any = parameter("ideal distances from the pedal, m, shape (rows,)", ndim=1)
    published: Any = parameter("published distances, m, shape (rows,); 0 where the ideal is the reference", ndim=1)
    longest_cycle: Any = parameter("longest cycle allowed, s", default=1.0)
    longest_lock: Any = parameter("longest lock above 15 km/h allowed, s", default=0.05)
    horizon: float = 10.0
    step: float = 2e-3
    substeps: int = 1
    max_events: int = 800
    objective: str = "balanced"
    reference: str = "ideal"

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

    def ratios(self, stops: Stop):
        """Distance over reference, (rows, sets), and what long cycles, long locks and failures are charged.

        A stop that does not end counts as if it went on decelerating as it has in the mean.
        """
        rows = self.speed.shape[0]

        def by_row(values):
            return values.reshape(rows, -1)

        if self.reference == "published":
            ratio = by_row(stops.published_quantity) / self.published[:, None]
        else:
            state = stops.rollout.state
            state = state.loop if hasattr(state, "loop") else state
            end, start, last = by_row(state.plant.speed), self.speed[:, None], self.loop.stop_speed
            slowed = (start**2 - jnp.maximum(end, last) ** 2) / (start**2 - last**2)
            ratio = by_row(stops.distance) / jnp.maximum(slowed, LEAST_SLOWED) / self.ideal[:, None]
        excess = jnp.maximum(by_row(stops.longest_cycle) - self.longest_cycle, 0.0)
        locked = jnp.maximum(by_row(stops.longest_lock[0]) - self.longest_lock, 0.0)
        failed = by_row(stops.outcome) != Outcome.STOPPED
        worst = 1 / LEAST_SLOWED
        charges = LONG_CYCLE_CHARGE * excess + LOCK_CHARGE * locked + FAILURE_CHARGE * failed
        return jnp.minimum(ratio, worst) + charges

    def cost(self, ratios, worst):
        """Cost of each set, (sets,), from ratios (rows, sets) and the worst of them."""
        mean = ratios.mean(axis=0)
        share = {"mean": 0.0, "worst": 1.0, "balanced": WORST_SHARE}[self.objective]
        return (1 - share) * mean + share * worst

    def smooth_costs(self, parameters: Mapping[str, Any]):
        """Cost of each set, (sets,), with a smooth maximum of the ratios for the worst."""
        ratios = self.ratios(self.stops(parameters))
        exponential = jax.nn.logsumexp(SHARPNESS * ratios, axis=0) - math.log(ratios.shape[0])
        return self.cost(ratios, exponential / SHARPNESS)


@dataclasses.dataclass(frozen=True)
class Figures:
    """What is told of a stop."""

    distance: float | None
    """from the pedal, m; None where it does not end"""
    published_quantity: float | None
    """v0^2 / (2 g mean friction of the ABS-active time), m; None where the vehicle was not slowed down"""
    cycles: int
    longest_cycle: float
    """s"""
    outcome: str
    onset_s: float | None = None
    """of the first switching, from the pedal; this and what follows is None in results of earlier versions"""
    onset_kmh: float | None = None
    """speed then"""
    lock_s_above_15: float | None = None
    lock_s_above_2_5: float | None = None
    longest_lock_above_15: float | None = None
    """s"""

    @classmethod
    def of(cls, stops: Stop, lane: int) -> "Figures":
        """Of one lane of stops, arrays (lanes,)."""
        outcome = Outcome(int(stops.outcome[lane]))
        distance, quantity = float(stops.distance[lane]), float(stops.published_quantity[lane])
        return cls(
            distance=distance if outcome is Outcome.STOPPED else None,
            published_quantity=quantity if np.isfinite(quantity) else None,
            onset_s=float(stops.onset_time[lane]),
            onset_kmh=3.6 * float(stops.onset_speed[lane]),
            cycles=int(stops.cycles[lane]),
            longest_cycle=float(stops.longest_cycle[lane]),
            lock_s_above_15=float(stops.lock_time[0][lane]),
            lock_s_above_2_5=float(stops.lock_time[1][lane]),
            longest_lock_above_15=float(stops.longest_lock[0][lane]),
            outcome=outcome.name,
        )


class Judgement(NamedTuple):
    """What parameter sets are worth: cost (sets,); stops of every row and set, arrays (rows * sets,)."""

    costs: np.ndarray
    ratios: np.ndarray
    """distance over reference with charges, (rows, sets)"""
    stops: Stop
    """without its rollout; arrays (rows, sets)"""

    def figures(self, row: int, number: int) -> Figures:
        """Of a stop."""
        return Figures.of(jax.tree.map(lambda leaf: leaf[row], self.stops), number)


@partial(jax.jit, static_argnames=("step", "ticks"))
def _judged(problem: Problem, parameters, step, ticks):
    stops, rows = problem.stops(parameters, step, ticks), problem.speed.shape[0]
    kept = stops._replace(rollout=None)
    return problem.ratios(stops), jax.tree.map(lambda leaf: leaf.reshape(rows, -1), kept)


def judge(problem: Problem, parameters: Mapping[str, Any], step: float | None = None, ticks: int = 0) -> Judgement:
    """Judge parameter sets, in chunks: located, or with guards tested every `ticks` steps."""
    same, names = dataclasses.replace(problem, objective="worst"), tuple(parameters)
    sets = np.stack([np.asarray(parameters[name], float) for name in names], axis=1)
    size = CHUNK if len(sets) > FEW else len(sets)
    ratios, stops = in_chunks(
        lambda chunk: _judged(same, dict(zip(names, chunk.T)), step or problem.step, ticks), sets, size, axis=-1
    )
    return Judgement(np.asarray(problem.cost(ratios, ratios.max(axis=0))), ratios, stops)


def build(config: TuningConfig) -> Problem:
    """The problem a configuration describes.

    Raises:
        ConfigError: if distances are to be relative to published ones that do not exist.
    """
    rows = rows_of(config)
    speed = np.array([row.speed for row in rows])
    horizon = SAFETY_HORIZON * max(row.longest_ideal for row in rows) + 1.0
    loop = config.loop(
        config.base_controller(), stacked([row.road for row in rows]), np.array([row.pedal_rate for row in rows])
    )
    reached = np.zeros(len(rows))
    if config.reference == "published":
        for i, row in enumerate(rows):
            if row.published(config.controller) is None:
                raise ConfigError(
                    f"reference = 'published', but no distance is published for {row.name} from {row.speed_kmh:g} km/h"
                )
            reached[i] = row.published(config.controller)
    return Problem(
        loop=loop,
        speed=speed,
        ideal=np.asarray(ideal_distance(dataclasses.replace(loop, observer=None), speed, horizon=horizon)),
        published=reached,
        longest_cycle=config.longest_cycle,
        longest_lock=config.longest_lock,
        horizon=horizon,
        step=config.grid_step,
        substeps=config.steps_per_sample,
        max_events=config.max_events,
        objective=config.objective,
        reference=config.reference,
    )
