"""A car from a file: wheel, load and brake as JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from absjax.parameters import bounds_of
from absjax.plant.wheel import Wheel
from tuning.core.components import built
from tuning.core.config import ConfigError, Values, choice, said
from tuning.core.files import read_json

ALIASES = {"wheel_inertia": "inertia"}
BESIDE = ("name", "source", "comment", "mass", "brake_lag", "surface_start", "burckhardt", "ecu", "noise")
"""What a file may say beside: where it comes from, and the truth of a simulated log."""
_VALUES = TypeAdapter(Values)


class CarError(ValueError):
    """A car description that cannot be used; the message names file and entry."""


def wheel_from(description: Any, name: str = "car") -> Wheel:
    """A wheel from a dictionary with some of inertia (or wheel_inertia), radius, load, brake_efficiency.

    Raises:
        CarError: if an entry is unknown, stands twice, or its value is not admissible.
    """
    if not isinstance(description, Mapping):
        raise CarError(f"{name}: a car is a dictionary, not {type(description).__name__}")
    known = (*bounds_of(Wheel), *ALIASES)
    values: dict[str, Any] = {}
    try:
        for key, value in description.items():
            choice("car", key, (*known, *BESIDE))
            field = str(ALIASES.get(key, key))
            if field in values:
                raise ConfigError(f"{key} and {field} are the same entry")
            if key in known:
                values[field] = value
        return built("car", Wheel, _VALUES.validate_python(values))
    except ValidationError as error:
        raise CarError(f"{name}: {said(error)}") from None
    except ConfigError as error:
        raise CarError(f"{name}: {error}") from None


def read_car(path: Path) -> Wheel:
    """A wheel from a JSON file.

    Raises:
        ValueError: if the file is missing, not JSON, or an entry is not admissible.
    """
    return wheel_from(read_json(path), str(path))


def car_of(log: Path, car: Path | None) -> Path | None:
    """The car file of a log: the one given, else the JSON file of the log's name beside it, if there is one."""
    beside = log.with_suffix(".json")
    return beside if car is None and beside.is_file() else car
