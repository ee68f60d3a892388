"""What estimator of side-slip to tune, on which logs."""

import dataclasses
from typing import Annotated

from pydantic import Field

from absjax.sideslip.base import Estimator
from tuning.core.box import Box
from tuning.core.config import (
    LONGEST,
    Count,
    Flag,
    Names,
    NonNegative,
    Positive,
    Reals,
    Text,
    Whole,
    choice,
    config,
    require,
)
from tuning.core.fit import SearchConfig
from tuning.sideslip.estimators import ESTIMATORS, box_of, estimator_of, parameters_of, with_parts, with_values


@config
class SideSlipConfig(SearchConfig):
    """What to tune, on what. JSON keys are the names of the fields, and those of `SearchConfig`.

    Parameters of a part have names as `friction_model.stiffness_at_rest`. Losses are mean logarithms of the rms errors
    of side-slip and of the lateral velocity, against those at the start: their mean over logs is a geometric one, and
    `worst` is the log that has gained least.

    Attributes:
        estimator: name in `tuning.sideslip.estimators.ESTIMATORS`.
        parts: other parts than the estimator has, e.g. `{"friction_model": "burckhardt", "rule": "slope"}`, by the
            names of `tuning.sideslip.estimators.PARTS` or as `package.module:Class`.
        logs: tuned on; each with the JSON file of its car beside it.
        held_out: judged on only.
        each: whether every log of `logs` is held out in turn, besides.
        prior: weight of the mean square of how far parameters have moved, on the scales of `tuning.core.box`.
        biases: added to the lateral accelerometer [m/s^2]; every log is tuned on with each, so that no gain relies on
            the one bias a log happens to have.
    """

    estimator: Text = "better"
    parts: Annotated[dict[Text, Text], Field(max_length=9)] = dataclasses.field(default_factory=dict)
    logs: Annotated[Names, Field(min_length=1, max_length=LONGEST)] = ()
    held_out: Names = ()
    each: Flag = False
    prior: NonNegative = 0.1
    biases: Annotated[Reals, Field(min_length=1, max_length=9)] = (0.0,)
    starts: Count = 2
    screened: Count = 8
    scatter: NonNegative = 0.3
    iterations: Count = 20
    learning_rate: Positive = 0.08
    refinements: Whole = 0

    def __post_init__(self):
        super().__post_init__()
        choice("estimator", self.estimator, ESTIMATORS)
        require("tune", self.tune, bool(self.tuned), f"names of parameters: {self.estimator} tunes none by default")
        require("objective", self.objective, self.objective != "power", "one that takes negative losses")
        require("each", self.each, not self.each or len(self.logs) > 1, "of two logs at least")
        twice = sorted(set(self.logs) & set(self.held_out)) + [log for log in self.logs if self.logs.count(log) > 1]
        require("logs", self.logs, not twice, f"distinct, and none held out; {twice[:1]} stands twice")
        self.box()

    @property
    def tuned(self) -> tuple[str, ...]:
        """Names of the parameters that are tuned."""
        there = parameters_of(self._untouched())
        return tuple(self.tune) or tuple(name for name in ESTIMATORS[self.estimator].tuned if name in there)

    def _untouched(self) -> Estimator:
        return with_parts(estimator_of("estimator", self.estimator), self.parts)

    def initial(self) -> Estimator:
        """The estimator the descent starts from."""
        estimator = self._untouched()
        for name in self.start:
            choice("start", name, parameters_of(estimator))
        return with_values(estimator, self.start)

    def box(self) -> Box:
        """The tuned parameters and their limits."""
        return box_of(self.initial(), self.tuned, self.limits)
