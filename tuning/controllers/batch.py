"""Roads, speeds and pedals as lanes: the stops of parameter sets on every row, and what they lose."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import repeated, taken
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.growth import stop_and_growth
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.step_check import for_half_step
from absjax.loop.stop import Outcome, Stop, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.parameters import model, parameter, part
from tuning.cars.speedometer import Speedometer
from tuning.controllers.chain import of_chain, told_through
from tuning.controllers.loops import Loop, Sensors, carried, in_control_unit, loop_of_lanes, shortest
from tuning.controllers.rows import rows_of
from tuning.controllers.setup import Setup
from tuning.controllers.stop_figures import StopFigures
from tuning.core.compilation import drop_if_many
from tuning.core.config import ConfigError
from tuning.core.problem import in_chunks
from tuning.core.roads import stacked

CHUNK = 64
"""Parameter sets that are rolled out together when only figures are wanted: one shape, compiled once."""
FEW = 4
"""A chunk where there are no more, as when a few are judged or shown: a second shape, and no third."""
LONG_CYCLE_CHARGE = 0.05
"""Added to a row's ratio for every second by which its longest cycle exceeds the longest allowed."""
LOCK_CHARGE = 2.0
"""Added for every second by which its longest lock above 15 km/h exceeds the longest allowed."""
SLIDE_CHARGE = 2.0
"""Added for every second by which a wheel slides longer than allowed, in all; of a vehicle the one that slides most."""
FAILURE_CHARGE = 1.0
"""Added to the ratio of a row that does not stop; it guides the choice, not the descent."""
LEAST_SLOWED = 0.02
"""Share of the kinetic energy below which a row counts no worse: a stop that fails outright has a finite cost."""
SAFETY_HORIZON = 1.5
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""


def on_every_row(parameters: Mapping[str, Any], rows: int) -> dict[str, Any]:
    """Parameters of sets, (sets,), as lanes (rows * sets,)."""
    return {name: jnp.tile(values, rows) for name, values in parameters.items()}


def every_set_on_every_row(loop: Loop, parameters: Mapping[str, Any], rows: int) -> Loop:
    """Lanes (rows * sets,) of a loop whose plant and driver carry the rows; the controller's parameters are (sets,)."""
    return loop_of_lanes(loop, on_every_row(parameters, rows), rows)


