"""Simulated anti-lock stops of a car on two axles, as an estimator of its speed is told them.

A front and a rear wheel brake under a shipped controller, each with its share of the car. The car's speed is what
their forces make of both shares together, and the rims turn with the slips the wheels have:

    v = (m_f v_f + m_r v_r) / (m_f + m_r),  R w_i = (1 + lambda_i) v

Load transfer and suspension are left out.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.controllers import CONTROLLERS
from absjax.lanes import over_lanes, taken
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.stop import stop
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

AXLES = {"front": {"load": 4200.0, "brake_efficiency": 17.5}, "rear": {"load": 3000.0, "brake_efficiency": 8.5}}
"""A wheel of each axle, by fields of `absjax.plant.wheel.Wheel`."""
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
        return self._each(lambda values: values[index])

    def after_rolling(self, seconds: float) -> "Stops":
        """The same stops, before which the wheels roll freely so much longer [s]; as many samples after them are cut.

        Raises:
            ValueError: if a controller still acts in those.
        """
        more, samples = round(seconds / self.period), self.active.shape[1]
        if self.active[:, samples - more :].any():
            raise ValueError(f"seconds = {seconds:g}: there is no such time after the stops that could be cut")
        return self._each(lambda x: np.concatenate([np.repeat(x[:, :1], more, axis=1), x], axis=1)[:, :samples])

    def _each(self, change: Callable[[Any], Any]) -> "Stops":
        return self._replace(**{name: change(getattr(self, name)) for name in self._fields[:-1]})

    @classmethod
    def joined(cls, parts: Sequence["Stops"]) -> "Stops":
        """Several sets of stops of equal length as one."""
        arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in cls._fields[:-1]}
        return parts[0]._replace(**arrays)


def simulate(
    road: Road,
    speeds: Sequence[float],
    controller: str,
    *,
    delay: float,
    stop_speed: float,
    period: float,
    horizon: float,
) -> Stops:
    """Simulate stops, front and rear wheels side by side as lanes of one loop.

    Args:
        road: of every stop; leaves with a leading axis are of one stop each.
        speeds: at the start, (stops,) [m/s].
        controller: name of a kind and of its shipped set, on both axles.
        delay: before the pedal is touched [s].
        stop_speed: that ends a stop [m/s].
        period: of the samples, rounded to the grid of the simulation [s].
        horizon: longest time [s].

    Raises:
        RolloutError: if a stop fails otherwise than by still moving at the horizon.
    """
    every, stops = max(1, round(period / GRID)), len(speeds)
    fields = {name: np.repeat([axle[name] for axle in AXLES.values()], stops) for name in AXLES["front"]}
    wheel, road = Wheel(**fields), taken(road, np.tile(np.arange(stops), len(AXLES)))
    loop = ClosedLoop(
        QuarterCar(wheel, road),
        Brake(rate_limit=750.0, lag=5e-3),
        built("controllers", CONTROLLERS[controller], shipped("controllers.json").get(controller, {}), wheel),
        stop_speed=stop_speed,
        driver=Driver(rate=400.0, delay=delay, largest=180.0),
    )
    start = np.tile(np.asarray(speeds, float), len(AXLES))
    found = stop(loop, start, horizon=horizon, step=GRID, max_events=SWITCHINGS, save_every=every)
    found.rollout.raise_if_failed()
    path = found.rollout.path
    assert path is not None
    measured = over_lanes(lambda one, *points: jax.vmap(one.measured)(*points), loop, path.time, path.state, path.mode)
    signals, valid, onset = jax.tree.map(
        lambda x: np.reshape(x, (len(AXLES), stops, *np.shape(x)[1:])), (measured, path.valid, found.onset_time)
    )
    share = np.reshape(wheel.load, (len(AXLES), stops))[..., None]
    share = share / share.sum(axis=0)
    speed, acceleration = (np.sum(share * x, axis=0) for x in (signals.vehicle_speed, signals.vehicle_acceleration))
    slips = signals.radius * signals.wheel_speed / signals.vehicle_speed - 1
    time = GRID * every * np.arange(speed.shape[1])
    active = valid.all(axis=0) & (time >= onset.min(axis=0)[:, None] + delay)
    return Stops(speed, acceleration, np.moveaxis((1 + slips) * speed, 0, 2), active, GRID * every)


def published_scenario(period: float, controller: str) -> Stops:
    """Dry asphalt, snow from 2.5 s, wet asphalt from 5 s, from 180 to 15 km/h, the pedal touched at 0.25 s.

    Source: Aguado-Rojas 2019, section 3.6 and Fig. 3.15.
    """
    surfaces = tuple(surface(name) for name in ("dry_asphalt", "snow", "wet_asphalt"))
    road = ChangingRoad(surfaces, (2.5, 5.0))
    return simulate(road, [180 / 3.6], controller, delay=0.25, stop_speed=15 / 3.6, period=period, horizon=12.0)


@dataclasses.dataclass(frozen=True)
class Told:
    """Stops as they are told, with their names."""

    names: tuple[str, ...]
    stops: Stops
    samples: SpeedSamples
    measured: tuple[Accelerometer, float, Any]
    """by which accelerometer, noise of the rims [m/s], and its seeds"""

    @property
    def roads(self) -> list[str]:
        """Road and bias of every stop."""
        return [f"{name.rsplit(', ', 4)[0]}, {name.rsplit(', ', 2)[1]}" for name in self.names]

    def after_rolling(self, seconds: float) -> "Told":
        """The same after `Stops.after_rolling`, told anew."""
        stops = self.stops.after_rolling(seconds)
        return dataclasses.replace(self, stops=stops, samples=stops.told(*self.measured))

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        stops: Stops,
        errors: Sequence[tuple[float, float]],
        noise: float,
        rim_noise: float,
        seed: int,
    ) -> "Told":
        """Every stop with every error of the accelerometer, its bias [m/s^2] and its gain."""
        count = len(names) * len(errors)
        index, seeds = np.repeat(np.arange(len(names)), len(errors)), seed + np.arange(count)
        each, (biases, gains) = stops.select(index), np.tile(np.array(errors, float).T, len(names))
        sensor = Accelerometer(biases, noise, seeds, gains)
        named = tuple(f"{name}, bias {bias:+g}, gain {gain:+g}" for name in names for bias, gain in errors)
        measured = sensor, rim_noise, seeds
        return cls(named, each, each.told(*measured), measured)
