"""The car's own quantities, of which a log says something beside the road: what is known of them before, and after."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from absjax.plant.wheel import Wheel

Z95 = 1.959963984540054


@dataclasses.dataclass(frozen=True)
class Kind:
    """A quantity a log may tell: unit, how well it is known where nobody says, and what is not worth a word."""

    unit: str
    nominal: float | None
    """None: as in the wheel"""
    spread: float
    """standard deviation before the log is seen, where the car file has none; of what `relative` says"""
    tolerance: float
    """departure from what was known that is not worth a word"""
    relative: bool = False
    """whether spread and tolerance are shares of the value"""
    low: float = -math.inf
    wheel: bool = False
    """whether it is a field of `Wheel`"""


KINDS: dict[str, Kind] = {
    "radius": Kind("m", None, 0.03, 0.007, relative=True, low=1e-3, wheel=True),
    "inertia": Kind("kg m^2", None, 0.3, 0.15, relative=True, low=1e-3, wheel=True),
    "brake_efficiency": Kind("N m/bar", None, 0.5, 0.08, relative=True, low=1e-3, wheel=True),
    "load": Kind("N", None, 0.0, 0.0, relative=True, low=1.0, wheel=True),
    "pressure_zero": Kind("bar", 0.0, 10.0, 1.5),
    "pressure_lag": Kind("s", 0.0, 0.01, 1.5e-3, low=0.0),
    "speed_delay": Kind("s", 0.0, 0.1, 8e-3),
    "load_lag": Kind("s", 0.0, 0.1, 0.15, low=0.0),
    "acceleration_bias": Kind("m/s^2", 0.0, 0.3, 0.3),
    "slope": Kind("rad", 0.0, 0.05, 0.03),
    "force_zero": Kind("N", 0.0, 300.0, 50.0),
}
"""By name. What a log cannot tell stays as it is known: a rig without measured force has only the ratio of brake
efficiency and load to friction, a stop only ratios to the load."""


@dataclasses.dataclass(frozen=True)
class Prior:
    """What is known of a quantity before the log is seen."""

    value: float
    spread: float
    """standard deviation; 0: fixed"""
    stated: bool
    """whether the car file gives the standard deviation"""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """What a quantity turned out to be.

    Attributes:
        value, spread: estimate and standard deviation; 0 where it was fixed.
        given, given_spread: before.
        unit: of all of them.
    """

    value: float
    spread: float
    given: float
    given_spread: float
    unit: str

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - Z95 * self.spread, self.value + Z95 * self.spread


def priors_of(wheel: Wheel, spreads: Mapping[str, float], values: Mapping[str, float]) -> dict[str, Prior]:
    """What is known of every quantity.

    Args:
        wheel: with the values of those that are its fields.
        spreads: standard deviations where they are given, in the quantity's unit.
        values: of the quantities that are not the wheel's, where they are given.
    """
    priors = {}
    for name, kind in KINDS.items():
        value = float(getattr(wheel, name)) if kind.wheel else float(values.get(name, kind.nominal or 0.0))
        spread = spreads.get(name, kind.spread * (abs(value) if kind.relative else 1.0))
        priors[name] = Prior(value, float(spread), name in spreads)
    return priors


def departures(quantities: Mapping[str, Quantity], priors: Mapping[str, Prior]) -> list[str]:
    """A sentence for every quantity that the log has elsewhere than it was known to be."""
    said = []
    for name, found in quantities.items():
        kind, prior = KINDS[name], priors[name]
        apart = abs(found.value - prior.value)
        if prior.stated:
            worth = apart > 3 * math.hypot(prior.spread, found.spread)
        else:
            tolerance = kind.tolerance * (abs(prior.value) if kind.relative else 1.0)
            worth = apart > max(tolerance, 3 * found.spread)
        if worth and prior.spread > 0:
            words = name.replace("_", " ")
            said.append(
                f"{words}: known as {prior.value:.4g} {kind.unit}, the log has {found.value:.4g} +- "
                f"{Z95 * found.spread:.2g} {kind.unit}; the log's was used{hint(name, found.value, prior.value)}"
            )
    return said


def hint(name: str, found: float, known: float) -> str:
    """What a common mistake would make of it, where that is what is seen."""
    ratio = found / known if known else np.inf
    factors: dict[str, Any] = {
        "brake_efficiency": ((10.0, "pressure in MPa"), (14.5, "pressure in ksi"), (0.1, "another unit of pressure")),
        "radius": ((1 / 3.6 / known if known else 0.0, "wheel speed as rim speed in km/h"),),
    }
    for factor, what in factors.get(name, ()):
        if abs(math.log(max(ratio, 1e-9) / factor)) < 0.05 and factor > 0:
            return f" ({what}?)"
    return ""
