"""An estimate kept to the physical range of XBS."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from absjax.observers.base import Observer
from absjax.observers.certificate import Certificate, certify
from absjax.observers.load import at_load
from absjax.parameters import concrete, model, parameter, part


@model
class Clamped:
    """An observer whose estimate is clamped to [low, high]; its state is left alone.

    On a Burckhardt road XBS lies in (-c3, c1 c2 - c3]; the defaults span the published surfaces.
    """

    observer: Observer = part("the observer")
    low: Any = parameter("smallest XBS", default=-0.9)
    high: Any = parameter("largest XBS", default=35.0)

    def __post_init__(self):
        if concrete(self.low) and concrete(self.high) and not np.all(np.less(self.low, self.high)):
            raise ValueError(f"Clamped.low = {self.low} must be below Clamped.high = {self.high}")

    def at_load(self, share) -> "Clamped":
        """With an observer that knows the load is `share` of the one its gain a is for."""
        return dataclasses.replace(self, observer=at_load(self.observer, share))

    def certificate(self) -> Certificate:
        """That of the observer, whose state is left alone."""
        return certify(self.observer)

    def initial_state(self, y):
        """State before anything is known."""
        return self.observer.initial_state(y)

    def flow(self, state, y, speed, rate):
        """d(state)/dt."""
        return self.observer.flow(state, y, speed, rate)

    def stiffness(self, state, y):
        """Estimated XBS, clamped."""
        return jnp.clip(self.observer.stiffness(state, y), self.low, self.high)

    def fastest_rate(self, state, y, speed):
        """Fastest rate of the error dynamics [1/s]."""
        return self.observer.fastest_rate(state, y, speed)
