"""The search every tuner shares."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tuning.core.search import Box, descend, in_chunks, refine, screen

BOX = Box(("size", "shift"), (0.1, -1.0), (10.0, 3.0))


def bowl(points):
    """Least at size 2 and shift -0.5."""
    values = BOX.values(points)
    return jnp.log(values["size"] / 2.0) ** 2 + (values["shift"] + 0.5) ** 2


def test_values_and_points_are_each_others_inverse():
    values = {"size": np.array([0.3, 4.0]), "shift": np.array([-0.7, 2.0])}
    back = BOX.values(BOX.point(values))
    assert BOX.point(values).shape == (2, 2)
    for name in values:
        np.testing.assert_allclose(back[name], values[name], rtol=1e-12)
    low, high = BOX.limits
    np.testing.assert_allclose(BOX.values(low)["shift"], -1.0)
    assert BOX.on_limit(np.array([low[0], 0.0])) == ["size"] and BOX.on_limit(high) == ["size", "shift"]


def test_descent_finds_the_least_from_every_start():
    starts = np.stack([BOX.point({"size": s, "shift": t}) for s, t in ((0.5, 2.0), (8.0, -0.9))])
    compiled = []

    @jax.jit
    def costs_and_gradients(points):
        compiled.append(1)
        return bowl(points), jax.grad(lambda x: bowl(x).sum())(points)

    seen = []
    ends, history = descend(
        costs_and_gradients, BOX, starts, iterations=150, learning_rate=0.1, progress=lambda *x: seen.append(x)
    )
    for values in zip(*BOX.values(ends).values()):
        assert values == (pytest.approx(2.0, rel=0.02), pytest.approx(-0.5, abs=0.02))
    assert len(history) == 150 and seen[-1][:2] == (150, 150) and len(compiled) == 1


def test_descent_stays_in_the_box():
    seen = []

    def uphill(points):
        seen.append(points)
        return -points.sum(axis=1), -np.ones_like(points)

    descend(uphill, BOX, BOX.point({"size": 9.0, "shift": 2.5})[None], iterations=40, learning_rate=0.2)
    low, high = BOX.limits
    assert all(np.all((low <= points) & (points <= high)) for points in seen)
    np.testing.assert_allclose(seen[-1][0], high)


def test_descent_passes_over_a_gradient_that_is_not_a_number():
    calls = []

    def costs_and_gradients(points):
        calls.append(1)
        gradients = jax.grad(lambda x: bowl(x).sum())(jnp.asarray(points))
        return bowl(points), gradients * np.nan if len(calls) == 3 else gradients

    start = BOX.point({"size": 8.0, "shift": 2.0})[None]
    ends, _ = descend(costs_and_gradients, BOX, start, iterations=120, learning_rate=0.1)
    assert float(bowl(ends)[0]) < 1e-2


def test_random_search():
    first = BOX.point({"size": 5.0, "shift": 1.0})
    kept = screen(lambda x: np.asarray(bowl(x)), BOX, first, scatter=1.0, count=200, keep=3, seed=0)
    costs = np.asarray(bowl(kept))
    assert kept.shape == (3, 2) and np.all(np.diff(costs) >= 0) and costs[0] < float(bowl(first))
    best, cost = refine(lambda x: np.asarray(bowl(x)), BOX, kept, rounds=12, count=40, widest=0.5, seed=1)
    assert cost < 1e-2 and cost == pytest.approx(float(bowl(best)))
    assert screen(lambda x: x, BOX, first, scatter=1.0, count=5, keep=0, seed=0).shape == (0, 2)


def test_chunks_have_one_shape_and_join_again():
    shapes = []

    def double(chunk):
        shapes.append(chunk.shape)
        return {"rows": 2 * chunk, "columns": chunk.T}

    points = np.arange(14.0).reshape(7, 2)
    joined = in_chunks(lambda chunk: double(chunk)["rows"], points, 3)
    np.testing.assert_array_equal(joined, 2 * points)
    np.testing.assert_array_equal(in_chunks(lambda chunk: double(chunk)["columns"], points, 3, axis=-1), points.T)
    assert set(shapes) == {(3, 2)}
