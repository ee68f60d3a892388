"""What chain from edges to wheel speed to tune, on which encoders and references."""

import dataclasses
import math

from absjax.encoder.encoder import Encoder
from tuning.core.config import Entries, choice, require
from tuning.core.search import Box
from tuning.encoder.bench import BRAKED, REFERENCES, SIGNALS

PUBLISHED = {"forgetting": 0.1, "cutoff": 1.0, "gain": 1000.0, "gate": 300.0}
"""The source has no gate; this one is beyond the accelerations of the references."""
LIMITS = {"forgetting": (0.01, 10.0), "cutoff": (0.2, 30.0), "gain": (1.0, 1e6), "gate": (5.0, 1e4)}
"""By parameter of `absjax.encoder.harmonics.HarmonicCompensation`, for both signals."""
NAMES = tuple(f"{signal}_{name}" for signal in SIGNALS for name in PUBLISHED)


@dataclasses.dataclass(frozen=True)
class EncoderConfig(Entries):
    """What to tune, on what. JSON keys are the names of the fields.

    Attributes:
        start: parameters to start from, names as `speed_forgetting`; the published ones where not given.
        tune: names of the parameters to tune; all when empty.
        limits: (low, high) by name.
        teeth: N.
        events: values of n to choose from. harmonics: values of M to choose from. Every pair is tried.
        filter_regressor: 1 if the regressors are filtered as the signals are, 0 for the published law.
        through_edges: 1 if the regressors are made of the edges, 0 if of the signals, as published.
        tolerance: of the teeth, encoder cycles. eccentricity: of the code track, m. jitter: encoder cycles.
        clock: tick of the stamps [s]; None for exact stamps.
        encoders: number of encoders tuned on, seeds from `seed` on; held_out: number of those judged on, seeds
            after them.
        references: how the wheels turn. duration: of a run [s]. settle: time from which errors count [s].
        starts: descents run together: one from the start, the others from the best of `screened` random sets.
        scatter: standard deviation of the random sets' logarithms.
        iterations, learning_rate: of the descent (Adam on the logarithms, cosine decay).
    """

    start: dict[str, float] = dataclasses.field(default_factory=dict)
    tune: tuple[str, ...] = ()
    limits: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    teeth: int = 60
    events: tuple[float, ...] = (8.0, 10.0, 12.0, 15.0, 20.0)
    harmonics: tuple[float, ...] = (4.0, 5.0, 6.0, 8.0, 10.0)
    filter_regressor: int = 1
    through_edges: int = 0
    tolerance: float = 0.004
    eccentricity: float = 1.6e-4
    jitter: float = 0.0
    clock: float | None = 1e-6
    encoders: int = 6
    held_out: int = 16
    references: tuple[str, ...] = REFERENCES
    duration: float = 4.0
    settle: float = 0.5
    starts: int = 2
    screened: int = 16
    scatter: float = 1.5
    iterations: int = 20
    learning_rate: float = 0.2
    seed: int = 100

    def __post_init__(self):
        for name in (*self.start, *self.tune, *self.limits):
            choice("start, tune and limits", name, NAMES)
        for name in self.references:
            choice("references", name, REFERENCES)
        for name in ("encoders", "held_out", "starts", "screened", "iterations"):
            require(name, getattr(self, name), getattr(self, name) >= 1, "at least 1")
        require("seed", self.seed, self.seed >= 0, "at least 0")
        require("teeth", self.teeth, self.teeth >= 12, "at least 12")
        require("events", self.events, self._whole(self.events, 3), "whole numbers of at least 3")
        require("harmonics", self.harmonics, self._whole(self.harmonics, 1), "whole numbers of at least 1")
        require("harmonics", self.harmonics, 2 * max(self.harmonics) < self.teeth, "below half the teeth")
        require("references", self.references, len(self.references) > 0, "not empty")
        require("settle", self.settle, 0 <= self.settle < self.duration, "in [0, duration)")
        longest = 2 * BRAKED if "braking" in self.references else 600.0
        require("duration", self.duration, 0 < self.duration <= longest, f"in (0, {longest:g}] s")
        for name in ("filter_regressor", "through_edges"):
            require(name, getattr(self, name), getattr(self, name) in (0, 1), "0 or 1")
        require("tolerance", self.tolerance, 0 <= self.tolerance <= 0.45, "in [0, 0.45] cycles")
        require("jitter", self.jitter, 0 <= self.jitter <= 0.1, "in [0, 0.1] cycles")
        require("eccentricity", self.eccentricity, 0 <= self.eccentricity <= 0.005, "in [0, 0.005] m")
        require("clock", self.clock, self.clock is None or 0 < self.clock <= 1e-3, "in (0, 1e-3] s, or null")
        for name in ("scatter", "learning_rate"):
            require(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "positive")
        self.box()

    @staticmethod
    def _whole(values, least: int) -> bool:
        return len(values) > 0 and all(v == int(v) and v >= least for v in values)

    def initial(self) -> dict[str, float]:
        """Parameters the descent starts from."""
        return {**{name: PUBLISHED[name.partition("_")[2]] for name in NAMES}, **self.start}

    def box(self) -> Box:
        """The tuned parameters and their limits."""
        names, initial = self.tune or NAMES, self.initial()
        pairs = [self.limits.get(name, LIMITS[name.partition("_")[2]]) for name in names]
        for name, (low, high) in zip(names, pairs):
            require(f"limits.{name}", (low, high), 0 < low <= high < math.inf, "(low, high) with 0 < low <= high")
            require(f"start.{name}", initial[name], low <= initial[name] <= high, f"in [{low:g}, {high:g}]")
        return Box(names, tuple(float(low) for low, _ in pairs), tuple(float(high) for _, high in pairs))

    def drawn(self, first: int, count: int) -> Encoder:
        """Encoders of the seeds from `first` on, as lanes."""
        return Encoder.random(
            range(first, first + count),
            self.teeth,
            self.tolerance,
            self.eccentricity,
            clock=self.clock,
            jitter=self.jitter or None,
        )
