"""Roads of a configuration: a published surface by name, coefficients, or surfaces that follow one another.

    "wet_asphalt"
    [0.8, 12.0, 0.0]
    {"surfaces": ["dry_asphalt", "snow", "dry_asphalt"], "changes": [25.0, 55.0]}

with the changes in m from the start. The last may have "speeds_kmh" of its own, for which it is meant.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from absjax.plant.base import Road
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.tyres.burckhardt import Burckhardt
from tuning.core.config import ConfigError, tyre_of

BLEND = 0.5
"""Length of the blend from one surface to the next, m."""
NEVER = 1e9
"""Where a surface begins that never does, m."""
SHORT = {"dry_asphalt": "dry", "wet_asphalt": "wet"}


def name_of(road: Any) -> str:
    """What a road is called in tables."""
    if isinstance(road, str):
        return road
    if isinstance(road, dict):
        parts = [SHORT.get(s, s) if isinstance(s, str) else name_of(s) for s in road["surfaces"]]
        changes = [f"{change:g} m" for change in road["changes"]]
        return parts[0] + "".join(f", {change}: {part}" for part, change in zip(parts[1:], changes))
    return f"c = {tuple(road)}"


def surfaces_of(road: Any) -> tuple[list[Burckhardt], list[float]]:
    """Tyre curves of a road, and where each but the first begins [m].

    Raises:
        ConfigError: if the road is not of a kind this module knows.
    """
    if not isinstance(road, dict):
        return [tyre_of(road)], []
    if not {"surfaces", "changes"} <= set(road) <= {"surfaces", "changes", "speeds_kmh"}:
        raise ConfigError(f"roads: {road} must have the entries surfaces and changes, and may have speeds_kmh")
    tyres, changes = [tyre_of(s) for s in road["surfaces"]], [float(change) for change in road["changes"]]
    if len(changes) != len(tyres) - 1 or sorted(changes) != changes or min(changes, default=1.0) <= 0:
        raise ConfigError(f"roads: {name_of(road)} must have a change between each two surfaces, in order, above 0")
    return tyres, changes


def stacked(roads: Sequence[Any]) -> Road:
    """Roads as the lanes of one."""
    described = [surfaces_of(road) for road in roads]
    most = max(len(tyres) for tyres, _ in described)
    padded = [(t + t[-1:] * (most - len(t)), c + [NEVER] * (most - 1 - len(c))) for t, c in described]

    def lanes(k: int) -> Burckhardt:
        return Burckhardt(*(np.array([float(getattr(t[k], c)) for t, _ in padded]) for c in ("c1", "c2", "c3")))

    if most == 1:
        return UniformRoad(lanes(0))
    changes = tuple(np.array([c[k] for _, c in padded]) for k in range(most - 1))
    return ChangingRoad(tuple(lanes(k) for k in range(most)), changes, BLEND, "distance")


def speeds_of(road: Any, speeds_kmh: tuple[float, ...]) -> tuple[float, ...]:
    """The speeds a road is braked from [km/h]: its own, or the given ones."""
    return tuple(road.get("speeds_kmh", speeds_kmh)) if isinstance(road, dict) else speeds_kmh


def least_peak(road: Any) -> float:
    """Least of the peak frictions of a road."""
    return min(float(tyre.peak().friction) for tyre in surfaces_of(road)[0])
