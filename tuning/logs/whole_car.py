"""A car on four wheels from a file: geometry, mass and driven axle as JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from absjax.sideslip.car import Car
from tuning.core.components import built
from tuning.core.config import ConfigError, Values, choice, said
from tuning.core.files import read_json
from tuning.logs.car import CarError

ENTRIES = {
    "mass_kg": "mass",
    "yaw_inertia_kg_m2": "yaw_inertia",
    "cg_to_front_m": "to_front",
    "cg_to_rear_m": "to_rear",
    "track_front_m": "track_front",
    "track_rear_m": "track_rear",
    "cg_height_m": "height",
    "wheel_radius_m": "radius",
}
"""Entry of the file, and field of `absjax.sideslip.car.Car`."""
DRIVEN = {"front": (1.0, 0.0), "rear": (0.0, 1.0), "all": (1.0, 1.0)}
BESIDE = ("name", "source", "comment", "axes", "sensors", "reference", "sprung_mass_kg")
"""What a file may say beside."""
_VALUES = TypeAdapter(Values)


def whole_car_from(description: Any, name: str = "car") -> Car:
    """A car from a dictionary: `ENTRIES`, by themselves or under `car`, and `driven`: front, rear or all.

    Raises:
        CarError: if an entry is missing or unknown, or its value is not admissible.
    """
    if not isinstance(description, Mapping):
        raise CarError(f"{name}: a car is a dictionary, not {type(description).__name__}")
    inner = description.get("car", {})
    if not isinstance(inner, Mapping):
        raise CarError(f"{name}: car is a dictionary, not {type(inner).__name__}")
    entries = {**{key: value for key, value in description.items() if key != "car"}, **inner}
    try:
        for key in entries:
            choice("car", key, (*ENTRIES, "driven", *BESIDE))
        missing = [key for key in (*ENTRIES, "driven") if key not in entries]
        if missing:
            raise ConfigError(f"car: no {', '.join(missing)}")
        choice("driven", entries["driven"], DRIVEN)
        values = _VALUES.validate_python({field: entries[key] for key, field in ENTRIES.items()})
        front, rear = DRIVEN[entries["driven"]]
        return built("car", Car, {**values, "driven_front": front, "driven_rear": rear})
    except ValidationError as error:
        raise CarError(f"{name}: {said(error)}") from None
    except ConfigError as error:
        raise CarError(f"{name}: {error}") from None


def read_whole_car(path: Path) -> Car:
    """A car from a JSON file.

    Raises:
        ValueError: if the file is missing, not JSON, or an entry is not admissible.
    """
    return whole_car_from(read_json(path), str(path))
