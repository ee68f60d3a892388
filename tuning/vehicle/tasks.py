"""The study of whole vehicles: the published scenario, distances of cars, split mu, and what channels cost."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from absjax.controllers.five_phase import FivePhase
from absjax.speed import KalmanSpeed
from absjax.speed.base import SpeedEstimator
from tuning.cars.car import shipped_cars
from tuning.cars.entry import of_axle
from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.controllers.recipes import car_sets
from tuning.core.figures import save
from tuning.core.report import Report
from tuning.vehicle import figures
from tuning.vehicle.distances import CHANGING, FURTHER, Found, distances, drawn, together
from tuning.vehicle.scenario import Ride, figures_of, ride, rides_told, scenario_loop

UNBIASED = {"bias_drift": 1e-4, "bias_deviation": 0.05, "rim_noise": 1.0}
"""Of a filter that hardly believes in a bias of its accelerometer: it coasts on one of 0.5 m/s^2."""
FILTERS: dict[str, SpeedEstimator | None] = {
    "true speed": None,
    "both axles": KalmanSpeed(),
    "front axle": KalmanSpeed(wheels=1),
    "front axle, no bias": KalmanSpeed(wheels=1, **UNBIASED),
}

SCATTERED: dict[str, Any] = {
    "setting": "sampled",
    "checked": 4,
    "seed": 1,
    "vehicle": {"speed": "kalman", "accelerometer_gain": 0.03, "accelerometer_slope": 0.15},
}
"""Conditions of drawn stops besides those of `tuning.controllers.config.Scatter`: bias, error of scale and slope are
normal."""
ON_CHANGING = "five_phase", "slip", "rolling_slip"
"""Controllers with a set of three cars, which are judged on roads that change as well."""


def study(out: Path) -> Iterator[Report]:
    """Every table and figure of whole vehicles."""
    yield scenario(out)
    cars = tuple(shipped_cars())
    yield _over_ideal("distances", distances(cars, ROADS, SPEEDS_KMH))
    yield _over_ideal("roads that change", distances(cars, CHANGING, SPEEDS_KMH, ON_CHANGING))
    yield _over_ideal("further roads that change", distances(cars, FURTHER, SPEEDS_KMH, ON_CHANGING))
    every = *ROADS, *CHANGING, *FURTHER
    yield _over_ideal("all roads drawn", distances(cars, every, SPEEDS_KMH, ON_CHANGING, drawn, **SCATTERED))


def scenario(out: Path) -> Report:
    """Figs 3.15 to 3.19 of the source, with several filters of the speed."""
    sets = car_sets()["five_phase"].start
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
    told_of = rides_told(loop, KalmanSpeed(wheels=1))
    lengths = [
        {"told of the relaxation length": name, "axle": axle, **figures_of(found, i)}
        for name, found in told_of.items()
        for i, axle in enumerate(figures.AXLES)
    ]
    tables = {
        "published scenario: estimates while the controllers act": rows,
        "observers told a share of the relaxation length, published scenario": lengths,
    }
    return Report(tables, [], files)


def _over_ideal(what: str, found: Sequence[Found]) -> Report:
    """A table for each vehicle, and one of all together."""
    found = [*found, *together(found)]
    vehicles = dict.fromkeys(one.vehicle for one in found)
    tables = {
        f"{what} {vehicle}: from the pedal to 15 km/h, over the ideal of the car": [
            one.row() for one in found if one.vehicle == vehicle
        ]
        for vehicle in vehicles
    }
    return Report(tables, [], [])
