"""Five phases with acceleration tracking on a brake with a delay, which a predictor makes up for.

Phases, thresholds and the cubics that are followed are those of `absjax.controllers.tracking`; the law and the
predictor, in phases 1, 3 and 4, those of `absjax.delay.prediction`. alpha, beta1 and beta2 are the published ones of
10 ms.
Source: Hoang 2014 (thesis), section 7.3.
"""

import math
from typing import Any, ClassVar

from absjax._numerics import pick
from absjax.controllers.phases import OPEN_VALVE
from absjax.controllers.tracking import AccelerationTracking
from absjax.delay.prediction import Predicting, Prediction
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class PredictiveTracking(Predicting, AccelerationTracking):
    """Five phases that follow the acceleration through a delay of the brake."""

    title: ClassVar[str] = "five-phase, predictive"
    grid_step: ClassVar[float] = 1e-3

    gain: Any = parameter(
        "alpha, tracking gain, 1/s", default=25 * math.pi, low=0.0, open_low=True, trainable=True, span=(5.0, 300.0)
    )

    def pull(self, signals: Signals):
        """alpha [1/s]."""
        return self.gain

    def follows(self, phase):
        """Whether the phase is 1, 3 or 4."""
        return (phase == 1) | (phase == 3) | (phase == 4)

    def switch(self, signals: Signals, state: Prediction, phase, slot):
        """The phase that follows, the prediction begun anew."""
        kept, following = AccelerationTracking.switch(self, signals, state, phase, slot)
        return self.begun(signals, kept, following), following

    def rate(self, signals: Signals, state: Prediction, phase):
        """Commanded dPb/dt [bar/s]."""
        follow = self.following(signals, state, phase)
        return pick(phase, (OPEN_VALVE, follow, 0.0, follow, follow, 0.0))
