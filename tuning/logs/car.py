"""A car from a file: wheel, load and brake as JSON, and how well each is known.

A value is a number, or `{"value": 0.3, "sd": 0.002}` with its standard deviation; `"sd": 0` is certain. Beside the
wheel's there may be the quantities of `tuning.logs.quantities`, and where the load changes while braking, where the
centre of gravity lies: `wheelbase`, `cg_height`, `cg_to_front` [m] and the wheel's `axle`, "front" or "rear".
"""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from absjax.parameters import bounds_of
from absjax.plant.wheel import GRAVITY, Wheel
from tuning.core.components import built
from tuning.core.config import ConfigError, Values, choice, said
from tuning.core.files import read_json
from tuning.logs.quantities import KINDS, Prior, priors_of

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


@dataclasses.dataclass(frozen=True)
class Axle:
    """Where the centre of gravity lies, as seen from a wheel's axle."""

    cg_height: float
    """m"""
    to_other: float
    """distance of the centre of gravity from the other axle, m"""
    front: bool

    def load_share(self, acceleration):
        """Load over that at rest, 1 -+ h a / (g l) with l to the other axle, (samples,); a < 0 while braking [m/s^2].

        Source: Aguado-Rojas 2019, eq. (3.36), both sides alike.
        """
        moved = self.cg_height * acceleration / (GRAVITY * self.to_other)
        return 1 - moved if self.front else 1 + moved


@dataclasses.dataclass(frozen=True)
class Car:
    """What is known of a car before a log of it is seen."""

    wheel: Wheel = dataclasses.field(default_factory=Wheel)
    spreads: Mapping[str, float] = dataclasses.field(default_factory=dict)
    """standard deviations, where they are given"""
    values: Mapping[str, float] = dataclasses.field(default_factory=dict)
    """of quantities that are not the wheel's, where they are given"""
    axle: Axle | None = None

    @classmethod
    def of(cls, car: "Car | Wheel | None") -> "Car":
        """A car of a wheel alone, or of nothing at all."""
        return car if isinstance(car, Car) else cls(Wheel() if car is None else car)

    @property
    def priors(self) -> dict[str, Prior]:
        """What is known of every quantity."""
        return priors_of(self.wheel, self.spreads, self.values)

    @property
    def stated(self) -> dict[str, Prior]:
        """What the file says of zeros and delays, and of what it says how well it is known."""
        return {name: prior for name, prior in self.priors.items() if name in self.values or name in self.spreads}


PLACES = ("wheelbase", "cg_height", "cg_to_front")


def car_from(description: Any, name: str = "car") -> Car:
    """A car from a dictionary: entries of a wheel, of `tuning.logs.quantities.KINDS`, and of its axle.

    Raises:
        CarError: if an entry is unknown, stands twice, or its value is not admissible.
    """
    if not isinstance(description, Mapping):
        raise CarError(f"{name}: a car is a dictionary, not {type(description).__name__}")
    of_wheel, values, spreads = {}, {}, {}
    for key, entry in description.items():
        quantity = ALIASES.get(str(key), str(key))
        if quantity in KINDS and isinstance(entry, Mapping):
            value, spread = _known(entry, f"{name}: {key}")
            if spread is not None:
                spreads[quantity] = spread
            entry = value
        if quantity in KINDS and not KINDS[quantity].wheel:
            values[quantity] = _number(entry, f"{name}: {key}")
        elif key not in (*PLACES, "axle"):
            of_wheel[key] = entry
    return Car(wheel_from(of_wheel, name), spreads, values, _axle(description, name))


def _number(value: Any, where: str, low: float = -math.inf) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not low <= value < math.inf:
        raise CarError(f"{where} = {value!r} must be a finite number" + (f" >= {low:g}" if low > -math.inf else ""))
    return float(value)


def _known(entry: Mapping[str, Any], where: str) -> tuple[float, float | None]:
    strange = set(entry) - {"value", "sd"}
    if strange or "value" not in entry:
        raise CarError(f"{where} has 'value' and perhaps 'sd', not {', '.join(map(repr, entry)) or 'nothing'}")
    spread = _number(entry["sd"], f"{where}: sd", 0.0) if "sd" in entry else None
    return _number(entry["value"], f"{where}: value"), spread


def _axle(description: Mapping[str, Any], name: str) -> Axle | None:
    given = [key for key in (*PLACES, "axle") if key in description]
    if not given:
        return None
    for key in (*PLACES, "axle"):
        if key not in description:
            raise CarError(f"{name}: {given[0]} without {key}; load transfer needs {', '.join(PLACES)} and axle")
    wheelbase, height, to_front = (_number(description[key], f"{name}: {key}", 0.0) for key in PLACES)
    if description["axle"] not in ("front", "rear"):
        raise CarError(f"{name}: axle = {description['axle']!r} must be 'front' or 'rear'")
    if not 0 < to_front < wheelbase:
        raise CarError(f"{name}: cg_to_front = {to_front:g} must be between 0 and the wheelbase, {wheelbase:g}")
    front = description["axle"] == "front"
    return Axle(height, wheelbase - to_front if front else to_front, front)


def read_car(path: Path) -> Car:
    """A car from a JSON file.

    Raises:
        ValueError: if the file is missing, not JSON, or an entry is not admissible.
    """
    return car_from(read_json(path), str(path))


def car_of(log: Path, car: Path | None) -> Path | None:
    """The car file of a log: the one given, else the JSON file of the log's name beside it, if there is one."""
    beside = log.with_suffix(".json")
    return beside if car is None and beside.is_file() else car
