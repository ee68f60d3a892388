"""The stops of a screening: what is struck from which speed on which road (5.2 and 5.3 of the Annex)."""

from typing import NamedTuple

from absjax.loop.driver import Driver
from absjax.plant.wheel import GRAVITY
from tuning.core.roads import NEVER
from tuning.vehicle.regulation.quantities import KMH
from tuning.vehicle.regulation.surfaces import Side, surfaces

HIGH, LOW = ("high", "high"), ("low", "low")
END = 14.0
"""Speed that ends a stop, km/h: below 15 km/h wheels may lock."""
REPEATED = 55.0, 55.4, 55.8
"""Initial speeds of the three tests of z_AL, km/h: anti-lock is at another point of its cycle in each."""
RUN_UP = 15.0
"""By how much a stop that passes to another surface begins faster, for anti-lock to cycle when it does, km/h."""
FULL_BRAKING = 0.1
"""Time from the foot's touch that is lost until the wheels use the road, s."""
USED = 0.9
"""Share of the peak by which a passage is reckoned ahead."""


class Manoeuvre(NamedTuple):
    """A stop from a speed."""

    name: str
    """what it is for: utilisation, struck, passage, rise, split"""
    surface: str
    """for tables"""
    speed: float
    """initial, km/h"""
    left: Side
    right: Side
    change: float = NEVER
    """where the second surface begins, m"""
    at: float = 0.0
    """the speed that the regulation names, km/h"""


def manoeuvres(driver: Driver) -> list[Manoeuvre]:
    """All stops of a screening, the longest last."""
    found = []
    for name, side in (("high", HIGH), ("low", LOW)):
        found += [Manoeuvre("utilisation", name, speed, side, side, at=55.0) for speed in REPEATED]
        found += [Manoeuvre("struck", name, speed, side, side, at=speed) for speed in (40.0, 120.0)]
    for speed in (40.0, 120.0):
        found.append(_passing("passage", "high to low", "high", speed, driver))
    found.append(_passing("rise", "low to high", "low", 50.0, driver))
    found.append(Manoeuvre("split", "split", 50.0, HIGH, LOW, at=50.0))
    return sorted(found, key=lambda stop: stop.speed / (1.0 if stop.surface == "high" else 0.3))


def _passing(name: str, surface: str, first: str, at: float, driver: Driver) -> Manoeuvre:
    """A stop that is at a speed [km/h] where the surface changes, as far as can be told before."""
    run_up = RUN_UP if first == "high" else 0.4 * RUN_UP
    begin = at + run_up
    deceleration = USED * float(surfaces()[first].peak().friction) * GRAVITY
    change = KMH * begin * (driver.delay + FULL_BRAKING) + KMH**2 * (begin**2 - at**2) / (2 * deceleration)
    side = (first, "low" if first == "high" else "high")
    return Manoeuvre(name, surface, begin, side, side, change, at)
