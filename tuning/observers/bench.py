"""Runs on which observer gains are judged: settling after road changes, noise, and the size of the step."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import taken
from absjax.observers.base import Design, Sample
from absjax.observers.designs import Adaptive
from absjax.observers.run import STABLE, observe
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from tuning.core.config import require
from tuning.core.objective import Objective
from tuning.core.roads import tyre_of
from tuning.observers.config import ObserverConfig, random_surfaces
from tuning.observers.metrics import TOLERANCE
from tuning.observers.scenarios import Excitation, Scenarios, concatenate, simulate
from tuning.observers.signals import LogSignals

STEP_CHARGE = 1.0
"""Added to the cost, in s, for every unit by which step times rate exceeds `STEP_SHARE` of the stable one."""
STEP_SHARE = 0.7
NOISE_WINDOW = 0.3
"""Last part of each road over which noise is measured, s."""
LARGEST_ERROR = 1e3
"""Error of XBS at which a run that diverges is counted."""


class Judgement(NamedTuple):
    """What a parameter set is worth."""

    smooth: Any
    """smooth settling times, s, (runs, roads)"""
    settling: Any
    """settling times, s, (runs, roads)"""
    noise: Any
    """rms of the estimate's noise, (runs, roads)"""
    error: Any
    """rms of the error, noise included, (runs, roads)"""
    stepping: Any
    """by how much step times rate exceeds its share of the stable one"""

    def cost(self, objective: Objective, noise_weight, exact: bool = False):
        """Objective of the settling, smooth or `exact`, + noise_weight * mean noise + what too large a step is charged.

        Without a weight (None) it is that of the rms of the error instead.
        """
        times = self.error if noise_weight is None else self.settling if exact else self.smooth
        noise = 0.0 if noise_weight is None else noise_weight * self.noise.mean()
        return objective.costs(times.reshape(-1), smooth=not exact) + noise + STEP_CHARGE * self.stepping


def _bounded(error):
    return jnp.where(jnp.isfinite(error), jnp.clip(error, -LARGEST_ERROR, LARGEST_ERROR), LARGEST_ERROR)


def _rms(square, where):
    return jnp.sqrt(jnp.sum(jnp.where(where, square, 0.0), axis=-1) / jnp.sum(where, axis=-1) + 1e-12)


@model
class Bench:
    """Runs an observer is judged on, lanes of a model: their samples, and the roads on them."""

    samples: Sample = part("without noise")
    noise: Any = parameter("noise on y, m/s^2, shape (samples,)", ndim=1)
    stiffness: Any = parameter("true XBS, shape (samples,)", ndim=1)
    begins: Any = parameter("s, shape (roads,)", ndim=1)
    ends: Any = parameter("s, shape (roads,)", ndim=1)
    wheel: Wheel = part("as the observer knows it")
    period: Any = parameter("of the samples, s", low=0.0, open_low=True)
    design: type[Design] = Adaptive
    substeps: int = 1

    def of(self, members: Any) -> "Bench":
        """Some of the runs, (members,); traceable."""
        return taken(self, members)

    def estimates(self, values: Mapping[str, Any]):
        """Estimated XBS without and with noise, (runs, samples) each, and the largest step times rate."""
        observer = self.design(**values).observer(self.wheel)

        noisy = self.samples._replace(y=self.samples.y + self.noise)
        both = jax.tree.map(lambda *runs: jnp.concatenate(runs), self.samples, noisy)
        found = jax.vmap(lambda samples: observe(observer, samples, self.period, substeps=self.substeps))(both)
        runs = self.noise.shape[0]
        stepping = jnp.maximum(found.stepping[:runs], found.stepping[runs:])
        return found.stiffness[:runs], found.stiffness[runs:], stepping

    def _on_road(self):
        """Time since each road began, and whether a sample lies on it, (runs, roads, samples)."""
        time = self.period * jnp.arange(self.stiffness.shape[1])
        since = time - self.begins[..., None]
        return since, (since >= 0) & (time < self.ends[..., None])

    def judge(self, values: Mapping[str, Any]) -> Judgement:
        """What one parameter set is worth.

        The smooth settling time of a road is the cube root of 3 int t^2 o(t) dt, with o the share to which
        |error| exceeds 1, e^4 / (1 + e^4): it is T for an error that is large until T and small from then on.
        """
        clean, noisy, stepping = self.estimates(values)
        since, on_road = self._on_road()
        error = _bounded(clean - self.stiffness)[:, None, :]
        fourth = (error / TOLERANCE) ** 4
        moment = 3 * self.period * jnp.sum(jnp.where(on_road, fourth / (1 + fourth) * since**2, 0.0), axis=-1)
        smooth = jnp.cbrt(moment + 1e-9)
        last = jnp.where(on_road & (jnp.abs(error) > TOLERANCE), since, 0.0).max(axis=-1)
        both = _bounded(noisy - self.stiffness)[:, None, :] ** 2
        late = on_road & (since > (self.ends - self.begins)[..., None] - NOISE_WINDOW)
        noise = _rms(_bounded(noisy - clean)[:, None, :] ** 2, late)
        excess = jax.nn.relu(jnp.max(_bounded(stepping)) / STABLE - STEP_SHARE)
        return Judgement(smooth, last, noise, _rms(both, on_road), excess)


