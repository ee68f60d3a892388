"""What controller to tune, over which roads and speeds, under which pedal and limits."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Self

from absjax.controllers.base import Controller
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.observers.base import Observer
from absjax.parameters import bounds_of, trainable_names
from absjax.plant.base import Road
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import as_road
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES
from tuning.controllers import published
from tuning.controllers.kinds import CONTROLLERS, Kind
from tuning.controllers.legacy import updated
from tuning.controllers.roads import name_of, speeds_of, surfaces_of
from tuning.core.config import ConfigError, Entries, choice, require
from tuning.core.search import Box
from tuning.observers.kinds import KINDS

REACHED = 0.9
"""Share of -c3 that chi_a stays above, so that rounding cannot take it there."""
ROUNDING = 1.05
"""Factor on the margin by which parameters keep their order, likewise."""
OBJECTIVES = ("mean", "worst", "balanced")


@dataclasses.dataclass(frozen=True)
class TuningConfig(Entries):
    """What to tune, over what, under which limits. JSON keys are the names of the fields.

    Attributes:
        controller: name of the controller, in `tuning.controllers.kinds.CONTROLLERS`.
        observer: name of the observer that tells it XBS, in `tuning.observers.kinds.KINDS`; None tells it the true one.
        observer_parameters: of that observer; the default ones where not given.
        start: parameters to start from; the controller's defaults where not given.
        tune: names of the parameters to tune; those declared trainable when empty.
        roads: published surfaces, by name, or (c1, c2, c3), or surfaces that follow one another
            (`tuning.controllers.roads`).
        speeds_kmh: initial speeds [km/h].
        wheel: fields of `absjax.plant.wheel.Wheel`.
        rate_limit: of the actuator [bar/s]; None for none. `lag` [s] and `delay` [s] likewise.
        pedal_rate, foot_delay, driver_pressure: the driver: pressure rate [bar/s], time before the foot presses [s] and
            largest pressure [bar]. Given, never tuned.
        pedal_strength: where given, every road and speed is braked a second time under this over the initial speed
            [bar m/s^2], as a ramp of the sources' form begins.
        threshold_floor: smallest threshold [m/s^2], from the noise of the measured acceleration.
        limits: (low, high) by parameter; where not given, those of `tuning.controllers.kinds`, or the floor for
            thresholds and a twentieth of the start for others, and five times the start.
        stop_speed_kmh: speed that ends a stop [km/h]; below the source's 2.5 km/h lock does not matter.
        longest_cycle: longest time between two cycles a controller may take [s]; one that rests at a
            pressure near the peak is no anti-lock controller, however short it stops.
        longest_lock: longest lock above 15 km/h [s].
        largest_contraction: of the limit cycles on every road, on the true XBS; a set that keeps it is preferred to
            any that does not. None does not constrain them; they are certified all the same.
        cycle_speeds_kmh: speeds at which limit cycles are looked for [km/h].
        objective: over the rows of distance over reference: the 'worst', the 'mean', or 'balanced', a weighted mean of
            both.
        reference: what is tuned. 'ideal': the distance from the pedal, over the ideal one under the same pedal.
            'published': the published quantity, which begins at the first switching, over the published one (of the
            two-phase algorithm, if that is what is tuned, else of the five-phase one).
        known: further parameter sets to start from, as from an earlier result.
        starts: descents run together; screened: random starts they are chosen from.
        scatter: standard deviation of the random starts, on the scales of `tuning.core.search`.
        iterations, learning_rate, seed: of the descent (Adam on the same scales, cosine decay).
        step: grid step [s]; what the controller's default parameters and the observer's gains need when None.
        substeps: Runge-Kutta steps of the observer per sample of the sampled semantics; when None twice what its
            default gains need, because a brake that is not as the observer takes it to be asks for more.
        max_events: switchings a stop may make.
        sampled_period: period at which guards are tested when the result is re-scored [s].
        refinements: generations of evolution from the winner of the descents, judged under both semantics.
        evolutions: how often that is tried, with other draws.
    """

    controller: str = "five_phase"
    observer: str | None = None
    observer_parameters: dict[str, float] = dataclasses.field(default_factory=dict)
    start: dict[str, float] = dataclasses.field(default_factory=dict)
    tune: tuple[str, ...] = ()
    roads: tuple[Any, ...] = published.ROADS
    speeds_kmh: tuple[float, ...] = published.SPEEDS_KMH
    wheel: dict[str, float] = dataclasses.field(default_factory=dict)
    rate_limit: float | None = 750.0
    lag: float | None = 0.005
    delay: float | None = None
    pedal_rate: float = 400.0
    foot_delay: float = 0.0
    driver_pressure: float = 150.0
    pedal_strength: float | None = None
    threshold_floor: float = 10.0
    limits: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    stop_speed_kmh: float = 2.5
    longest_cycle: float = 1.0
    longest_lock: float = 0.05
    largest_contraction: float | None = None
    cycle_speeds_kmh: tuple[float, ...] = (30.0, 60.0, 120.0, 180.0)
    objective: str = "balanced"
    reference: str = "ideal"
    known: tuple[dict[str, float], ...] = ()
    starts: int = 8
    screened: int = 256
    scatter: float = 0.5
    iterations: int = 60
    learning_rate: float = 0.01
    seed: int = 0
    step: float | None = None
    substeps: int | None = None
    max_events: int = 800
    sampled_period: float = 1e-3
    refinements: int = 40
    evolutions: int = 1

    def __post_init__(self):
        choice("controller", self.controller, CONTROLLERS)
        if self.observer is not None:
            choice("observer", self.observer, KINDS)
        choice("objective", self.objective, OBJECTIVES)
        choice("reference", self.reference, ("ideal", "published"))
        require("refinements", self.refinements, self.refinements >= 0, "an integer >= 0")
        for name in ("starts", "iterations", "max_events", "evolutions"):
            require(name, getattr(self, name), getattr(self, name) >= 1, "an integer >= 1")
        require("screened", self.screened, self.screened >= self.starts, "at least as many as starts")
        require("substeps", self.substeps, self.substeps is None or self.substeps >= 1, "an integer >= 1, or null")
        require("step", self.step, self.step is None or 0 < self.step < math.inf, "positive, or null")
        for name in ("sampled_period", "learning_rate", "driver_pressure", "stop_speed_kmh", "longest_cycle"):
            require(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "positive")
        largest = self.largest_contraction
        require("largest_contraction", largest, largest is None or 0 < largest < math.inf, "positive, or null")
        cycling = self.kind.model.cycle_phase is not None
        require("largest_contraction", largest, largest is None or cycling, f"null: {self.controller} does not cycle")
        require("pedal_rate", self.pedal_rate, 0 < self.pedal_rate < math.inf, "positive")
        strength = self.pedal_strength
        require("pedal_strength", strength, strength is None or 0 < strength < math.inf, "positive, or null")
        require("foot_delay", self.foot_delay, 0 <= self.foot_delay < math.inf, ">= 0")
        require("longest_lock", self.longest_lock, 0 <= self.longest_lock < math.inf, ">= 0")
        require("threshold_floor", self.threshold_floor, self.threshold_floor >= 0, ">= 0")
        require("roads", self.roads, len(self.roads) > 0, "one road at least")
        require("speeds_kmh", self.speeds_kmh, len(self.speeds_kmh) > 0, "one speed at least")
        for speed in (speed for road in (*self.roads, "") for speed in speeds_of(road, self.speeds_kmh)):
            require("speeds_kmh", speed, self.stop_speed_kmh < speed <= 500, "above stop_speed_kmh and at most 500")
        require("cycle_speeds_kmh", self.cycle_speeds_kmh, len(self.cycle_speeds_kmh) > 0, "one speed at least")
        for speed in self.cycle_speeds_kmh:
            require("cycle_speeds_kmh", speed, 0 < speed <= 500, "above 0 and at most 500")
        for entry, names in (("start", self.start), ("limits", self.limits), *(("known", k) for k in self.known)):
            for name in names:
                choice(entry, name, self.kind.names)
        given = self.observer_parameters
        require("observer_parameters", given, self.observer is not None or not given, "empty without an observer")
        for name in given:
            choice("observer_parameters", name, KINDS[self.observer].default)
        require("starts", self.starts, self.starts > len(self.known), "more than the known sets")
        for name in self.tune:
            choice("tune", name, self.kind.names)
        for road in self.roads:
            surfaces_of(road)
        self.loop(self.base_controller())

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Build from a dictionary as JSON gives it; a driver's ramp of an old one is dropped with a warning.

        Raises:
            ConfigError: naming the entry that is unknown, of the wrong kind or out of range.
        """
        return super().from_json(updated(data))

    def pedals(self, speed_kmh: float) -> tuple[float, ...]:
        """Pressure rates of the driver [bar/s] under which a speed [km/h] is braked."""
        strength = self.pedal_strength
        return (self.pedal_rate,) if strength is None else (self.pedal_rate, strength * 3.6 / speed_kmh)

    @property
    def uniform_roads(self) -> tuple[Any, ...]:
        """The roads without a change."""
        return tuple(road for road in self.roads if not isinstance(road, dict))

    @property
    def kind(self) -> Kind:
        """The controller to tune."""
        return CONTROLLERS[self.controller]

    @property
    def grid_step(self) -> float:
        """Grid step [s]."""
        if self.step is not None:
            return self.step
        return self.kind.step if self.observer is None else 1e-3 / KINDS[self.observer].substeps

    @property
    def steps_per_sample(self) -> int:
        """Runge-Kutta steps of the observer per sample."""
        if self.observer is None:
            return 1
        return self.substeps or math.ceil(2 * KINDS[self.observer].substeps * self.sampled_period / 1e-3)

    def car(self) -> Wheel:
        """The wheel."""
        try:
            return Wheel(**self.wheel)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"wheel: {error}") from None

    def base_controller(self) -> Controller:
        """The controller the descent starts from."""
        try:
            return self.kind.build(self.car(), self.start)
        except ValueError as error:
            raise ConfigError(f"start: {error}") from None

    def initial(self) -> dict[str, float]:
        """Parameters of the controller the descent starts from."""
        base = self.base_controller()
        return {name: float(getattr(base, name)) for name in self.kind.names}

    def observer_model(self) -> Observer | None:
        """The observer in the loop."""
        if self.observer is None:
            return None
        kind = KINDS[self.observer]
        return kind.build(self.car(), {**kind.default, **self.observer_parameters})

    def _brake(self) -> Brake:
        try:
            return Brake(self.rate_limit, self.lag, self.delay)
        except ValueError as error:
            raise ConfigError(str(error)) from None

    def driver(self, pedal_rate: Any = None) -> Driver:
        """Who presses the pedal; of a pressure rate [bar/s], scalar or (lanes,), where one is given."""
        return Driver(self.pedal_rate if pedal_rate is None else pedal_rate, self.foot_delay, self.driver_pressure)

    def loop(self, controller: Controller, road: Any = SURFACES["dry_asphalt"], pedal_rate: Any = None) -> ClosedLoop:
        """The closed loop this configuration describes, on a road or tyre curve."""
        car = QuarterCar(self.car(), as_road(road))
        return ClosedLoop(
            car, self._brake(), controller, self.stop_speed_kmh / 3.6, self.observer_model(), self.driver(pedal_rate)
        )

    def rig_loop(self, controller: Controller, road: Road, speed: Any) -> ClosedLoop:
        """The same on a rig at constant speed [m/s], where limit cycles are looked for."""
        return dataclasses.replace(self.loop(controller, road), plant=TestRig(self.car(), road, speed), stop_speed=None)

    def sampled_grid(self) -> tuple[float, int]:
        """Grid step [s] and steps per test of the guards when sampled; the observer has steps of its own then.

        The step is the period itself, or the largest part of it that does for the controller.
        """
        longest = self.grid_step if self.observer is None else self.kind.step
        ticks = max(1, math.ceil(self.sampled_period / longest - 1e-9))
        return self.sampled_period / ticks, ticks

    def box(self) -> Box:
        """The tuned parameters, their limits and their order.

        Raises:
            ConfigError: if limits are not admissible, or a threshold on XBS lies where a road's XBS never is.
        """
        names = self.tune or trainable_names(self.kind.model)
        own, initial = bounds_of(self.kind.model), self.initial()
        pairs = {name: self.limits.get(name) or self._range(name, own[name], initial[name]) for name in names}
        for name, (low, high) in pairs.items():
            require(f"limits.{name}", (low, high), own[name].low <= low <= high <= own[name].high, "(low, high)")
            require(f"limits.{name}", (low, high), low > 0 or not own[name].open_low, "(low, high) with 0 < low")
        if self.controller == "two_phase":
            self._require_reachable("start.chi_a", initial["chi_a"])
            if "chi_a" in pairs:
                self._require_reachable("limits.chi_a", pairs["chi_a"][0])
        ordered = []
        for low, high, least in self.kind.ordered:
            margin = ROUNDING * least
            if low in pairs:
                ceiling = (pairs[high][1] if high in pairs else initial[high]) - margin
                pairs[low] = (min(pairs[low][0], ceiling), min(pairs[low][1], ceiling))
            if high in pairs:
                floor = (pairs[low][0] if low in pairs else initial[low]) + margin
                pairs[high] = (max(pairs[high][0], floor), max(pairs[high][1], floor))
            if low in pairs and high in pairs:
                ordered.append((low, high, margin))
        lows, highs = zip(*pairs.values())
        return Box(names, tuple(map(float, lows)), tuple(map(float, highs)), tuple(ordered))

    def _range(self, name: str, bounds, start: float) -> tuple[float, float]:
        if name in self.kind.ranges:
            low, high = self.kind.ranges[name]
            if name == "chi_a":
                low = max(low, REACHED * self._least_stiffness()[0])
            return min(start, low), max(start, high)
        require(
            f"limits.{name}",
            None,
            start > 0,
            f"given: it starts at {start:g}, and only from a positive start are they known",
        )
        floor = self.threshold_floor if name in self.kind.model.thresholds else 0.0
        low = max(bounds.low, floor, 0.05 * start if not floor else 0.0)
        return low, min(bounds.high, max(5 * start, low))

    def _least_stiffness(self) -> tuple[float, Any]:
        """The largest of the least XBS of the roads that have a maximum, -c3, and the road."""
        surfaces = ((-float(tyre.c3), name_of(road)) for road in self.roads for tyre in surfaces_of(road)[0])
        return max((pair for pair in surfaces if pair[0] < 0), default=(-math.inf, ""), key=lambda pair: pair[0])

    def _require_reachable(self, entry: str, chi_a: float) -> None:
        least, road = self._least_stiffness()
        limited = self.initial()["slip_limit"] > -1
        if chi_a <= least:
            raise ConfigError(
                f"{entry} = {chi_a:g} must be above -c3 = {least:g}, the least XBS of road {road}: "
                "the apply would never end there"
            )
        for road in self.roads:
            flat = any(float(tyre.c3) == 0 for tyre in surfaces_of(road)[0])
            require(
                "start.slip_limit",
                -1,
                limited or not flat,
                f"above -1: on road {name_of(road)} XBS never falls below 0, and only the slip can end the apply",
            )
