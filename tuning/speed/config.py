"""What estimators of the vehicle's speed to tune and compare, on which stops."""

from typing import Annotated, Any

from pydantic import Field

from absjax.controllers import CONTROLLERS
from absjax.parameters import bounds_of
from tuning.core.box import Box
from tuning.core.config import (
    LONGEST,
    Count,
    Names,
    NonNegative,
    Positive,
    Real,
    Reals,
    Whole,
    choice,
    config,
    require,
)
from tuning.core.fit import SearchConfig
from tuning.core.roads import RoadEntry, Surfaces, speeds_of, stacked
from tuning.speed.estimators import NAMES, estimator_of, own, speed_box, with_values

Roads = Annotated[tuple[RoadEntry, ...], Field(min_length=1, max_length=LONGEST)]
Speeds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=LONGEST)]


@config
class SpeedConfig(SearchConfig):
    """What to tune, on what. JSON keys are the names of the fields, and those of `SearchConfig`.

    Every estimator is tuned on its own. In `start`, `tune` and `limits` parameters have names as `kalman.rim_noise`;
    with a `tune` that is not empty, estimators without a parameter there stay as they are. A loss is the rms of the
    error of the speed [m/s] of a stop, while a controller acts.

    Attributes:
        estimators: names in `tuning.speed.estimators.NAMES`, or `package.module:Class`.
        roads: tuned on, from each of `speeds_kmh`, or the speeds of its own.
        held_out: roads judged on, from each of `held_out_speeds_kmh`, or the speeds of its own.
        controllers: names in `absjax.controllers.CONTROLLERS`, whose shipped sets act on both axles; every stop is made
            under each.
        biases: of the accelerometer [m/s^2].
        gains: of it, shares by which it tells more: its scale, and the body's pitch; every stop is told with each bias
            and each gain.
        noise: standard deviation of a sample of the accelerometer [m/s^2].
        rim_noise: of a rim speed [m/s].
        delay: before the pedal is touched, which is what an estimator has to find the bias by [s].
        stop_speed: at which a stop ends [m/s].
        period: of the samples [s].
        horizon: longest time of a stop [s].
    """

    estimators: Annotated[Names, Field(min_length=1)] = NAMES
    roads: Roads = (
        "dry_asphalt",
        "dry_cobblestones",
        "wet_asphalt",
        "snow",
        Surfaces(("dry_concrete", "snow", "wet_asphalt"), (35.0, 90.0)),
        Surfaces(("snow", "dry_asphalt"), (50.0,)),
    )
    speeds_kmh: Speeds = (60.0, 140.0)
    held_out: Roads = (
        "dry_concrete",
        "wet_cobblestones",
        (0.3, 60.0, 0.1),
        Surfaces(("dry_asphalt", "snow", "wet_asphalt"), (40.0, 80.0)),
        Surfaces(("wet_asphalt", "snow"), (40.0,)),
        Surfaces(("wet_cobblestones", "dry_concrete", "wet_cobblestones"), (30.0, 60.0)),
    )
    held_out_speeds_kmh: Speeds = (90.0, 160.0)
    controllers: Annotated[Names, Field(min_length=1)] = ("two_phase", "five_phase", "slip")
    biases: Annotated[Reals, Field(min_length=1, max_length=LONGEST)] = (0.5, -0.5)
    gains: Annotated[tuple[Annotated[Real, Field(gt=-1.0)], ...], Field(min_length=1, max_length=LONGEST)] = (
        0.02,
        -0.02,
    )
    noise: NonNegative = 0.1
    rim_noise: NonNegative = 0.05
    delay: Positive = 2.0
    stop_speed: Positive = 15 / 3.6
    period: Annotated[Positive, Field(ge=2e-3, le=0.1)] = 0.01
    horizon: Annotated[Positive, Field(le=60.0)] = 22.0
    starts: Count = 3
    screened: Count = 32
    iterations: Count = 60
    learning_rate: Positive = 0.1
    refinements: Whole = 8

    def __post_init__(self):
        super().__post_init__()
        require("estimators", self.estimators, len(set(self.estimators)) == len(self.estimators), "distinct")
        require("objective", self.objective, self.objective != "worst" or self.batch is None, "of all stops: no batch")
        for name in self.estimators:
            estimator_of(name)
        for name in self.controllers:
            choice("controllers", name, CONTROLLERS)
        for entry in ("start", "tune", "limits"):
            for name in getattr(self, entry):
                choice(entry, name.rpartition(".")[0], self.estimators)
        for entry in ("roads", "held_out"):
            stacked(getattr(self, entry))
        slowest = min(v for entry in ("roads", "held_out") for _, v in self.stops(entry)) / 3.6
        require("stop_speed", self.stop_speed, self.stop_speed < slowest, f"below the slowest start, {slowest:g} m/s")
        for name in self.estimators:
            self.box(name)

    def stops(self, entry: str) -> list[tuple[Any, float]]:
        """Roads and speeds [km/h] of the stops that are tuned on (`roads`) or judged on (`held_out`)."""
        speeds = self.speeds_kmh if entry == "roads" else self.held_out_speeds_kmh
        return [(road, speed) for road in getattr(self, entry) for speed in speeds_of(road, speeds)]

    def initial(self, name: str) -> Any:
        """The estimator of a name the descent starts from."""
        estimator = estimator_of(name)
        for parameter in own(name, self.start):
            choice("start", parameter, tuple(bounds_of(estimator)))
        return with_values(estimator, own(name, self.start))

    def box(self, name: str) -> Box | None:
        """What of an estimator is tuned, and its limits; None where nothing is."""
        tune = tuple(own(name, dict.fromkeys(self.tune)))
        if self.tune and not tune:
            return None
        return speed_box(self.initial(name), tune, own(name, self.limits))
