"""What observer to tune, on which simulated runs, against what noise."""

import dataclasses
import math
from typing import Any

import numpy as np

from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from tuning.core.config import ConfigError, Entries, choice, require, tyre_of
from tuning.core.search import Box
from tuning.observers.kinds import KINDS, Kind


@dataclasses.dataclass(frozen=True)
class ObserverConfig(Entries):
    """What to tune, on what. JSON keys are the names of the fields.

    Attributes:
        observer: name of the observer, in `tuning.observers.kinds.KINDS`.
        start: parameters to start from; the default ones where not given.
        tune: names of the parameters to tune; all when empty.
        limits: (low, high) by parameter.
        wheel: fields of `absjax.plant.wheel.Wheel`.
        roads: surfaces to change between, by name or (c1, c2, c3); when empty they are drawn at random over
            the range of the published ones (`random_surfaces`), so that no published road is tuned on.
        runs: number of runs, half of them under either controller.
        speeds: range the initial speeds are drawn from [m/s].
        deceleration: imposed [m/s^2].
        duration: of a run [s]; the road changes once, near the middle.
        noise: standard deviations of the white noise on y [m/s^2], sample by sample; dealt out to the runs in turn.
        noise_weight: settling time that 1 of XBS noise is worth [s]; None tunes on the rms of the error.
        period: of the samples [s]; substeps: Runge-Kutta steps per sample, None for what the default
            parameters need.
        starts: descents run together: one from the start, the others from the best of `screened` random sets.
        scatter: standard deviation of the random sets' logarithms.
        iterations, learning_rate, seed: of the descent (Adam on the logarithms, cosine decay).
        refinements: generations of evolution from the winner, on the settling times themselves.
    """

    observer: str = "adaptive"
    start: dict[str, float] = dataclasses.field(default_factory=dict)
    tune: tuple[str, ...] = ()
    limits: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    wheel: dict[str, float] = dataclasses.field(default_factory=dict)
    roads: tuple[Any, ...] = ()
    runs: int = 32
    speeds: tuple[float, ...] = (12.0, 30.0)
    deceleration: float = 1.96
    duration: float = 2.5
    noise: tuple[float, ...] = (0.5,)
    noise_weight: float | None = 0.1
    period: float = 1e-3
    substeps: int | None = None
    starts: int = 4
    screened: int = 64
    scatter: float = 0.7
    iterations: int = 30
    learning_rate: float = 0.08
    seed: int = 0
    refinements: int = 4

    def __post_init__(self):
        choice("observer", self.observer, KINDS)
        for entry, names in (("start", self.start), ("tune", self.tune), ("limits", self.limits)):
            for name in names:
                choice(entry, name, self.kind.default)
        for name in ("runs", "starts", "iterations"):
            require(name, getattr(self, name), getattr(self, name) >= 1, "an integer >= 1")
        require("screened", self.screened, self.screened >= self.starts, "at least as many as starts")
        require("refinements", self.refinements, self.refinements >= 0, "an integer >= 0")
        require("substeps", self.substeps, self.substeps is None or self.substeps >= 1, "an integer >= 1, or null")
        for name in ("duration", "period", "learning_rate", "scatter"):
            require(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "positive")
        for name in ("noise_weight", "deceleration"):
            require(name, getattr(self, name), 0 <= (getattr(self, name) or 0.0) < math.inf, ">= 0")
        sound = len(self.noise) > 0 and all(0 <= level < math.inf for level in self.noise)
        require("noise", self.noise, sound, "levels >= 0, one at least")
        low, high = self.speeds if len(self.speeds) == 2 else (0.0, -1.0)
        require("speeds", self.speeds, 0 < low <= high, "(lowest, highest)")
        least = self.deceleration * self.duration + 3.0
        require("speeds", self.speeds, low > least, f"above {least:g} m/s, so that runs end above 3 m/s")
        require("roads", self.roads, len(self.roads) != 1, "empty, or two at least")
        for road in self.roads:
            tyre_of(road)
        self.box()
        self.car()

    @property
    def kind(self) -> Kind:
        """The observer to tune."""
        return KINDS[self.observer]

    @property
    def steps_per_sample(self) -> int:
        """Runge-Kutta steps per sample."""
        return self.substeps or max(1, math.ceil(self.kind.substeps * self.period / 1e-3))

    def initial(self) -> dict[str, float]:
        """Parameters the descent starts from."""
        return {**self.kind.default, **self.start}

    def car(self) -> Wheel:
        """The wheel."""
        try:
            return Wheel(**self.wheel)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"wheel: {error}") from None

    def box(self) -> Box:
        """The tuned parameters and their limits."""
        names = self.tune or tuple(self.kind.default)
        pairs = [self.limits.get(name, (self.kind.low[name], self.kind.high[name])) for name in names]
        for name, (low, high) in zip(names, pairs):
            require(f"limits.{name}", (low, high), 0 < low <= high < math.inf, "(low, high) with 0 < low <= high")
            require(
                f"start.{name}", self.initial()[name], low <= self.initial()[name] <= high, f"in [{low:g}, {high:g}]"
            )
        return Box(names, tuple(float(low) for low, _ in pairs), tuple(float(high) for _, high in pairs))


def random_surfaces(rng: np.random.Generator, count: int) -> list[Burckhardt]:
    """Surfaces beyond the published ones on either side: from cobblestones to snow.

    c1 is log-uniform in [0.15, 1.4], c2 in [5, 130], c3 / c1 uniform in [0.3, 0.5].
    """
    c1, c2 = (np.exp(rng.uniform(np.log(low), np.log(high), count)) for low, high in ((0.15, 1.4), (5.0, 130.0)))
    c3 = c1 * rng.uniform(0.3, 0.5, count)
    return [Burckhardt(float(a), float(b), float(c)) for a, b, c in zip(c1, c2, c3)]
