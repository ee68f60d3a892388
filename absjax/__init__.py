"""A differentiable JAX model of anti-lock braking."""

from absjax.controllers.bosch import BoschLogic
from absjax.controllers.driver_braking import DriverBraking
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.production import ProductionLogic
from absjax.controllers.slip import SlipControl
from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.encoder.edges import Edges, edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.notch import NotchFilter
from absjax.encoder.rotation import Rotation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeed, WheelSpeedChain
from absjax.hybrid.rollout import Rollout, Status, rollout
from absjax.hybrid.system import HybridSystem, Smooth, TickingSystem
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver, FreeRamp
from absjax.loop.growth import growth
from absjax.loop.ideal import ideal_distance
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.step_check import checked_stop
from absjax.loop.stop import Outcome, Stop, stop
from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.along_a_run import certify_run
from absjax.observers.base import Sample
from absjax.observers.certificate import Certificate, certify
from absjax.observers.clamped import Clamped
from absjax.observers.run import Observation, ObserverStatus, observe
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import GRAVITY, Wheel
from absjax.results import FINISHED, RolloutError
from absjax.sensors.encoder import EncoderSensor
from absjax.sensors.noisy import NoisySensor
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.exponential_basis import ExponentialBasis, fit_exponential_basis
from absjax.tyres.surfaces import SURFACES, surface
from absjax.vectors import prefer_wide_vectors

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
    "ProductionLogic",
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
    "certify_run",
    "checked_stop",
    "constant_stiffness",
    "edges_of",
    "fit_exponential_basis",
    "growth",
    "ideal_distance",
    "known_road",
    "observe",
    "prefer_wide_vectors",
    "rollout",
    "stop",
    "surface",
    "unknown_road",
]
