"""What the type checker says of contracts: whole components pass, one that lacks a member is refused.

Not run, but checked with the rest: an ignored line that is no error would be one itself.
"""

# pyright: reportUnnecessaryTypeIgnoreComment=true

from absjax.controllers.base import Controller
from absjax.loop.channel import Channel
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.sampled_loop import SampledLoop
from absjax.observers.base import Design, Observer
from absjax.observers.clamped import Clamped
from absjax.plant.base import Actuator, Plant, Road
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.base import Sensor
from absjax.tyres.base import Tyre
from tests.foreign import Filtered, FilteredDesign, Rational, Rounding, Sled, SlipThresholds


def whole() -> SampledLoop:
    """Every component where the project takes one."""
    plant = Sled(Wheel(), UniformRoad(Rational()))
    loop = ClosedLoop(plant, Brake(), SlipThresholds(), 0.7, Clamped(Filtered()))
    design: Design = FilteredDesign()
    Channel(Brake(), SlipThresholds(), design.observer(Wheel()))
    return SampledLoop(loop, Rounding())


class Nothing:
    """A component without members."""


class Frictionless(Rational):
    """A tyre whose peak is no method."""

    peak = None  # pyright: ignore[reportAssignmentType]


tyre: Tyre = Nothing()  # pyright: ignore[reportAssignmentType]
road: Road = Rational()  # pyright: ignore[reportAssignmentType]
plant: Plant = UniformRoad(Rational())  # pyright: ignore[reportAssignmentType]
actuator: Actuator = Wheel()  # pyright: ignore[reportAssignmentType]
controller: Controller = Filtered()  # pyright: ignore[reportAssignmentType]
observer: Observer = SlipThresholds()  # pyright: ignore[reportAssignmentType]
design: Design = Filtered()  # pyright: ignore[reportAssignmentType]
sensor: Sensor = Filtered()  # pyright: ignore[reportAssignmentType]
