"""An observer on samples: one step between two of them, and the scan over a log."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax._numerics import rk4_step, safe_divide
from absjax.observers.base import Observer, Sample
from absjax.results import EndCode, RolloutError, raise_if_failed

STABLE = 2.785
"""Largest product of step and rate for which the Runge-Kutta step is stable, on the real axis."""


class ObserverStatus(EndCode):
    """How an observer fared."""

    SOUND = 0, "the step was small enough throughout"
    STEP_TOO_LARGE = 1, "somewhere the step was too large for the gains: the estimate is not to be trusted", True
    DIVERGED = 2, "the state left the finite numbers", True


class Observation(NamedTuple):
    """An observer's run over samples.

    Attributes:
        stiffness: estimated XBS, (samples,).
        state: of the observer, arrays (samples,).
        stepping: largest product of integration step and rate of the error dynamics; stable below `STABLE`.
        status: an `ObserverStatus` code.
    """

    stiffness: jax.Array
    state: Any
    stepping: jax.Array
    status: jax.Array

    def raise_if_failed(self) -> "Observation":
        """Return self.

        Raises:
            RolloutError: if the step was too large for the gains, or the state diverged; says by how much.
        """
        excess = float(np.max(np.asarray(self.stepping), initial=0.0)) / STABLE
        hint = f"; the step is {excess:.3g} times the largest stable one, use more substeps or smaller gains"
        raise_if_failed(self.status, ObserverStatus, "observer runs", hint)
        return self


def require_stable(observer: Observer, state: Any, y, speed, step) -> None:
    """Check the integration step of an observer in the loop, after a rollout.

    Args:
        observer: with its gains.
        state: along the run, arrays of equal shape; what is not finite is left out.
        y: its measured output there.
        speed: the vehicle speed there.
        step: of the integration, s.

    Raises:
        RolloutError: if step times rate of the error dynamics exceeds `STABLE`; says by how much.
    """
    stepping = np.asarray(observer.fastest_rate(state, y, speed)) * step
    largest = float(np.max(stepping, where=np.isfinite(stepping), initial=0.0))
    if largest > STABLE:
        raise RolloutError(
            f"observer STEP_TOO_LARGE: a step of {step:g} s is {largest / STABLE:.3g} times the largest stable one"
        )


def advance(observer: Observer, state: Any, before: Sample, after: Sample, period, substeps: int = 1):
    """State after `period` [s], the samples joined by straight lines: y and v linear, dPb/dt constant.

    Without a period to cover (0) the state stays.
    """
    rate = safe_divide(after.pressure - before.pressure, period, jnp.asarray(period) > 0)

    def flow(share, state):
        y, speed = (a + share * (b - a) for a, b in ((before.y, after.y), (before.speed, after.speed)))
        slope = observer.flow(state, y, speed, rate)
        return jax.tree.map(lambda d: period * d, slope)

    # A loop of its own: unrolled, the compiler would repeat the first substeps inside the last ones.
    def substep(i, state):
        share = i.astype(before.y.dtype) / substeps
        return rk4_step(flow, share, state, 1 / substeps, flow(share, state))[0]

    return lax.fori_loop(0, substeps, substep, state) if substeps > 1 else substep(jnp.zeros((), jnp.int32), state)


@partial(jax.jit, static_argnames="substeps")
def observe(observer: Observer, samples: Sample, period, *, substeps: int = 1, start: Any = None) -> Observation:
    """Run an observer over a log.

    Differentiable, and to be vmapped over logs, gain sets or both.

    Args:
        observer: the observer.
        samples: arrays (samples,), uniformly sampled.
        period: sampling period [s].
        substeps: Runge-Kutta steps per period.
        start: state at the first sample; `observer.initial_state` when None.
    """
    dtype = jnp.result_type(samples.y, jnp.float32)
    observer, samples, period = jax.tree.map(lambda x: jnp.asarray(x, dtype), (observer, samples, period))
    first = jax.tree.map(lambda x: x[0], samples)
    start = jax.tree.map(lambda x: jnp.asarray(x, dtype), observer.initial_state(first.y) if start is None else start)

    def body(carry, after):
        before, state = carry
        state = advance(observer, state, before, after, period, substeps)
        return (after, state), state

    _, path = lax.scan(jax.checkpoint(body, prevent_cse=False), (first, start), jax.tree.map(lambda x: x[1:], samples))
    path = jax.tree.map(lambda x, xs: jnp.concatenate([x[None], xs]), start, path)
    stepping = jnp.max(observer.fastest_rate(path, samples.y, samples.speed)) * period / substeps
    finite = jnp.isfinite(sum(jnp.sum(leaf) for leaf in jax.tree.leaves(path)))
    status = jnp.where(stepping > STABLE, ObserverStatus.STEP_TOO_LARGE, ObserverStatus.SOUND)
    status = jnp.where(finite, status, ObserverStatus.DIVERGED).astype(jnp.int32)
    return Observation(observer.stiffness(path, samples.y), path, stepping, status)
