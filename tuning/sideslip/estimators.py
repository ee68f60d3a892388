"""Estimators by name, and their parameters by the path of the part they belong to."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from absjax.parameters import bounds_of, is_model, span_of, trainable_names
from absjax.sideslip import FRICTION_MODELS, MONITORS, XI_RULES
from absjax.sideslip.base import Estimator
from absjax.sideslip.baselines import KinematicIntegration, extended_filter, linear_filter
from absjax.sideslip.choice import XiRule
from absjax.sideslip.friction import MonotoneFriction
from absjax.sideslip.monitor import Monitor
from absjax.sideslip.observer import better_gains, published_gains
from absjax.sideslip.offsets import OffsetAdaptation
from tuning.core.box import Box
from tuning.core.components import component
from tuning.core.config import choice, require


class Recipe(NamedTuple):
    """An estimator with its default values, and what of it is tuned unless said otherwise."""

    make: Callable[[], Estimator]
    tuned: tuple[str, ...]


STIFFNESS = "friction_model.stiffness_at_rest"
ESTIMATORS: dict[str, Recipe] = {
    "kinematic": Recipe(KinematicIntegration, ()),
    "fixed": Recipe(lambda: better_gains(adapts=False), ("lateral_gain", "yaw_gain", STIFFNESS)),
    "linear_filter": Recipe(
        linear_filter, ("lateral_drift", "yaw_drift", "acceleration_noise", "yaw_noise", STIFFNESS)
    ),
    "extended_filter": Recipe(
        extended_filter, ("lateral_drift", "yaw_drift", "friction_drift", "acceleration_noise", "yaw_noise", STIFFNESS)
    ),
    "published": Recipe(published_gains, ("lateral_gain", "friction_gain", STIFFNESS)),
    "better": Recipe(better_gains, ("lateral_gain", "friction_gain", STIFFNESS)),
    "offsets": Recipe(
        lambda: better_gains(offsets=OffsetAdaptation()),
        ("lateral_gain", "friction_gain", STIFFNESS, "offsets.bank_gain", "offsets.bank_memory"),
    ),
}
"""By name. `fixed` has theta at 1; `offsets` adapts road bank and biases besides."""
TITLES = {
    "kinematic": "kinematic integration",
    "fixed": "theta fixed at 1",
    "linear_filter": "linear two-track Kalman filter",
    "extended_filter": "extended Kalman filter, theta a random walk",
    "published": "adaptive observer, published gains",
    "better": "adaptive observer, better gains",
    "offsets": "adaptive observer, bank and biases adapted",
}


PARTS: dict[str, tuple[Mapping[str, type], type]] = {
    "friction_model": (FRICTION_MODELS, MonotoneFriction),
    "rule": (XI_RULES, XiRule),
    "monitor": (MONITORS, Monitor),
}
"""Parts that can be swapped by name: those the project lists, and their contract."""


def estimator_of(entry: str, name: str) -> Estimator:
    """The estimator of a name, with its default values.

    Raises:
        ConfigError: if there is none.
    """
    choice(entry, name, ESTIMATORS)
    return ESTIMATORS[name].make()


def with_parts(estimator: Any, parts: Mapping[str, str]) -> Any:
    """The estimator with other parts: names of the project's, or `package.module:Class` written to the contract.

    Raises:
        ConfigError: if the estimator has no such part, or there is no such class.
    """
    own = {field.name for field in dataclasses.fields(estimator)}
    for name in parts:
        choice("parts", name, [part for part in PARTS if part in own])
    return dataclasses.replace(
        estimator, **{n: component(f"parts.{n}", kind, *PARTS[n])() for n, kind in parts.items()}
    )


def parameters_of(estimator: Any, path: str = "") -> dict[str, tuple[float, Any, str]]:
    """Scalar parameters of an estimator and its parts: value, the model they belong to, and their name there."""
    found = {name_: (float(getattr(estimator, name)), estimator, name) for name_, name in _own(estimator, path)}
    for field in dataclasses.fields(estimator):
        part = getattr(estimator, field.name)
        if field.metadata.get("part") and is_model(part):
            found |= parameters_of(part, f"{path}{field.name}.")
    return found


def _own(estimator: Any, path: str) -> list[tuple[str, str]]:
    return [(path + name, name) for name in bounds_of(estimator)]


def trainable_of(estimator: Any) -> tuple[str, ...]:
    """Names of the parameters declared trainable."""
    return tuple(name for name, (_, owner, own) in parameters_of(estimator).items() if own in trainable_names(owner))


def with_values(estimator: Any, values: Mapping[str, Any]) -> Any:
    """The estimator with other values of some parameters; traceable."""
    own = {name: value for name, value in values.items() if "." not in name}
    parts: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        part, dot, rest = name.partition(".")
        if dot:
            parts.setdefault(part, {})[rest] = value
    changed = {part: with_values(getattr(estimator, part), inner) for part, inner in parts.items()}
    return dataclasses.replace(estimator, **own, **changed)


def box_of(estimator: Any, names: tuple[str, ...], limits: Mapping[str, tuple[float, float]]) -> Box:
    """The box of some parameters of an estimator, whose values have to lie in it.

    Raises:
        ConfigError: if a name is unknown, or limits are not admissible or do not hold the value.
    """
    known = parameters_of(estimator)
    lows, highs = [], []
    for name in names:
        choice("tune", name, known)
        value, owner, own = known[name]
        bounds = bounds_of(owner)[own]
        low, high = limits.get(name) or span_of(owner, own) or (value / 20, value * 5)
        require(f"limits.{name}", (low, high), bounds.low <= low < high <= bounds.high, f"(low, high) in {bounds}")
        require(f"start.{name}", value, low <= value <= high, f"in [{low:g}, {high:g}], its limits")
        lows.append(float(low))
        highs.append(float(high))
    return Box(tuple(names), tuple(lows), tuple(highs))
