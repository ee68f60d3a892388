"""Anti-lock controllers, one file each."""

from absjax.controllers.base import Controller
from absjax.controllers.bosch import BoschLogic
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.no_control import NoControl
from absjax.controllers.predictive_tracking import PredictiveTracking
from absjax.controllers.predictive_two_phase import PredictiveTwoPhase
from absjax.controllers.production import ProductionLogic
from absjax.controllers.rolling_slip import RollingSlip
from absjax.controllers.slip import SlipControl
from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase

CONTROLLERS: dict[str, type[Controller]] = {
    "five_phase": FivePhase,
    "tracking": AccelerationTracking,
    "two_phase": TwoPhase,
    "stiffness": StiffnessControl,
    "slip": SlipControl,
    "bosch": BoschLogic,
    "production": ProductionLogic,
}
"""By name."""

BASELINES: dict[str, type[Controller]] = {
    "no_control": NoControl,
}
"""By name, those with nothing to tune."""

FOR_CARS: dict[str, type[Controller]] = {
    "rolling_slip": RollingSlip,
}
"""By name, those for cars, whose other wheels brake while one does not."""

PREDICTIVE: dict[str, type[Controller]] = {
    "predictive_tracking": PredictiveTracking,
    "predictive_two_phase": PredictiveTwoPhase,
}
"""By name, those over a delay of the brake: in a `absjax.loop.delayed_loop.DelayedLoop`, or a control unit."""
