"""A set of parameters on the stops of the regulation: what tuners are charged for, and commands report.

Each stop is rolled out in a sampled control unit as the configuration has it, on four wheels, unladen and laden.
Adhesion does not depend on the set: it is measured once.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.loop.vehicle_loop import VehicleLoop
from tuning.cars.car import CarFigures
from tuning.cars.entry import VehicleEntry
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import with_parameters
from tuning.controllers.setup import Setup
from tuning.vehicle.regulation.lanes import Clocked, lanes_of, loops_of, run
from tuning.vehicle.regulation.screening import LOADS, Quantity, Turning, adhesions_of, all_quantities, row_of

USUAL: dict[str, Any] = {"model": "four_wheel", "wiring": "select_low_rear"}
FINALISTS = 8
"""Sets that are screened in a generation."""


def on_car(config: TuningConfig, figures: CarFigures, *, laden: bool) -> Setup:
    """The setup of a set on a car of four wheels, all else as the configuration has it; without a vehicle there, it is
    wired as cars are, with select-low behind.

    Raises:
        ConfigError: if it cannot be: names what.
    """
    entry = VehicleEntry(**USUAL) if config.vehicle is None else config.vehicle
    vehicle = dataclasses.replace(entry, car=figures, model="four_wheel", laden=laden)
    one_wheel = {"plant": "quarter_car", "plant_parameters": {}, "wheel": {}}
    free = {"largest_contraction": None, "reference": "ideal"}
    return Setup.of(dataclasses.replace(config, vehicle=vehicle, **one_wheel, **free))


def turning_of(config: TuningConfig) -> Turning:
    """The limits of a configuration's vehicle on the split road."""
    vehicle = config.vehicle
    return Turning() if vehicle is None else Turning(vehicle.largest_yaw_rate, vehicle.largest_side_slip)


def clocked(setup: Setup, located: bool = False) -> Clocked:
    """What is rolled out of a loop: sampled, or with switchings located."""

    def system(loop: VehicleLoop) -> tuple[Any, float]:
        return (loop, setup.step) if located else setup.sampled(loop)

    return system


def regulation_of(config: TuningConfig) -> "Regulation | None":
    """What a configuration's sets have to pass, if they have to."""
    return Regulation(config) if config.vehicle is not None and config.vehicle.regulation else None


class Regulation:
    """The rows of a configuration's vehicle as functions of a parameter set."""

    def __init__(self, config: TuningConfig, *, located: bool = False):
        (figures,) = config.vehicle.cars
        setups = {laden: on_car(config, figures, laden=laden) for laden in LOADS}
        loops: dict[bool, Any] = {laden: setup.loop_of() for laden, setup in setups.items()}
        self._lanes, self._known = lanes_of(setups[False].driver), adhesions_of(figures)
        self._turning = turning_of(config)
        self._loops, self._clocked = loops_of(loops, self._lanes), clocked(setups[False], located)
        self._margins = jax.jit(self.margins)

    def quantities(self, values: Mapping[str, Any]) -> list[tuple[bool, Quantity]]:
        """Of the parameters by name, scalars: (laden, quantity)."""
        own = {name: jnp.broadcast_to(value, len(self._lanes)) for name, value in values.items()}
        loops = with_parameters(self._loops, own)
        return all_quantities(loops, self._lanes, run(loops, self._lanes, self._clocked), self._known, self._turning)

    def margins(self, values: Mapping[str, Any]):
        """How far each row is on the right side, as a share of what it demands, (rows,); differentiable."""
        rows = [quantity for _, quantity in self.quantities(values) if quantity.demanded is not None]
        return jnp.stack([quantity.margin for quantity in rows])

    def breaches(self, parameters: Mapping[str, Any]) -> np.ndarray:
        """By how much sets (sets,) are on the wrong side, over all rows, each at most by what it demands; 0: none."""
        sets = np.stack(list(parameters.values()), axis=1)
        margins = np.array([self._margins(dict(zip(parameters, map(float, one)))) for one in sets])
        return np.clip(-margins, 0.0, 1.0).sum(axis=1)

    def judged(self, costs: np.ndarray, parameters: Mapping[str, Any], charge: float) -> np.ndarray:
        """Costs (sets,) of which the best few are charged for what they breach, and the others are out."""
        best = np.argsort(costs)[:FINALISTS]
        breached = self.breaches({name: values[best] for name, values in parameters.items()})
        charged = costs + 2 * charge
        charged[best] = costs[best] + breached + charge * (breached > 0)
        return charged

    def warnings(self, values: Mapping[str, Any]) -> list[str]:
        """A sentence for every row that is breached."""
        rows = [row_of("", laden, quantity) for laden, quantity in self.quantities(values)]
        return [
            f"regulation: {row.quantity} ({row.surface}, {row.load}) is breached: demanded {row.demanded:.3g}, reached "
            f"{'never' if row.reached is None else format(row.reached, '.3g')}"
            for row in rows
            if row.passed is False
        ]
