"""The predictor of Theorem 6.1, held to the delayed equation by a plain loop; roots; conditions."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.delay.chain import Integrators, Pendulum, Scalar
from absjax.delay.conditions import conditions
from absjax.delay.history import History
from absjax.delay.predictor import Predictor
from absjax.delay.reference import SquareWave
from absjax.delay.roots import integrator_root, predictor_root, rightmost_root, unpredicted_root
from absjax.delay.tracking import DelayedTracking, SampledTracking
from absjax.hybrid.rollout import rollout
from tests.oracles import delayed_chain

DELAY, STEP = 0.02, 2e-3
WAVE = SquareWave(high=np.pi, half_period=0.25)


def gains(n, alpha, beta):
    return Predictor(jnp.full(n, alpha), jnp.full(n, beta))


@partial(jax.jit, static_argnames=("step", "steps"))
def rolled(system, x, step, steps):
    return rollout(system, system.initial_state(*x), step=step, steps=steps, save_every=1)


def path(system, x, end, step=STEP):
    return rolled(system, x, step, round(end / step)).raise_if_failed().path


CASES = {
    "scalar": (Scalar(), (0.5,), 10.0, lambda x: 5.0 * x[0], WAVE),
    "pendulum": (Pendulum(), (0.5, 0.0), 5.0, lambda x: -np.sin(x[0]) - x[1], WAVE),
    "chain of three": (Integrators(3, 2.0), (0.5, 0.0, 0.0), 5.0, lambda x: 2.0 * x[0], SquareWave()),
}


@pytest.mark.parametrize("name", CASES)
def test_located_against_the_delayed_equation(name):
    chain, x, alpha, drift, wave = CASES[name]
    found = path(DelayedTracking(chain, gains(chain.order, alpha, 10.0), DELAY, wave), x, 0.5).state.x[0]
    fine, levels = 20, np.where(np.arange(2) % 2 == 0, wave.high, wave.low)
    truth = delayed_chain.run(
        x,
        DELAY,
        ([alpha] * chain.order, [10.0] * chain.order),
        drift,
        0.5,
        STEP / fine,
        lambda t: levels[int(t // wave.half_period) % 2],
    )
    np.testing.assert_allclose(found, truth[::fine], rtol=0, atol=1e-6)


def test_sampled_comes_to_the_delayed_equation_as_the_clock_quickens():
    pendulum, predictor = Pendulum(), gains(2, 5.0, 10.0)
    truth = delayed_chain.run((0.5, 0.0), DELAY, ([5.0] * 2, [10.0] * 2), CASES["pendulum"][3], 0.5, 1e-4)[-1]
    off = [
        float(path(SampledTracking(pendulum, predictor, ticks), (0.5, 0.0), 0.5, DELAY / ticks).state.x[0][-1] - truth)
        for ticks in (10, 20)
    ]
    assert abs(off[1]) < 5e-4 and off[1] / off[0] == pytest.approx(0.5, abs=0.05)


@jax.jit
def ends(p, x=0.5):
    """x at the end of lanes p (lanes, 3) of alpha, beta and delay."""
    p = jnp.asarray(p)
    system = DelayedTracking(Scalar(jnp.full_like(p[:, 0], 5.0)), Predictor(p[:, :1], p[:, 1:2]), p[:, 2])
    return rollout(system, system.initial_state(jnp.asarray(x, p.dtype)), step=STEP, steps=60).state.x[0]


def test_gradient_by_gains_and_delay_against_differences_and_lanes():
    p, move = np.array([10.0, 10.0, 0.0213]), 1e-5
    at = np.concatenate([p * (1 + move * np.eye(3)), p * (1 - move * np.eye(3)), np.tile(p, (3, 1))])
    lanes, slopes = jax.jvp(ends, (at,), (np.concatenate([np.zeros((6, 3)), np.eye(3)]),))
    np.testing.assert_allclose(slopes[6:], (lanes[:3] - lanes[3:6]) / (2 * move * p), rtol=1e-5)
    single = path(DelayedTracking(Scalar(), gains(1, *p[:2]), p[2]), (0.5,), 0.5).state.x[0][60]
    np.testing.assert_allclose(lanes[6], single, rtol=1e-12)


def test_single_precision_is_near():
    found = []
    for dtype in (jnp.float32, jnp.float64):
        predictor = Predictor(jnp.full(1, 10.0, dtype), jnp.full(1, 10.0, dtype))
        system = SampledTracking(Scalar(dtype(5.0)), predictor, 10)
        state = rolled(system, (dtype(0.5),), STEP, 60).state
        assert {leaf.dtype for leaf in jax.tree.leaves(state)} == {jnp.dtype(dtype)}
        found.append(float(state.x[0]))
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_a_past_that_is_too_short_is_said_so():
    system = DelayedTracking(Scalar(), gains(1, 10.0, 10.0), DELAY, nodes=16)
    with pytest.raises(ValueError, match="do not reach back"):
        rollout(system, system.initial_state(0.5), step=STEP, steps=5)
    with pytest.raises(ValueError, match="longer than the delay"):
        rollout(system, system.initial_state(0.5), step=0.03, steps=5)
    with pytest.raises(ValueError, match="order 2 needs"):
        DelayedTracking(Pendulum(), gains(1, 5.0, 5.0), DELAY)
    with pytest.raises(ValueError, match="must be positive"):
        gains(1, 0.0, 5.0)


def test_the_past_is_a_cubic_between_nodes_and_stays_in_its_piece():
    def cubic(t):
        return jnp.array([1 + t - t**2 + 2 * t**3])

    past = History.constant(8, jnp.zeros(1))
    for time in (0.0, 0.1, 0.25):
        past = past.pushed(time, cubic(time), jax.jacfwd(cubic)(time), 1.0 if time == 0 else 0.0)
    past = past.pushed(0.25, jnp.array([9.0]), jnp.zeros(1), 1.0)
    for time in (0.03, 0.2, 0.3):
        np.testing.assert_allclose(past.read(time, 1.0), cubic(time), rtol=1e-12)
    assert past.read(-5.0, 0.0) == 0 and past.read(0.4, 2.0) == 9
    assert past.overdue(0.24, 1.0) == pytest.approx(-0.01) and past.overdue(0.3, 2.0) == -1
    assert not past.forgets(0.0)


def test_decay_of_the_scalar_system_is_the_rightmost_root():
    found = path(DelayedTracking(Scalar(), gains(1, 10.0, 10.0), DELAY), (0.5,), 0.5)
    x = np.asarray(found.state.x[0])
    decay = np.log(x[-1] / x[-51]) / (found.time[-1] - found.time[-51])
    assert decay == pytest.approx(-12.96, rel=0.01)
    assert predictor_root(Scalar(), [0.0], [10.0], [10.0], DELAY) == pytest.approx(-12.96, abs=0.005)


def test_roots_against_the_equation_itself():
    A, Bs, h = np.array([[0.0, 1.0], [1.0, -1.0]]), np.array([[[0.0, 0], [-3, -2]], [[0.0, 0], [-1, -0.3]]]), 0.3
    s = complex(rightmost_root(A, Bs, h))
    matrix = s * np.eye(2) - A - sum(B * np.exp(-(k + 1) * s * h) for k, B in enumerate(Bs))
    assert abs(np.linalg.det(matrix)) < 1e-9
    # No root to the right of it: the argument of the determinant turns by no full circle around that half plane.
    edge = s.real + 1e-3 + 1j * np.sinh(np.linspace(-12, 12, 200001))
    lags = [np.exp(-(k + 1) * edge * h) for k in range(2)]

    def entry(i, j):
        return edge * (i == j) - A[i, j] - sum(lag * B[i, j] for lag, B in zip(lags, Bs))

    determinant = entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0)
    turned = np.unwrap(np.angle(determinant / (edge + 300) ** 2))
    assert abs(turned[-1] - turned[0]) < 0.1
    for alpha in (5.0, 18.0, 60.0):
        W = complex(rightmost_root(np.zeros((1, 1)), [[[-alpha]]], DELAY))
        assert integrator_root(alpha, DELAY) == pytest.approx(W.real, rel=1e-9)
    assert integrator_root(np.pi / 2 / DELAY, DELAY) == pytest.approx(0.0, abs=1e-9)
    assert predictor_root(Pendulum(), np.zeros(2), [5.0] * 2, [10.0] * 2, DELAY) == pytest.approx(-5.592, abs=5e-4)


def test_derivatives_of_roots_against_differences():
    def root(p):
        return predictor_root(Pendulum(), jnp.zeros(2), jnp.stack([p[0], p[0]]), jnp.stack([p[1], p[1]]), p[2])

    def without(p):
        return unpredicted_root(Pendulum(), jnp.zeros(2), jnp.stack([p[0], p[0]]), p[2])

    p, move = np.array([50.0, 10.0, DELAY]), 1e-5
    for function in (root, without):
        evaluate = jax.jit(function)
        differences = [
            (evaluate(p * (1 + move * e)) - evaluate(p * (1 - move * e))) / (2 * move * q) for e, q in zip(np.eye(3), p)
        ]
        np.testing.assert_allclose(jax.jit(jax.grad(function))(p), differences, rtol=1e-6, atol=1e-7)


def test_the_published_gains_do_not_meet_the_condition_on_beta():
    first, second = conditions([5.0, 5.0], [10.0, 10.0], DELAY, np.sqrt(2.0))
    assert first.holds and first.required == pytest.approx(4.7)
    assert not second.holds and second.required == pytest.approx(12.62, abs=5e-3)
    for condition, gamma in ((first, 1.0), (second, 1 + np.sqrt(2))):
        for g in (condition.low, condition.high):
            assert 4 * gamma + g * (g + 2 * gamma) * DELAY == pytest.approx(float(g))
    assert conditions([5.0, 5.0], [10.0, 10.0], 0.2, np.sqrt(2.0))[1].high == 0
