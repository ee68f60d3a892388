"""Stops on scattered roads, wheels, brakes, pedals and noise: how long, how bad the worst, how often locked.

All of it acts on a controller that knows the nominal wheel, tested at the sampling period on noisy signals.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.lanes import stacked, taken
from absjax.loop.stop import Outcome, Stop, stop
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import GRAVITY, Wheel
from absjax.sensors.noisy import NoisySensor
from absjax.tyres.surfaces import SURFACES
from tuning.controllers import published
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import shortest
from tuning.controllers.setup import Setup

HORIZON_FACTOR = 1.8
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""
STUCK = 1.0
"""A cycle that lasts longer is counted as stuck, s."""
LONG_LOCK = 0.05
"""A lock above 15 km/h that lasts longer is counted, s."""


class Scatter(NamedTuple):
    """How much is scattered: standard deviations of the logarithm, or (low, high) of a uniform distribution."""

    curve: float = 0.1
    """of the coefficients of the tyre curve, each by itself"""
    load: float = 0.1
    radius: float = 0.01
    brake_efficiency: float = 0.1
    lag: tuple[float, float] = (0.003, 0.01)
    """s"""
    noise: tuple[float, float] = (0.0, 1.0)
    """standard deviation of a sample of x2, m/s^2"""
    speed_kmh: tuple[float, float] = (50.0, 180.0)
    pedal_rate: tuple[float, float] = (400.0, 400.0)
    """bar/s"""


SCATTER = Scatter()
SCATTERED_PEDAL = Scatter(pedal_rate=(200.0, 1000.0))


class Draws(NamedTuple):
    """Drawn conditions, arrays (stops,), the longest stops last."""

    tyre: Any
    wheel: Wheel
    lag: np.ndarray
    noise: np.ndarray
    seed: np.ndarray
    speed: np.ndarray
    """m/s"""
    pedal_rate: np.ndarray
    """bar/s"""


class Summary(NamedTuple):
    """What the stops of one controller come to; distances from the pedal over the ideal ones."""

    unfinished: float
    """share of the stops that do not end"""
    mean: float
    """over the stops that end"""
    spread: float
    """standard deviation over those"""
    worst: float
    """mean of the worst 5 % of those"""
    locked: float
    """share that locks above 15 km/h for longer than `LONG_LOCK`"""
    stuck: float
    """share with a cycle longer than `STUCK`"""


def draw(count: int, seed: int, scatter: Scatter = SCATTER, roads: tuple[str, ...] = published.ROADS) -> Draws:
    """Draw conditions at random around the default wheel and the named surfaces."""
    rng = np.random.default_rng(seed)
    which = rng.integers(len(roads), size=count)

    def scattered(values, deviation):
        return np.asarray(values) * np.exp(deviation * rng.normal(size=count))

    curve = jax.tree.map(
        lambda c: scattered(c, scatter.curve), taken(stacked([SURFACES[road] for road in roads]), which)
    )
    nominal = Wheel()
    wheel = Wheel(
        inertia=np.full(count, float(nominal.inertia)),
        radius=scattered(np.full(count, float(nominal.radius)), scatter.radius),
        load=scattered(np.full(count, float(nominal.load)), scatter.load),
        brake_efficiency=scattered(np.full(count, float(nominal.brake_efficiency)), scatter.brake_efficiency),
    )
    ranges = (scatter.lag, scatter.noise, scatter.speed_kmh, scatter.pedal_rate)
    lag, noise, speed, pedal = (rng.uniform(*pair, count) for pair in ranges)
    draws = Draws(curve, wheel, lag, noise, np.arange(count), speed / 3.6, pedal)
    order = np.argsort(draws.speed / np.asarray(draws.tyre.peak().friction))
    return jax.tree.map(lambda leaf: np.asarray(leaf)[order], draws)


def stops(config: TuningConfig, controller: Any, draws: Draws) -> tuple[Stop, np.ndarray]:
    """The stops of a controller, sampled, in the drawn conditions, and the ideal distances; else as configured."""
    nominal = Setup.of(config)
    wheel, brake = draws.wheel, dataclasses.replace(nominal.brake, lag=draws.lag)
    scattered = dataclasses.replace(nominal, wheel=wheel, brake=brake)
    loop = scattered.loop(controller, UniformRoad(draws.tyre), draws.pedal_rate)
    sensor = NoisySensor(draws.noise, float(nominal.wheel.radius), draws.seed)
    sampled, step = nominal.sampled(loop, sensor=sensor)
    ideal = draws.speed / (GRAVITY * np.asarray(draws.tyre.peak().friction))
    horizon = HORIZON_FACTOR * float(ideal.max()) + 1.0
    stopped = stop(sampled, draws.speed, horizon=horizon, step=step, max_events=config.max_events, tile=64)
    return stopped, np.asarray(shortest(loop, draws.speed, horizon))


def excess(stopped: Stop, ideal: np.ndarray) -> np.ndarray:
    """Distance from the pedal over the ideal one, (stops,); infinite where the stop does not end."""
    ended = np.asarray(stopped.outcome) == Outcome.STOPPED
    return np.where(ended, np.asarray(stopped.distance) / ideal, np.inf)


def summarise(stopped: Stop, ideal: np.ndarray) -> Summary:
    """Mean, spread and worst of the stops that end, and the shares of those that do not, lock or stick."""
    ratios = np.sort(excess(stopped, ideal))
    ended = ratios[np.isfinite(ratios)]
    found = ended if ended.size else np.array([np.nan])
    return Summary(
        unfinished=float(1 - ended.size / ratios.size),
        mean=float(found.mean()),
        spread=float(found.std()),
        worst=float(found[-max(1, len(found) // 20) :].mean()),
        locked=float((np.asarray(stopped.longest_lock[0]) > LONG_LOCK).mean()),
        stuck=float((np.asarray(stopped.longest_cycle) > STUCK).mean()),
    )
