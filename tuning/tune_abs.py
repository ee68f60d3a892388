"""Anti-lock thresholds and rates tuned by gradient descent over a batch of roads and speeds.

Every start is a row of lanes, one lane per road and speed; all starts descend together, their gradients
taken in one reverse pass through the located switchings. Parameters move on a logarithmic scale between
their limits, and stay on a limit they have reached.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop, SampledLoop
from absjax.control.five_phase import FivePhase
from absjax.manoeuvre import Outcome, Stop, stop
from absjax.parameters import bounds_of, trainable_names
from absjax.road import SURFACES, UniformRoad, surface
from absjax.tyre import Burckhardt
from absjax.vehicle import GRAVITY, QuarterCar, Wheel
from tuning import published
from tuning.version import VERSION

CONTROLLERS: dict[str, type[FivePhase]] = {"five_phase": FivePhase}
SHARPNESS = 300.0
"""Of the smooth maximum over the rows: larger is nearer to the maximum."""
WORST_EFFICIENCY = 0.02
"""Efficiency below which a row counts no worse, so that a stop that fails outright has a finite cost."""
SAFETY_HORIZON = 1.35
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names the entry."""


@dataclasses.dataclass(frozen=True)
class TuningConfig:
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
        objective: 'worst' or 'mean' over the rows of distance over reference.
        reference: 'ideal' distances, or the 'published' ones of the five-phase algorithm.
        starts: descents run together; screened: random starts they are chosen from.
        scatter: standard deviation of the random starts' logarithms.
        iterations, learning_rate, seed: of the descent (Adam on the logarithms, cosine decay).
        step: grid step [s].
        sampled_period: period at which guards are tested when the result is re-scored [s].
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
    objective: str = "worst"
    reference: str = "ideal"
    starts: int = 8
    screened: int = 256
    scatter: float = 0.5
    iterations: int = 120
    learning_rate: float = 0.05
    seed: int = 0
    step: float = 2e-3
    sampled_period: float = 1e-3

    def __post_init__(self):
        _choice("controller", self.controller, CONTROLLERS)
        _choice("objective", self.objective, ("worst", "mean"))
        _choice("reference", self.reference, ("ideal", "published"))
        for name in ("starts", "iterations"):
            _require(name, getattr(self, name), getattr(self, name) >= 1, "an integer >= 1")
        _require("screened", self.screened, self.screened >= self.starts, "at least as many as starts")
        for name in ("step", "sampled_period", "learning_rate", "driver_pressure", "stop_speed_kmh"):
            _require(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "positive")
        _require("threshold_floor", self.threshold_floor, self.threshold_floor >= 0, ">= 0")
        ratio = self.sampled_period / self.step
        whole = min(abs(ratio - round(ratio)), abs(1 / ratio - round(1 / ratio)))
        _require("sampled_period", self.sampled_period, whole < 1e-9, "a multiple of step, or step of it")
        _require("roads", self.roads, len(self.roads) > 0, "one road at least")
        _require("speeds_kmh", self.speeds_kmh, len(self.speeds_kmh) > 0, "one speed at least")
        for speed in self.speeds_kmh:
            _require("speeds_kmh", speed, self.stop_speed_kmh < speed <= 500, "above stop_speed_kmh and at most 500")
        fields = bounds_of(CONTROLLERS[self.controller])
        for entry in ("start", "limits"):
            for name in getattr(self, entry):
                _choice(entry, name, fields)
        for name in self.tune:
            _choice("tune", name, fields)
        for road in self.roads:
            tyre_of(road)
        self.base_controller()
        self.loop(self.base_controller())

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningConfig":
        """Build from a dictionary as JSON gives it.

        Raises:
            ConfigError: naming the entry that is unknown, of the wrong kind or out of range.
        """
        if not isinstance(data, Mapping):
            raise ConfigError(f"a configuration is a dictionary, not {type(data).__name__}")
        known = {field.name: field for field in dataclasses.fields(cls)}
        values = {}
        for name, value in data.items():
            _choice("configuration", name, known)
            values[name] = _converted(name, value, known[name].type)
        return cls(**values)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that `from_json` reads back."""
        return dataclasses.asdict(self)

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
            _require(f"limits.{name}", (lowest, highest), 0 < lowest <= highest, "(low, high) with 0 < low <= high")
            low.append(lowest)
            high.append(highest)
        return names, np.asarray(low), np.asarray(high)


def _choice(entry: str, value: Any, allowed) -> None:
    if value not in allowed:
        raise ConfigError(f"{entry}: {value!r} is unknown; there are {', '.join(allowed)}")


def _require(entry: str, value: Any, holds: bool, what: str) -> None:
    if not holds:
        raise ConfigError(f"{entry} = {value} must be {what}")


def _converted(name: str, value: Any, kind: Any) -> Any:
    try:
        if kind is int:
            if isinstance(value, bool) or int(value) != value:
                raise ValueError
            return int(value)
        if kind is float or kind == float | None:
            if isinstance(value, bool):
                raise ValueError
            return None if value is None and kind != float else float(value)
        if kind is str:
            if not isinstance(value, str):
                raise ValueError
            return value
        if name == "speeds_kmh":
            return tuple(float(v) for v in value)
        if name in ("roads", "tune"):
            if isinstance(value, str):
                raise ValueError
            return tuple(tuple(v) if isinstance(v, list) else v for v in value)
        if name == "limits":
            return {k: (float(low), float(high)) for k, (low, high) in dict(value).items()}
        return {k: float(v) for k, v in dict(value).items()}
    except (TypeError, ValueError):
        raise ConfigError(f"{name} = {value!r} is not of the kind this entry takes") from None


def tyre_of(road: Any) -> Burckhardt:
    """The tyre curve of a road given by name or by coefficients.

    Raises:
        ConfigError: if the name is unknown, or the coefficients are not admissible.
    """
    try:
        return surface(road) if isinstance(road, str) else Burckhardt(*road)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"roads: {error}") from None


@dataclasses.dataclass(frozen=True)
class Row:
    """One road and speed: distances v0^2 / (2 g mean friction) [m] and how the stops ended."""

    road: str
    speed_kmh: float
    ideal: float
    published: float | None
    untuned: float
    tuned: float
    sampled: float
    outcome: str
    sampled_outcome: str

    @property
    def reached(self) -> bool | None:
        """Whether tuned distances, located and sampled, are at or below the published one."""
        return None if self.published is None else max(self.tuned, self.sampled) <= self.published


@dataclasses.dataclass(frozen=True)
class TuningResult:
    """A tuned controller and what it is worth. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    rows: list[Row]
    cost: float
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that ended on one of their limits"""
    config: TuningConfig
    version: str = VERSION

    @property
    def controller(self) -> FivePhase:
        """The tuned controller."""
        return CONTROLLERS[self.config.controller](**self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningResult":
        """Read back what `to_json` gave."""
        rows = [Row(**row) for row in data["rows"]]
        return cls(**{**data, "rows": rows, "config": TuningConfig.from_json(data["config"])})


class Batch:
    """The rows of a configuration as lanes, the longest stops last."""

    def __init__(self, config: TuningConfig):
        self.config = config
        pairs = [(road, speed) for road in config.roads for speed in config.speeds_kmh]
        duration = [s / float(tyre_of(r).peak().friction) for r, s in pairs]
        pairs = [pair for _, pair in sorted(zip(duration, pairs), key=lambda item: item[0])]
        self.labels = [(r if isinstance(r, str) else f"c = {tuple(r)}", s) for r, s in pairs]
        tyres = [tyre_of(road) for road, _ in pairs]
        self.tyre = Burckhardt(*(np.array([float(getattr(t, c)) for t in tyres]) for c in ("c1", "c2", "c3")))
        self.speed = np.array([speed for _, speed in pairs]) / 3.6
        peak = np.array([float(tyre.peak().friction) for tyre in tyres])
        self.ideal = self.speed**2 / (2 * GRAVITY * peak)
        self.horizon = SAFETY_HORIZON * float(np.max(self.speed / (GRAVITY * peak))) + 1.0
        known = [published.DISTANCES.get(r, {}).get(s) for r, s in self.labels]
        self.published = [None if row is None else row.five_phase for row in known]
        if config.reference == "published" and None in self.published:
            missing = self.labels[self.published.index(None)]
            raise ConfigError(f"reference = 'published', but no distance is published for {missing[0]} from {missing[1]:g} km/h")
        self.reference = self.ideal if config.reference == "ideal" else np.array(self.published, dtype=float)

    def stops(self, parameters: Mapping[str, Any], *, step: float | None = None, sampled: int = 0) -> Stop:
        """Stops of every start on every row, lanes (rows * starts,); parameters are arrays (starts,).

        `sampled`: steps between two tests of the guards, or 0 to locate switchings.
        """
        config, rows = self.config, len(self.speed)
        starts = max(np.size(value) for value in parameters.values())

        def per_lane(values):
            return jnp.repeat(jnp.asarray(values), starts)

        controller = dataclasses.replace(
            config.base_controller(), **{k: jnp.tile(jnp.broadcast_to(v, starts), rows) for k, v in parameters.items()}
        )
        loop = config.loop(controller, jax.tree.map(per_lane, self.tyre))
        loop = SampledLoop(loop, tick_every=sampled) if sampled else loop
        tile = min(64, max(8, rows * starts // 4))
        return stop(loop, per_lane(self.speed), horizon=self.horizon, step=step or config.step, max_events=800, tile=tile)

    def ratios(self, stops: Stop):
        """Distance over reference, (rows, starts)."""
        rows = len(self.speed)
        efficiency = jnp.maximum(stops.efficiency, WORST_EFFICIENCY).reshape(rows, -1)
        return jnp.asarray(self.ideal / self.reference)[:, None] / efficiency

    def costs(self, stops: Stop):
        """Cost of each start (starts,)."""
        ratios = self.ratios(stops)
        if self.config.objective == "mean":
            return ratios.mean(axis=0)
        smooth = jax.nn.logsumexp(SHARPNESS * ratios, axis=0) - math.log(ratios.shape[0])
        return smooth / SHARPNESS


def tune_abs(config: TuningConfig, *, progress: Callable[[int, int, float], None] = lambda i, n, cost: None) -> TuningResult:
    """Tune a controller as the configuration says.

    Args:
        config: what to tune.
        progress: called with iteration, iterations and the best cost so far.
    """
    batch = Batch(config)
    names, low, high = config.box()
    logs = _starts(config, batch, names, low, high)
    schedule = optax.cosine_decay_schedule(config.learning_rate, config.iterations, 0.02)
    optimiser = optax.chain(optax.zero_nans(), optax.adam(schedule))
    box = jnp.log(low), jnp.log(high)

    @jax.jit
    def descend(logs, state):
        def total(logs):
            costs = batch.costs(batch.stops(dict(zip(names, jnp.exp(logs.T)))))
            return costs.sum(), costs

        (_, costs), gradient = jax.value_and_grad(total, has_aux=True)(logs)
        # Starts descend independently: each gradient is held to unit length by itself.
        gradient = gradient / jnp.maximum(jnp.linalg.norm(gradient, axis=1, keepdims=True), 1.0)
        updates, state = optimiser.update(gradient, state)
        return jnp.clip(optax.apply_updates(logs, updates), *box), state, costs

    state = optimiser.init(logs)
    history, best, chosen = [], np.inf, np.asarray(logs[0])
    for iteration in range(config.iterations):
        before = np.asarray(logs)
        logs, state, costs = descend(logs, state)
        costs = np.asarray(costs)
        history.append([float(c) for c in costs])
        if np.nanmin(costs) < best:
            best, chosen = float(np.nanmin(costs)), before[np.nanargmin(costs)]
        progress(iteration + 1, config.iterations, best)
    tuned = {name: float(value) for name, value in zip(names, np.exp(chosen))}
    edge = (np.abs(chosen - np.log(low)) < 1e-6) | (np.abs(chosen - np.log(high)) < 1e-6)
    base = config.base_controller()
    parameters = {name: float(getattr(base, name)) for name in bounds_of(base)} | tuned
    return TuningResult(
        parameters=parameters,
        rows=score(config, parameters),
        cost=best,
        history=history,
        on_limit=[name for name, at in zip(names, edge) if at],
        config=config,
    )


def _starts(config: TuningConfig, batch: Batch, names, low, high):
    """The best of the screened random starts, the configured one always among them."""
    base = np.log([float(getattr(config.base_controller(), name)) for name in names])
    scatter = np.random.default_rng(config.seed).normal(size=(config.screened, len(names))) * config.scatter
    scatter[0] = 0
    logs = jnp.clip(jnp.asarray(base + scatter), jnp.log(low), jnp.log(high))
    if config.screened == config.starts:
        return logs
    costs = jax.jit(lambda logs: batch.costs(batch.stops(dict(zip(names, jnp.exp(logs.T))))))(logs)
    order = 1 + jnp.argsort(costs[1:])[: config.starts - 1]
    return jnp.concatenate([logs[:1], logs[order]])


def score(config: TuningConfig, parameters: Mapping[str, float]) -> list[Row]:
    """Distances of the configured start and of tuned parameters: located, and sampled."""
    batch = Batch(config)
    base = config.base_controller()
    start = {name: float(getattr(base, name)) for name in parameters}
    both = {name: jnp.array([start[name], parameters[name]]) for name in parameters}
    step = min(config.step, config.sampled_period)
    ticks = max(1, round(config.sampled_period / step))
    located = jax.jit(lambda p: batch.stops(p))(both)
    sampled = jax.jit(lambda p: batch.stops(p, step=step, sampled=ticks))(both)
    distance, again = (np.asarray(s.equivalent_distance).reshape(-1, 2) for s in (located, sampled))
    outcome, outcome_again = (np.asarray(s.outcome).reshape(-1, 2)[:, 1] for s in (located, sampled))
    rows = [
        Row(
            road=road,
            speed_kmh=speed,
            ideal=float(batch.ideal[i]),
            published=batch.published[i],
            untuned=float(distance[i, 0]),
            tuned=float(distance[i, 1]),
            sampled=float(again[i, 1]),
            outcome=Outcome(int(outcome[i])).name,
            sampled_outcome=Outcome(int(outcome_again[i])).name,
        )
        for i, (road, speed) in enumerate(batch.labels)
    ]
    places = {(road, speed): i for i, (road, speed) in enumerate((r, s) for s in config.speeds_kmh for r in _names(config))}
    return sorted(rows, key=lambda row: places[row.road, row.speed_kmh])


def _names(config: TuningConfig):
    return [r if isinstance(r, str) else f"c = {tuple(r)}" for r in config.roads]