def training_runs(config: ObserverConfig) -> Scenarios:
    """The runs a configuration asks for: half under the five-phase, half under the two-phase controller.

    Runs on which the controller stops cycling excite no observer; half as many again are simulated, and the
    first that cycle are taken.

    Raises:
        ConfigError: if too few do.
    """
    rng = np.random.default_rng(config.seed)
    roads = [tyre_of(road) for road in config.roads]
    halves = []
    halves_of: tuple[tuple[Excitation, int], ...] = (
        ("five_phase", config.runs - config.runs // 2),
        ("two_phase", config.runs // 2),
    )
    for excitation, runs in halves_of:
        if not runs:
            continue
        drawn = runs + -(-runs // 2)
        if roads:
            surfaces = [[roads[i] for i in rng.choice(len(roads), 2, replace=False)] for _ in range(drawn)]
        else:
            scattered = random_surfaces(rng, 2 * drawn)
            surfaces = [scattered[2 * i : 2 * i + 2] for i in range(drawn)]
        simulated = simulate(
            surfaces,
            config.duration * rng.uniform(0.4, 0.5, drawn),
            speed=rng.uniform(*config.speeds, drawn),
            deceleration=config.deceleration,
            excitation=excitation,
            duration=config.duration,
            period=config.period,
            wheel=config.car(),
        )
        cycling = np.flatnonzero(simulated.cycling)[:runs]
        require("duration", config.duration, len(cycling) == runs, f"longer: {len(cycling)} of {drawn} runs cycle")
        halves.append(simulated.select(cycling))
    return concatenate(halves)


def bench_of(config: ObserverConfig, runs: Scenarios) -> Bench:
    """Runs as a bench for the configured observer, with the configured noise."""
    levels = np.resize(config.noise, (runs.runs, 1))
    noise = levels * np.random.default_rng(config.seed + 1).normal(size=runs.stiffness.shape)
    return Bench(
        runs.samples,
        noise,
        runs.stiffness,
        runs.begins,
        runs.ends,
        runs.wheel,
        runs.period,
        design=config.design,
        substeps=config.steps_per_sample,
    )


def log_bench(config: ObserverConfig, signals: LogSignals, truth: np.ndarray, wheel: Wheel, begin: float, end: float):
    """A stretch of a log with known XBS as a bench: one run, one road, the noise that of the log.

    Args:
        config: how observers are judged.
        signals: of the log, see `tuning.observers.signals`.
        truth: its XBS, (samples,).
        wheel: the log's.
        begin: of the stretch on which errors count, s of the log. The observer runs from the log's start.
        end: of that stretch.
    """
    one = jax.tree.map(lambda x: np.asarray(x)[None], signals.samples)
    first, period = signals.time[0], float(np.median(np.diff(signals.time)))
    begins, ends = np.array([[begin - first]]), np.array([[end - first]])
    return Bench(
        one,
        np.zeros_like(one.y),
        truth[None],
        begins,
        ends,
        wheel,
        period,
        design=config.design,
        substeps=config.steps_per_sample,
    )
