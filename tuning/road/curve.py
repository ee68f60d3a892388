"""A kind of tyre curve as identification sees it: an array of the coefficients that are fitted."""

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from absjax.parameters import bounds_of, span_of, trainable_names
from absjax.tyres.base import Tyre
from absjax.tyres.burckhardt import Burckhardt

LARGEST_SLIP, POINTS, STARTS = 0.6, 60, 12
"""Of the search for a start."""


@dataclasses.dataclass(frozen=True)
class Curve:
    """A class of tyre curves; its coefficients are those declared trainable, the others as by default. Hashable."""

    kind: type[Tyre]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coefficients, in order."""
        return trainable_names(self.kind)

    @property
    def lower(self) -> np.ndarray:
        """Their lower bounds, (coefficients,)."""
        bounds = bounds_of(self.kind)
        return np.array([bounds[name].low for name in self.names])

    def tyre(self, coefficients: Iterable[Any]) -> Tyre:
        """The curve of given coefficients; traceable."""
        return self.kind(**dict(zip(self.names, coefficients)))

    def near(self, rough) -> np.ndarray:
        """Coefficients (coefficients,) whose curve is near Burckhardt's of (c1, c2, c3)."""
        if self.kind is Burckhardt:
            return np.asarray(rough, float)
        slip = -np.linspace(0.0, LARGEST_SLIP, POINTS)
        wanted = np.asarray(Burckhardt(*map(float, rough)).friction(slip))
        spans = [span_of(self.kind, name) for name in self.names]
        low, high = (np.array([(-1.0, 1.0)[i] if s is None else s[i] for s in spans]) for i in (0, 1))

        def miss(c):
            return np.asarray(self.tyre(c).friction(slip), float) - wanted

        draws = np.random.default_rng(0).uniform(low, high, (STARTS, len(low)))
        found = [least_squares(miss, x, bounds=(low, high), x_scale=high - low) for x in (0.5 * (low + high), *draws)]
        return min(found, key=lambda fit: fit.cost).x
