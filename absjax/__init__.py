"""A differentiable JAX model of anti-lock braking."""

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop, SampledLoop
from absjax.control.five_phase import FivePhase
from absjax.engine import Rollout, RolloutError, Status, rollout
from absjax.hybrid import FINISHED, HybridSystem, Smooth, TickingSystem
from absjax.manoeuvre import Outcome, Stop, stop
from absjax.road import SURFACES, ChangingRoad, UniformRoad, surface
from absjax.tyre import Burckhardt, ExponentialBasis, fit_exponential_basis
from absjax.vehicle import GRAVITY, QuarterCar, TestRig, Wheel

__all__ = [
    "FINISHED",
    "GRAVITY",
    "SURFACES",
    "Brake",
    "Burckhardt",
    "ChangingRoad",
    "ClosedLoop",
    "ExponentialBasis",
    "FivePhase",
    "HybridSystem",
    "Outcome",
    "QuarterCar",
    "Rollout",
    "RolloutError",
    "SampledLoop",
    "Smooth",
    "Status",
    "Stop",
    "TestRig",
    "TickingSystem",
    "UniformRoad",
    "Wheel",
    "fit_exponential_basis",
    "rollout",
    "stop",
    "surface",
]
