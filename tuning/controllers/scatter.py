"""Conditions a controller meets where it runs, drawn around the rows of a configuration.

Every row of road, speed and pedal is drawn so many times: the coefficients of its tyre curves, the places where its
surface changes, load, radius, brake efficiency, lag, pedal and speed vary, and so do the phase of the control unit's
clock, and the noise or the encoder of what it measures with. Of a vehicle it is load and centre of gravity that vary,
radius and brake of each wheel, and the errors of the accelerometer by which its speed is estimated.
The controller knows the nominal wheel. What is tuned on, what chooses between candidates and
what is reported in the end are drawn apart.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, Literal

import jax
import numpy as np

from absjax.encoder.edges import capacity_for
from absjax.encoder.encoder import Encoder
from absjax.loop.closed_loop import ClosedLoop
from absjax.plant.brake import Brake
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.plant.two_axle import TwoAxle
from absjax.plant.wheel import GRAVITY, Wheel
from absjax.sensors.base import Sensor
from absjax.sensors.delayed import DelayedSensor
from absjax.sensors.encoder import EncoderSensor
from absjax.sensors.noisy import NoisySensor
from absjax.tyres.base import Tyre
from tuning.controllers.batch import SAFETY_HORIZON, Batch
from tuning.controllers.chain import EVENTS, TEETH
from tuning.controllers.config import Scatter
from tuning.controllers.loops import Sensors, shortest
from tuning.controllers.rows import rows_of
from tuning.controllers.setup import Setup
from tuning.core.roads import stacked
from tuning.encoder.chains import measured_chain

Split = Literal["training", "validation", "test"]
LARGEST_SEED = 2**31
APART = 7919
"""Between the seeds of the wheels of a vehicle."""
SPLITS: tuple[Split, ...] = ("training", "validation", "test")
ROLLING = 2000
"""Samples of free rolling before the pedal: by then the harmonics of the encoder are learned."""


def scattered(setup: Setup, split: Split, *, stand_in: bool = False) -> Batch:
    """The batch of a setup in scattered conditions.

    Args:
        stand_in: whether a chain is replaced by what is smooth (`absjax.sensors.delayed`).
    """
    scatter = Scatter(**setup.config.conditions)
    draws = setup.config.draws if split == "training" else setup.config.checked
    config, rows = setup.config, rows_of(setup.config)
    rng = np.random.default_rng((config.seed, SPLITS.index(split)))
    lanes = [row for row in rows for _ in range(draws)]
    count = len(lanes)

    def around(values: Any, deviation: float):
        return np.broadcast_to(values, count) * np.exp(deviation * rng.normal(size=count))

    road = _with_surfaces(stacked([row.road for row in lanes]), around, scatter)
    nominal = setup.loop_of(None, road, which=[row.which for row in lanes])
    loop = _with_car(nominal, around, scatter)
    lag = None if setup.brake.lag is None else around(setup.brake.lag, scatter.lag)
    speed = around([row.speed for row in lanes], scatter.speed)
    phase = rng.uniform(size=count) * config.sampled_period
    driver = dataclasses.replace(
        setup.driver,
        rate=around([row.pedal_rate for row in lanes], scatter.pedal),
        delay=np.asarray(setup.driver.delay) + phase,
    )
    loop = _with_brake(dataclasses.replace(loop, driver=driver), Brake(setup.brake.rate_limit, lag, setup.brake.delay))
    least = np.min([tyre.peak().friction for tyre in _tyres_of(road)], axis=0)
    horizon = SAFETY_HORIZON * float(np.max(speed / (GRAVITY * least))) + 1.0
    seeds = rng.integers(LARGEST_SEED, size=count)
    noise = rng.uniform(0.0, scatter.noise, count)
    sensor = _sensors(setup, _radius(nominal), seeds, noise, scatter, stand_in)
    if isinstance(sensor, EncoderSensor) and isinstance(loop, ClosedLoop):
        plant: Any = loop.plant
        sensor = sensor.rolled(speed / plant.wheel.radius)
        sensor = sensor.settled() if config.chain == "settled" else sensor
    speedometer = None if config.vehicle is None else config.vehicle.speedometer()
    return Batch(
        loop=loop,
        speed=speed,
        ideal=np.asarray(shortest(loop, speed, horizon)),
        published=np.zeros(count),
        sensor=sensor,
        speedometer=None if speedometer is None else speedometer.scattered(rng, seeds),
        longest_cycle=config.longest_cycle,
        longest_lock=config.longest_lock,
        slide_time=config.slide_time,
        horizon=horizon,
        step=setup.step,
        substeps=setup.substeps(),
        max_events=config.max_events,
    )


def _tyres_of(road: Any) -> tuple[Tyre, ...]:
    """Its tyre curves."""
    return road.surfaces if isinstance(road, ChangingRoad) else (road.tyre,)


def _with_surfaces(road: Any, around: Callable[[Any, float], Any], scatter: Scatter) -> Any:
    """A road with other tyre curves in every lane; where it changes, its stretches are longer or shorter alike."""
    surfaces = tuple(jax.tree.map(lambda c: around(c, scatter.curve), tyre) for tyre in _tyres_of(road))
    if not isinstance(road, ChangingRoad):
        return UniformRoad(*surfaces)
    scale = around(1.0, scatter.change)
    return dataclasses.replace(road, surfaces=surfaces, changes=tuple(scale * change for change in road.changes))


def _with_car(loop: Any, around: Callable[[Any, float], Any], scatter: Scatter) -> Any:
    """The loop with another plant or vehicle in every lane."""

    def scattered_wheel(wheel: Wheel, **fields: Any) -> Wheel:
        radius = around(wheel.radius, scatter.radius)
        efficiency = around(wheel.brake_efficiency, scatter.brake_efficiency)
        return dataclasses.replace(wheel, radius=radius, brake_efficiency=efficiency, **fields)

    if isinstance(loop, ClosedLoop):
        plant: Any = loop.plant
        load = around(plant.wheel.load, scatter.load)
        wheel = scattered_wheel(plant.wheel, load=load)
        return dataclasses.replace(loop, plant=dataclasses.replace(plant, wheel=wheel))
    car = loop.vehicle
    wheels = "axles" if isinstance(car, TwoAxle) else "corners"
    changed = {wheels: tuple(map(scattered_wheel, getattr(car, wheels)))}
    changed |= {name: around(getattr(car, name), getattr(scatter, name)) for name in ("height", "to_front")}
    return dataclasses.replace(loop, vehicle=dataclasses.replace(car, mass=around(car.mass, scatter.load), **changed))


def _with_brake(loop: Any, brake: Brake) -> Any:
    if isinstance(loop, ClosedLoop):
        return dataclasses.replace(loop, brake=brake)
    return dataclasses.replace(loop, channels=tuple(dataclasses.replace(c, brake=brake) for c in loop.channels))


def _radius(loop: Any) -> Any:
    """R of a wheel, as the control unit knows it."""
    return loop.plant.wheel.radius if isinstance(loop, ClosedLoop) else loop.vehicle.wheels[0].radius


def _sensors(setup: Setup, radius: Any, seeds, noise, scatter: Scatter, stand_in: bool) -> Sensors:
    """What is measured with: of a vehicle at each wheel, of its own seed."""
    if setup.sensor is not None:
        return setup.sensor
    if setup.config.vehicle is None:
        return _sensor(setup, radius, seeds, noise, scatter, stand_in)
    own = ((seeds + APART * wheel) % LARGEST_SEED for wheel in range(setup.config.vehicle.wheels))
    return tuple(_sensor(setup, radius, of_wheel, noise, scatter, stand_in) for of_wheel in own)


def _sensor(setup: Setup, radius: Any, seeds, noise, scatter: Scatter, stand_in: bool) -> Sensor:
    config = setup.config
    if config.setting != "chain":
        return NoisySensor(noise if scatter.noise else None, radius, seeds)
    chain = setup.chain()
    if stand_in:
        edges = DelayedSensor(float(TEETH), float(EVENTS), left=scatter.tolerance / np.sqrt(3), phase=phase_of(seeds))
        return edges if chain is None else chain.stand_in(edges)
    encoder = Encoder.random([int(seed) for seed in seeds], TEETH, scatter.tolerance)
    fastest = 1.2 * max(row.speed for row in rows_of(config)) / float(np.min(radius))
    capacity = capacity_for(fastest * config.sampled_period / encoder.pitch)
    told = measured_chain(TEETH, EVENTS) if chain is None else chain.chain(config.chain)
    return EncoderSensor(encoder, told, rolling=ROLLING, period=config.sampled_period, capacity=capacity)


def phase_of(seeds):
    """Of the ripple that is left of an encoder's errors [rad]."""
    return 2 * np.pi * seeds / LARGEST_SEED
