"""What a car file states of zeros and delays of a log's channels, as the checks before any fit take it.

A zero counts as it is stated, and within `SURE` of its standard deviations, where that is stated too.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from tuning.logs.quantities import Prior

ZEROS = {"brake_pressure": "pressure_zero", "acceleration": "acceleration_bias", "force": "force_zero"}
"""By signal, the quantity that its zero is."""
SURE = 3.0
Stated = Mapping[str, Prior]
"""Quantities of `tuning.logs.quantities.KINDS` that a car file gives; `tuning.logs.car.Car.stated`."""
NOTHING: Stated = MappingProxyType({})


class Zero(NamedTuple):
    """What a signal shows where there is nothing, in its unit, and how far it may be off that."""

    value: float
    within: float


AT_ZERO = Zero(0.0, 0.0)


def zero_of(signal: str, stated: Stated) -> Zero:
    """The zero of a signal; 0 and within nothing where nobody says."""
    name = ZEROS.get(signal)
    return AT_ZERO if name is None or name not in stated else Zero(stated[name].value, within(name, stated))


def within(name: str, stated: Stated) -> float:
    """How far a quantity may be off what is stated of it, in its unit; 0 where that is not stated."""
    prior = stated.get(name)
    return SURE * prior.spread if prior is not None and prior.stated else 0.0
