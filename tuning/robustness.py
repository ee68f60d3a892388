"""Stops on scattered roads, wheels, brakes and noise: how often they lock, how long they are, how bad the worst.

All of it acts on a controller that knows the nominal wheel, tested at the sampling period on noisy signals.
"""

from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop, SampledLoop
from absjax.manoeuvre import Outcome, Stop, stop
from absjax.road import SURFACES, UniformRoad
from absjax.sensor import NoisySensor
from absjax.tyre import Burckhardt
from absjax.vehicle import GRAVITY, QuarterCar, Wheel
from tuning import published
from tuning.config import TuningConfig

HORIZON_FACTOR = 1.6
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""


class Scatter(NamedTuple):
    """How much is scattered: standard deviations of the logarithm, or (low, high) of a uniform distribution."""

    curve: float = 0.1
    """of c1, c2 and c3, each by itself"""
    load: float = 0.1
    radius: float = 0.01
    brake_efficiency: float = 0.1
    lag: tuple[float, float] = (0.003, 0.01)
    """s"""
    noise: tuple[float, float] = (0.0, 1.0)
    """standard deviation of a sample of x2, m/s^2"""
    speed_kmh: tuple[float, float] = (50.0, 180.0)


SCATTER = Scatter()


class Draws(NamedTuple):
    """Drawn conditions, arrays (stops,), the longest stops last."""

    tyre: Burckhardt
    wheel: Wheel
    lag: np.ndarray
    noise: np.ndarray
    seed: np.ndarray
    speed: np.ndarray
    """m/s"""


class Summary(NamedTuple):
    """What the stops of one controller come to; distances as v0^2 / (2 g mean friction) over the ideal one."""

    locked: float
    """share of the stops that lock above `LOCK_SPEED`, or do not end at all"""
    mean: float
    """over the stops that end, locked or not"""
    worst: float
    """mean of the worst 5 % of those"""


LOCK_SPEED = 5.0
"""Vehicle speed above which a locked wheel counts, m/s: below it steering does not matter any more."""


def draw(count: int, seed: int, scatter: Scatter = SCATTER, roads: tuple[str, ...] = published.ROADS) -> Draws:
    """Draw conditions at random around the default wheel and the named surfaces."""
    rng = np.random.default_rng(seed)
    which = rng.integers(len(roads), size=count)

    def scattered(values, deviation):
        return np.asarray(values) * np.exp(deviation * rng.normal(size=count))

    curve = [
        scattered([float(getattr(SURFACES[roads[i]], c)) for i in which], scatter.curve) for c in ("c1", "c2", "c3")
    ]
    nominal = Wheel()
    wheel = Wheel(
        inertia=np.full(count, float(nominal.inertia)),
        radius=scattered(np.full(count, float(nominal.radius)), scatter.radius),
        load=scattered(np.full(count, float(nominal.load)), scatter.load),
        brake_efficiency=scattered(np.full(count, float(nominal.brake_efficiency)), scatter.brake_efficiency),
    )
    lag, noise, speed = (rng.uniform(*pair, count) for pair in (scatter.lag, scatter.noise, scatter.speed_kmh))
    draws = Draws(Burckhardt(*curve), wheel, lag, noise, np.arange(count), speed / 3.6)
    order = np.argsort(draws.speed / np.asarray(draws.tyre.peak().friction))
    return jax.tree.map(lambda leaf: np.asarray(leaf)[order], draws)


def stops(config: TuningConfig, controller: Any, draws: Draws) -> Stop:
    """The stops of a controller, sampled, in the drawn conditions; the rest is as configured."""
    nominal = config.loop(controller)
    car = QuarterCar(draws.wheel, UniformRoad(draws.tyre))
    brake = Brake(config.rate_limit, draws.lag, config.delay, config.driver_pressure)
    loop = ClosedLoop(car, brake, controller, nominal.stop_speed, nominal.observer)
    step, ticks = config.sampled_grid()
    sensor = NoisySensor(draws.noise, float(nominal.plant.wheel.radius), draws.seed)
    sampled = SampledLoop(loop, sensor, ticks, substeps=config.steps_per_sample)
    ideal = draws.speed / (GRAVITY * np.asarray(draws.tyre.peak().friction))
    horizon = HORIZON_FACTOR * float(ideal.max()) + 1.0
    return stop(sampled, draws.speed, horizon=horizon, step=step, max_events=60, tile=64)


def excess(stopped: Stop) -> np.ndarray:
    """Distance over the ideal one, (stops,), up to where the stop ended; infinite where the vehicle was not slowed."""
    return np.asarray(stopped.equivalent_distance / stopped.ideal_distance)


def summarise(stopped: Stop) -> Summary:
    """Share that lock or fail, mean and worst 5 %."""
    outcome, state = np.asarray(stopped.outcome), stopped.rollout.state
    ended = (outcome == Outcome.STOPPED) | (outcome == Outcome.LOCKED)
    failed = ~ended | ((outcome == Outcome.LOCKED) & (np.asarray(state.loop.plant.speed) > LOCK_SPEED))
    ratios = np.sort(excess(stopped)[ended])
    tail = ratios[-max(1, len(ratios) // 20) :]
    return Summary(float(failed.mean()), float(ratios.mean()), float(tail.mean()))
