"""Delay margins: the published numbers, all crossovers, gradients, and what a simulation says of each."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.delay.acceleration_loop import AccelerationLoop
from absjax.delay.margins import delay_margin
from absjax.hybrid.rollout import rollout

R, KMH = 0.3, 1 / 3.6


def filtered(v, zd, gain=63.0, theta=0.0):
    return gain * v, v, theta, v / R, 0.01 * zd, zd


_margins = jax.jit(jax.vmap(lambda p: delay_margin(*p)))
SHAPE = 64
"""Loops at a time: one program."""


def margin_of(cases):
    """Of at most `SHAPE` cases of three numbers, without a filter, or six."""
    rows = np.ones((SHAPE, 6))
    cases = np.asarray(cases, float)
    rows[: len(cases), : cases.shape[1]] = cases
    return jax.tree.map(lambda leaf: np.asarray(leaf)[: len(cases)], _margins(rows))


def test_published_numbers():
    plain = [
        (62.83185307 * 20, 20.0, 0.0),
        (63 * 20.0, 20.0, 0.0),
        (88.63 * 50.0, 50.0, 1875.0),
        (88.63 * 70 * KMH, 70 * KMH, 1875.0),
        (800.0, 33 * KMH, -375.0),
        (300.0, 33 * KMH, -375.0),
    ]
    found = margin_of(plain)
    np.testing.assert_allclose(1e3 * found.margin, [25.0, 24.93, 25.0, np.inf, 14.05, 0.0], rtol=3e-4)
    assert plain[3][0] == pytest.approx(1723.37, abs=0.01) and np.all(np.isinf(found.crossovers[3]))
    assert list(found.stable) == [True] * 5 + [False]
    cases = [filtered(v, zd) for zd in (0.1, 0.01) for v in (10.0, 20.0, 30.0, 50.0)]
    published = [17.17, 19.50, 22.27, 23.65, 17.20, 22.87, 24.61, 24.80]
    np.testing.assert_allclose(1e3 * margin_of(cases).margin, published, atol=5.1e-3)


def test_25_ms_are_feasible_above_33_75_kmh():
    gains = np.geomspace(376.0, 2000.0, SHAPE)
    best = [float(margin_of([(K, v * KMH, -375.0) for K in gains]).margin.max()) for v in (33.5, 34.0)]
    assert best[0] < 0.025 < best[1]


def random_loops(count=40):
    rng = np.random.default_rng(3)
    v = rng.uniform(8, 60, count)
    zd = 10 ** rng.uniform(-2, 0, count)
    zn, theta, gain = zd * rng.uniform(0, 2, count), rng.uniform(-400, 3000, count), rng.uniform(20, 150, count)
    return np.stack([v * gain, v, theta, v / R, zn, zd], axis=1)


def test_all_crossovers_against_the_magnitude_on_a_grid():
    w = np.geomspace(1e-2, 2e3, 400000)
    loops = random_loops()
    found = margin_of(loops)
    for i, (K, v, theta, wn, zn, zd) in enumerate(loops):
        s = 1j * w
        L = K / (v * s + theta) * ((s / wn) ** 2 + 2 * zn * s / wn + 1) / ((s / wn) ** 2 + 2 * zd * s / wn + 1)
        at = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1)))
        crossovers = np.sort(found.crossovers[i])
        np.testing.assert_allclose(crossovers[: len(at)], w[at], rtol=1e-4)
        assert np.all(np.isinf(crossovers[len(at) :]))
        filtered_loop = [1, 2 * zd * wn, wn**2], [1, 2 * zn * wn, wn**2]
        poles = np.roots(np.polyadd(np.polymul([v, theta], filtered_loop[0]), K * np.array(filtered_loop[1])))
        assert found.stable[i] == (poles.real.max() < 0)


def test_gradients_against_differences():
    loops, move = random_loops(12), 1e-6
    slopes = np.asarray(jax.vmap(jax.grad(lambda p: delay_margin(*p).margin))(jnp.asarray(loops)))
    assert np.all(np.isfinite(slopes))
    finite = np.isfinite(margin_of(loops).margin) & (margin_of(loops).margin > 0)
    assert finite.sum() > 6 and not np.any(slopes[~finite])
    for k in range(6):
        change = move * (np.abs(loops[:, k]) + 1e-3)[:, None] * np.eye(6)[k]
        ahead, behind = margin_of(loops + change).margin, margin_of(loops - change).margin
        differences = (ahead[finite] - behind[finite]) / (2 * change[finite, k])
        np.testing.assert_allclose(slopes[finite, k], differences, rtol=2e-5, atol=1e-9)


def test_a_simulation_is_stable_below_the_margin_and_unstable_above():
    loops = np.array(
        [filtered(v, zd) for zd in (0.1, 0.01) for v in (20.0, 50.0)]
        + [(800.0, 33 * KMH, -375.0, 1.0, 1.0, 1.0), (88.63 * 50, 50.0, 1875.0, 1.0, 1.0, 1.0)]
    )
    margins = np.asarray(margin_of(loops).margin)
    cases = np.repeat(loops, 2, axis=0)
    K, v, theta, wn, zn, zd = cases.T
    delay = np.repeat(margins, 2) * np.tile([0.98, 1.02], len(loops))
    system = AccelerationLoop(K, v, theta, delay, wn, zn, zd)
    result = rollout(system, system.initial_state(np.ones(len(cases))), step=1e-3, steps=4000, save_every=1)
    size = np.abs(result.raise_if_failed().path.state.offset)
    growth = size[:, -800:].max(axis=1) / size[:, 1200:2000].max(axis=1)
    assert np.all(growth[0::2] < 0.98) and np.all(growth[1::2] > 1.02)
