"""The compensation of encoder errors tuned: numbers of events and harmonics by trying all, the rest by descent.

The cost is the mean logarithm of the rms errors, of speed and acceleration, over encoders and references; its
exponential against that of the measured signals is how many times smaller errors have become. Errors are against the
truth, so that the delay of a long window counts.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain
from tuning.core import search
from tuning.core.search import Box, Progress
from tuning.core.version import VERSION
from tuning.encoder.bench import SIGNALS, Bench, bench_of, ratio_rows
from tuning.encoder.config import EncoderConfig


@dataclasses.dataclass(frozen=True)
class EncoderResult:
    """A tuned chain. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    events: int
    harmonics: int
    grid: list[dict[str, float]]
    """cost of every pair of n and M at the start"""
    held_out: list[dict[str, Any]]
    """rms errors on encoders that were not tuned on"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    config: EncoderConfig
    version: str = VERSION

    def chain(self) -> WheelSpeedChain:
        """The tuned chain."""
        return chain_of(self.config, self.parameters, self.events, self.harmonics)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "EncoderResult":
        """Read back what `to_json` gave."""
        return cls(**{**data, "config": EncoderConfig.from_json(data["config"])})


def chain_of(
    config: EncoderConfig, parameters: Mapping[str, Any], events: int, harmonics: int, window=None, active=None
) -> WheelSpeedChain:
    """The chain of given parameters; of n `events` only `window` are used, of M `harmonics` only `active`."""

    def compensation(signal):
        own = {name.removeprefix(f"{signal}_"): x for name, x in parameters.items() if name.startswith(signal)}
        how = bool(config.filter_regressor), bool(config.through_edges)
        return HarmonicCompensation(signal, harmonics, *how, active=active, **own)

    stamping = TimeStamping(config.teeth, events, window=window)
    return WheelSpeedChain(stamping, *(compensation(signal) for signal in SIGNALS))


def training_benches(config: EncoderConfig) -> tuple[Bench, ...]:
    """The encoders tuned on, under every reference."""
    encoder = config.drawn(config.seed, config.encoders)
    return tuple(bench_of(encoder, name, config.duration, config.settle) for name in config.references)


def cost_of(benches: tuple[Bench, ...], chain: WheelSpeedChain):
    """Mean logarithm of the rms errors of a chain; traceable."""
    errors = [jnp.log(error).mean() for bench in benches for error in bench.errors(chain)]
    return sum(errors) / len(errors)


@partial(jax.jit, static_argnames=("shape", "events", "harmonics"))
def _pair_cost(shape, benches, parameters, events: int, harmonics: int, window, active):
    return cost_of(benches, chain_of(shape, parameters, events, harmonics, window, active))


def pair_costs(config: EncoderConfig, benches: tuple[Bench, ...], parameters: Mapping[str, float]):
    """Cost of every pair of n and M, one program for all: rows with `events`, `harmonics` and `cost`."""
    events, harmonics = int(max(config.events)), int(max(config.harmonics))
    one = partial(_pair_cost, _shape(config), benches, dict(parameters), events, harmonics)
    n, m = (np.ravel(x) for x in np.meshgrid(config.events, config.harmonics, indexing="ij"))
    costs = jax.lax.map(lambda pair: one(*pair), (jnp.asarray(n), jnp.asarray(m)), batch_size=len(config.harmonics))
    return [{"events": int(a), "harmonics": int(b), "cost": float(c)} for a, b, c in zip(n, m, costs)]


@dataclasses.dataclass(frozen=True)
class _Shape:
    """What of a configuration a program depends on."""

    teeth: int
    filter_regressor: int
    through_edges: int


def _shape(config: EncoderConfig) -> _Shape:
    return _Shape(config.teeth, config.filter_regressor, config.through_edges)


@partial(jax.jit, static_argnames=("shape", "box", "events", "harmonics"))
def _costs_and_gradients(shape: _Shape, benches, points, box: Box, fixed, events: int, harmonics: int):
    def cost(point):
        return cost_of(benches, chain_of(shape, {**fixed, **box.values(point)}, events, harmonics))

    def one(point):
        # Forward mode: few parameters, and no state of the chain to be kept for thousands of samples.
        value, push = jax.linearize(cost, point)
        return value, jax.vmap(push)(jnp.eye(len(box.names)))

    return jax.lax.map(one, points)


@partial(jax.jit, static_argnames=("shape", "box", "events", "harmonics"))
def _costs(shape: _Shape, benches, points, box: Box, fixed, events: int, harmonics: int):
    return jax.lax.map(
        lambda point: cost_of(benches, chain_of(shape, {**fixed, **box.values(point)}, events, harmonics)), points
    )


def tune_encoder(config: EncoderConfig, *, progress: Progress = lambda i, n, cost: None) -> EncoderResult:
    """Tune the chain as the configuration says.

    Args:
        progress: called with iteration, iterations and the best cost so far.
    """
    benches, box, initial = training_benches(config), config.box(), config.initial()
    grid = pair_costs(config, benches, initial)
    best = min(grid, key=lambda row: row["cost"])
    events, harmonics = best["events"], best["harmonics"]
    fixed = (box, initial, events, harmonics)
    first = box.point(initial)
    others = search.screen(
        lambda points: np.asarray(_costs(_shape(config), benches, points, *fixed)),
        box,
        first,
        scatter=config.scatter,
        count=config.screened,
        keep=config.starts - 1,
        seed=config.seed,
    )
    ends, history = search.descend(
        lambda points: _costs_and_gradients(_shape(config), benches, points, *fixed),
        box,
        np.concatenate([first[None], others]),
        iterations=config.iterations,
        learning_rate=config.learning_rate,
        progress=progress,
    )
    chosen = ends[np.argmin(np.min(history, axis=0))]
    parameters = {**initial, **{name: float(value) for name, value in box.values(chosen).items()}}
    rows = held_out_rows(config, initial, parameters, events, harmonics)
    return EncoderResult(parameters, events, harmonics, grid, rows, history, config)


def held_out_rows(config: EncoderConfig, before, after, events: int, harmonics: int) -> list[dict[str, Any]]:
    """Rms errors on encoders that were not tuned on: as measured, before the descent, tuned."""
    encoder = config.drawn(config.seed + config.encoders, config.held_out)
    chains = {
        "measured": WheelSpeedChain(TimeStamping(config.teeth, events)),
        "before": chain_of(config, before, events, harmonics),
        "tuned": chain_of(config, after, events, harmonics),
    }
    rows = []
    for name in config.references:
        rows += ratio_rows(bench_of(encoder, name, config.duration, config.settle), chains, reference=name)
    return rows
