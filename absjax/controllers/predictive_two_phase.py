"""The two-phase algorithm on a brake with a delay, which a predictor makes up for.

Phases and thresholds are those of `absjax.controllers.two_phase`; the law and the predictor those of
`absjax.delay.prediction`, with a constant z1* and alpha = kp / v. Ours: no source has it.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.phases import OPEN_VALVE
from absjax.controllers.two_phase import TwoPhase
from absjax.delay.prediction import Predicting, Prediction
from absjax.parameters import model
from absjax.signals import Signals


@model
class PredictiveTwoPhase(Predicting, TwoPhase):
    """Two phases on XBS through a delay of the brake."""

    title: ClassVar[str] = "two-phase, predictive"
    grid_step: ClassVar[float] = 1e-3

    def target(self, time, state: Prediction, phase) -> tuple[Any, Any]:
        """z1* [m/s^2], the same throughout a phase, and its rate, 0."""
        level = self.zref * pick(phase, (0.0, 1.0, -1.0, self.recovery)) + 0.0 * state.offset
        return level, 0.0 * level

    def pull(self, signals: Signals):
        """alpha [1/s]."""
        return self.gain / signals.vehicle_speed

    def follows(self, phase):
        """Whether it is not the driver's."""
        return phase > 0

    def switch(self, signals: Signals, state: Prediction, phase, slot):
        """The phase that follows, the prediction begun anew."""
        _, following = TwoPhase.switch(self, signals, (), phase, slot)
        return self.begun(signals, self.initial_state(signals), following), following

    def rate(self, signals: Signals, state: Prediction, phase):
        """Commanded dPb/dt [bar/s]."""
        return jnp.where(phase == 0, OPEN_VALVE, self.following(signals, state, phase))
