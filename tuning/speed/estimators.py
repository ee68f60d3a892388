"""Estimators of the vehicle's speed as a study knows them, on a front and a rear rim, and their parameters by name."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from absjax.parameters import defaults_of, trainable_names
from absjax.speed import SPEED_ESTIMATORS
from absjax.speed.base import SpeedEstimator
from absjax.speed.kalman import KalmanSpeed
from absjax.speed.reference import ReferenceSpeed
from tuning.core.box import Box, box_of
from tuning.core.components import component
from tuning.core.config import choice

UNTUNED: dict[str, Any] = {
    "speed_drift": 0.1,
    "bias_drift": 0.02,
    "bias_deviation": 0.5,
    "rim_noise": 0.1,
    "below": 2.0,
    "above": 5.0,
    "deviation": 5.0,
    "unbraked": 0.5,
    "slip": 0.0,
}
"""Of the Kalman filter, guessed: what it is tuned from. The class has tuned values by default."""
VARIANTS: dict[str, SpeedEstimator] = {
    "kalman": KalmanSpeed(**UNTUNED),
    "kalman_front": KalmanSpeed(**UNTUNED, wheels=1),
    "reference_refreshed": ReferenceSpeed(refreshed_by=1),
}
"""Those that are not what a class makes by default."""
NAMES = tuple(dict.fromkeys(["kalman", "kalman_front", "reference", "reference_refreshed", *SPEED_ESTIMATORS]))
TITLES = {
    "kalman": "Kalman filter, both axles",
    "kalman_front": "Kalman filter, front axle",
    "reference": "reference speed",
    "reference_refreshed": "reference speed, refreshed by the rear",
    "largest_rim": "largest rim",
    "fixed_gradient": "fixed gradient, front axle",
}


def title_of(name: str) -> str:
    """For tables and figures."""
    return TITLES.get(name, name.rpartition(":")[2])


def estimator_of(name: str) -> SpeedEstimator:
    """The estimator of a name in `NAMES`, or `package.module:Class` with its default values, untuned.

    Raises:
        ConfigError: if there is none.
    """
    if ":" not in name:
        choice("estimators", name, NAMES)
    return VARIANTS.get(name) or component("estimators", name, SPEED_ESTIMATORS, SpeedEstimator)()


def own(name: str, entries: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the entries `estimator.parameter` that are of one estimator, by parameter."""
    return {key.rpartition(".")[2]: value for key, value in entries.items() if key.rpartition(".")[0] == name}


def with_values(estimator: Any, values: Mapping[str, Any]) -> Any:
    """The estimator with other values of some parameters; traceable."""
    return dataclasses.replace(estimator, **values)


def speed_box(estimator: Any, tune: tuple[str, ...], limits: Mapping[str, tuple[float, float]]) -> Box | None:
    """The box of an estimator; None where it has nothing to tune.

    Args:
        tune: names of the parameters; those declared trainable when empty.
    """
    kind = type(estimator)
    if not (tune or trainable_names(kind)):
        return None
    values = {name: float(getattr(estimator, name)) for name in defaults_of(kind)}
    return box_of(kind, values, tune=tune, limits=limits)
