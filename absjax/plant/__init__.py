"""What is braked: wheels, roads, vehicles, and the brake actuator."""

from absjax.plant.base import Plant
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.test_rig import TestRig

PLANTS: dict[str, type[Plant]] = {
    "quarter_car": QuarterCar,
    "test_rig": TestRig,
}
"""By name."""
