"""What to tune, over which roads and speeds, under which limits."""

import dataclasses
import math
from typing import Any

import numpy as np

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop
from absjax.control.five_phase import FivePhase
from absjax.parameters import bounds_of, trainable_names
from absjax.road import SURFACES, UniformRoad
from absjax.tyre import Burckhardt
from absjax.vehicle import QuarterCar, Wheel
from tuning import published
from tuning.entries import ConfigError, Entries, choice, require, tyre_of

CONTROLLERS: dict[str, type[FivePhase]] = {"five_phase": FivePhase}


@dataclasses.dataclass(frozen=True)
class TuningConfig(Entries):
    """What to tune, over what, under which limits. JSON keys are the names of the fields.

    Attributes:
        controller: name of the controller, in `CONTROLLERS`.
        start: parameters to start from; the controller's defaults where not given.
        tune: names of the parameters to tune; those declared trainable when empty.
        roads: published surfaces, by name, or (c1, c2, c3).
        speeds_kmh: initial speeds [km/h].
        wheel: fields of `absjax.vehicle.Wheel`.
        rate_limit: of the actuator [bar/s]; None for none. `lag` [s] and `delay` [s] likewise.
        driver_pressure: largest pressure [bar].
        threshold_floor: smallest threshold [m/s^2], from the noise of the measured acceleration.
        limits: (low, high) by parameter; `RATE_LIMITS` and the floor hold where not given.
        stop_speed_kmh: speed that ends a stop [km/h]; below the published 2.5 km/h lock does not matter.
        longest_cycle: longest time between two cycles a controller may take [s]; one that rests at a
            pressure near the peak is no anti-lock controller, however short it stops.
        objective: 'worst' or 'mean' over the rows of distance over reference.
        reference: 'ideal' distances, or the 'published' ones of the five-phase algorithm.
        known: further parameter sets to start from, as from an earlier result.
        starts: descents run together; screened: random starts they are chosen from.
        scatter: standard deviation of the random starts' logarithms.
        iterations, learning_rate, seed: of the descent (Adam on the logarithms, cosine decay).
        step: grid step [s].
        sampled_period: period at which guards are tested when the result is re-scored [s].
        refinements: rounds of random search around the winner, under both semantics.
    """

    controller: str = "five_phase"
    start: dict[str, float] = dataclasses.field(default_factory=dict)
    tune: tuple[str, ...] = ()
    roads: tuple[Any, ...] = published.ROADS
    speeds_kmh: tuple[float, ...] = published.SPEEDS_KMH
    wheel: dict[str, float] = dataclasses.field(default_factory=dict)
    rate_limit: float | None = 750.0
    lag: float | None = 0.005
    delay: float | None = None
    driver_pressure: float = 150.0
    threshold_floor: float = 10.0
    limits: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    stop_speed_kmh: float = 2.5
    longest_cycle: float = 1.0
    objective: str = "worst"
    reference: str = "ideal"
    known: tuple[dict[str, float], ...] = ()
    starts: int = 8
    screened: int = 256
    scatter: float = 0.5
    iterations: int = 120
    learning_rate: float = 0.05
    seed: int = 0
    step: float = 2e-3
    sampled_period: float = 1e-3
    refinements: int = 4

    def __post_init__(self):
        choice("controller", self.controller, CONTROLLERS)
        choice("objective", self.objective, ("worst", "mean"))
        choice("reference", self.reference, ("ideal", "published"))
        require("refinements", self.refinements, self.refinements >= 0, "an integer >= 0")
        for name in ("starts", "iterations"):
            require(name, getattr(self, name), getattr(self, name) >= 1, "an integer >= 1")
        require("screened", self.screened, self.screened >= self.starts, "at least as many as starts")
        for name in ("step", "sampled_period", "learning_rate", "driver_pressure", "stop_speed_kmh", "longest_cycle"):
            require(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "positive")
        require("threshold_floor", self.threshold_floor, self.threshold_floor >= 0, ">= 0")
        ratio = self.sampled_period / self.step
        whole = min(abs(ratio - round(ratio)), abs(1 / ratio - round(1 / ratio)))
        require("sampled_period", self.sampled_period, whole < 1e-9, "a multiple of step, or step of it")
        require("roads", self.roads, len(self.roads) > 0, "one road at least")
        require("speeds_kmh", self.speeds_kmh, len(self.speeds_kmh) > 0, "one speed at least")
        for speed in self.speeds_kmh:
            require("speeds_kmh", speed, self.stop_speed_kmh < speed <= 500, "above stop_speed_kmh and at most 500")
        fields = bounds_of(CONTROLLERS[self.controller])
        for entry, names in (("start", self.start), ("limits", self.limits), *(("known", k) for k in self.known)):
            for name in names:
                choice(entry, name, fields)
        require("starts", self.starts, self.starts > len(self.known), "more than the known sets")
        for name in self.tune:
            choice("tune", name, fields)
        for road in self.roads:
            tyre_of(road)
        self.base_controller()
        self.loop(self.base_controller())

    def base_controller(self) -> FivePhase:
        """The controller the descent starts from."""
        try:
            return CONTROLLERS[self.controller](**self.start)
        except ValueError as error:
            raise ConfigError(f"start: {error}") from None

    def loop(self, controller: FivePhase, tyre: Burckhardt | None = None) -> ClosedLoop:
        """The closed loop this configuration describes."""
        try:
            brake = Brake(self.rate_limit, self.lag, self.delay, self.driver_pressure)
            car = QuarterCar(Wheel(**self.wheel), UniformRoad(SURFACES["dry_asphalt"] if tyre is None else tyre))
            return ClosedLoop(car, brake, controller, self.stop_speed_kmh / 3.6)
        except (ValueError, TypeError) as error:
            raise ConfigError(str(error)) from None

    def sampled_grid(self) -> tuple[float, int]:
        """Grid step [s] and steps per test of the guards when sampled."""
        step = min(self.step, self.sampled_period)
        return step, max(1, round(self.sampled_period / step))

    def box(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Names of the tuned parameters and their limits."""
        controller = CONTROLLERS[self.controller]
        names = self.tune or trainable_names(controller)
        own = bounds_of(controller)
        base = self.base_controller()
        low, high = [], []
        for name in names:
            floor = self.threshold_floor if name in controller.thresholds else 0.0
            lowest = max(own[name].low, floor, 0.05 * float(getattr(base, name)) if not floor else 0.0)
            highest = min(own[name].high, max(5 * float(getattr(base, name)), lowest))
            lowest, highest = self.limits.get(name, (lowest, highest))
            require(f"limits.{name}", (lowest, highest), 0 < lowest <= highest, "(low, high) with 0 < low <= high")
            low.append(lowest)
            high.append(highest)
        return names, np.asarray(low), np.asarray(high)
