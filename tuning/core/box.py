"""The tuned parameters of a component, their limits and their order, on a scale of their own.

Positive parameters move on a logarithmic scale; those that may be negative on a linear one on which their
limits are `LINEAR_SPAN` apart, about as far as the limits of a positive one. They stay on a limit they reach.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.parameters import bounds_of, span_of, trainable_names
from tuning.core.config import choice, require

LINEAR_SPAN = 4.0
ROUNDED = 1e-9
"""Share of its limits by which a start may miss them."""
ROUNDING = 1.05
"""Factor on the margin by which parameters keep their order, so that rounding cannot break it."""


class Box(NamedTuple):
    """Tuned parameters and their limits; a point is where they are on their scales, (..., parameters). Hashable.

    Pairs of parameters that have to keep an order keep it at every point: where a point has them nearer, the higher one
    is raised.
    """

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    ordered: tuple[tuple[str, str, float], ...] = ()
    """(lower, higher, by how much at least); the limits leave room for it"""

    def called(self, prefix: str) -> "Box":
        """The box with a prefix to every name."""
        ordered = tuple((prefix + low, prefix + high, margin) for low, high, margin in self.ordered)
        return self._replace(names=tuple(prefix + name for name in self.names), ordered=ordered)

    @property
    def _logarithmic(self) -> np.ndarray:
        return np.asarray(self.low) > 0

    @property
    def _unit(self) -> np.ndarray:
        span = np.subtract(self.high, self.low)
        return np.where(span > 0, span, 1.0) / LINEAR_SPAN

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest point."""
        return self.point(dict(zip(self.names, self.low))), self.point(dict(zip(self.names, self.high)))

    def point(self, values: Mapping[str, Any]) -> np.ndarray:
        """The point of given values; others are left out. Arrays (sets,) give (sets, parameters)."""
        stacked = np.stack(np.broadcast_arrays(*(np.asarray(values[name], float) for name in self.names)), axis=-1)
        log = self._logarithmic
        return np.where(log, np.log(np.where(log, stacked, 1.0)), stacked / self._unit)

    def values(self, point) -> dict[str, Any]:
        """Values by name, arrays (...), in order; traceable."""
        log, unit = self._logarithmic, self._unit
        scaled = (jnp.exp(point[..., i]) if log[i] else point[..., i] * unit[i] for i in range(len(self.names)))
        values = dict(zip(self.names, scaled))
        for low, high, margin in self.ordered:
            values[high] = jnp.maximum(values[high], values[low] + margin)
        return values

    def arrays(self, points) -> dict[str, np.ndarray]:
        """The same as arrays of NumPy."""
        return {name: np.asarray(values) for name, values in self.values(points).items()}

    def valid(self, points) -> np.ndarray:
        """The nearest points within the limits, in order."""
        points = np.clip(points, *self.limits)
        return np.asarray(self.point(self.values(points))) if self.ordered else points

    def on_limit(self, point) -> list[str]:
        """Names of the parameters that lie on a limit."""
        low, high = self.limits
        return [n for n, at in zip(self.names, (abs(point - low) < 1e-6) | (abs(point - high) < 1e-6)) if at]


def joined(boxes: Sequence[Box]) -> Box:
    """Boxes of different names as one."""
    names, low, high, ordered = (sum(parts, ()) for parts in zip(*boxes))
    return Box(names, low, high, ordered)


def box_of(
    kind: type,
    initial: Mapping[str, float],
    *,
    tune: Sequence[str] = (),
    limits: Mapping[str, tuple[float, float]] | None = None,
    spans: Mapping[str, tuple[float, float]] | None = None,
    floor: float = 0.0,
) -> Box:
    """The box of a component.

    Args:
        kind: its class.
        initial: values it starts from.
        tune: names of the parameters to tune; those declared trainable when empty.
        limits: (low, high) by name, where they are given.
        spans: where else to look than the class declares, by name.
        floor: smallest value of what the class calls `thresholds`.

    Raises:
        ConfigError: if a name is unknown, or limits are not admissible or do not hold the start.
    """
    limits, spans, own = limits or {}, spans or {}, bounds_of(kind)
    for entry, names in (("tune", tune), ("limits", limits)):
        for name in names:
            choice(entry, name, tuple(own))
    pairs: dict[str, tuple[float, float]] = {}
    for name in tune or trainable_names(kind):
        least = floor if name in getattr(kind, "thresholds", ()) else 0.0
        declared = spans.get(name) or span_of(kind, name)
        pairs[name] = limits.get(name) or _span(name, own[name], declared, initial[name], least)
        low, high = pairs[name]
        require(f"limits.{name}", (low, high), own[name].low <= low <= high <= own[name].high, "(low, high)")
        require(f"limits.{name}", (low, high), low > 0 or not own[name].open_low, "(low, high) with 0 < low")
        if name in limits:
            # Shipped values are rounded: one on a limit may lie beside it.
            near = ROUNDED * max(abs(low), abs(high))
            inside = low - near <= initial[name] <= high + near
            require(f"start.{name}", initial[name], inside, f"in [{low:g}, {high:g}], its limits")
    ordered = []
    for low, high, least in getattr(kind, "ordered", ()):
        margin = ROUNDING * least
        if low in pairs:
            ceiling = (pairs[high][1] if high in pairs else initial[high]) - margin
            pairs[low] = (min(pairs[low][0], ceiling), min(pairs[low][1], ceiling))
        if high in pairs:
            floor_ = (pairs[low][0] if low in pairs else initial[low]) + margin
            pairs[high] = (max(pairs[high][0], floor_), max(pairs[high][1], floor_))
        if low in pairs and high in pairs:
            ordered.append((low, high, margin))
    lows, highs = zip(*pairs.values())
    return Box(tuple(pairs), tuple(map(float, lows)), tuple(map(float, highs)), tuple(ordered))


def _span(name: str, bounds, declared: tuple[float, float] | None, start: float, least: float) -> tuple[float, float]:
    if declared is not None:
        return min(start, declared[0]), max(start, declared[1])
    require(
        f"limits.{name}",
        None,
        start > 0,
        f"given: it starts at {start:g}, and only from a positive start are they known",
    )
    low = max(bounds.low, least, 0.05 * start if not least else 0.0)
    return low, min(bounds.high, max(5 * start, low))
