"""Roads: which tyre curve holds where and when."""

import dataclasses
from typing import Any, Literal

import jax.numpy as jnp

from absjax.parameters import model, parameter, part
from absjax.plant.base import Road
from absjax.tyres.base import Tyre
from absjax.tyres.surfaces import surface


@model
class UniformRoad:
    """One surface everywhere."""

    tyre: Tyre = part("tyre curve")

    def friction(self, slip, time, distance):
        """mu(lambda)."""
        return self.tyre.friction(slip)

    @property
    def across(self) -> "UniformRoad | None":
        """What a tyre feels across the wheel, of its part `lateral`; None: the same as along it."""
        lateral = getattr(self.tyre, "lateral", None)
        return None if lateral is None else UniformRoad(lateral)

    def stiffness(self, slip, time, distance):
        """XBS."""
        return self.tyre.stiffness(slip)

    def peak_friction(self, time, distance):
        """Largest friction to be had."""
        return self.tyre.peak().friction


@model
class ChangingRoad:
    """A sequence of surfaces along time or along the road, blended from each to the next.

    Friction is the first surface's plus, for every change i, S((x - x_i) / blend) times the difference
    to the surface before; S(z) = z^4 (35 - 84 z + 70 z^2 - 20 z^3) has three continuous derivatives,
    so that the rollout keeps its fourth order.

    Raises:
        ValueError: at construction, unless there is one change fewer than surfaces.
    """

    surfaces: tuple[Tyre, ...] = part("tyre curves, in order")
    changes: tuple[Any, ...] = parameter("x_i, where each blend begins, s or m")
    blend: Any = parameter("length of a blend, s or m", default=0.025, low=0.0, open_low=True)
    along: Literal["time", "distance"] = "time"

    def __post_init__(self):
        if len(self.changes) != len(self.surfaces) - 1:
            raise ValueError(f"ChangingRoad.changes has {len(self.changes)} entries for {len(self.surfaces)} surfaces")
        if self.along not in ("time", "distance"):
            raise ValueError(f"ChangingRoad.along = {self.along!r} must be 'time' or 'distance'")

    @property
    def across(self) -> "ChangingRoad | None":
        """As of `UniformRoad`; None where no surface has a curve of its own across the wheel."""
        lateral = [getattr(tyre, "lateral", None) for tyre in self.surfaces]
        if all(own is None for own in lateral):
            return None
        surfaces = tuple(tyre if own is None else own for tyre, own in zip(self.surfaces, lateral))
        return dataclasses.replace(self, surfaces=surfaces)

    def peak_friction(self, time, distance):
        """Largest friction to be had at `time` or `distance`; within a blend of two surfaces no less than that."""
        return self._mix([tyre.peak().friction for tyre in self.surfaces], time, distance)

    def _mix(self, values, time, distance):
        position = time if self.along == "time" else distance
        total = values[0]
        for change, before, after in zip(self.changes, values, values[1:]):
            z = jnp.clip((position - change) / self.blend, 0.0, 1.0)
            share = z**4 * (35 - 84 * z + 70 * z**2 - 20 * z**3)
            total = total + share * (after - before)
        return total

    def friction(self, slip, time, distance):
        """mu(lambda) at `time` or `distance`."""
        return self._mix([tyre.friction(slip) for tyre in self.surfaces], time, distance)

    def stiffness(self, slip, time, distance):
        """XBS at `time` or `distance`."""
        return self._mix([tyre.stiffness(slip) for tyre in self.surfaces], time, distance)


def as_road(road_or_tyre) -> Road:
    """A road from a road, a tyre curve, or the name of a published surface."""
    if isinstance(road_or_tyre, str):
        return UniformRoad(surface(road_or_tyre))
    if hasattr(road_or_tyre, "peak_friction"):
        return road_or_tyre
    return UniformRoad(road_or_tyre)
