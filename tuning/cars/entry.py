"""The vehicle of a configuration, and the loop of its channels."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from absjax.controllers.base import Controller
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.observers.base import Observer
from absjax.plant.base import Actuator, Road
from absjax.plant.vehicle import Vehicle
from absjax.speed import SPEED_ESTIMATORS
from absjax.speed.accelerometer import Accelerometer
from absjax.speed.base import SpeedEstimator
from tuning.cars.car import MODELS, CarFigures, car_entry, name_of_car
from tuning.cars.speedometer import Speedometer
from tuning.core.components import built, component
from tuning.core.config import (
    ConfigError,
    Entries,
    Flag,
    NonNegative,
    Positive,
    Real,
    Text,
    Values,
    choice,
    config,
    require,
)

WIRINGS: dict[str, dict[int, tuple[tuple[int, ...], ...]]] = {
    "independent": {2: ((0,), (1,)), 4: ((0,), (1,), (2,), (3,))},
    "select_low_rear": {4: ((0,), (1,), (2, 3))},
    "select_low": {4: ((0, 1), (2, 3))},
}
"""By name and number of wheels: the wheels each channel commands."""
AXLES = "front.", "rear."
"""What the names of an axle's own parameters begin with."""
SETS = "one", "own"
"""One set of parameters for all channels, or its own for each axle."""


FEWEST, MOST = 1, 20
"""Cars of a configuration."""


def _loads(value: Any) -> Any:
    loads = tuple(value) if isinstance(value, list | tuple) else (value,)
    sound = len(loads) > 0 and all(isinstance(load, bool) for load in loads)
    if not sound:
        raise ConfigError("must be true, false or both")
    return loads if isinstance(value, list | tuple) else value


def _cars(value: Any) -> Any:
    return tuple(map(car_entry, value)) if isinstance(value, list | tuple) else car_entry(value)


