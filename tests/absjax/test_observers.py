"""Observers and least squares on samples, against their matrix form, SciPy and plain loops."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from absjax.observers import rls
from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.base import Sample
from absjax.observers.certificate import certify
from absjax.observers.clamped import Clamped
from absjax.observers.excitation import decay_along, dwell_times, excitation, regressor
from absjax.observers.run import ObserverStatus, observe
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.plant.wheel import Wheel
from absjax.results import RolloutError

WHEEL = Wheel()
A_GAIN, B_GAIN = 187.5, 4.375
FACTOR = (120.0, 3600.0)
OBSERVERS = {
    "constant": SwitchedObserver.placed(constant_stiffness(WHEEL), [FACTOR]),
    "known road": SwitchedObserver.placed(known_road(WHEEL, 24.0), [(60.0,), FACTOR]),
    "unknown road": SwitchedObserver.placed(unknown_road(WHEEL), [FACTOR, FACTOR], 1.5),
    "adaptive": AdaptiveObserver.placed(WHEEL, (160.0, 6400.0), (4e3, 1e3)),
}
PERIOD = 1e-3


def simplified_model(stiffness=lambda slip: 1.28 * 24 * np.exp(24 * slip) - 0.52, duration=0.4, speed=20.0):
    """Samples of the simplified model z1' = -(a/v) z1 XBS - b Pb', slip' = z1/v, solved by SciPy; and XBS."""

    def pressure_rate(t):
        return 300 * np.cos(2 * np.pi * 8 * t)

    def slope(t, x):
        return [-A_GAIN / speed * x[0] * stiffness(x[1]) - B_GAIN * pressure_rate(t), x[0] / speed, pressure_rate(t)]

    time = np.arange(round(duration / PERIOD) + 1) * PERIOD
    path = solve_ivp(slope, (0, duration), [0.0, -0.1, 30.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    samples = Sample(path[0], np.full(time.size, speed), path[2])
    return samples, stiffness(path[1])


SAMPLES, TRUTH = simplified_model()


def matrix_form(observer, samples):
    """The observer's equations with matrices, as the sources print them, solved by SciPy along the samples."""
    time = np.arange(len(samples.y)) * PERIOD

    def inputs(t):
        k = min(int(t / PERIOD), len(time) - 2)
        share = t / PERIOD - k
        y, v = ((1 - share) * x[k] + share * x[k + 1] for x in (samples.y, samples.speed))
        return y, v, (samples.pressure[k + 1] - samples.pressure[k]) / PERIOD

    if isinstance(observer, SwitchedObserver):
        A, B, C = np.asarray(observer.A), np.asarray(observer.B), np.eye(len(observer.B))[0]

        def slope(t, z):
            y, v, u = inputs(t)
            K = np.asarray(observer.plus if y > 0 else observer.minus)
            return y / v * (A @ z + K * (y - C @ z)) + B * u

        start = np.array([samples.y[0], *[0.0] * (len(B) - 1)])
    else:
        C, G = np.array([[1.0, 0.0]]), np.diag(observer.adaptation)

        def slope(t, x):
            y, v, u = inputs(t)
            w, theta, Y = x[:2], x[2:4], x[4:].reshape(2, 2)
            A = y / v * np.array([[0.0, -A_GAIN], [0.0, 0.0]])
            K = y / v * np.asarray(observer.plus if y > 0 else observer.minus)[:, None]
            Psi = np.array([[y**2 / v, 0.0], [-B_GAIN / A_GAIN * u, y / v]])
            error = y - C @ w
            injected = (K + Y @ G @ Y.T @ C.T) @ error
            dw = A @ w + np.array([-B_GAIN, 0.0]) * u + Psi @ theta + injected
            return np.concatenate([dw, G @ Y.T @ C.T @ error, ((A - K @ C) @ Y + Psi).reshape(-1)])

        c, d = observer.start_c, observer.start_d
        start = np.array([samples.y[0], c / A_GAIN * samples.y[0], c, d, 0, 0, 0, 0])
    path = [start]
    for k in range(len(time) - 1):
        inside = (time[k] + 1e-12, time[k + 1] - 1e-12)
        path.append(solve_ivp(slope, inside, path[-1], rtol=1e-9, atol=1e-11).y[:, -1])
    return np.array(path)


@pytest.mark.parametrize("name", OBSERVERS)
def test_against_the_matrix_form_solved_by_scipy(name):
    part = jax.tree.map(lambda x: x[:150], SAMPLES)
    found = observe(OBSERVERS[name], part, PERIOD, substeps=8).raise_if_failed()
    expected = matrix_form(OBSERVERS[name], part)
    got = np.stack(jax.tree.leaves(found.state), axis=1)
    scale = np.abs(expected).max(axis=0) + 1e-3
    np.testing.assert_allclose(got / scale, expected / scale, atol=2e-4)


def test_a_tyre_that_relaxes_is_followed_by_who_knows_its_length():
    """Begun at the truth, the estimate stays there on the model with sigma l'' = y - v l', solved by SciPy."""
    sigma, speed, c, c3 = 0.25, 20.0, 24.0, 0.52

    def stiffness(slip):
        return 1.28 * c * np.exp(c * slip) - c3

    def slope(t, x):
        y, slip, rate, _ = x
        pressing = 300 * np.cos(2 * np.pi * 8 * t)
        return [-A_GAIN * stiffness(slip) * rate - B_GAIN * pressing, rate, (y - speed * rate) / sigma, pressing]

    time = np.arange(4001) * 1e-4
    y, slip, _, pressure = solve_ivp(slope, (0, 0.4), [0.0, -0.1, 0.0, 30.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    samples, true = Sample(y, np.full_like(time, speed), pressure), stiffness(slip)
    knows = dataclasses.replace(OBSERVERS["adaptive"], start_c=c, start_d=c * c3, relaxation=sigma)
    start = knows.initial_state(0.0)._replace(w2=true[0])
    errors = {}
    for observer, begun in (
        (knows, start),
        (dataclasses.replace(knows, relaxation=None), start._replace(slip_rate=None)),
    ):
        found = observe(observer, samples, 1e-4, start=begun).raise_if_failed()
        errors[observer.relaxation] = np.abs(found.stiffness - true).max()
    assert errors[sigma] < 1e-3 and errors[None] > 0.5
    _, slope = _last(knows, sigma, samples)
    ends = [float(_last(knows, sigma + h, samples)[0]) for h in (-1e-4, 1e-4)]
    assert float(slope) == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=1e-4)


@jax.jit
def _last(observer, length, samples):
    def last(length):
        return observe(dataclasses.replace(observer, relaxation=length), samples, 1e-4).stiffness[-1]

    return jax.jvp(last, (length,), (jnp.ones_like(length),))


def exponential_basis(slip):
    """Dry road of Hoang et al. 2014, Table I."""
    return -0.527 + 25.222 * np.exp(22 * slip) + 7.204 * np.exp(52 * slip)


@pytest.mark.parametrize("name, tolerance", [("known road", 0.05), ("unknown road", 0.1), ("adaptive", 0.1)])
def test_converges_to_the_true_stiffness_of_its_road(name, tolerance):
    """What is left comes from the straight lines between samples."""
    observer = OBSERVERS[name]
    samples, truth = simplified_model(duration=1.2)
    if name == "unknown road":
        samples, truth = simplified_model(exponential_basis, duration=1.2)
        observer = SwitchedObserver.placed(unknown_road(WHEEL), [(200.0, 1e4), (200.0, 1e4)])
    if name == "adaptive":
        observer = dataclasses.replace(observer, adaptation=jnp.array([4e4, 1e4]))
    error = np.abs(observe(observer, samples, PERIOD, substeps=8).raise_if_failed().stiffness - truth)
    assert error[0] > 1 and error[-400:].max() < tolerance


@pytest.mark.parametrize("name", ["unknown road", "adaptive"])
def test_vmap_over_gains_and_logs_against_a_loop(name):
    observer, part = OBSERVERS[name], jax.tree.map(lambda x: x[:60], SAMPLES)
    gains = jnp.array([0.5, 1.0, 1.5])
    logs = jax.tree.map(lambda x: jnp.stack([x, x[::-1]]), part)

    def run(scale, log):
        return observe(dataclasses.replace(observer, plus=scale * observer.plus), log, PERIOD).stiffness

    batched = jax.vmap(jax.vmap(run, in_axes=(None, 0)), in_axes=(0, None))(gains, logs)
    for i, scale in enumerate(gains):
        for j in range(2):
            single = run(scale, jax.tree.map(lambda x, j=j: x[j], logs))
            np.testing.assert_allclose(batched[i, j], single, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", ["unknown road", "adaptive"])
def test_gradient_with_respect_to_the_gains_against_differences(name):
    part = jax.tree.map(lambda x: x[:120], SAMPLES)

    def cost(x):
        if name == "adaptive":
            observer = AdaptiveObserver.placed(WHEEL, (x[0], x[1]), jnp.stack([x[2], x[3]]), x[4])
        else:
            observer = SwitchedObserver.placed(unknown_road(WHEEL), [(x[0], x[1]), (x[2], x[3])], x[4])
        return jnp.mean((observe(observer, part, PERIOD, substeps=4).stiffness - TRUTH[:120]) ** 2)

    x = jnp.array([160.0, 6400.0, 4e3, 1e3, 1.2] if name == "adaptive" else [120.0, 3600.0, 90.0, 2500.0, 1.2])
    value, gradient = jax.jit(jax.value_and_grad(cost))(x)
    assert np.isfinite(float(value))
    for i in range(x.size):
        h = 1e-5 * float(x[i])
        difference = float(cost(x.at[i].add(h)) - cost(x.at[i].add(-h))) / (2 * h)
        assert float(gradient[i]) == pytest.approx(difference, rel=1e-5, abs=1e-9)


def test_single_precision_keeps_its_type_and_agrees():
    part = jax.tree.map(lambda x: jnp.asarray(x[:200], jnp.float32), SAMPLES)
    for observer in (OBSERVERS["unknown road"], OBSERVERS["adaptive"]):
        single = observe(observer, part, PERIOD, substeps=4).stiffness
        double = observe(observer, jax.tree.map(lambda x: x[:200], SAMPLES), PERIOD, substeps=4).stiffness
        assert single.dtype == jnp.float32
        np.testing.assert_allclose(single, double, atol=2e-3 * np.abs(double).max())


def test_values_do_not_recompile():
    before = observe._cache_size()
    part = jax.tree.map(lambda x: x[:33], SAMPLES)
    for scale in (1.0, 2):
        observer = dataclasses.replace(OBSERVERS["constant"], plus=scale * OBSERVERS["constant"].plus)
        observe(observer, part, scale * PERIOD)
    assert observe._cache_size() == before + 1


def test_a_step_too_large_for_stiff_gains_is_said():
    stiff = dataclasses.replace(OBSERVERS["adaptive"], adaptation=jnp.array([2e5, 1e4]))
    coarse = jax.tree.map(lambda x: x[::8], SAMPLES)
    fine, rough = observe(stiff, SAMPLES, PERIOD, substeps=8), observe(stiff, coarse, 8 * PERIOD)
    assert int(fine.status) == ObserverStatus.SOUND
    assert int(rough.status) in (ObserverStatus.STEP_TOO_LARGE, ObserverStatus.DIVERGED)
    assert float(rough.stepping) > 2.785 > float(fine.stepping)
    with pytest.raises(RolloutError, match=r"the step is .* times the largest stable one"):
        rough.raise_if_failed()


def test_the_stated_limit_is_where_the_scheme_turns_unstable():
    """A constant y makes the error dynamics linear: with step times rate 5 % below the limit it decays."""
    observer = SwitchedObserver.placed(constant_stiffness(WHEEL), [(1010.0, 1e4)])
    samples = Sample(np.full(800, 20.0), np.full(800, 20.0), np.full(800, 10.0))
    rate = float(observer.fastest_rate(None, 20.0, 20.0))
    ends = []
    for factor in (0.93, 1.07):
        run = observe(observer, samples, factor * 2.785 / rate, start=(jnp.asarray(19.0), jnp.asarray(0.3)))
        ends.append((int(run.status), abs(float(run.state[0][-1]) - 20.0)))
    assert ends[0][0] == ObserverStatus.SOUND and ends[0][1] < 0.2
    assert ends[1][0] != ObserverStatus.SOUND and not ends[1][1] < 10.0


def test_standstill_of_the_acceleration_gives_no_nan():
    samples = Sample(jnp.zeros(5), jnp.full(5, 20.0), jnp.full(5, 10.0))
    for observer in (OBSERVERS["unknown road"], OBSERVERS["adaptive"]):
        value, gradient = jax.value_and_grad(
            lambda plus, o=observer: observe(dataclasses.replace(o, plus=plus), samples, PERIOD).stiffness.sum()
        )(jnp.asarray(observer.plus))
        assert np.isfinite(float(value)) and np.isfinite(gradient).all()


def test_clamp():
    observer = Clamped(OBSERVERS["unknown road"], low=-0.5, high=3.0)
    plain, clamped = (observe(o, SAMPLES, PERIOD) for o in (OBSERVERS["unknown road"], observer))
    np.testing.assert_allclose(clamped.stiffness, np.clip(plain.stiffness, -0.5, 3.0), rtol=1e-12)
    assert float(plain.stiffness.max()) > 3.0
    with pytest.raises(ValueError, match=r"Clamped\.low = 3"):
        Clamped(OBSERVERS["constant"], low=3.0, high=1.0)


def test_least_squares_against_plain_sums():
    rng = np.random.default_rng(0)
    y = np.cumsum(rng.normal(size=120)) + 5 * np.sin(np.arange(120) / 4)
    samples = Sample(y, np.linspace(20, 18, 120), np.cumsum(rng.normal(size=120)))
    phi = -A_GAIN * PERIOD * 0.5 * (y[1:] / samples.speed[1:] + y[:-1] / samples.speed[:-1])
    target = np.diff(y) + B_GAIN * np.diff(samples.pressure)
    memory, prior, window = 0.02, 1e-2, 30
    recursive = rls.recursive(samples, PERIOD, WHEEL, memory, prior)
    windowed = rls.windowed(samples, PERIOD, WHEEL, window, prior)
    for k in (1, 17, 119):
        age = np.exp(-PERIOD / memory * np.arange(k)[::-1])
        information = np.sum(age * phi[:k] ** 2) + prior * np.exp(-PERIOD * k / memory)
        assert float(recursive[k]) == pytest.approx(np.sum(age * phi[:k] * target[:k]) / information, rel=1e-9)
        first = max(0, k - window)
        least = np.sum(phi[first:k] * target[first:k]) / (np.sum(phi[first:k] ** 2) + prior)
        assert float(windowed[k]) == pytest.approx(least, rel=1e-9)
    with pytest.raises(ValueError, match="window = 0"):
        rls.windowed(samples, PERIOD, WHEEL, 0)


def test_least_squares_find_a_constant_stiffness():
    samples, _ = simplified_model(lambda slip: 2.0)
    for estimate in (rls.recursive, rls.windowed):
        assert float(estimate(samples, PERIOD, WHEEL)[-1]) == pytest.approx(2.0, rel=5e-3)


def test_dwell_times_and_excitation():
    time = np.arange(3000) * PERIOD
    samples = Sample(10 * np.sin(2 * np.pi * 4 * time + 0.3), np.full(3000, 20.0), 5 * np.sin(2 * np.pi * 4 * time))
    dwell = dwell_times(samples, PERIOD)
    np.testing.assert_allclose(dwell.length, 0.125, rtol=1e-5)
    np.testing.assert_allclose(dwell.scaled, 10 / 20 * 2 / np.pi * 0.125, rtol=1e-3)
    values, psi = excitation(samples, PERIOD, WHEEL, 0.5), regressor(samples, PERIOD, WHEEL)
    direct = sum(PERIOD * psi[k].T @ psi[k] for k in range(700, 1200))
    np.testing.assert_allclose(values[700], np.linalg.eigvalsh(direct), rtol=1e-9)
    assert values.min() > 0
    with pytest.raises(ValueError, match="window = 9 s"):
        excitation(samples, PERIOD, WHEEL, 9.0)


def test_decay_along_a_run_against_the_simulated_transition_of_the_error():
    """Differences between runs from several starts obey the error dynamics exactly."""
    samples, _ = simplified_model(exponential_basis, duration=1.0)
    dwell = dwell_times(samples, PERIOD)
    ends = round(dwell.begin[0] / PERIOD), round((dwell.begin[-1] + dwell.length[-1]) / PERIOD)
    window = jax.tree.map(lambda x: x[ends[0] : ends[1] + 1], samples)
    for pole in (60.0, 100.0):
        observer = SwitchedObserver.placed(unknown_road(WHEEL), [(2 * pole, pole**2)] * 2)
        rest = observe(observer, window, PERIOD, substeps=16, start=(0.0,) * 4).state
        columns = []
        for i in range(4):
            start = tuple(float(i == j) for j in range(4))
            moved = observe(observer, window, PERIOD, substeps=16, start=start).state
            columns.append([float(a[-1] - b[-1]) for a, b in zip(moved, rest)])
        root = np.linalg.cholesky(certify(observer).lyapunov).T
        factor = np.linalg.norm(root @ np.array(columns).T @ np.linalg.inv(root), 2)
        time = (ends[1] - ends[0]) * PERIOD
        assert decay_along(observer, samples, PERIOD) == pytest.approx(-np.log(factor) / time, rel=0.03)
        scaled = np.sum(np.abs(window.y) / window.speed) * PERIOD / time
        assert decay_along(observer, samples, PERIOD) < 0.2 * certify(observer).decay * scaled
