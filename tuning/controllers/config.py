"""What controller to tune, over which roads and speeds, under which pedal and limits."""

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import BeforeValidator, Field

from absjax.controllers import BASELINES, CONTROLLERS, FOR_CARS, PREDICTIVE
from absjax.controllers.base import Controller
from absjax.observers import OBSERVERS
from absjax.observers.base import Design
from absjax.parameters import bounds_of
from absjax.plant import PLANTS
from absjax.plant.base import Plant
from absjax.sensors import SENSORS
from absjax.sensors.base import Sensor
from tuning.cars.entry import VehicleEntry
from tuning.controllers.chain import of_chain, of_controller, own_names
from tuning.controllers.legacy import updated
from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.core.components import component
from tuning.core.config import (
    LONGEST,
    Count,
    NonNegative,
    Positive,
    Text,
    Values,
    choice,
    config,
    require,
)
from tuning.core.fit import SearchConfig
from tuning.core.objective import Name
from tuning.core.roads import RoadEntry, changes_along, speeds_of

FASTEST_KMH = 500.0


class Scatter(NamedTuple):
    """How much is scattered: standard deviations of the logarithm, but for the last two.

    Of a vehicle each wheel has its own radius and brake efficiency, and the load is that of the vehicle.
    """

    curve: float = 0.1
    """of each coefficient of the tyre curves"""
    change: float = 0.1
    """of the places where the surface changes, all of a road alike"""
    load: float = 0.1
    height: float = 0.05
    """of a vehicle's centre of gravity"""
    to_front: float = 0.03
    """the distance from it to the front axle"""
    radius: float = 0.01
    brake_efficiency: float = 0.1
    lag: float = 0.3
    pedal: float = 0.0
    speed: float = 0.02
    noise: float = 0.0
    """largest standard deviation of a sample of x2, m/s^2; uniform from 0"""
    tolerance: float = 0.004
    """by which edges of the encoder lie off their places, where it is told by one, encoder cycles"""


Speeds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=LONGEST)]


def _vehicle(value: Any) -> VehicleEntry | None:
    return value if value is None or isinstance(value, VehicleEntry) else VehicleEntry.from_json(value)