@config
class VehicleEntry(Entries):
    """A vehicle under anti-lock controllers, or several under one set.

    Attributes:
        car: name of a shipped car, or its figures (`tuning.cars.car.CarFigures`); or several: every row is braked by
            each, and each knows its own wheels.
        model: of `tuning.cars.car.MODELS`.
        laden: whether it is; or both.
        wiring: of `WIRINGS`; select-low goes by the worse wheel of an axle.
        sets: of `SETS`.
        follows_load: whether controllers and observers know the load from the acceleration.
        speed: name of the estimator that the sampled control unit has for the vehicle's speed, in
            `absjax.speed.SPEED_ESTIMATORS`, or `package.module:Class`; None tells it the true one.
        speed_parameters: its fields.
        regulation: whether a set has to pass the screening after UN Regulation 13-H, on each of the cars
            (`tuning.controllers.regulation`).
        largest_yaw_rate, largest_side_slip: what it allows on the split road besides, a driver steering [deg/s, deg];
            None: any.
        least_steerability: what the half second that has least of it must leave besides; None: any.
        accelerometer_bias, accelerometer_noise: of the control unit's [m/s^2], where it estimates the speed.
        accelerometer_gain: share by which it tells more: its scale, and what is left of the body's pitch.
        accelerometer_slope: by which it tells more from where the manoeuvre begins, as on a road that begins to rise
            [m/s^2]; the car is not moved by it.
        rolling: how long the car rolls freely before it brakes, with its unit turned on, where that estimates the
            speed [s]; it finds the bias meanwhile. Two seconds are few; 0 is a unit that the pedal turns on.
    """

    car: Annotated[Any, BeforeValidator(_cars)] = dataclasses.field(default_factory=lambda: car_entry("mid_size"))
    model: Text = "two_axle"
    laden: Annotated[Any, BeforeValidator(_loads)] = False
    wiring: Text = "independent"
    sets: Text = "one"
    follows_load: Flag = True
    speed: Text | None = None
    speed_parameters: Annotated[Values, Field()] = dataclasses.field(default_factory=dict)
    regulation: Flag = False
    largest_yaw_rate: Positive | None = None
    largest_side_slip: Positive | None = None
    least_steerability: Annotated[Positive, Field(lt=1.0)] | None = None
    accelerometer_bias: Real = 0.5
    accelerometer_noise: NonNegative = 0.1
    accelerometer_gain: Annotated[Real, Field(gt=-1.0)] = 0.02
    accelerometer_slope: Real = 0.0
    rolling: Annotated[NonNegative, Field(le=60.0)] = 2.0

    def __post_init__(self):
        choice("vehicle.model", self.model, MODELS)
        choice("vehicle.wiring", self.wiring, tuple(WIRINGS))
        choice("vehicle.sets", self.sets, SETS)
        if self.wheels not in WIRINGS[self.wiring]:
            raise ConfigError(f"vehicle.wiring = {self.wiring!r} needs the model four_wheel")
        for name in ("largest_yaw_rate", "largest_side_slip", "least_steerability"):
            if getattr(self, name) is not None and not self.regulation:
                raise ConfigError(f"vehicle.{name} is a limit of the screening: it needs regulation = true")
        require("vehicle.car", len(self.cars), FEWEST <= len(self.cars) <= MOST, f"{FEWEST} to {MOST} cars")
        for entry, several in (("car", self.cars), ("laden", self.loads)):
            require(f"vehicle.{entry}", len(several), all(several.count(one) == 1 for one in several), "each once")
        self.speedometer()

    @property
    def wheels(self) -> int:
        """How many turn on their own."""
        return 2 if self.model == "two_axle" else 4

    @property
    def cars(self) -> tuple[CarFigures, ...]:
        """The cars."""
        return self.car if isinstance(self.car, tuple) else (self.car,)

    @property
    def loads(self) -> tuple[bool, ...]:
        """Whether they are laden."""
        return self.laden if isinstance(self.laden, tuple) else (self.laden,)

    @property
    def each(self) -> "tuple[VehicleEntry, ...]":
        """An entry for each of them, of one car and one load."""
        return tuple(dataclasses.replace(self, car=car, laden=laden) for car in self.cars for laden in self.loads)

    @property
    def name(self) -> str:
        """Of a car and its load."""
        return ", ".join(name_of_car(car) + (" laden" if laden else "") for car in self.cars for laden in self.loads)

    @property
    def channel_axles(self) -> tuple[int, ...]:
        """For each channel its axle: 0 in front, 1 behind."""
        return tuple(wheels[0] * 2 // self.wheels for wheels in WIRINGS[self.wiring][self.wheels])

    @property
    def prefixes(self) -> tuple[str, ...]:
        """What the names of parameters begin with, one for each set of them."""
        return ("",) if self.sets == "one" else AXLES

    def vehicle(self, roads: Sequence[Road]) -> Vehicle:
        """The model on roads under its axles or wheels; of several that of the first."""
        return self.cars[0].vehicle(self.model, roads, laden=self.loads[0])

    def speedometer(self) -> Speedometer | None:
        """What the control unit estimates the speed by, where it does."""
        if self.speed is None:
            return None
        kind = component("vehicle.speed", self.speed, SPEED_ESTIMATORS, SpeedEstimator)
        estimator = built("vehicle.speed_parameters", kind, self.speed_parameters)
        errors, slope = (self.accelerometer_bias, self.accelerometer_noise), self.accelerometer_slope
        return Speedometer(estimator, Accelerometer(*errors, gain=self.accelerometer_gain, slope=slope), self.rolling)

    def loop(
        self,
        vehicle: Vehicle,
        brake: Actuator,
        controllers: Sequence[Controller],
        observers: Sequence[Observer | None],
        stop_speed: Any,
        driver: Driver,
    ) -> VehicleLoop:
        """The loop with a controller and an observer for each axle."""
        channels = tuple(Channel(brake, controllers[axle], observers[axle]) for axle in self.channel_axles)
        wiring = WIRINGS[self.wiring][self.wheels]
        return VehicleLoop(vehicle, channels, stop_speed, driver, wiring=wiring, follows_load=self.follows_load)


def of_axle(values: Mapping[str, Any], axle: int) -> dict[str, Any]:
    """The parameters of an axle's channels: those that begin with its prefix, and those without one."""
    prefix = AXLES[axle]
    return {name.removeprefix(prefix): value for name, value in values.items() if "." not in name or prefix in name}
