"""What a control unit estimates the speed of its vehicle by."""

import dataclasses

import numpy as np

from absjax.parameters import model, part
from absjax.speed.accelerometer import Accelerometer
from absjax.speed.base import SpeedEstimator

ERRORS = "bias", "gain", "slope"
"""Of the accelerometer."""


@model
class Speedometer:
    """An estimator and what it is told by, the rims apart."""

    estimator: SpeedEstimator = part("of the vehicle's speed")
    accelerometer: Accelerometer = part("of the unit")
    rolling: float = 0.0
    """free rolling before the pedal, which the estimator has been told of, s"""

    def scattered(self, rng: np.random.Generator, seeds: np.ndarray) -> "Speedometer":
        """That of stops (stops,), the accelerometer of other errors in each: drawn from a normal distribution with the
        given ones as standard deviations."""
        own = self.accelerometer
        errors = {name: getattr(own, name) * rng.normal(size=len(seeds)) for name in ERRORS}
        return dataclasses.replace(self, accelerometer=dataclasses.replace(own, **errors, seed=seeds))
