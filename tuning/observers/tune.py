"""Observer gains tuned by gradient descent over simulated road changes.

Every start is a parameter set; all sets run over all runs at once and descend together, on the cost of
`tuning.observers.bench`: a power mean of smooth settling times over runs and roads, plus noise_weight times
the mean noise of the estimate. The winner is chosen, and refined by random search, by the settling times
themselves. Every iterate is stable by construction (`tuning.observers.kinds`), and steps too large for the gains
are charged.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import jax
import numpy as np

from absjax.observers.certificate import certify
from tuning.core import search
from tuning.core.search import Box, Progress
from tuning.core.version import VERSION
from tuning.observers.bench import Bench, Judgement, bench_of, training_runs
from tuning.observers.config import ObserverConfig

CHUNK = 32
"""Sets judged together: one shape, compiled once; and those of a generation of evolution."""
WIDEST_SEARCH = 0.15
"""Standard deviation of the first generation on the scales of the box."""


@dataclasses.dataclass(frozen=True)
class ObserverResult:
    """A tuned observer. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    gains: dict[str, list[float]]
    """K+ and K-, and G of the adaptive observer"""
    certificate: dict[str, Any]
    before: dict[str, float]
    """worst and mean settling [s], mean noise and mean rms of the error on the runs tuned on, at the start"""
    after: dict[str, float]
    history: list[list[float]]
    """cost of each start, by iteration"""
    config: ObserverConfig
    version: str = VERSION

    def observer(self):
        """The tuned observer."""
        return self.config.kind.build(self.config.car(), self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ObserverResult":
        """Read back what `to_json` gave."""
        return cls(**{**data, "config": ObserverConfig.from_json(data["config"])})


def tune_observer(
    config: ObserverConfig,
    bench: Bench | None = None,
    *,
    progress: Progress = lambda i, n, cost: None,
) -> ObserverResult:
    """Tune an observer as the configuration says.

    Args:
        config: what to tune.
        bench: runs to tune on; simulated as the configuration says when None.
        progress: called with iteration, iterations and the best cost so far.
    """
    bench = bench or bench_of(config, training_runs(config))
    box, initial = config.box(), config.initial()
    first = box.point(initial)

    def costs(points):
        return exact_costs(config, bench, points)

    others = search.screen(
        costs, box, first, scatter=config.scatter, count=config.screened, keep=config.starts - 1, seed=config.seed
    )
    starts = np.concatenate([first[None], others])
    weights = None if config.noise_weight is None else np.full(len(starts), config.noise_weight)
    ends, history = descend(config, bench, starts, weights, progress)
    chosen, _ = search.refine(
        costs,
        box,
        np.concatenate([ends, first[None]]),
        rounds=config.refinements,
        count=CHUNK,
        widest=WIDEST_SEARCH,
        seed=config.seed + 2,
    )
    parameters = {**initial, **{name: float(value) for name, value in box.values(chosen).items()}}
    judged = judge(config, bench, np.stack([first, chosen]))
    before, after = map(_summary, _each(judged))
    observer = config.kind.build(config.car(), parameters)
    fields = ("plus", "minus", "adaptation")
    gains = {f: np.asarray(getattr(observer, f)).tolist() for f in fields if hasattr(observer, f)}
    return ObserverResult(parameters, gains, certify(observer).to_json(), before, after, history, config)


def descend(
    config: ObserverConfig,
    bench: Bench,
    starts: np.ndarray,
    noise_weights: np.ndarray | None,
    progress: Progress = lambda i, n, cost: None,
) -> tuple[np.ndarray, list[list[float]]]:
    """Run the descents, each with a noise weight of its own.

    Args:
        starts: points (sets, parameters).
        noise_weights: (sets,), or None to descend on the rms of the error.

    Returns:
        The best point of every descent, (sets, parameters), and the costs by iteration.
    """
    box, fixed = config.box(), config.initial()
    return search.descend(
        lambda points: _costs_and_gradients(bench, points, noise_weights, box, fixed),
        box,
        starts,
        iterations=config.iterations,
        learning_rate=config.learning_rate,
        progress=progress,
    )


@partial(jax.jit, static_argnames="box")
def _costs_and_gradients(bench: Bench, points, noise_weights, box: Box, fixed):
    def one(point, weight):
        return jax.value_and_grad(lambda x: bench.judge({**fixed, **box.values(x)}).cost(weight))(point)

    return jax.vmap(one, in_axes=(0, None if noise_weights is None else 0))(points, noise_weights)


def judge(config: ObserverConfig, bench: Bench, points: np.ndarray) -> Judgement:
    """What parameter sets are worth, in chunks of one shape; points (sets, parameters), leaves (sets, ...)."""
    box, fixed = config.box(), config.initial()
    return search.in_chunks(lambda chunk: _judged(bench, chunk, box, fixed), points, CHUNK)


@partial(jax.jit, static_argnames="box")
def _judged(bench: Bench, points, box: Box, fixed):
    return jax.vmap(lambda point: bench.judge({**fixed, **box.values(point)}))(points)


def exact_costs(config: ObserverConfig, bench: Bench, points: np.ndarray) -> np.ndarray:
    """Cost of parameter sets by the settling times themselves, (sets,)."""
    judged = judge(config, bench, points)
    return np.array([float(one.cost(config.noise_weight, exact=True)) for one in _each(judged)])


def _each(judged: Judgement) -> list[Judgement]:
    return [jax.tree.map(lambda x, i=i: x[i], judged) for i in range(len(judged.smooth))]


def _summary(judgement: Judgement) -> dict[str, float]:
    return {
        "worst_settling": float(judgement.settling.max()),
        "mean_settling": float(judgement.settling.mean()),
        "mean_noise": float(judgement.noise.mean()),
        "mean_rms": float(judgement.error.mean()),
    }


def trade_off(config: ObserverConfig, starts: Sequence[Mapping[str, float]], weights: Sequence[float]):
    """Tuned sets from one end of the trade-off to the other, settling against noise.

    Args:
        starts: parameter sets every descent begins from.
        weights: of the noise, one point of the curve each.

    Returns:
        A dictionary for each weight and one for each start: the weight (None for a start), the parameters,
        and mean settling and noise.
    """
    bench = bench_of(config, training_runs(config))
    box = config.box()
    first = np.stack([box.point(start) for start in starts])
    grid = np.repeat(np.asarray(weights, float), len(first))
    ends, _ = descend(config, bench, np.tile(first, (len(weights), 1)), grid)

    def point(place, one, weight):
        parameters = {**config.initial(), **{name: float(value) for name, value in box.values(place).items()}}
        settled, noise = float(one.settling.mean()), float(one.noise.mean())
        return {"noise_weight": weight, "mean": settled, "noise": noise, "parameters": parameters}

    judged = _each(judge(config, bench, ends))
    curve = []
    for weight in weights:
        mine = np.flatnonzero(grid == weight)
        costs = [judged[i].settling.mean() + weight * judged[i].noise.mean() + judged[i].stepping for i in mine]
        best = mine[int(np.argmin(costs))]
        curve.append(point(ends[best], judged[best], float(weight)))
    return curve, [point(x, one, None) for x, one in zip(first, _each(judge(config, bench, first)))]
