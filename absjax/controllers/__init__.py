"""Anti-lock controllers, one file each."""

from absjax.controllers.base import Controller
from absjax.controllers.bosch import BoschLogic
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.no_control import NoControl
from absjax.controllers.production import ProductionLogic
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
    "no_control": NoControl,
}
"""By name."""
