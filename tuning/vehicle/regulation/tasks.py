"""The command on the regulation: a controller set on cars, screened, with its table and figures."""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from absjax.controllers import PREDICTIVE
from tuning.cars.car import CarFigures, name_of_car, shipped_cars
from tuning.controllers.config import TuningConfig
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.regulation import clocked, limits_of, loops_on
from tuning.core.config import ConfigError, choice
from tuning.core.figures import save
from tuning.core.files import write_csv
from tuning.core.report import Report
from tuning.core.version import VERSION
from tuning.vehicle.regulation.figures import stops_figure
from tuning.vehicle.regulation.screening import Row, Screened, screened

OWN = "own"
"""The cars of the configuration, among the names of cars."""


def cars_of(config: TuningConfig, names: Sequence[str] | None) -> dict[str, CarFigures]:
    """Cars by name: those named, of which `OWN` are those of the configuration; without names these, or where it has
    none all that are shipped.

    Raises:
        ConfigError: if there is no such car.
    """
    known, own = dict(shipped_cars()), () if config.vehicle is None else config.vehicle.cars
    names = ((OWN,) if own else tuple(known)) if names is None else names
    found: dict[str, CarFigures] = {}
    for name in names:
        choice("--cars", name, (*known, *((OWN,) if own else ())))
        found |= _called(own) if name == OWN else {name: known[name]}
    return found


def _called(cars: Sequence[CarFigures]) -> dict[str, CarFigures]:
    """Cars by their names; where several have one they are numbered."""
    names = [name_of_car(car) for car in cars]
    numbered = [f"{n} {i + 1}" if names.count(n) > 1 else n for i, n in enumerate(names)]
    return dict(zip(numbered, cars))


def shipped_set(name: str) -> TuningConfig:
    """The shipped tuned set of a controller; of one that has none, its defaults.

    Raises:
        ConfigError: if there is no such controller.
    """
    return tuned_sets().get(name) or TuningConfig(controller=name)


def screening_of(config: TuningConfig, car: str, figures: CarFigures, *, located: bool = False) -> Screened:
    """A set on a car, sampled as the configuration has it or with switchings located."""
    setup, loops = loops_on(config, figures)
    return screened(car, figures, loops, clocked(setup, located), limits_of(config))


def regulation(
    config: TuningConfig, cars: dict[str, CarFigures], out: Path, *, located: bool = False
) -> Iterator[Report]:
    """A report for each car, the last with what all of them say together."""
    rows: list[Row] = []
    for i, (car, figures) in enumerate(cars.items()):
        found = screening_of(config, car, figures, located=located)
        rows += found.rows
        files = [save(stops_figure(found, f"{config.kind.title}, {car}".replace("_", " ")), out / f"{car}.png")]
        results = {}
        if i == len(cars) - 1:
            written = {"version": VERSION, "config": config.to_json(), "located": located}
            written["rows"] = [dataclasses.asdict(row) for row in rows]
            files.append(write_csv(cells_of(rows), out / "screening.csv"))
            results = {out / "result.json": written}
        word, reasons = verdict(found.rows)
        tables = {f"screening of {car}: {config.kind.title}": cells_of(found.rows)}
        yield Report(tables, [], files, verdict=word, reasons=reasons, results=results)


def verdict(rows: Sequence[Row]) -> tuple[str, list[str]]:
    """Of a car: a verdict, and the rows that speak against it."""
    car = rows[0].car.replace("_", " ")
    failed = [row for row in rows if row.passed is False]
    narrow = [row for row in rows if row.passed and not row.passed_with_margin]
    reasons = [f"{car}: {len(failed)} of {len(rows)} rows failed: {', '.join(map(_row, failed))}"] if failed else []
    if narrow:
        reasons.append(f"{car}: not by 5 %: {', '.join(map(_row, narrow))}")
    if failed:
        return f"rows failed, {car}", reasons
    return f"every row passed{', not each by 5 %' if narrow else ''}, {car}", reasons


def _row(row: Row) -> str:
    return f"{row.quantity.split(' [')[0]} ({row.surface}, {row.load})"


def cells_of(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Rows as they are written in tables."""
    said = {True: "yes", False: "no", None: "-"}

    def number(value: float | None, missing: str) -> str:
        return missing if value is None else f"{value:.3f}"

    return [
        {
            "car": row.car,
            "load": row.load,
            "surface": row.surface,
            "quantity": row.quantity,
            "demanded": number(row.demanded, "-"),
            "reached": number(row.reached, "never"),
            "margin [%]": "-" if row.margin is None else f"{100 * row.margin:.1f}",
            "passed": said[row.passed],
            "with 5 %": said[row.passed_with_margin],
            "note": row.note,
        }
        for row in rows
    ]


def config_of(data: Any, controller: str | None) -> TuningConfig:
    """The set to screen: of a file, or a shipped one by the name of its controller.

    Raises:
        ConfigError: if neither is given, or both are; or the entry that cannot be used.
    """
    if (data is None) == (controller is None):
        raise ConfigError("one of --config and --controller is needed: a result or configuration, or a shipped set")
    if controller in PREDICTIVE:
        raise ConfigError(f"--controller: {controller} predicts over a delay, for one wheel, not for a car")
    return TuningConfig.from_json(data) if controller is None else shipped_set(controller)
