"""A car from a file: wheel, load and brake as JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from absjax.parameters import bounds_of
from absjax.plant.wheel import Wheel
from tuning.core.files import read_json

ALIASES = {"wheel_inertia": "inertia"}


class CarError(ValueError):
    """A car description that cannot be used; the message names file and entry."""


def wheel_from(description: Mapping[str, Any], name: str = "car") -> Wheel:
    """A wheel from a dictionary with some of inertia (or wheel_inertia), radius, load, brake_efficiency.

    Other entries are left alone: a car file may say more than this project asks.

    Raises:
        CarError: if a value is not admissible.
    """
    if not isinstance(description, Mapping):
        raise CarError(f"{name}: a car is a dictionary, not {type(description).__name__}")
    fields = bounds_of(Wheel)
    known = {ALIASES.get(key, key): value for key, value in description.items() if ALIASES.get(key, key) in fields}
    try:
        return Wheel(**{key: float(value) for key, value in known.items()})
    except (TypeError, ValueError) as error:
        raise CarError(f"{name}: {error}") from None


def read_car(path: Path) -> Wheel:
    """A wheel from a JSON file.

    Raises:
        ValueError: if the file is missing, not JSON, or a value is not admissible.
    """
    return wheel_from(read_json(path), str(path))


def car_of(log: Path, car: Path | None) -> Path | None:
    """The car file of a log: the one given, else the JSON file of the log's name beside it, if there is one."""
    beside = log.with_suffix(".json")
    return beside if car is None and beside.is_file() else car
