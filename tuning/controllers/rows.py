"""Rows of a tuning problem: a road, a speed, a pedal and a vehicle each."""

from typing import Any, NamedTuple

from absjax.plant.wheel import GRAVITY
from tuning.controllers import published
from tuning.controllers.config import TuningConfig
from tuning.core.roads import changes_along, least_peak, name_of, speeds_of


class Row(NamedTuple):
    """A road, a speed and a pedal, and where there are vehicles which of them."""

    road: Any
    speed_kmh: float
    pedal_rate: float
    """bar/s"""
    which: int = 0
    """of the vehicles of the configuration"""

    @property
    def name(self) -> str:
        """Of the road."""
        return name_of(self.road)

    @property
    def speed(self) -> float:
        """m/s"""
        return self.speed_kmh / 3.6

    @property
    def longest_ideal(self) -> float:
        """Time the ideal stop would take on the worst surface of the road [s]."""
        return self.speed / (GRAVITY * least_peak(self.road))

    @property
    def published_ideal(self) -> float | None:
        """v0^2 / (2 g mu_max) [m]; None on a road that changes."""
        if changes_along(self.road):
            return None
        return self.speed**2 / (2 * GRAVITY * least_peak(self.road))

    def published(self, controller: str) -> float | None:
        """The published distance [m]: of that controller if there is one, else of the five-phase algorithm."""
        found = published.DISTANCES.get(self.name, {}).get(self.speed_kmh)
        return None if found is None else getattr(found, controller, found.five_phase)


def rows_of(config: TuningConfig) -> list[Row]:
    """The rows of a configuration, the longest stops last."""
    rows = [
        Row(road, speed, pedal, which)
        for road in config.roads
        for speed in speeds_of(road, config.speeds_kmh)
        for pedal in pedals(config, speed)
        for which in range(1 if config.vehicle is None else len(config.vehicle.each))
    ]
    return sorted(rows, key=lambda row: row.longest_ideal)


def pedals(config: TuningConfig, speed_kmh: float) -> tuple[float, ...]:
    """Pressure rates of the driver [bar/s] under which a speed [km/h] is braked."""
    strength = config.pedal_strength
    return (config.pedal_rate,) if strength is None else (config.pedal_rate, strength * 3.6 / speed_kmh)
