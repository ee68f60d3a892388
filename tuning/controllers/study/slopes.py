"""The slope of the mean stop under a control unit's clock: located, ticking and fitted, against differences.

Five phases from about 25 m/s to 20 km/h under 400 bar/s, brake 750 bar/s and 5 ms. Lanes differ in the phase of the
clock and by up to 0.05 m/s in speed; distances are brought to 25 m/s by its square.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import stop
from absjax.loop.ticking_loop import TickingLoop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.base import Sensor
from absjax.tyres.surfaces import surface
from tuning.core.slope import offsets, pooled_slope

SPEED, SPREAD, END_SPEED, HORIZON = 25.0, 0.05, 20 / 3.6, 8.0
SET = {"eps0": 45.0, "eps1": 22.0, "eps2": 27.0, "eps3": 19.0, "eps4": 15.0, "eps5": 19.0}
RATES = {"u1": 25000.0, "u3": 3000.0, "u4": 2000.0}
GROWTH = 1.0
"""of eps0, 1/s; not among what is differentiated"""
CHANGE = 0.03
"""Of each parameter in a difference, as a share of it."""
SCATTER = 0.012
"""Of the pairs of points, as a share of each parameter."""
LOCATED_LANES = 64
PERIODS = (1e-3, 5e-3)
"""Of the clock, s."""


class Slopes(NamedTuple):
    """d(mean distance) / d(parameter) times the parameter [m], arrays (parameters,)."""

    differences: np.ndarray
    halves: tuple[np.ndarray, np.ndarray]
    """of two halves of the lanes"""
    located: np.ndarray
    ticking: np.ndarray
    """mean of the gradients"""
    pooled: np.ndarray
    """with what is fitted over the pairs"""


def cosine(a: np.ndarray, b: np.ndarray) -> float:
    """Of the angle between two slopes."""
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def _system(kind: str, values: Mapping[str, Any], delay, road: str, ticks: int, sensor: Sensor | None):
    car = QuarterCar(Wheel(), UniformRoad(surface(road)))
    controller = FivePhase(**values, eps0_growth=GROWTH)
    loop = ClosedLoop(car, Brake(750.0, 5e-3), controller, END_SPEED, driver=Driver(400.0, delay))
    kinds = {"sampled": SampledLoop, "ticking": TickingLoop}
    return kinds[kind](loop, sensor, tick_every=ticks) if kind in kinds else loop


@partial(jax.jit, static_argnames=("kind", "road", "period"))
def distances(points, speed, delay, sensor: Sensor | None, kind: str, road: str, period: float):
    """Distances (lanes,) of points (lanes, parameters), as from 25 m/s."""
    values = dict(zip((*SET, *RATES), points.T))
    ticks = int(np.ceil(period / FivePhase.grid_step - 1e-9))
    step = period / ticks
    stopped = stop(_system(kind, values, delay, road, ticks, sensor), speed, horizon=HORIZON, step=step, tile=64)
    return stopped.distance * (SPEED / speed) ** 2


def slopes(road: str, period: float, pairs: int, sensor: Sensor | None = None, seed: int = 1) -> Slopes:
    """All of them on a road, under a clock of a period [s].

    Args:
        pairs: of lanes; differences are of as many lanes.
        sensor: what is told; None tells the truth.
    """
    rng = np.random.default_rng(seed)
    speed, delay = SPEED + SPREAD * rng.random(pairs), period * rng.random(pairs)
    start = np.array([*SET.values(), *RATES.values()])

    def run(kind, points, which=slice(None), sensor=sensor):
        return distances(points, speed[which], delay[which], sensor, kind=kind, road=road, period=period)

    def gradients(kind, points, which=slice(None), sensor=sensor):
        found, pull = jax.vjp(lambda x: run(kind, x, which, sensor), points)
        return np.asarray(found), np.asarray(pull(jnp.ones_like(found))[0]) * start

    found = []
    for i in range(len(start)):
        up, down = (np.tile(np.where(np.arange(len(start)) == i, 1 + s * CHANGE, 1.0), (pairs, 1)) for s in (1, -1))
        found.append(np.asarray(run("sampled", start * up) - run("sampled", start * down)) / (2 * CHANGE))
    by_lane = np.stack(found, axis=1)
    apart = offsets(seed, pairs, len(start), SCATTER)
    both = [gradients("ticking", start * (1 + sign * apart)) for sign in (1, -1)]
    losses, own = (np.stack([pair[k] for pair in both]) for k in (0, 1))
    few = slice(LOCATED_LANES)
    _, located = gradients("located", np.tile(start, (min(pairs, LOCATED_LANES), 1)), few, None)
    return Slopes(
        differences=by_lane.mean(axis=0),
        halves=(by_lane[::2].mean(axis=0), by_lane[1::2].mean(axis=0)),
        located=located.mean(axis=0),
        ticking=own.mean(axis=(0, 1)),
        pooled=np.asarray(pooled_slope(jnp.asarray(losses), jnp.asarray(own), jnp.asarray(apart)).slope),
    )


def wrong_signs(found: np.ndarray, differences: np.ndarray) -> int:
    """Entries above a tenth of the largest whose sign is not that of the differences."""
    large = np.abs(differences) > 0.1 * np.abs(differences).max()
    return int((large & (found * differences < 0)).sum())


def row(road: str, found: Slopes) -> dict[str, Any]:
    """Cosines to the differences, and entries of the wrong sign."""
    wanted = found.differences
    return {
        "road": road,
        **{f"cosine, {name}": round(cosine(getattr(found, name), wanted), 3) for name in ("located", "ticking")},
        "cosine, fitted too": round(cosine(found.pooled, wanted), 4),
        "cosine of halves": round(cosine(*found.halves), 4),
        "wrong signs, located": wrong_signs(found.located, wanted),
        "wrong signs, ticking": wrong_signs(found.ticking, wanted),
        "wrong signs, fitted too": wrong_signs(found.pooled, wanted),
    }


def table(period: float, pairs: int, roads: tuple[str, ...]) -> list[dict[str, Any]]:
    """A row for each road."""
    return [row(road, slopes(road, period, pairs)) for road in roads]
