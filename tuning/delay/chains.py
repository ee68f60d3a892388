"""The predictor on a scalar system, the pendulum and a longer chain: measured against the rightmost root.

Source: Hoang 2014 (thesis), sections 3.1 and 6.4. The past before time 0 is that of a system at rest, without an error.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.delay.chain import Chain, Integrators, Pendulum, Scalar
from absjax.delay.conditions import conditions
from absjax.delay.predictor import Predictor
from absjax.delay.reference import SquareWave
from absjax.delay.roots import integrator_root, predictor_root, unpredicted_root
from absjax.delay.tracking import DelayedTracking, SampledTracking
from absjax.hybrid.rollout import rollout

DELAY, TICK = 0.02, 1e-3
INSTANTS = (0.5, 1.0, 2.0)
"""At which the error of the pendulum is told, s."""
WAVE = SquareWave(high=np.pi)
LIPSCHITZ = float(np.sqrt(2.0))
"""Of the pendulum's f_2 with a = b = 1, gamma_1, 1/s."""
DECAY_FROM = 0.5
"""Share of a run after which its decay is measured."""


class ChainCase(NamedTuple):
    """A chain with the gains of a source, and where it is made linear."""

    label: str
    chain: Chain
    alpha: float
    beta: float
    at: tuple[float, ...]

    def predictor(self, predicts: bool = True) -> Predictor:
        """Its predictor, or the law without prediction."""
        n = self.chain.order
        return Predictor(jnp.full(n, self.alpha), jnp.full(n, self.beta), predicts)


PENDULUM = ChainCase("pendulum", Pendulum(), 5.0, 10.0, (0.0, 0.0))
CASES = (
    ChainCase("scalar, c = 5", Scalar(), 10.0, 10.0, (0.0,)),
    PENDULUM,
    ChainCase("chain of 3, c = 2", Integrators(3, 2.0), 5.0, 10.0, (0.0, 0.0, 0.0)),
)


EQUILIBRIA = ((0.0, 0.0), (float(np.pi), 0.0))
"""Of the pendulum, hanging and upright."""


class Course(NamedTuple):
    """A run on the grid, arrays (points,)."""

    time: np.ndarray
    x: np.ndarray
    errors: np.ndarray
    """(n, points)"""
    target: np.ndarray
    """x_1* of h ago"""


def course(system: DelayedTracking | SampledTracking, x: tuple[float, ...], duration: float, step: float) -> Course:
    """Roll a chain out from x."""
    steps = round(duration / step)
    path = rollout(system, system.initial_state(*x), step=step, steps=steps, save_every=1).raise_if_failed().path
    errors = np.asarray(jnp.stack(jax.jit(jax.vmap(system.errors))(path.time, path.state)))
    x1 = np.asarray(path.state.x[0])
    return Course(np.asarray(path.time), x1, errors, x1 - errors[0])


def decay_rows() -> list[dict[str, Any]]:
    """Decay of located runs from x_1 = 0.5, of the last error, against the rightmost root [1/s]."""
    rows = []
    for case in CASES:
        n = case.chain.order
        gains = jnp.full(n, case.alpha), jnp.full(n, case.beta)
        found = course(DelayedTracking(case.chain, case.predictor(), DELAY), (0.5,) + (0.0,) * (n - 1), 1.2, 2e-3)
        size, middle = np.abs(found.errors[-1]), int(DECAY_FROM * len(found.time))
        measured = np.log(size[-1] / size[middle]) / (found.time[-1] - found.time[middle])
        rows.append(
            {
                "system": case.label,
                "measured": round(float(measured), 4),
                "rightmost root": round(float(predictor_root(case.chain, case.at, *gains, DELAY)), 4),
                "without prediction": round(float(unpredicted_root(case.chain, case.at, gains[0], DELAY)), 4),
            }
        )
    return rows


