"""Random stops: controllers scattered around their defaults, on scattered roads, brakes and feet."""

import dataclasses

import numpy as np

from absjax.controllers import CONTROLLERS, PREDICTIVE
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.delayed_loop import DelayedLoop, nodes_of
from absjax.loop.driver import Driver
from absjax.parameters import bounds_of, trainable_names
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import SURFACES

KINDS = (*CONTROLLERS.values(), *PREDICTIVE.values())
"""Controllers that are attacked."""
END = 3.0
ROOM = 1e-3
"""Left to bounds and orders, so that there is something on both sides of every value."""
DELAYS = (5e-3, 15e-3)
"""s, of the brake of a controller that predicts"""


def random_controller(kind, rng, lanes: int, spread: float = 0.5, room: float = ROOM):
    """Trainable parameters scattered around the defaults, kept within bounds and in the order the class demands."""
    values = {}
    for name in trainable_names(kind):
        default, bounds = float(getattr(kind(), name)), bounds_of(kind)[name]
        drawn = default * np.exp(spread * rng.normal(size=lanes)) if default else rng.uniform(0.0, 3.0, lanes)
        values[name] = np.clip(drawn, bounds.low + room, bounds.high - room)
    for low, high, margin in getattr(kind, "ordered", ()):
        values[high] = np.maximum(values[high], (1 + room) * values[low] + margin)
    return kind(**values)


def random_loop(kind, rng, lanes: int, step: float = 2e-3) -> ClosedLoop:
    """A lane each of controller, road, brake and foot; of a delay too where it predicts, for steps from `step` on."""
    surfaces = [SURFACES[name] for name in SURFACES]
    which = rng.integers(len(surfaces), size=lanes)
    c = (np.array([float(getattr(surfaces[i], c)) for i in which]) for c in ("c1", "c2", "c3"))
    tyre = Burckhardt(*(x * np.exp(0.1 * rng.normal(size=lanes)) for x in c))
    wheel = Wheel(inertia=rng.uniform(0.7, 2.0, lanes), load=rng.uniform(1800.0, 3500.0, lanes))
    brake = Brake(rate_limit=rng.uniform(500.0, 1500.0, lanes), lag=rng.uniform(2e-3, 20e-3, lanes))
    driver = Driver(rate=rng.uniform(200.0, 1500.0, lanes), largest=rng.uniform(100.0, 160.0, lanes))
    controller = random_controller(kind, rng, lanes)
    if "wheel" in {f.name for f in dataclasses.fields(kind)}:
        controller = dataclasses.replace(controller, wheel=wheel)
    plant = QuarterCar(wheel, UniformRoad(tyre))
    if kind not in PREDICTIVE.values():
        return ClosedLoop(plant, brake, controller, END, driver=driver)
    delay, nodes = rng.uniform(*DELAYS, lanes), nodes_of(DELAYS[1], step)
    controller = dataclasses.replace(controller, delay=delay)
    return DelayedLoop(plant, brake, controller, END, driver=driver, delay=delay, nodes=nodes)


def random_speeds(rng, lanes: int) -> np.ndarray:
    """m/s"""
    return rng.uniform(8.0, 30.0, lanes)