@config
class TuningConfig(SearchConfig):
    """What to tune, over what, under which limits. JSON keys are the names of the fields, and those of `SearchConfig`.

    Attributes:
        controller: name of the controller, in `absjax.controllers.CONTROLLERS`, `FOR_CARS` or `PREDICTIVE`, or
            `package.module:Class`.
        observer: name of the observer that tells it XBS, in `absjax.observers.OBSERVERS`, or as above; None tells it
            the true one.
        observer_parameters: of that observer; the default ones where not given.
        roads: see `tuning.core.roads`.
        speeds_kmh: initial speeds [km/h].
        plant: what is braked, in `absjax.plant.PLANTS`, or as above; plant_parameters: its further fields.
        wheel: fields of `absjax.plant.wheel.Wheel`.
        vehicle: a whole vehicle instead of plant and wheel, see `tuning.cars.entry.VehicleEntry`. With sets of their
            own the parameters are called front.eps0, rear.eps0 and so on. Its limit cycles are not looked for.
        sensor: what the sampled control unit measures with, in `absjax.sensors.SENSORS`, or as above; None measures
            without error. sensor_parameters: its fields.
        rate_limit: of the actuator [bar/s]; None for none. `lag` [s] and `delay` [s] likewise: an approximant of the
            delay, or the delay itself between a controller that predicts and the brake.
        pedal_rate, foot_delay, driver_pressure: the driver: pressure rate [bar/s], time before the foot presses [s] and
            largest pressure [bar]. Given, never tuned.
        pedal_strength: where given, every road and speed is braked a second time under this over the initial speed
            [bar m/s^2], as a ramp of the sources' form begins.
        threshold_floor: smallest threshold [m/s^2], from the noise of the measured acceleration. Where no limits are
            given or declared, they are this for thresholds and a twentieth of the start for others, and five times it.
        stop_speed_kmh: speed that ends a stop [km/h]; below the source's 2.5 km/h lock does not matter.
        longest_cycle: longest time between two cycles a controller may take [s]; one that rests at a
            pressure near the peak is no anti-lock controller, however short it stops.
        longest_lock: longest lock above 15 km/h [s].
        slide_time: longest time in all that a wheel may have a slip below -0.8 above 15 km/h [s]: one that is let go of
            for a moment whenever it stands has no long lock, and slides all the same.
        largest_contraction: of the limit cycles on every road, on the true XBS; a set that keeps it is preferred to
            any that does not. None does not constrain them; they are certified all the same.
        cycle_speeds_kmh: speeds at which limit cycles are looked for [km/h].
        reference: the loss of a row. 'ideal': the distance from the pedal, over the ideal one under the same pedal.
            'published': the published quantity, which begins at the first switching, over the published one (of the
            two-phase algorithm, if that is what is tuned, else of the five-phase one).
        known: further parameter sets to start from, as from an earlier result.
        step: grid step [s]; what the controller's default parameters and the observer's gains need when None.
        substeps: Runge-Kutta steps of the observer per sample of the sampled semantics; when None twice what its
            default gains need, because a brake that is not as the observer takes it to be asks for more.
        max_events: switchings a stop may make.
        sampled_period: period at which guards are tested when the result is re-scored, and of a setting [s].
        setting: what is tuned for. 'located': switchings located, told the truth, roads as they are. 'sampled':
            a control unit that ticks every `sampled_period` in scattered conditions (`tuning.controllers.scatter`),
            told the truth but for noise and radius, or what `sensor` tells; 'chain': the same, told by an encoder.
        chain: 'edges': a window of 12 ms, the lowest 12 harmonics of the encoder's errors taken off through the edges;
            'settled': all that were learned before the pedal, and learned no more; 'window': the last 12 edges. Its
            parameters, `tuning.controllers.chain`, may be tuned with the controller's: chain.memory and so on.
        draws: of every row, in training; checked: in validation and test each, for a setting other than 'located'.
        conditions: how much they scatter, by name of `tuning.controllers.config.Scatter`.
        smoothing: standard deviation of the scatter of points a slope is fitted over, on the scales of the box.
    """

    controller: Text = "five_phase"
    observer: Text | None = None
    observer_parameters: Values = dataclasses.field(default_factory=dict)
    roads: Annotated[tuple[RoadEntry, ...], Field(min_length=1, max_length=LONGEST)] = ROADS
    speeds_kmh: Speeds = SPEEDS_KMH
    plant: Text = "quarter_car"
    plant_parameters: Values = dataclasses.field(default_factory=dict)
    wheel: Values = dataclasses.field(default_factory=dict)
    vehicle: Annotated[Any, BeforeValidator(_vehicle)] = None
    sensor: Text | None = None
    sensor_parameters: Values = dataclasses.field(default_factory=dict)
    rate_limit: Positive | None = 750.0
    lag: Positive | None = 0.005
    delay: Positive | None = None
    pedal_rate: Positive = 400.0
    foot_delay: NonNegative = 0.0
    driver_pressure: Positive = 150.0
    pedal_strength: Positive | None = None
    threshold_floor: NonNegative = 10.0
    stop_speed_kmh: Positive = 2.5
    longest_cycle: Positive = 1.0
    longest_lock: NonNegative = 0.05
    slide_time: NonNegative = 0.5
    largest_contraction: Positive | None = None
    cycle_speeds_kmh: Speeds = (30.0, 60.0, 120.0, 180.0)
    objective: Name = "balanced"
    reference: Literal["ideal", "published"] = "ideal"
    known: Annotated[tuple[Values, ...], Field(max_length=LONGEST)] = ()
    step: Positive | None = None
    substeps: Count | None = None
    max_events: Count = 1500
    sampled_period: Positive = 1e-3
    setting: Literal["located", "sampled", "chain"] = "located"
    chain: Literal["edges", "window", "settled"] = "edges"
    draws: Count = 8
    checked: Count = 8
    conditions: Values = dataclasses.field(default_factory=dict)
    smoothing: Positive = 0.03

    def __post_init__(self):
        super().__post_init__()
        kind = self.kind
        for entry, names in (("start", self.start), *(("known", k) for k in self.known)):
            for name in names:
                own = tuple(prefix + field for prefix in self.prefixes for field in bounds_of(kind))
                choice(entry, name, own + (own_names() if self.tells else ()))
        for entry, names in (("tune", self.tune), ("limits", self.limits)):
            for name in of_chain(dict.fromkeys(names)):
                require(entry, f"chain.{name}", self.tells, "given only where a chain tells that is tuned")
        for entry, part, values in (
            ("observer", self.design, self.observer_parameters),
            ("sensor", self.sensor_kind, self.sensor_parameters),
        ):
            require(f"{entry}_parameters", values, part is not None or not values, f"empty without {entry}")
        largest = self.largest_contraction
        require(
            "largest_contraction", largest, largest is None or kind.cycle_phase is not None, "null: it never cycles"
        )
        for speed in (speed for road in (*self.roads, "") for speed in speeds_of(road, self.speeds_kmh)):
            within = self.stop_speed_kmh < speed <= FASTEST_KMH
            require("speeds_kmh", speed, within, f"above stop_speed_kmh and at most {FASTEST_KMH:g}")
        for speed in self.cycle_speeds_kmh:
            require("cycle_speeds_kmh", speed, speed <= FASTEST_KMH, f"at most {FASTEST_KMH:g}")
        require("starts", self.starts, self.starts > len(self.known), "more than the known sets")
        require("plant", self.plant, self.plant_kind is not None, "given")
        if self.vehicle is not None:
            quarter = not self.wheel and not self.plant_parameters and self.plant == "quarter_car"
            require("vehicle", "given", quarter, "without plant and wheel: it has its own")
            require("largest_contraction", largest, largest is None, "null: limit cycles are those of one wheel")
            require(
                "reference",
                self.reference,
                self.reference == "ideal",
                "'ideal': distances of vehicles are not published",
            )
        if self.predicts:
            require("delay", self.delay, self.delay is not None, f"given: {self.controller} predicts over it")
            step = self.step or kind.grid_step
            require("delay", self.delay, (self.delay or 0.0) >= step, f"no shorter than the grid step of {step:g} s")
            require("largest_contraction", largest, largest is None, "null: a cycle through a delay has no return map")
            require("vehicle", "given", self.vehicle is None, f"null: {self.controller} predicts for one wheel")
        for name, value in self.conditions.items():
            choice("conditions", name, Scatter._fields)
            require(f"conditions.{name}", value, 0 <= value <= 1 or name == "noise", "between 0 and 1")
        if self.setting != "located":
            require("setting", self.setting, not self.predicts, f"'located': {self.controller} predicts over a delay")
            require(
                "reference", self.reference, self.reference == "ideal", "'ideal' for a setting other than 'located'"
            )
            require("chain", self.chain, self.vehicle is None or self.chain != "settled", "another for a vehicle")
            require("pedal_strength", self.pedal_strength, self.pedal_strength is None, "null for such a setting")

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Build from a dictionary as JSON gives it; a driver's ramp of an old one is dropped with a warning.

        Raises:
            ConfigError: naming the entry that is unknown, of the wrong kind or out of range.
        """
        return super().from_json(updated(data))

    @property
    def prefixes(self) -> tuple[str, ...]:
        """What the names of parameters begin with, one for each set of them."""
        return ("",) if self.vehicle is None else self.vehicle.prefixes

    @property
    def tells(self) -> bool:
        """Whether the controller is told by a chain that may be tuned with it."""
        return self.setting == "chain" and self.chain != "window" and self.vehicle is None

    @property
    def began(self) -> str:
        """What the set is called that the search begins with: untuned if it is the default one."""
        return "start" if self.start else "untuned"

    @property
    def own_tune(self) -> tuple[str, ...]:
        """Names of the controller's own parameters to tune; none: those declared trainable."""
        return tuple(of_controller(dict.fromkeys(self.tune)))

    @property
    def kind(self) -> type[Controller]:
        """Class of the controller to tune."""
        return component(
            "controller", self.controller, {**CONTROLLERS, **FOR_CARS, **BASELINES, **PREDICTIVE}, Controller
        )

    @property
    def predicts(self) -> bool:
        """Whether the controller predicts over a delay of the brake."""
        return hasattr(self.kind, "remembering")

    @property
    def design(self) -> type[Design] | None:
        """Class of the observer in the loop."""
        return None if self.observer is None else component("observer", self.observer, OBSERVERS, Design)

    @property
    def plant_kind(self) -> type[Plant]:
        """Class of what is braked."""
        return component("plant", self.plant, PLANTS, Plant)

    @property
    def sensor_kind(self) -> type[Sensor] | None:
        """Class of the sensor."""
        return None if self.sensor is None else component("sensor", self.sensor, SENSORS, Sensor)

    @property
    def uniform_roads(self) -> tuple[Any, ...]:
        """The roads without a change."""
        return tuple(road for road in self.roads if not changes_along(road))
