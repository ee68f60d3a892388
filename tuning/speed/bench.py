"""Errors of an estimator of the vehicle's speed on stops, counted while a controller acts."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.speed.base import SpeedEstimator, SpeedSamples
from absjax.speed.run import estimate_speed
from tuning.speed.stops import Told

SMALLEST = 1e-4
"""Error below which none is told from another, m/s."""


class SpeedErrors(NamedTuple):
    """Of an estimator on stops, arrays (stops,)."""

    relative: Any
    """mean of |v^ - v| / v"""
    signed: Any
    """mean of (v^ - v) / v"""
    rms: Any
    """m/s"""
    largest: Any
    """m/s"""


class Bench(NamedTuple):
    """Stops side by side as programs take them."""

    samples: SpeedSamples
    """arrays (stops, samples, ...)"""
    speed: Any
    """true v, (stops, samples) [m/s]"""
    active: Any
    """bool (stops, samples): where errors count"""
    period: Any

    @classmethod
    def of(cls, told: Told) -> "Bench":
        """The bench of simulated stops."""
        return jax.tree.map(jnp.asarray, cls(told.samples, told.stops.speed, told.stops.active, told.stops.period))

    def of_members(self, members) -> "Bench":
        """Some of the stops; traceable."""
        samples, speed, active = jax.tree.map(lambda x: x[members], (self.samples, self.speed, self.active))
        return Bench(samples, speed, active, self.period)

    def estimates(self, estimator: SpeedEstimator):
        """v^ (stops, samples) [m/s]; traceable."""
        return jax.vmap(lambda samples: estimate_speed(estimator, samples, self.period).speed)(self.samples)

    def errors(self, estimator: SpeedEstimator) -> SpeedErrors:
        """Errors; traceable."""
        error, count = self.estimates(estimator) - self.speed, jnp.sum(self.active, axis=1)

        def mean(values):
            return jnp.sum(jnp.where(self.active, values, 0.0), axis=1) / count

        return SpeedErrors(
            mean(jnp.abs(error) / self.speed),
            mean(error / self.speed),
            jnp.sqrt(mean(error**2) + SMALLEST**2),
            jnp.max(jnp.where(self.active, jnp.abs(error), 0.0), axis=1),
        )


@jax.jit
def _errors(bench: Bench, estimator: SpeedEstimator) -> SpeedErrors:
    return bench.errors(estimator)


def errors_of(bench: Bench, estimator: SpeedEstimator) -> SpeedErrors:
    """Errors, arrays of NumPy (stops,)."""
    return jax.tree.map(np.asarray, _errors(bench, jax.tree.map(jnp.asarray, estimator)))
