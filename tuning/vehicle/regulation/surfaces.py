"""The two surfaces of the regulation: one of about 0.8, one of 0.3 or less; and roads of both under four wheels."""

import dataclasses
import functools
from typing import Any

from absjax.plant.road import ChangingRoad
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import surface
from tuning.core.roads import BLEND, NEVER

LOW_PEAK = 0.30
Side = tuple[str, str]
"""Surfaces under the wheels of a side: the first, and the one that follows."""


def scaled_to(tyre: Burckhardt, peak: float) -> Burckhardt:
    """The curve with another peak, its shape the same."""
    factor = peak / float(tyre.peak().friction)
    return dataclasses.replace(tyre, c1=factor * tyre.c1, c3=factor * tyre.c3)


@functools.cache
def surfaces() -> dict[str, Burckhardt]:
    """high: wet asphalt; low: the published wet cobblestones, scaled to a peak of 0.30."""
    return {"high": surface("wet_asphalt"), "low": scaled_to(surface("wet_cobblestones"), LOW_PEAK)}


def roads(left: Side, right: Side, change: Any = NEVER) -> tuple[ChangingRoad, ...]:
    """Under each of four wheels; the second surface begins at `change` [m].

    All are of one structure, so that they can be lanes of one another.
    """
    sides = [ChangingRoad(tuple(surfaces()[s] for s in side), (change,), BLEND, "distance") for side in (left, right)]
    return (*sides, *sides)
