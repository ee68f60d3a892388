"""What chain from edges to wheel speed to tune, on which encoders and references."""

from typing import Annotated

from pydantic import Field

from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.parameters import span_of, trainable_names
from tuning.core.box import Box
from tuning.core.config import (
    LONGEST,
    Count,
    NonNegative,
    Positive,
    Whole,
    choice,
    config,
    require,
)
from tuning.core.fit import SearchConfig
from tuning.encoder.bench import BRAKED, REFERENCES, Reference
from tuning.encoder.chains import SIGNALS

PUBLISHED = {"forgetting": 0.1, "cutoff": 1.0, "gain": 1000.0, "gate": 300.0}
"""The source has no gate; this one is beyond the accelerations of the references."""
NAMES = tuple(f"{signal}_{name}" for signal in SIGNALS for name in trainable_names(HarmonicCompensation))
Switch = Annotated[Whole, Field(le=1)]


@config
class EncoderConfig(SearchConfig):
    """What to tune, on what. JSON keys are the names of the fields, and those of `SearchConfig`.

    Parameters have names as `speed_forgetting`; they start from the published values.
    Losses are logarithms of rms errors.

    Attributes:
        teeth: N.
        events: values of n to choose from. harmonics: values of M to choose from. Every pair is tried.
        filter_regressor: 1 if the regressors are filtered as the signals are, 0 for the published law.
        through_edges: 1 if the regressors are made of the edges, 0 if of the signals, as published.
        tolerance: of the teeth, encoder cycles. eccentricity: of the code track, m. jitter: encoder cycles.
        clock: tick of the stamps [s]; None for exact stamps.
        encoders: number of encoders tuned on, seeds from `seed` on; held_out: number of those judged on, seeds
            after them.
        references: how the wheels turn. duration: of a run [s]. settle: time from which errors count [s].
    """

    teeth: Annotated[Count, Field(ge=12, le=10_000)] = 60
    events: Annotated[tuple[Annotated[Count, Field(ge=3, le=10_000)], ...], Field(min_length=1, max_length=LONGEST)] = (
        8,
        10,
        12,
        15,
        20,
    )
    harmonics: Annotated[tuple[Count, ...], Field(min_length=1, max_length=LONGEST)] = (4, 5, 6, 8, 10)
    filter_regressor: Switch = 1
    through_edges: Switch = 0
    tolerance: Annotated[NonNegative, Field(le=0.45)] = 0.004
    eccentricity: Annotated[NonNegative, Field(le=0.005)] = 1.6e-4
    jitter: Annotated[NonNegative, Field(le=0.1)] = 0.0
    clock: Annotated[Positive, Field(le=1e-3)] | None = 1e-6
    encoders: Count = 6
    held_out: Count = 16
    references: Annotated[tuple[Reference, ...], Field(min_length=1, max_length=LONGEST)] = REFERENCES
    duration: Positive = 4.0
    settle: NonNegative = 0.5
    starts: Count = 2
    screened: Count = 16
    scatter: NonNegative = 1.5
    iterations: Count = 20
    learning_rate: Positive = 0.2
    seed: Whole = 100
    refinements: Whole = 0

    def __post_init__(self):
        super().__post_init__()
        for entry, names in (("start", self.start), ("tune", self.tune), ("limits", self.limits)):
            for name in names:
                choice(entry, name, NAMES)
        require("objective", self.objective, self.objective != "power", "one that takes negative losses")
        require("harmonics", self.harmonics, 2 * max(self.harmonics) < self.teeth, "below half the teeth")
        require("settle", self.settle, self.settle < self.duration, "below the duration")
        longest = 2 * BRAKED if "braking" in self.references else 600.0
        require("duration", self.duration, self.duration <= longest, f"at most {longest:g} s")
        self.box()

    def initial(self) -> dict[str, float]:
        """Parameters the descent starts from."""
        return {**{name: PUBLISHED[name.partition("_")[2]] for name in NAMES}, **self.start}

    def box(self) -> Box:
        """The tuned parameters and their limits."""
        names, initial = self.tune or NAMES, self.initial()
        pairs = [self.limits.get(n) or span_of(HarmonicCompensation, n.partition("_")[2]) or (0.0, 0.0) for n in names]
        for name, (low, high) in zip(names, pairs):
            require(f"limits.{name}", (low, high), 0 < low <= high, "(low, high) with 0 < low <= high")
            require(f"start.{name}", initial[name], low <= initial[name] <= high, f"in [{low:g}, {high:g}]")
        return Box(tuple(names), tuple(float(low) for low, _ in pairs), tuple(float(high) for _, high in pairs))

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
