"""The study of whole vehicles: the published scenario, distances of cars, split mu, and what channels cost."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from absjax.controllers.five_phase import FivePhase
from absjax.speed import KalmanSpeed
from absjax.speed.base import SpeedEstimator
from tuning.cars.entry import of_axle
from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.core.figures import save
from tuning.core.report import Report
from tuning.vehicle import figures
from tuning.vehicle.distances import car_sets, distances
from tuning.vehicle.scenario import Ride, figures_of, ride, scenario_loop

TRUSTING = {"below": 50.0, "above": 50.0, "deviation": 500.0}
"""Gates so wide that the filter trusts a wheel while it slips: what the published error is made of."""
FILTERS: dict[str, SpeedEstimator | None] = {
    "true speed": None,
    "both axles": KalmanSpeed(),
    "front axle": KalmanSpeed(wheels=1),
    "front axle, trusted while it slips": KalmanSpeed(wheels=1, **TRUSTING),
}


def study(out: Path) -> Iterator[Report]:
    """Every table and figure of whole vehicles."""
    yield scenario(out)
    for name in ("mid_size",):
        yield cars(name)


def scenario(out: Path) -> Report:
    """Figs 3.15 to 3.19 of the source, with several filters of the speed."""
    sets = car_sets()["five_phase"]
    controllers = tuple(FivePhase(**of_axle(sets, axle)) for axle in range(2))
    loop = scenario_loop(controllers)
    rides: dict[str, Ride] = {name: ride(loop, estimator) for name, estimator in FILTERS.items()}
    rows: list[dict[str, Any]] = [
        {"filter": name, "axle": axle, **figures_of(found, i)}
        for name, found in rides.items()
        for i, axle in enumerate(figures.AXLES)
    ]
    told = rides["front axle"]
    files = [
        save(figures.speed_figure({n: r for n, r in rides.items() if FILTERS[n] is not None}), out / "speed.png"),
        save(figures.pressure_figure(told), out / "pressure.png"),
        save(figures.load_figure(told), out / "load.png"),
        save(figures.stiffness_figure(told, from_truth=True), out / "stiffness_compared.png"),
        save(figures.stiffness_figure(told, from_truth=False), out / "stiffness.png"),
    ]
    return Report({"published scenario: estimates while the controllers act": rows}, [], files)


def cars(car: str) -> Report:
    """Distances of a car over its ideal, every controller."""
    rows = [found.row() for found in distances(car, ROADS, SPEEDS_KMH)]
    return Report({f"distances {car}: from the pedal to 15 km/h, over the ideal of the car": rows}, [], [])
