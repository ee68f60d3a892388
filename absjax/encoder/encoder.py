"""An incremental encoder with the imperfections real ones have.

With N teeth, tooth k passes the pick-up at the wheel angle th where

    th + (e / r) sin(th + phi) = 2 pi (k + delta_k) / N

delta_k is where its edge lies off its nominal place [encoder cycles], e the eccentricity of the code track of radius r.
Source: Aguado-Rojas 2019, section 5.3, eq. 5.6 and 5.8.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.parameters import concrete, model, parameter

NEWTON_STEPS = 5
LARGEST_SHARE = 0.1
"""Largest eccentricity over radius, for which the fifth step is below rounding."""


@model
class Encoder:
    """An encoder on a wheel, and the clock that stamps its edges.

    Every error repeats with each revolution but `jitter` and `missing`, which are drawn for each passing edge.
    """

    deviation: Any = parameter("delta, encoder cycles; shape (teeth,)", ndim=1, low=-0.45, high=0.45)
    eccentricity: Any = parameter("e, m", default=0.0, low=0.0)
    track_radius: Any = parameter("r, of the code track, m", default=0.05, low=0.0, open_low=True)
    phase: Any = parameter("phi, rad", default=0.0)
    clock: Any = parameter("length of a clock tick, s; None: stamps are exact", default=None, low=0.0, open_low=True)
    jitter: Any = parameter(
        "standard deviation of what does not repeat, encoder cycles; None: nothing", default=None, low=0.0, high=0.1
    )
    missing: Any = parameter("share of the edges that are not seen; None: all are", default=None, low=0.0, high=1.0)
    seed: Any = parameter("of jitter and missing edges, an integer", default=0, low=0.0)

    def __post_init__(self):
        if jnp.shape(self.deviation)[-1] < 3:
            raise ValueError(f"Encoder.deviation has {jnp.shape(self.deviation)[-1]} teeth; an encoder has at least 3")
        if concrete(self.eccentricity) and concrete(self.track_radius):
            if np.max(np.asarray(self.eccentricity) / np.asarray(self.track_radius)) > LARGEST_SHARE:
                raise ValueError(
                    f"Encoder.eccentricity = {np.max(self.eccentricity):g} m is more than {LARGEST_SHARE:g} of the "
                    f"track radius, {np.min(self.track_radius):g} m"
                )

    @classmethod
    def ideal(cls, teeth: int = 60, **other: Any) -> "Encoder":
        """An encoder without errors, but for what else is given."""
        return cls(np.zeros(teeth), **other)

    @classmethod
    def random(
        cls,
        seed: int | Sequence[int],
        teeth: int = 60,
        tolerance: float = 0.004,
        eccentricity: Any = 1.6e-4,
        **other: Any,
    ) -> "Encoder":
        """An encoder drawn from a seed, or one for each seed of a sequence as lanes.

        Args:
            tolerance: edges lie uniformly within +- this many cycles of their places; usual are 0.002 to 0.05.
            eccentricity: e [m], in a random direction; usual are 0.05 to 0.25 mm on a track of 50 mm.
            other: further fields.
        """

        def draw(one):
            rng = np.random.default_rng(one)
            return rng.uniform(-tolerance, tolerance, teeth), rng.uniform(0.0, 2 * np.pi)

        if isinstance(seed, int | np.integer):
            deviation, phase = draw(seed)
        else:
            deviation, phase = (np.stack(values) for values in zip(*map(draw, seed)))
        return cls(deviation, eccentricity, phase=phase, seed=np.asarray(seed), **other)

    @property
    def teeth(self) -> int:
        """N."""
        return jnp.shape(self.deviation)[-1]

    @property
    def pitch(self) -> float:
        """2 pi / N, the nominal angle between two teeth [rad]."""
        return 2 * np.pi / self.teeth

    def edge_angle(self, tooth, passing=None):
        """Wheel angle at which a tooth passes [rad], in [0, 2 pi) but for the errors.

        Args:
            tooth: k in [0, N), integers of any shape.
            passing: number of the passing edge since the start, from which its jitter is drawn; None: without jitter.
        """
        place = tooth + self.deviation[tooth]
        if self.jitter is not None and passing is not None:
            place = place + self.jitter * _draw(jax.random.normal, self.seed, 0, passing, place.dtype)
        place = self.pitch * place
        share, angle = self.eccentricity / self.track_radius, place
        for _ in range(NEWTON_STEPS):
            excess = angle + share * jnp.sin(angle + self.phase) - place
            angle = angle - excess / (1 + share * jnp.cos(angle + self.phase))
        return angle

    def seen(self, passing):
        """Whether the passing edge of that number is seen."""
        if self.missing is None:
            return jnp.ones(jnp.shape(passing), bool)
        return _draw(jax.random.uniform, self.seed, 1, passing, jnp.float32) >= self.missing


def _draw(distribution, seed, stream: int, passing, dtype):
    """A number for each passing edge, the same whenever it is asked for."""
    key = jax.random.fold_in(jax.random.key(jnp.asarray(seed, jnp.int32)), stream)
    return jnp.vectorize(lambda i: distribution(jax.random.fold_in(key, i), (), dtype))(passing)
