"""Observer gains tuned by gradient descent over simulated road changes.

Every start is a parameter set; all sets run over all runs at once and descend together, on the cost of
`tuning.observer_bench`: a power mean of smooth settling times over runs and roads, plus noise_weight times
the mean noise of the estimate. The winner is chosen, and refined by random search, by the settling times
themselves. Parameters move on a logarithmic scale; every iterate is stable by construction
(`tuning.observers`), and steps too large for the gains are charged.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from absjax.observers.certificate import certify
from tuning.observer_bench import Bench, Judgement, bench_of, training_runs
from tuning.observer_config import ObserverConfig
from tuning.version import VERSION

CHUNK = 32
"""Sets judged together: one shape, compiled once; and those tried in a round of random search."""
WIDEST_SEARCH, NARROWING = 0.15, 0.7
"""Standard deviation of the first round on the logarithms, and its factor from one to the next."""


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
    progress: Callable[[int, int, float], None] = lambda i, n, cost: None,
) -> ObserverResult:
    """Tune an observer as the configuration says.

    Args:
        config: what to tune.
        bench: runs to tune on; simulated as the configuration says when None.
        progress: called with iteration, iterations and the best cost so far.
    """
    bench = bench or bench_of(config, training_runs(config))
    names, low, high = config.box()
    box = np.log(low), np.log(high)
    first = np.log([config.initial()[name] for name in names])
    scatter = config.scatter * np.random.default_rng(config.seed).normal(size=(config.screened, len(names)))
    scattered = np.clip(first + scatter, *box)
    order = np.argsort(exact_costs(config, bench, scattered))
    starts = np.concatenate([first[None], scattered[order[: config.starts - 1]]])
    weights = None if config.noise_weight is None else np.full(len(starts), config.noise_weight)
    ends, history = descend(config, bench, starts, weights, progress)
    chosen = _refined(config, bench, np.concatenate([ends, first[None]]), box)
    parameters = {**config.initial(), **{name: float(value) for name, value in zip(names, np.exp(chosen))}}
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
    progress: Callable[[int, int, float], None] = lambda i, n, cost: None,
) -> tuple[np.ndarray, list[list[float]]]:
    """Run the descents, each with a noise weight of its own.

    Args:
        starts: logarithms of the tuned parameters, (sets, parameters).
        noise_weights: (sets,), or None to descend on the rms of the error.

    Returns:
        The best point of every descent, (sets, parameters), and the costs by iteration.
    """
    names, low, high = config.box()
    box, fixed = (np.log(low), np.log(high)), config.initial()
    logs = jnp.asarray(starts)
    moments = jax.vmap(_ADAM.init)(logs)
    best, best_logs, history = np.full(len(starts), np.inf), np.array(starts), []
    for iteration in range(config.iterations):
        before = np.asarray(logs)
        rate = config.learning_rate * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * iteration / config.iterations)))
        logs, moments, costs = _descend(bench, logs, moments, rate, noise_weights, names, fixed, box)
        costs = np.asarray(costs)
        better = costs < best
        best, best_logs = np.where(better, costs, best), np.where(better[:, None], before, best_logs)
        history.append([float(c) for c in costs])
        progress(iteration + 1, config.iterations, float(best.min()))
    return best_logs, history


_ADAM = optax.chain(optax.zero_nans(), optax.clip_by_global_norm(1.0), optax.scale_by_adam())


@partial(jax.jit, static_argnames="names")
def _descend(bench: Bench, logs, moments, rate, noise_weights, names, fixed, box):
    def one(logs, moments, weight):
        def cost(logs):
            return bench.judge({**fixed, **dict(zip(names, jnp.exp(logs)))}).cost(weight)

        value, gradient = jax.value_and_grad(cost)(logs)
        updates, moments = _ADAM.update(gradient, moments)
        return jnp.clip(logs - rate * updates, *box), moments, value

    axes = (0, 0, None if noise_weights is None else 0)
    return jax.vmap(one, in_axes=axes)(logs, moments, noise_weights)


def judge(config: ObserverConfig, bench: Bench, logs: np.ndarray) -> Judgement:
    """What parameter sets are worth, in chunks of one shape; leaves (sets, ...).

    Args:
        logs: logarithms of the tuned parameters, (sets, parameters).
    """
    names, *_ = config.box()
    pieces = []
    for first in range(0, len(logs), CHUNK):
        chunk = np.resize(logs[first : first + CHUNK], (CHUNK, logs.shape[1]))
        pieces.append(jax.tree.map(np.asarray, _judged(bench, chunk, names, config.initial())))
    return jax.tree.map(lambda *x: np.concatenate(x)[: len(logs)], *pieces)


@partial(jax.jit, static_argnames="names")
def _judged(bench: Bench, logs, names, fixed):
    return jax.vmap(lambda logs: bench.judge({**fixed, **dict(zip(names, jnp.exp(logs)))}))(logs)


def exact_costs(config: ObserverConfig, bench: Bench, logs: np.ndarray) -> np.ndarray:
    """Cost of parameter sets by the settling times themselves, (sets,)."""
    judged = judge(config, bench, logs)
    return np.array([float(one.cost(config.noise_weight, exact=True)) for one in _each(judged)])


def _refined(config: ObserverConfig, bench: Bench, logs: np.ndarray, box) -> np.ndarray:
    """The best of the descents' ends and the start, and what random search around it finds."""
    rng = np.random.default_rng(config.seed + 2)
    costs = exact_costs(config, bench, logs)
    best, cost = logs[np.argmin(costs)], float(costs.min())
    for round_ in range(config.refinements):
        spread = WIDEST_SEARCH * NARROWING**round_
        nearby = np.clip(best + rng.normal(size=(CHUNK, len(best))) * spread, *box)
        costs = exact_costs(config, bench, nearby)
        if costs.min() < cost:
            best, cost = nearby[np.argmin(costs)], float(costs.min())
    return best


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
    names, *_ = config.box()
    first = np.log([[start[name] for name in names] for start in starts])
    grid = np.repeat(np.asarray(weights, float), len(first))
    ends, _ = descend(config, bench, np.tile(first, (len(weights), 1)), grid)

    def point(logs, one, weight):
        parameters = {**config.initial(), **dict(zip(names, np.exp(logs).tolist()))}
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
