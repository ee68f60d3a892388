"""Every controller screened on every car: untuned, tuned on one wheel, tuned on a car."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from absjax.controllers import CONTROLLERS, FOR_CARS
from tuning.cars.car import CarFigures
from tuning.cars.entry import VehicleEntry
from tuning.controllers.config import TuningConfig
from tuning.controllers.recipes import car_sets, tuned_sets
from tuning.core.config import ConfigError, choice
from tuning.core.files import write_csv
from tuning.core.report import Report
from tuning.vehicle.regulation.screening import HELD, SPLIT, UTILISED, Row
from tuning.vehicle.regulation.tasks import cells_of, screening_of

NONE = "no_control"
NAMES = *CONTROLLERS, *FOR_CARS, NONE


def chosen(names: Sequence[str] | None) -> tuple[str, ...]:
    """Names of controllers; all if None.

    Raises:
        ConfigError: if there is no such controller.
    """
    for name in names or ():
        choice("--controllers", name, NAMES)
    return tuple(names or NAMES)


ESTIMATION = {
    "--bias": "accelerometer_bias",
    "--gain": "accelerometer_gain",
    "--slope": "accelerometer_slope",
    "--rolling": "rolling",
}
"""Options on a unit that estimates the speed: the entries of `tuning.cars.entry.VehicleEntry` they are."""


def estimation(
    speed: str | None, located: bool, told: Mapping[str, float | None], errors: bool = False
) -> dict[str, float]:
    """The entries of the options that are given.

    Raises:
        ConfigError: if one is, or the speed is to be estimated, or `--errors` are told, where no unit estimates it.
    """
    given = {option: value for option, value in told.items() if value is not None}
    if speed is None and (given or errors):
        raise ConfigError(f"{', '.join(given) or '--errors'}: of a unit that estimates the speed; needs --speed")
    if speed is not None and located:
        raise ConfigError("--speed: estimated at the ticks of a unit; with --located there is none")
    return {ESTIMATION[option]: value for option, value in given.items()}


def sets_of(controller: str, **entries: Any) -> dict[str, TuningConfig]:
    """The sets that are shipped of a controller, and its defaults, on a car of four wheels; `entries`: of its
    `tuning.cars.entry.VehicleEntry`."""
    found = {"untuned": TuningConfig(controller=controller)}
    if controller in tuned_sets():
        found["tuned"] = tuned_sets()[controller]
    if controller in car_sets():
        found["of the car"] = car_sets()[controller]
    return {
        name: dataclasses.replace(
            config,
            vehicle=VehicleEntry(
                model="four_wheel", sets="one" if config.vehicle is None else config.vehicle.sets, **entries
            ),
        )
        for name, config in found.items()
    }


def study(
    cars: dict[str, CarFigures], controllers: Sequence[str], out: Path, *, located: bool = False, **entries: Any
) -> Iterator[Report]:
    """A table for each controller, a line for each set and car, the worst of both loads; all rows as a file.

    `entries`: as `sets_of` has them.
    """
    every: list[dict[str, Any]] = []
    for controller in controllers:
        lines, sets = [], sets_of(controller, **entries)
        for which, config in sets.items():
            for car, figures in cars.items():
                rows = screening_of(config, car, figures, located=located).rows
                lines.append({"set": which, "observer": config.observer or "-", **line(rows)})
                every += [{"controller": controller, "set": which, **cell} for cell in cells_of(rows)]
        files = [write_csv(every, out / "screening.csv")] if controller == controllers[-1] else []
        yield Report({f"screening of {sets['untuned'].kind.title}": lines}, [], files)


ERRORS: dict[str, dict[str, float]] = {
    "scale 5 % too large": {"accelerometer_gain": 0.05},
    "scale 5 % too small": {"accelerometer_gain": -0.05},
    "a slope of 3 % upwards begins": {"accelerometer_slope": 0.3},
    "a slope of 3 % downwards begins": {"accelerometer_slope": -0.3},
    "turned on by the pedal": {"rolling": 0.0},
}
"""What a unit that estimates the speed is told wrongly, one after the other: entries of `VehicleEntry`."""


def study_of_errors(
    cars: dict[str, CarFigures], controllers: Sequence[str], out: Path, **entries: Any
) -> Iterator[Report]:
    """A table for each controller, a line for each set and each of `ERRORS`, the worst of all cars and both loads; all
    rows as a file."""
    every: list[dict[str, Any]] = []
    for controller in controllers:
        lines, title = [], TuningConfig(controller=controller).kind.title
        for told, error in ERRORS.items():
            for which, config in sets_of(controller, **{**entries, **error}).items():
                screened = {car: screening_of(config, car, figures).rows for car, figures in cars.items()}
                lines.append({"told": told, "set": which, **_of_cars(screened)})
                every += [
                    {"controller": controller, "set": which, "told": told, **cell}
                    for rows in screened.values()
                    for cell in cells_of(rows)
                ]
        files = [write_csv(every, out / "screening.csv")] if controller == controllers[-1] else []
        yield Report({f"{title} told wrongly: the worst of {', '.join(cars)}, unladen and laden": lines}, [], files)


def _of_cars(screened: Mapping[str, Sequence[Row]]) -> dict[str, Any]:
    """What one set reaches on all cars: how many rows each fails, and the worst of some."""
    rows = [row for rows in screened.values() for row in rows]
    return {
        "rows failed": ", ".join(str(sum(row.passed is False for row in rows)) for rows in screened.values()),
        "epsilon": _told(min(_reached(rows, UTILISED)), 2),
        "longest slide [s]": _told(_largest(_reached(rows, "slide")), 2),
        "steerability": _told(min(_reached(rows, "steerability")), 2),
        HELD: _told(min(_reached(rows, HELD)), 2),
    }


def line(rows: Sequence[Row]) -> dict[str, Any]:
    """What one set reaches on one car: of each quantity the worst."""
    splits = [row.reached / row.demanded for row in rows if row.quantity in SPLIT and row.reached and row.demanded]
    return {
        "car": rows[0].car.replace("_", " "),
        "rows failed": sum(row.passed is False for row in rows),
        "narrow": sum(bool(row.passed) and not row.passed_with_margin for row in rows),
        "epsilon high": _told(min(_reached(rows, UTILISED, "high")), 2),
        "epsilon low": _told(min(_reached(rows, UTILISED, "low")), 2),
        "longest lock [s]": _told(_largest(_reached(rows, "lock")), 2),
        "longest slide [s]": _told(_largest(_reached(rows, "slide")), 2),
        "z split over demand": _told(min(splits, default=0.0), 2),
        "steerability": _told(min(_reached(rows, "steerability")), 2),
        HELD: _told(min(_reached(rows, HELD)), 2),
        "steered in 2 s [deg]": _told(_largest(_reached(rows, "steered in 2 s")), 0),
    }


def _reached(rows: Sequence[Row], name: str, surface: str | None = None) -> list[float]:
    """Of the quantities whose names begin so, on a surface or on all; not a number where one never is."""
    mine = [row for row in rows if row.quantity.startswith(name) and surface in (None, row.surface)]
    return [math.nan if row.reached is None else row.reached for row in mine]


def _told(value: float, digits: int) -> str:
    return "undefined" if math.isnan(value) else f"{value:.{digits}f}"


def _largest(values: Sequence[float]) -> float:
    """Not a number where one is none."""
    return math.nan if any(map(math.isnan, values)) else max(values)
