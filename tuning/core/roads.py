"""Roads as a configuration has them: a published surface, coefficients, a tyre curve, or surfaces that follow.

    "wet_asphalt"
    [0.8, 12.0, 0.0]
    {"tyre": "exponential_basis", "parameters": {"theta0": -0.5, "theta1": 26.0, "theta2": 12.0}}
    {"surfaces": ["dry_asphalt", "snow", "dry_asphalt"], "changes": [25.0, 55.0]}

with (c1, c2, c3) of Burckhardt's curve, tyres by name as in `absjax.tyres.TYRES`, and the changes in m from the start.
The last may have "speeds_kmh" of its own, for which it is meant.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from absjax.lanes import stacked as as_lanes
from absjax.plant.base import Road
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.tyres import TYRES
from absjax.tyres.base import Tyre
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import surface
from tuning.core.components import built, component
from tuning.core.config import LONGEST, ConfigError, Entries, Positive, Reals, Text, Values, config, require

BLEND = 0.5
"""Length of the blend from one surface to the next, m."""
NEVER = 1e9
"""Where a surface begins that never does, m."""
SHORT = {"dry_asphalt": "dry", "wet_asphalt": "wet"}
LEAST_FRICTION = 0.01
"""Peak friction below which a road is taken for a mistake; ice has 0.05."""


@config
class Curve(Entries):
    """A tyre curve by name.

    Attributes:
        tyre: name of the curve, in `absjax.tyres.TYRES`, or `package.module:Class`.
        parameters: its coefficients.
    """

    tyre: Text
    parameters: Values = Field(default_factory=dict)


def _surface(value: Any) -> Any:
    if isinstance(value, Mapping):
        value = Curve.from_json(value)
    tyre_of(value)
    return tuple(map(float, value)) if isinstance(value, list | tuple) else value


Surface = Annotated[Any, BeforeValidator(_surface)]


@config
class Surfaces(Entries):
    """Surfaces that follow one another.

    Attributes:
        surfaces: in order.
        changes: where each but the first begins, m from the start.
        speeds_kmh: from which it is braked [km/h]; those of the configuration when None.
    """

    surfaces: Annotated[tuple[Surface, ...], Field(min_length=1, max_length=LONGEST)]
    changes: Reals
    speeds_kmh: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=LONGEST)] | None = None

    def __post_init__(self):
        count = len(self.surfaces) - 1
        one_each = f"{count} place{'' if count == 1 else 's'}, one between each two of the {count + 1} surfaces"
        require("changes", self.changes, len(self.changes) == count, one_each if count else "empty: one surface")
        rises = sorted(set(self.changes)) == list(self.changes) and min(self.changes, default=1.0) > 0
        require("changes", self.changes, rises, "above 0, each beyond the one before")


def road_entry(value: Any) -> Any:
    """A road as a configuration keeps it, from what JSON or a user gives.

    Raises:
        ConfigError: naming what of it cannot be used.
    """
    if isinstance(value, Surfaces):
        return value
    if isinstance(value, Mapping) and "tyre" not in value:
        return Surfaces.from_json(value)
    return _surface(value)


RoadEntry = Annotated[Any, BeforeValidator(road_entry)]
"""A road of a configuration."""


def tyre_of(value: Any) -> Tyre:
    """The tyre curve of a surface.

    Raises:
        ConfigError: if the name is unknown, or the coefficients are not admissible.
    """
    if isinstance(value, Curve):
        tyre = built("parameters", component("tyre", value.tyre, TYRES, Tyre), value.parameters)
    elif isinstance(value, str):
        try:
            tyre = surface(value)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    else:
        numbers = isinstance(value, list | tuple) and len(value) == 3
        sound = numbers and all(isinstance(c, int | float) and not isinstance(c, bool) for c in value)
        require("a road", value, sound, "a name, three coefficients, a tyre, or surfaces with their changes")
        try:
            tyre = Burckhardt(*map(float, value))
        except (ValueError, OverflowError) as error:
            raise ConfigError(str(error)) from None
    peak = float(tyre.peak().friction)
    if not peak >= LEAST_FRICTION:
        raise ConfigError(f"{name_of(value)} has a peak friction of {peak:g}; {LEAST_FRICTION} at least")
    return tyre


def name_of(road: Any) -> str:
    """What a road is called in tables."""
    if isinstance(road, str):
        return road
    if isinstance(road, Surfaces):
        parts = [SHORT.get(s, s) if isinstance(s, str) else name_of(s) for s in road.surfaces]
        changes = [f"{change:g} m" for change in road.changes]
        return parts[0] + "".join(f", {change}: {part}" for part, change in zip(parts[1:], changes))
    if isinstance(road, Curve):
        return f"{road.tyre.rpartition(':')[2]} {tuple(road.parameters.values())}"
    return f"c = {tuple(road)}"


def surfaces_of(road: Any) -> tuple[list[Tyre], list[float]]:
    """Tyre curves of a road, and where each but the first begins [m]."""
    if not isinstance(road, Surfaces):
        return [tyre_of(road)], []
    return [tyre_of(s) for s in road.surfaces], list(road.changes)


def tyres_by_name(roads: Sequence[Any]) -> dict[str, list[Tyre]]:
    """Tyre curves of roads by their names."""
    return {name_of(road): surfaces_of(road)[0] for road in roads}


def changes_along(road: Any) -> bool:
    """Whether a road has more than one surface."""
    return isinstance(road, Surfaces) and len(road.surfaces) > 1


def stacked(roads: Sequence[Any]) -> Road:
    """Roads as the lanes of one.

    Raises:
        ConfigError: if their tyre curves are of different kinds.
    """
    described = [surfaces_of(road) for road in roads]
    kinds = {type(tyre).__name__ for tyres, _ in described for tyre in tyres}
    require("roads", sorted(kinds), len(kinds) == 1, "of one kind of tyre curve")
    most = max(len(tyres) for tyres, _ in described)
    padded = [(t + t[-1:] * (most - len(t)), c + [NEVER] * (most - 1 - len(c))) for t, c in described]
    tyres = tuple(as_lanes([t[k] for t, _ in padded]) for k in range(most))
    if most == 1:
        return UniformRoad(tyres[0])
    changes = tuple(np.array([c[k] for _, c in padded]) for k in range(most - 1))
    return ChangingRoad(tyres, changes, BLEND, "distance")


def speeds_of(road: Any, speeds_kmh: tuple[float, ...]) -> tuple[float, ...]:
    """The speeds a road is braked from [km/h]: its own, or the given ones."""
    return getattr(road, "speeds_kmh", None) or speeds_kmh


def least_peak(road: Any) -> float:
    """Least of the peak frictions of a road."""
    return min(float(tyre.peak().friction) for tyre in surfaces_of(road)[0])
