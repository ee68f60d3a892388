"""What observer to tune, on which simulated runs, against what noise."""

import dataclasses
import math
from typing import Annotated

import numpy as np
from pydantic import Field

from absjax.observers import OBSERVERS
from absjax.observers.base import Design
from absjax.parameters import bounds_of
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from tuning.core.box import Box, box_of
from tuning.core.components import built, component, initial
from tuning.core.config import (
    LONGEST,
    Count,
    NonNegative,
    Positive,
    Text,
    Values,
    Whole,
    choice,
    config,
    require,
)
from tuning.core.fit import SearchConfig
from tuning.core.objective import Name
from tuning.core.roads import Surface


@config
class ObserverConfig(SearchConfig):
    """What to tune, on what. JSON keys are the names of the fields, and those of `SearchConfig`.

    Attributes:
        observer: name of the observer, in `absjax.observers.OBSERVERS`, or `package.module:Class`.
        wheel: fields of `absjax.plant.wheel.Wheel`.
        roads: surfaces to change between, by name or (c1, c2, c3); when empty they are drawn at random over
            the range of the published ones (`random_surfaces`), so that no published road is tuned on.
        runs: number of runs, half of them under either controller.
        speeds: range the initial speeds are drawn from [m/s].
        deceleration: imposed [m/s^2].
        duration: of a run [s]; the road changes once, near the middle.
        noise: standard deviations of the white noise on y [m/s^2], sample by sample; dealt out to the runs in turn.
        noise_weight: settling time that 1 of XBS noise is worth [s]; None: the losses are the rms of the error instead.
        period: of the samples [s]; substeps: Runge-Kutta steps per sample, None for what the default
            parameters need.
    """

    observer: Text = "adaptive"
    wheel: Values = dataclasses.field(default_factory=dict)
    roads: Annotated[tuple[Surface, ...], Field(max_length=LONGEST)] = ()
    runs: Count = 32
    speeds: tuple[Positive, Positive] = (12.0, 30.0)
    deceleration: NonNegative = 1.96
    duration: Positive = 2.5
    noise: Annotated[tuple[NonNegative, ...], Field(min_length=1, max_length=LONGEST)] = (0.5,)
    noise_weight: NonNegative | None = 0.1
    objective: Name = "power"
    period: Positive = 1e-3
    substeps: Count | None = None
    starts: Count = 4
    screened: Count = 64
    scatter: NonNegative = 0.7
    iterations: Count = 30
    learning_rate: Positive = 0.08
    refinements: Whole = 4

    def __post_init__(self):
        super().__post_init__()
        for name in self.start:
            choice("start", name, tuple(bounds_of(self.design)))
        low, high = self.speeds
        require("speeds", self.speeds, low <= high, "(lowest, highest)")
        least = self.deceleration * self.duration + 3.0
        require("speeds", self.speeds, low > least, f"above {least:g} m/s, so that runs end above 3 m/s")
        require("roads", self.roads, len(self.roads) != 1, "empty, or two at least")
        self.box()
        self.car()

    @property
    def design(self) -> type[Design]:
        """Class of the observer to tune."""
        return component("observer", self.observer, OBSERVERS, Design)

    @property
    def steps_per_sample(self) -> int:
        """Runge-Kutta steps per sample."""
        return self.substeps or max(1, math.ceil(self.design.substeps * self.period / 1e-3))

    def initial(self) -> dict[str, float]:
        """Parameters the descent starts from."""
        return initial(self.design, self.start)

    def car(self) -> Wheel:
        """The wheel."""
        return built("wheel", Wheel, self.wheel)

    def box(self) -> Box:
        """The tuned parameters and their limits."""
        return box_of(self.design, self.initial(), tune=self.tune, limits=self.limits)


def random_surfaces(rng: np.random.Generator, count: int) -> list[Burckhardt]:
    """Surfaces beyond the published ones on either side: from cobblestones to snow.

    c1 is log-uniform in [0.15, 1.4], c2 in [5, 130], c3 / c1 uniform in [0.3, 0.5].
    """
    c1, c2 = (np.exp(rng.uniform(np.log(low), np.log(high), count)) for low, high in ((0.15, 1.4), (5.0, 130.0)))
    c3 = c1 * rng.uniform(0.3, 0.5, count)
    return [Burckhardt(float(a), float(b), float(c)) for a, b, c in zip(c1, c2, c3)]
