"""A set of parameters on the stops of the regulation: what tuners are charged for, and commands report.

Each stop is rolled out in a sampled control unit as the configuration has it, on four wheels, unladen and laden.
Adhesion does not depend on the set: it is measured once.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import repeated
from absjax.loop.stop import Stop
from absjax.loop.vehicle_loop import VehicleLoop
from tuning.cars.car import CarFigures, name_of_car
from tuning.cars.entry import VehicleEntry
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import with_parameters
from tuning.controllers.setup import Setup
from tuning.core.problem import in_chunks
from tuning.vehicle.regulation.lanes import Clocked, Lane, lanes_of, loops_of, run
from tuning.vehicle.regulation.screening import (
    LOADS,
    Adhesions,
    Limits,
    Quantity,
    adhesions_of,
    all_quantities,
    row_of,
)

USUAL: dict[str, Any] = {"model": "four_wheel", "wiring": "select_low_rear"}
FINALISTS = 8
"""Sets that are screened together."""


def on_car(config: TuningConfig, figures: CarFigures, *, laden: bool) -> Setup:
    """The setup of a set on a car of four wheels, all else as the configuration has it; if it has not four wheels, they
    are wired as usual, with select-low behind.

    Raises:
        ConfigError: if it cannot be: names what.
    """
    entry = config.vehicle or VehicleEntry()
    wired = {} if entry.model == "four_wheel" else USUAL
    vehicle = dataclasses.replace(entry, car=figures, laden=laden, **wired)
    one_wheel = {"plant": "quarter_car", "plant_parameters": {}, "wheel": {}}
    free = {"largest_contraction": None, "reference": "ideal"}
    return Setup.of(dataclasses.replace(config, vehicle=vehicle, **one_wheel, **free))


def loops_on(config: TuningConfig, figures: CarFigures) -> tuple[Setup, dict[bool, VehicleLoop]]:
    """Of a set on a car, as `on_car` has it: the setup, and the loops unladen (False) and laden (True)."""
    setups = {laden: on_car(config, figures, laden=laden) for laden in LOADS}
    loops: dict[bool, Any] = {laden: setup.loop_of() for laden, setup in setups.items()}
    return setups[False], loops


def limits_of(config: TuningConfig) -> Limits:
    """The limits of a configuration's vehicle."""
    vehicle = config.vehicle
    if vehicle is None:
        return Limits()
    return Limits(vehicle.largest_yaw_rate, vehicle.largest_side_slip, vehicle.least_steerability)


def clocked(setup: Setup, located: bool = False) -> Clocked:
    """What is rolled out of a loop: sampled, or with switchings located."""

    def system(loop: VehicleLoop) -> tuple[Any, float]:
        return (loop, setup.step) if located else setup.sampled(loop)

    return system


def regulation_of(config: TuningConfig) -> "Regulation | None":
    """What a configuration's sets have to pass, if they have to."""
    return Regulation(config) if config.vehicle is not None and config.vehicle.regulation else None


class Regulation:
    """The rows of a configuration's vehicles, each unladen and laden, as functions of parameter sets."""

    def __init__(self, config: TuningConfig, *, located: bool = False):
        self._cars = [(name_of_car(figures), _Car.of(config, figures)) for figures in config.vehicle.cars]
        setup = on_car(config, config.vehicle.cars[0], laden=False)
        how = tuple(lanes_of(setup.driver)), clocked(setup, located), limits_of(config)
        self._quantities = partial(_quantities, how=how)
        self._margins = jax.jit(partial(_margins, how=how))

    def margins(self, parameters: Mapping[str, Any]):
        """How far each row is beyond what a set has to keep, as a share of what it demands, (rows, sets), of parameters
        (sets,): epsilon and z by 5 % more, all else as it is demanded. Differentiable."""
        return jnp.concatenate([self._margins(car, parameters) for _, car in self._cars])

    def breaches(self, parameters: Mapping[str, Any]) -> np.ndarray:
        """By how much sets (sets,) are on the wrong side, over all rows, each at most by what it demands; 0: none."""
        sets = np.stack([np.asarray(values, float) for values in parameters.values()], axis=1)
        margins = in_chunks(lambda chunk: self.margins(dict(zip(parameters, chunk.T))), sets, FINALISTS, axis=1)
        return np.clip(-margins, 0.0, 1.0).sum(axis=0)

    def judged(self, costs: np.ndarray, parameters: Mapping[str, Any], charge: float) -> np.ndarray:
        """Costs (sets,), charged for what is breached: the best few are screened, then the next, until a set keeps all
        rows; those that are left are out."""
        charged, order = costs + 2 * charge, np.argsort(costs)
        for first in range(0, len(order), FINALISTS):
            some = order[first : first + FINALISTS]
            breached = self.breaches({name: values[some] for name, values in parameters.items()})
            charged[some] = costs[some] + breached + charge * (breached > 0)
            if not breached.all():
                break
        return charged

    def breached(self, values: Mapping[str, Any]) -> list[str]:
        """A sentence for every row that is breached."""
        rows = [
            row_of(name, laden, quantity)
            for name, car in self._cars
            for laden, quantity in self._quantities(car, values)
        ]
        return [
            f"regulation: {row.quantity} ({row.surface}, {row.car} {row.load}) is breached: demanded "
            f"{row.demanded:.3g}, reached {'never' if row.reached is None else format(row.reached, '.3g')}"
            for row in rows
            if row.passed is False
        ]


class _Car(NamedTuple):
    """What is screened of a car."""

    loops: VehicleLoop
    """of its stops"""
    known: Adhesions

    @classmethod
    def of(cls, config: TuningConfig, figures: CarFigures) -> "_Car":
        setup, loops = loops_on(config, figures)
        return cls(loops_of(loops, lanes_of(setup.driver)), adhesions_of(figures))


_How = tuple[tuple[Lane, ...], Clocked, Limits]


def _quantities(car: _Car, values: Mapping[str, Any], how: _How) -> list[tuple[bool, Quantity]]:
    """Of the parameters by name, scalars: (laden, quantity)."""
    lanes, in_clock, limits = how
    loops = _of_set(car, values)
    return all_quantities(loops, lanes, run(loops, lanes, in_clock), car.known, limits)


def _margins(car: _Car, parameters: Mapping[str, Any], how: _How):
    """(rows, sets) of a car, of parameters (sets,)."""
    lanes, in_clock, limits = how
    sets = len(next(iter(parameters.values())))
    together = with_parameters(repeated(car.loops, sets), {n: jnp.tile(v, len(lanes)) for n, v in parameters.items()})
    stops = run(together, lanes, in_clock, sets=sets)

    def of_set(values, stops: Stop):
        rows = [quantity for _, quantity in all_quantities(_of_set(car, values), lanes, stops, car.known, limits)]
        return jnp.stack([row.margin - row.firmly for row in rows if row.demanded is not None])

    by_set = jax.tree.map(lambda leaf: leaf.reshape(len(lanes), sets, *leaf.shape[1:]), stops)
    return jax.vmap(of_set, in_axes=(0, 1), out_axes=1)(dict(parameters), by_set)


def _of_set(car: _Car, values: Mapping[str, Any]) -> VehicleLoop:
    """The loops of a car with the parameters of a set, scalars."""
    return with_parameters(
        car.loops, {name: jnp.broadcast_to(x, len(car.loops.driver.delay)) for name, x in values.items()}
    )
