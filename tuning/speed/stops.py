"""Simulated anti-lock stops of a car on two axles, as an estimator of its speed is told them.

A front and a rear wheel brake under shipped controllers, each with its share of the car. The car's speed is what their
forces make of both shares together, v = (m_f v_f + m_r v_r) / (m_f + m_r); the rims turn with the slips the wheels have,
R w_i = (1 + lambda_i) v. Load transfer and suspension are left out.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.controllers import CONTROLLERS
from absjax.lanes import over_lanes
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.stop import Stop, stop
from absjax.plant.base import Road
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.white import white_noise
from absjax.speed.accelerometer import Accelerometer
from absjax.speed.base import SpeedSamples
from absjax.tyres.surfaces import surface
from tuning.core.components import built
from tuning.core.files import shipped

AXLES = {
    "front": (Wheel(inertia=1.2, load=4200.0, brake_efficiency=17.5), "five_phase"),
    "rear": (Wheel(inertia=1.2, load=3000.0, brake_efficiency=8.5), "two_phase"),
}
"""A wheel of each axle, and the shipped controller set it brakes under."""
GRID, SWITCHINGS = 2e-3, 2000
RIM_CHANNEL = 2
"""Of the noise of the first rim; the next ones follow."""


class Stops(NamedTuple):
    """Stops side by side; arrays (stops, samples)."""

    speed: Any
    """true v [m/s]"""
    acceleration: Any
    """true v' [m/s^2]"""
    rims: Any
    """true R w, (stops, samples, 2) [m/s]"""
    active: Any
    """bool: while a controller acts, until the stop speed"""
    period: float
    """s"""

    @property
    def time(self) -> np.ndarray:
        """(samples,) [s]."""
        return self.period * np.arange(self.speed.shape[1])

    def told(self, accelerometer: Accelerometer, rim_noise: float, seeds: Any) -> SpeedSamples:
        """What is measured, the rims with white noise [m/s]; `seeds` (stops,), of the rims' noise."""
        seeds = np.asarray(seeds)[:, None]
        rims = [
            self.rims[..., i] + rim_noise * white_noise(seeds, self.time, self.rims.dtype, RIM_CHANNEL + i)
            for i in range(self.rims.shape[2])
        ]
        measured = over_lanes(lambda sensor, a: sensor.measure(a, self.time), accelerometer, self.acceleration)
        return SpeedSamples(np.asarray(measured), np.stack(rims, axis=2))

    def select(self, index) -> "Stops":
        """Some of the stops."""
        return Stops(self.speed[index], self.acceleration[index], self.rims[index], self.active[index], self.period)


def simulate(
    road: Road, speeds: Sequence[float], *, delay: float, stop_speed: float, period: float, horizon: float
) -> Stops:
    """Simulate stops.

    Args:
        road: of every stop; leaves with a leading axis are of one stop each.
        speeds: at the start, (stops,) [m/s].
        delay: before the pedal is touched [s].
        stop_speed: that ends a stop [m/s].
        period: of the samples, rounded to the grid of the simulation [s].
        horizon: longest time [s].

    Raises:
        RolloutError: if a stop fails otherwise than by still moving at the horizon.
    """
    every, first = max(1, round(period / GRID)), np.asarray(speeds, float)
    wheels = []
    for wheel, name in AXLES.values():
        controller = built(name, CONTROLLERS[name], shipped("controllers.json")[name], wheel)
        driver = Driver(rate=400.0, delay=delay, largest=180.0)
        brake = Brake(rate_limit=750.0, lag=5e-3)
        loop = ClosedLoop(QuarterCar(wheel, road), brake, controller, stop_speed=stop_speed, driver=driver)
        found = stop(loop, first, horizon=horizon, step=GRID, max_events=SWITCHINGS, save_every=every)
        found.rollout.raise_if_failed()
        wheels.append((float(wheel.mass), found, _signals(loop, found)))
    masses = np.array([mass for mass, *_ in wheels])
    share = masses / masses.sum()

    def of_the_car(values):
        return sum(part * value for part, value in zip(share, values))

    speed = of_the_car([s.vehicle_speed for *_, s in wheels])
    acceleration = of_the_car([s.vehicle_acceleration for *_, s in wheels])
    slips = [s.radius * s.wheel_speed / s.vehicle_speed - 1 for *_, s in wheels]
    rims = np.stack([(1 + slip) * speed for slip in slips], axis=2)
    paths = [found.rollout.path for _, found, _ in wheels]
    moves = np.logical_and(*(np.asarray(path.valid) for path in paths if path is not None))
    acts = np.min([np.asarray(found.onset_time) for _, found, _ in wheels], axis=0) + delay
    time = GRID * every * np.arange(speed.shape[1])
    return Stops(speed, acceleration, rims, moves & (time >= acts[:, None]), GRID * every)


def _signals(loop: ClosedLoop, found: Stop):
    path = found.rollout.path
    assert path is not None
    measured = over_lanes(
        lambda one, *points: jax.vmap(one.measured)(*points), loop, path.time, path.state, path.mode
    )
    return jax.tree.map(np.asarray, measured)


def published_scenario(period: float) -> Stops:
    """Dry asphalt, snow from 2.5 s, wet asphalt from 5 s, from 180 to 15 km/h, the pedal touched at 0.25 s.

    Source: Aguado-Rojas 2019, section 3.6 and Fig. 3.15.
    """
    surfaces = tuple(surface(name) for name in ("dry_asphalt", "snow", "wet_asphalt"))
    road = ChangingRoad(surfaces, (2.5, 5.0))
    return simulate(road, [180 / 3.6], delay=0.25, stop_speed=15 / 3.6, period=period, horizon=12.0)


@dataclasses.dataclass(frozen=True)
class Told:
    """Stops as they are told, with their names."""

    names: tuple[str, ...]
    stops: Stops
    samples: SpeedSamples

    @classmethod
    def of(cls, names, stops: Stops, biases: Sequence[float], noise: float, rim_noise: float, seed: int) -> "Told":
        """Every stop with every bias of the accelerometer [m/s^2]."""
        count = len(names) * len(biases)
        index, seeds = np.repeat(np.arange(len(names)), len(biases)), seed + np.arange(count)
        each = stops.select(index)
        sensor = Accelerometer(np.tile(np.asarray(biases, float), len(names)), noise, seeds)
        named = tuple(f"{name}, bias {bias:+g}" for name in names for bias in biases)
        return cls(named, each, each.told(sensor, rim_noise, seeds))
