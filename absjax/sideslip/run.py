"""Estimators of side-slip over logs: a scan over one, or over logs of unequal length side by side."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax._numerics import tree_where
from absjax.results import EndCode, raise_if_failed
from absjax.sideslip.base import Estimate, Estimator
from absjax.sideslip.car import Car, CarSample


class SideSlipStatus(EndCode):
    """How an estimator fared."""

    SOUND = 0, "the estimates are finite"
    DIVERGED = 1, "the state left the finite numbers: gains too large for the sampling period", True


class Estimates(NamedTuple):
    """A run of an estimator over a log.

    Attributes:
        estimate: arrays (samples,); of padding, the last values.
        insight: what the estimator based them on, arrays (samples,); () where it tells nothing.
        status: a `SideSlipStatus` code.
    """

    estimate: Estimate
    insight: Any
    status: jax.Array

    def raise_if_failed(self) -> "Estimates":
        """Return self.

        Raises:
            RolloutError: if the state left the finite numbers.
        """
        raise_if_failed(self.status, SideSlipStatus, "runs over logs")
        return self


class PaddedLogs(NamedTuple):
    """Logs of unequal length side by side."""

    samples: CarSample
    """arrays (logs, samples, ...), the last sample repeated"""
    valid: Any
    """bool (logs, samples), false at padding"""


def padded(logs: Sequence[CarSample]) -> PaddedLogs:
    """Logs side by side, padded to the longest."""
    lengths = [len(log.yaw_rate) for log in logs]
    longest = max(lengths)

    def pad(*columns):
        return np.stack([np.concatenate([x, np.repeat(x[-1:], longest - len(x), axis=0)]) for x in columns])

    samples = jax.tree.map(pad, *(jax.tree.map(np.asarray, log) for log in logs))
    return PaddedLogs(samples, np.arange(longest) < np.asarray(lengths)[:, None])


@jax.jit
def estimate(estimator: Estimator, car: Car, samples: CarSample, period, *, valid: Any = None) -> Estimates:
    """Run an estimator over a log.

    Differentiable, and to be vmapped over logs, cars and parameter sets.

    Args:
        estimator: e.g. `absjax.sideslip.observer.SideSlipObserver`.
        car: as the estimator knows it.
        samples: arrays (samples, ...), uniformly sampled.
        period: sampling period [s].
        valid: bool (samples,): where false, the state stays; None: everywhere true.
    """
    dtype = jnp.result_type(samples.yaw_rate, jnp.float32)
    estimator, car, samples, period = jax.tree.map(lambda x: jnp.asarray(x, dtype), (estimator, car, samples, period))
    valid = jnp.ones(samples.yaw_rate.shape, bool) if valid is None else jnp.asarray(valid)
    start = estimator.initial_state(car, jax.tree.map(lambda x: x[0], samples))

    def body(state, given):
        sample, counts = given
        after, *told = estimator.step(car, state, sample, period)
        return tree_where(counts, after, state), told

    _, (path, insight) = lax.scan(jax.checkpoint(body, prevent_cse=False), start, (samples, valid))
    finite = jnp.isfinite(sum(jnp.sum(leaf) for leaf in path))
    status = jnp.where(finite, SideSlipStatus.SOUND, SideSlipStatus.DIVERGED).astype(jnp.int32)
    return Estimates(path, insight, status)


def estimate_logs(estimator: Estimator, cars: Car, logs: PaddedLogs, period) -> Estimates:
    """Run an estimator over many logs at once: arrays (logs, samples).

    Args:
        cars: of the logs, stacked (`absjax.lanes.stacked`).
        logs: side by side.
        period: sampling period [s], of all.
    """
    return jax.vmap(lambda car, samples, valid: estimate(estimator, car, samples, period, valid=valid))(cars, *logs)