@model
class Batch:
    """Rows as arrays (rows,), the longest stops last, and what is the same for all."""

    loop: ClosedLoop | VehicleLoop = part("the loop with the start's controller; its road and driver carry the rows")
    speed: Any = parameter("initial speeds, m/s, shape (rows,)", ndim=1)
    ideal: Any = parameter("ideal distances from the pedal, m, shape (rows,)", ndim=1)
    published: Any = parameter("published distances, m, shape (rows,); 0 where the ideal is the reference", ndim=1)
    sensor: Sensors = part("what a sampled control unit measures with, one for all wheels or each", default=None)
    speedometer: Speedometer | None = part("of a vehicle's sampled unit; None tells it the true speed", default=None)
    longest_cycle: Any = parameter("longest cycle allowed, s", default=1.0)
    longest_lock: Any = parameter("longest lock above 15 km/h allowed, s", default=0.05)
    slide_time: Any = parameter("longest time in all with a slip below -0.8 above 15 km/h allowed, s", default=0.5)
    horizon: float = 10.0
    step: float = 2e-3
    substeps: int = 1
    max_events: int = 1500
    reference: str = "ideal"
    delay: float | None = None
    """between a controller that predicts and the brake, s"""

    @property
    def rows(self) -> int:
        """How many."""
        return self.speed.shape[0]

    def of(self, members: Any) -> "Batch":
        """Some of the rows, (members,); traceable."""
        rows = {name: jnp.take(getattr(self, name), members) for name in ("speed", "ideal", "published")}
        parts = {name: taken(getattr(self, name), members) for name in ("sensor", "speedometer")}
        return dataclasses.replace(self, loop=carried(self.loop, partial(taken, index=members)), **parts, **rows)

    def stops(self, parameters: Mapping[str, Any], step: float | None = None, ticks: int = 0) -> Stop:
        """Stops of every set on every row, lanes (rows * sets,); parameters are arrays (sets,).

        `ticks`: steps between two tests of the guards, or 0 to locate switchings.
        """
        return self.stops_of_lanes(on_every_row(parameters, self.rows), step, ticks)

    def stops_of_lanes(
        self, own: Mapping[str, Any], step: float | None = None, ticks: int = 0, kind: type[SampledLoop] = SampledLoop
    ) -> Stop:
        """The same of parameters (rows * sets,), each lane's own; `kind` of the loop with ticks."""
        loop = loop_of_lanes(self.loop, own, self.rows)
        sets = len(next(iter(own.values()))) // self.rows
        sensor, speedometer = (repeated(part, sets) for part in (self.sensor, self.speedometer))
        how = ticks, self.substeps, ticks * (step or self.step), told_through(sensor, of_chain(own)), speedometer
        system = in_control_unit(loop, *how, self.delay, kind=kind) if ticks else loop
        return stop(system, **self._how(own, step))

    def at_half_step(self, parameters: Mapping[str, Any]) -> tuple[Stop, Any]:
        """Stops of every set on every row, switchings located, at half the grid step, and their growth
        (`absjax.loop.growth`); lanes (rows * sets,)."""
        own = on_every_row(parameters, self.rows)
        loop = for_half_step(loop_of_lanes(self.loop, own, self.rows))
        return stop_and_growth(loop, **self._how(own, self.step / 2))

    def _how(self, own: Mapping[str, Any], step: float | None = None) -> dict[str, Any]:
        lanes = len(next(iter(own.values())))
        return {
            "speed": jnp.repeat(self.speed, lanes // self.rows),
            "horizon": self.horizon,
            "step": step or self.step,
            "max_events": self.max_events,
            "tile": min(64, max(8, lanes // 4)),
        }

    def ratios(self, stops: Stop):
        """Distance over reference, (rows, sets).

        A stop that does not end counts as if it went on decelerating as it has in the mean.
        """
        if self.reference == "published":
            ratio = self._by_row(stops.published_quantity) / self.published[:, None]
        else:
            end = self._by_row(stops.end_speed)
            start, last = self.speed[:, None], self.loop.stop_speed
            slowed = (start**2 - jnp.maximum(end, last) ** 2) / (start**2 - last**2)
            ratio = self._by_row(stops.distance) / jnp.maximum(slowed, LEAST_SLOWED) / self.ideal[:, None]
        return jnp.minimum(ratio, 1 / LEAST_SLOWED)

    def charges(self, stops: Stop):
        """What long cycles, long locks, slides and failures are charged, (rows, sets)."""
        cycle = LONG_CYCLE_CHARGE * jnp.maximum(stops.longest_cycle - self.longest_cycle, 0.0)
        lock = LOCK_CHARGE * jnp.maximum(stops.longest_lock[0] - self.longest_lock, 0.0)
        slide = SLIDE_CHARGE * jnp.maximum(jnp.stack(stops.slide_time).max(axis=0) - self.slide_time, 0.0)
        return self._by_row(cycle + lock + slide + FAILURE_CHARGE * (stops.outcome != Outcome.STOPPED))

    def losses(self, stops: Stop):
        """Distance over reference with charges, (rows, sets)."""
        return self.ratios(stops) + self.charges(stops)

    def by_row(self, stops: Stop) -> Stop:
        """Stops without their rollout, arrays (rows, sets)."""
        return jax.tree.map(self._by_row, stops._replace(rollout=None))

    def _by_row(self, values):
        return values.reshape(self.rows, -1)


class Scored(NamedTuple):
    """Parameter sets on every row."""

    losses: np.ndarray
    """distance over reference with charges, (rows, sets)"""
    ratios: np.ndarray
    """without charges"""
    stops: Stop
    """without its rollout; arrays (rows, sets)"""

    def figures(self, row: int, number: int) -> StopFigures:
        """Of a stop."""
        return StopFigures.of(jax.tree.map(lambda leaf: leaf[row], self.stops), number)


@partial(jax.jit, static_argnames=("step", "ticks"))
def _scored(batch: Batch, parameters, step, ticks):
    stops = batch.stops(parameters, step, ticks)
    return batch.losses(stops), batch.ratios(stops), batch.by_row(stops)


@jax.jit
def _at_half_step(batch: Batch, parameters):
    stops, growths = batch.at_half_step(parameters)
    return batch.by_row(stops), growths


def at_half_step(batch: Batch, parameters: Mapping[str, float]) -> tuple[Stop, np.ndarray]:
    """Stops of one set at half the grid step, without their rollouts, and their growth; arrays (rows,)."""
    sets = {name: np.array([float(value)]) for name, value in parameters.items()}
    return jax.tree.map(np.ravel, _at_half_step(batch, sets))


def scored(
    batch: Batch, parameters: Mapping[str, Any], step: float | None = None, ticks: int = 0, chunk: int = CHUNK
) -> Scored:
    """Parameter sets, arrays (sets,), in chunks: located, or with guards tested every `ticks` steps."""
    names = tuple(parameters)
    sets = np.stack([np.asarray(parameters[name], float) for name in names], axis=1)
    size = chunk if len(sets) > FEW else min(chunk, FEW)
    return Scored(
        *in_chunks(
            lambda chunk: _scored(batch, dict(zip(names, chunk.T)), step or batch.step, ticks), sets, size, axis=-1
        )
    )


def batch_of(setup: Setup) -> Batch:
    """The rows of a setup. Every batch has programs of its own: where those before are many, they are dropped.

    Raises:
        ConfigError: if distances are to be relative to published ones that do not exist.
    """
    drop_if_many()
    config, rows = setup.config, rows_of(setup.config)
    speed = np.array([row.speed for row in rows])
    horizon = SAFETY_HORIZON * max(row.longest_ideal for row in rows) + 1.0
    road, pedal = stacked([row.road for row in rows]), np.array([row.pedal_rate for row in rows])
    loop = setup.loop_of(None, road, pedal, [row.which for row in rows])
    reached = np.zeros(len(rows))
    if config.reference == "published":
        for i, row in enumerate(rows):
            distance = row.published(config.controller)
            if distance is None:
                where = f"{row.name} from {row.speed_kmh:g} km/h"
                raise ConfigError(f"reference = 'published', but no distance is published for {where}")
            reached[i] = distance
    return Batch(
        loop=loop,
        speed=speed,
        ideal=np.asarray(shortest(loop, speed, horizon)),
        published=reached,
        sensor=setup.sensor,
        speedometer=None if config.vehicle is None else config.vehicle.speedometer(),
        longest_cycle=config.longest_cycle,
        longest_lock=config.longest_lock,
        slide_time=config.slide_time,
        horizon=horizon,
        step=setup.step,
        substeps=setup.substeps(),
        max_events=config.max_events,
        reference=config.reference,
        delay=config.delay,
    )
