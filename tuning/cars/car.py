"""Cars as a configuration has them: one that is shipped, by name, or its figures; and the models made of them.

    "mid_size"
    {"unladen": {"mass": 1500.0, "to_front": 1.2, ...}, "wheelbase": 2.7, ...}

Units and symbols are those of `absjax.plant.two_axle.TwoAxle` and `absjax.plant.four_wheel.FourWheel`. Wheels, brakes
and springs are given (front, rear), wheels and brakes each, springs of an axle.
"""

import functools
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator

from absjax.plant.base import Road
from absjax.plant.four_wheel import FourWheel
from absjax.plant.steering import FixedSteering
from absjax.plant.two_axle import Suspension, TwoAxle
from absjax.plant.vehicle import Vehicle
from absjax.plant.wheel import GRAVITY, Wheel
from tuning.core.config import ConfigError, Entries, Positive, Real, Text, choice, config
from tuning.core.files import data_folder, read_json

MODELS = "two_axle", "four_wheel"
Pair = tuple[Positive, Positive]


@config
class Load(Entries):
    """What changes with the load.

    Attributes:
        mass: m [kg].
        to_front: from the centre of gravity to the front axle [m].
        height: h of the centre of gravity [m].
        pitch_inertia: Iy [kg m^2].
        yaw_inertia: Iz [kg m^2].
    """

    mass: Positive
    to_front: Positive
    height: Positive
    pitch_inertia: Positive
    yaw_inertia: Positive


def _load(value: Any) -> Any:
    return value if isinstance(value, Load) else Load.from_json(value)


OneLoad = Annotated[Any, BeforeValidator(_load)]


@config
class CarFigures(Entries):
    """A car.

    Attributes:
        unladen, laden: see `Load`.
        wheelbase: L [m].
        radius: R of the wheels [m].
        inertia: J of a wheel, front and rear [kg m^2].
        brake_efficiency: gamma_b of a brake, front and rear [N m/bar].
        stiffness, damping: of the suspension of an axle [N/m, N s/m].
        track_front, track_rear: T [m].
        roll_split: share of the roll moment that the front axle takes.
        relaxation: sigma [m]; None for none.
        note: what it is.
    """

    unladen: OneLoad
    laden: OneLoad
    wheelbase: Positive
    radius: Positive
    inertia: Pair
    brake_efficiency: Pair
    stiffness: Pair = (50e3, 46e3)
    damping: Pair = (4400.0, 4000.0)
    track_front: Positive = 1.5
    track_rear: Positive = 1.5
    roll_split: Real = 0.55
    relaxation: Positive | None = 0.25
    note: Text = ""

    def _wheel(self, axle: int, wheels: int) -> Wheel:
        """So many wheels of an axle as one; the load is the model's."""
        return Wheel(wheels * self.inertia[axle], self.radius, GRAVITY, wheels * self.brake_efficiency[axle])

    def vehicle(self, model: str, roads: Sequence[Road], *, laden: bool = False, steering: Any = None) -> Vehicle:
        """A model of the car.

        Args:
            model: of `MODELS`.
            roads: under the two axles, or the four wheels.
            laden: whether it is.
            steering: who steers the four-wheel car; straight on when None.

        Raises:
            ConfigError: if the figures are not admissible, or there is no such model.
        """
        choice("model", model, MODELS)
        load = self.laden if laden else self.unladen
        shared = {
            "roads": tuple(roads),
            "mass": load.mass,
            "wheelbase": self.wheelbase,
            "to_front": load.to_front,
            "height": load.height,
            "relaxation": self.relaxation,
        }
        try:
            if model == "two_axle":
                return TwoAxle(
                    axles=(self._wheel(0, 2), self._wheel(1, 2)),
                    pitch_inertia=load.pitch_inertia,
                    suspension=Suspension(self.stiffness, self.damping),
                    **shared,
                )
            return FourWheel(
                corners=tuple(self._wheel(axle, 1) for axle in (0, 0, 1, 1)),
                yaw_inertia=load.yaw_inertia,
                track_front=self.track_front,
                track_rear=self.track_rear,
                roll_split=self.roll_split,
                steering=FixedSteering() if steering is None else steering,
                **shared,
            )
        except ValueError as error:
            raise ConfigError(f"car: {error}") from None


@functools.cache
def shipped_cars() -> dict[str, CarFigures]:
    """The cars shipped here, by name."""
    with data_folder() as data:
        return {name: CarFigures.from_json(figures) for name, figures in read_json(data / "cars.json").items()}


def car_entry(value: Any) -> Any:
    """The car of an entry: a name, or figures.

    Raises:
        ConfigError: if there is no such car, or a figure is not admissible; names it.
    """
    if isinstance(value, CarFigures):
        return value
    if isinstance(value, Mapping):
        return CarFigures.from_json(value)
    choice("car", value, tuple(shipped_cars()))
    return shipped_cars()[value]


def name_of_car(figures: CarFigures) -> str:
    """Of a car that is shipped; of another what its note says, or that it is one of its own."""
    named = [name for name, known in shipped_cars().items() if known == figures]
    return named[0] if named else figures.note or "own car"
