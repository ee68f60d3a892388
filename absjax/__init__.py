"""A differentiable JAX model of anti-lock braking."""

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop
from absjax.control.bosch import BoschLogic
from absjax.control.driver import DriverBraking
from absjax.control.five_phase import FivePhase
from absjax.control.slip import SlipControl
from absjax.control.stiffness import StiffnessControl
from absjax.control.tracking import AccelerationTracking
from absjax.control.two_phase import TwoPhase
from absjax.driver import Driver, FreeRamp
from absjax.encoder.edges import Edges, edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.notch import NotchFilter
from absjax.encoder.rotation import Rotation
from absjax.encoder.sensor import EncoderSensor
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeed, WheelSpeedChain
from absjax.engine import Rollout, RolloutError, Status, rollout
from absjax.hybrid import FINISHED, HybridSystem, Smooth, TickingSystem
from absjax.ideal import ideal_distance
from absjax.manoeuvre import Outcome, Stop, stop
from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.certificate import Certificate, certify
from absjax.observers.clamped import Clamped
from absjax.observers.sampled import Observation, ObserverStatus, Sample, observe
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.road import SURFACES, ChangingRoad, UniformRoad, surface
from absjax.sampled_loop import SampledLoop
from absjax.sensor import NoisySensor
from absjax.tyre import Burckhardt, ExponentialBasis, fit_exponential_basis
from absjax.vehicle import GRAVITY, QuarterCar, TestRig, Wheel

__all__ = [
    "FINISHED",
    "GRAVITY",
    "SURFACES",
    "AccelerationTracking",
    "AdaptiveObserver",
    "BoschLogic",
    "Brake",
    "Burckhardt",
    "Certificate",
    "ChangingRoad",
    "Clamped",
    "ClosedLoop",
    "Driver",
    "DriverBraking",
    "Edges",
    "Encoder",
    "EncoderSensor",
    "ExponentialBasis",
    "FivePhase",
    "FreeRamp",
    "HarmonicCompensation",
    "HybridSystem",
    "NoisySensor",
    "NotchFilter",
    "Observation",
    "ObserverStatus",
    "Outcome",
    "QuarterCar",
    "Rollout",
    "RolloutError",
    "Rotation",
    "Sample",
    "SampledLoop",
    "SlipControl",
    "Smooth",
    "Status",
    "StiffnessControl",
    "Stop",
    "SwitchedObserver",
    "TestRig",
    "TickingSystem",
    "TimeStamping",
    "TwoPhase",
    "UniformRoad",
    "Wheel",
    "WheelSpeed",
    "WheelSpeedChain",
    "certify",
    "constant_stiffness",
    "edges_of",
    "fit_exponential_basis",
    "ideal_distance",
    "known_road",
    "observe",
    "rollout",
    "stop",
    "surface",
    "unknown_road",
]
