"""Entries of a configuration: checked, converted from JSON, refused by name."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import surface

LEAST_FRICTION = 0.01
"""Peak friction below which a road is taken for a mistake; ice has 0.05."""


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names the entry."""


class Entries:
    """Mixin of a configuration dataclass: from and to what JSON holds. Keys are the names of the fields."""

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Build from a dictionary as JSON gives it.

        Raises:
            ConfigError: naming the entry that is unknown, of the wrong kind or out of range.
        """
        if not isinstance(data, Mapping):
            raise ConfigError(f"a configuration is a dictionary, not {type(data).__name__}")
        known = {field.name: field for field in dataclasses.fields(cls)}
        values = {}
        for name, value in data.items():
            choice("configuration", name, known)
            values[name] = _converted(name, value, known[name].type)
        return cls(**values)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that `from_json` reads back."""
        return dataclasses.asdict(self)


def choice(entry: str, value: Any, allowed) -> None:
    """Refuse a value that is not among those allowed."""
    if value not in allowed:
        raise ConfigError(f"{entry}: {value!r} is unknown; there are {', '.join(allowed)}")


def require(entry: str, value: Any, holds: bool, what: str) -> None:
    """Refuse a value for which a condition does not hold."""
    if not holds:
        raise ConfigError(f"{entry} = {value} must be {what}")


def _converted(name: str, value: Any, kind: Any) -> Any:
    try:
        if kind is int or kind == int | None:
            if value is None and kind is not int:
                return None
            if isinstance(value, bool) or int(value) != value:
                raise ValueError
            return int(value)
        if kind is float or kind == float | None:
            if isinstance(value, bool):
                raise ValueError
            return None if value is None and kind is not float else float(value)
        if kind == str | None and value is None:
            return None
        if kind == str | None:
            kind = str
        if kind is str or kind == tuple[str, ...] or kind == tuple[Any, ...]:
            if isinstance(value, str) != (kind is str):
                raise ValueError
            return value if kind is str else tuple(tuple(v) if isinstance(v, list) else v for v in value)
        if kind == tuple[float, ...]:
            return tuple(float(v) for v in value)
        if kind == tuple[dict[str, float], ...]:
            return tuple({k: float(v) for k, v in dict(item).items()} for item in value)
        if kind == dict[str, tuple[float, float]]:
            return {k: (float(low), float(high)) for k, (low, high) in dict(value).items()}
        return {k: float(v) for k, v in dict(value).items()}
    except (TypeError, ValueError):
        raise ConfigError(f"{name} = {value!r} is not of the kind this entry takes") from None


def tyre_of(road: Any) -> Burckhardt:
    """The tyre curve of a road given by name or by coefficients.

    Raises:
        ConfigError: if the name is unknown, or the coefficients are not admissible.
    """
    try:
        tyre = surface(road) if isinstance(road, str) else Burckhardt(*road)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"roads: {error}") from None
    peak = float(tyre.peak().friction)
    if peak < LEAST_FRICTION:
        raise ConfigError(f"roads: c = {tuple(road)} has a peak friction of {peak:g}; {LEAST_FRICTION} at least")
    return tyre
