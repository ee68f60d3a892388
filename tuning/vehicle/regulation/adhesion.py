"""k, measured as the regulation has it: one axle braked, anti-lock off, the pressure raised until a wheel locks.

From 50 km/h, each test at a constant pressure. The tests that count are those in which no wheel locks between 40 and
20 km/h; t_min is the shortest of their times from 40 to 20 km/h, t_m the mean of the three shortest within 1.05 t_min.
Pressures are raised in steps, and in finer ones from the last that locks nothing. Source: Appendix 2.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.no_control import NoControl
from absjax.lanes import stacked, taken
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.stop import Stop, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.two_axle import TwoAxle
from absjax.tyres.base import Tyre
from tuning.cars.car import CarFigures
from tuning.core.config import require
from tuning.vehicle.regulation.quantities import KMH, Weights, braking_rate

SPEED, HIGH, LOW, END = 50.0, 40.0, 20.0, 19.0
"""Initial speed, those between which a test is timed, and where it ends, km/h."""
NEAR = 1.05
"""Share of the shortest time up to which a test counts."""
COUNTED = 3
NOT_BRAKED = 1e-9
"""Share of its efficiency that a brake has whose line is closed."""
FOOT = 400.0
"""Pressure rate of the foot, bar/s."""
LEAST, MOST = 0.1, 1.5
"""Brake force of a wheel over its static load between which the pressure of lock is looked for."""
PRESSURES = 8
"""In a round."""
ROUNDS = 4
"""The first in steps of 47 %, the last of 0.1 %."""
STEP, HORIZON, SAVED = 2e-3, 12.0, 5
MAX_EVENTS = 12


def straight_ahead(figures: CarFigures, tyre: Tyre, *, laden: bool) -> TwoAxle:
    """A car that goes straight ahead: two axles without suspension are the four-wheel car then."""
    car = figures.vehicle("two_axle", (UniformRoad(tyre),) * 2, laden=laden)
    assert isinstance(car, TwoAxle)
    return dataclasses.replace(car, suspension=None)


def single_axle(car: TwoAxle, axle: int) -> VehicleLoop:
    """A car of which one axle is braked, anti-lock off, at a pressure that the driver sets."""
    axles = list(car.axles)
    other = axles[1 - axle]
    axles[1 - axle] = dataclasses.replace(other, brake_efficiency=NOT_BRAKED * other.brake_efficiency)
    channels = tuple(Channel(Brake(), NoControl()) for _ in axles)
    return VehicleLoop(dataclasses.replace(car, axles=tuple(axles)), channels, END * KMH, Driver(FOOT))


def tested(loops: VehicleLoop, pressures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Braking rates from 40 to 20 km/h, and whether a wheel locked before 20 km/h, of loops at pressures (lanes,)."""
    found = _stopped(dataclasses.replace(loops, driver=dataclasses.replace(loops.driver, largest=pressures)))
    path = found.rollout.path
    rates = jax.vmap(lambda t, v: braking_rate(t, v, HIGH * KMH, LOW * KMH))(path.time, path.state.vehicle.speed)
    locks = jnp.stack([wheel.locks.speed for wheel in found.rollout.state.memory.wheels])
    return np.asarray(rates), np.asarray((locks > LOW * KMH).any(axis=0))


def _stopped(loops: VehicleLoop) -> Stop:
    speeds = jnp.full_like(jnp.asarray(loops.driver.largest), SPEED * KMH)
    return stop(loops, speeds, horizon=HORIZON, step=STEP, max_events=MAX_EVENTS, save_every=SAVED, tile=32)


def measured_adhesion(cars: Sequence[TwoAxle]) -> np.ndarray:
    """k_f and k_r of cars on their roads, (cars, 2).

    Raises:
        ConfigError: if no pressure up to a brake force of `MOST` times the load locks a wheel, or the least does.
    """
    tests = [(car, axle) for car in cars for axle in range(2)]
    loops = stacked([single_axle(car, axle) for car, axle in tests])
    # The pressure at which a wheel's brake force is its static load.
    weighed = [car.wheels[axle] for car, axle in tests]
    at_load = np.array([w.load * w.radius / w.brake_efficiency for w in weighed], float)
    low, high = np.full(len(tests), LEAST), np.full(len(tests), MOST)
    free: list[list[float]] = [[] for _ in tests]
    lanes = taken(loops, np.repeat(np.arange(len(tests)), PRESSURES))
    for _ in range(ROUNDS):
        asked = np.geomspace(low, high, PRESSURES, axis=1)
        rates, locked = (x.reshape(asked.shape) for x in tested(lanes, (asked * at_load[:, None]).ravel()))
        for i in range(len(tests)):
            first = int(np.argmax(locked[i]))
            require(
                "adhesion", "", locked[i].any() and first > 0, f"found: between {low[i]:g} and {high[i]:g} times load"
            )
            free[i] += list(rates[i, :first])
            low[i], high[i] = asked[i, first - 1], asked[i, first]
    k = [Weights.of(car).adhesion(axle, mean_of_best(found)) for (car, axle), found in zip(tests, free)]
    return np.array(k, float).reshape(-1, 2)


def mean_of_best(rates: Sequence[Any]) -> float:
    """z_m of the mean time of the three shortest tests within 1.05 t_min; of fewer, where no three are."""
    times = np.sort(1 / np.array([rate for rate in rates if rate > 0]))
    return float(1 / times[times <= NEAR * times[0]][:COUNTED].mean())