def pendulum_rows() -> list[dict[str, Any]]:
    """|e_1| of the pendulum released at 0.5, located and sampled, with and without prediction."""
    rows = []
    for name, predicts in (("predicted", True), ("not predicted", False)):
        predictor = PENDULUM.predictor(predicts)
        located = DelayedTracking(PENDULUM.chain, predictor, DELAY)
        sampled = SampledTracking(PENDULUM.chain, predictor, round(DELAY / TICK))
        for how, system, step in (("located", located, TICK), ("sampled, 1 ms", sampled, TICK)):
            found = course(system, (0.5, 0.0), max(INSTANTS), step)
            at = [abs(found.errors[0][round(t / step)]) for t in INSTANTS]
            rows.append({"law": name, "run": how, **{f"{t:g} s": float(f"{e:.4g}") for t, e in zip(INSTANTS, at)}})
    return rows


def wave_courses() -> dict[str, Course]:
    """The pendulum between its two equilibria, the control unit at 1 ms, with and without prediction."""
    ticks = round(DELAY / TICK)
    return {
        name: course(SampledTracking(PENDULUM.chain, PENDULUM.predictor(on), ticks, WAVE), (0.0, 0.0), 12.0, TICK)
        for name, on in (("predicted", True), ("not predicted", False))
    }


def wave_rows(courses: dict[str, Course]) -> list[dict[str, Any]]:
    """Largest |e_1| after 2 s."""
    return [
        {"law": name, "largest |e1| after 2 s": float(f"{np.abs(c.errors[0][c.time >= 2]).max():.4g}")}
        for name, c in courses.items()
    ]


def root_curves(delays: np.ndarray) -> dict[str, np.ndarray]:
    """Rightmost root of the pendulum over the delay, gains as published and in the unstable equilibrium too."""
    alpha, beta = jnp.full(2, PENDULUM.alpha), jnp.full(2, PENDULUM.beta)
    found = {}
    for name, at in zip(("hanging", "upright"), jnp.array(EQUILIBRIA)):
        predicted = jax.jit(jax.vmap(lambda h, at=at: predictor_root(PENDULUM.chain, at, alpha, beta, h)))
        plain = jax.jit(jax.vmap(lambda h, at=at: unpredicted_root(PENDULUM.chain, at, alpha, h)))
        found[f"predicted, {name}"] = np.asarray(predicted(delays))
        found[f"not predicted, {name}"] = np.asarray(plain(delays))
    return found


def limit_rows(delays: np.ndarray, curves: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """Delay at which the rightmost root comes to the imaginary axis [ms]; that of the range if it does not."""
    rows = []
    for name, root in curves.items():
        at = np.flatnonzero(root >= 0)
        rows.append(
            {"pendulum": name, "stable to [ms]": round(1e3 * float(delays[at[0]] if at.size else delays[-1]), 1)}
        )
    return rows


def condition_rows() -> list[dict[str, Any]]:
    """The sufficient conditions of Theorem 6.1 on the published gains, and the exact one."""
    alpha, beta = jnp.full(2, PENDULUM.alpha), jnp.full(2, PENDULUM.beta)
    rows = []
    for condition in conditions(alpha, beta, DELAY, LIPSCHITZ):
        rows.append(
            {
                "condition": condition.name,
                "gain": float(condition.least),
                "required": round(float(condition.required), 3),
                "met": "yes" if condition.holds else "no",
                "met by equal gains from": round(float(condition.low), 2),
                "to": round(float(condition.high), 2),
                "stable to": round(_largest_stable(condition.name == "(6.30)"), 2),
            }
        )
    return rows


def _largest_stable(of_alpha: bool) -> float:
    """Largest gain for which the loop is stable, the other as published, by bisection on the rightmost root, 1/s."""
    fixed = jnp.full(2, PENDULUM.alpha)

    @jax.jit
    def root(gain):
        if of_alpha:
            return integrator_root(gain, DELAY)
        both = jax.vmap(lambda at: predictor_root(PENDULUM.chain, at, fixed, jnp.full(2, gain), DELAY))
        return jnp.max(both(jnp.array(EQUILIBRIA)))

    low, high = 1.0, 200.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if root(middle) < 0 else (low, middle)
    return low
